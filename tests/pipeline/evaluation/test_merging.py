"""Shards of a campaign become the run that one command would have made, or are refused."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from pipeline.evaluation import merging
from pipeline.run import artifacts, maker, tables, writing

WORDS = ["+experiment=evaluate", "controller=lqr", "sun=mixed", "duration_s=200", "optimum.reference=null"]
WORDS += ["monte_carlo.num_cases=40", "engine.part_cases=9", "stages=[scenario,evaluate]"]
WORDS += ["+dispersions.deputy.mass_kg={kind:normal,mean:12.0,std:0.5}"]
SHARDS = {"a": "[0,13]", "b": "[10,33]", "c": "[33,40]", "d": "[12,20]"}


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    from pipeline.command_line.cli import main  # noqa: PLC0415

    folder = tmp_path_factory.mktemp("shards")
    for name, cases in {"whole": "null", **SHARDS}.items():
        assert main([*WORDS, f"monte_carlo.only_cases={cases}", f"hydra.run.dir={folder / name}"]) == 0
    return folder


@pytest.fixture
def shards(flown, tmp_path):
    """The folders of the shards, to be changed."""
    shutil.copytree(flown, tmp_path / "flown")
    return {name: tmp_path / "flown" / name for name in SHARDS}


def forged(folder: Path, change) -> None:
    """Write the flights of a shard with one number changed, and the manifest for them."""
    columns = dict(tables.read_parquet(folder, artifacts.EPISODES))
    change(columns)
    tables.write_parquet(folder / artifacts.EPISODES, columns)
    manifest = artifacts.read_json(folder, artifacts.MANIFEST)
    manifest["sha256"][artifacts.EPISODES] = artifacts.file_hash(folder / artifacts.EPISODES)
    writing.write_json(folder / artifacts.MANIFEST, manifest)


@pytest.mark.parametrize(("order", "block"), [("abc", 65536), ("cdba", 4)])
def test_the_shards_of_a_campaign_are_byte_for_byte_the_whole(
    flown, tmp_path, monkeypatch, ran, order, block
):
    monkeypatch.setattr(merging, "BLOCK_ROWS", block)
    output = ran("merge", *(str(flown / name) for name in order), "-o", str(tmp_path / "merged"))
    assert output.out.strip() == str(tmp_path / "merged")
    for name in (artifacts.EPISODES, artifacts.SUMMARY, artifacts.SCENARIOS):
        assert (tmp_path / "merged" / name).read_bytes() == (flown / "whole" / name).read_bytes()
    whole, merged = (
        artifacts.read_json(path, artifacts.MANIFEST) for path in (flown / "whole", tmp_path / "merged")
    )
    assert (whole["config_hash"], whole["makers"]) == (merged["config_hash"], merged["makers"])
    assert not (tmp_path / "merged" / artifacts.EPISODE_PARTS).exists()


def test_what_was_flown_in_parts_is_repeated_in_its_folder(flown, shards, ran):
    ran("repeat", str(shards["a"]), "evaluate")
    ran("merge", *(str(shards[name]) for name in "abc"), "-o", str(shards["d"].parent / "whole"))
    for name, again in ("a", shards["a"]), ("whole", shards["d"].parent / "whole"):
        for table in (artifacts.EPISODES, artifacts.SUMMARY):
            assert (again / table).read_bytes() == (flown / name / table).read_bytes()
        assert not (again / artifacts.EPISODE_PARTS).exists()


def test_shards_are_merged_beside_other_files(flown, tmp_path, ran):
    (tmp_path / "merged").mkdir()
    (tmp_path / "merged" / "notes.txt").write_text("spring")
    ran("merge", *(str(flown / name) for name in "abc"), "-o", str(tmp_path / "merged"))
    assert (tmp_path / "merged" / "notes.txt").read_text() == "spring"
    merged, whole = (path / artifacts.SUMMARY for path in (tmp_path / "merged", flown / "whole"))
    assert merged.read_bytes() == whole.read_bytes()


def test_a_shard_has_the_cases_of_the_whole(flown):
    whole, shard = (tables.read_parquet(flown / name, artifacts.EPISODES) for name in ("whole", "b"))
    for name in whole:
        assert np.array_equal(whole[name][10:33], shard[name])
    assert artifacts.read_json(flown / "b", artifacts.SUMMARY)["only_cases"] == [10, 33]
    rows = (flown / "b" / artifacts.SCENARIOS).read_text().splitlines()
    assert rows[1:] == (flown / "whole" / artifacts.SCENARIOS).read_text().splitlines()[11:34]


def test_overlaps_that_differ_are_refused(shards, ran, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def change(columns):
        columns["delta_v_m_s"] = columns["delta_v_m_s"] + np.where(columns["case"] == 11, 1e-15, 0.0)

    forged(shards["b"], change)
    error = ran("merge", *(str(shards[name]) for name in "abc"), code=2).err
    assert "both have case 11, and differ in its delta_v_m_s in evaluate/episodes.parquet" in error
    assert not Path("outputs").exists()


def test_cases_that_no_shard_has_are_told_with_the_command(shards, ran):
    error = ran("merge", str(shards["a"]), str(shards["c"]), code=2).err
    assert "no shard has the cases 13 to 32; fly them" in error
    assert "monte_carlo.only_cases=[13,33]" in error
    assert "no shard has the cases 33 to 39" in ran("merge", str(shards["b"]), str(shards["a"]), code=2).err


def test_what_is_no_shard_of_this_campaign_or_program_is_refused(shards, ran, tmp_path, monkeypatch):
    a, b, c = (str(shards[name]) for name in "abc")
    whole = str(shards["a"].with_name("whole"))
    assert "is no shard, it was flown whole" in ran("merge", a, whole, code=2).err
    other = tmp_path / "other"
    words = [*WORDS, "seed=2", "monte_carlo.only_cases=[33,40]", f"hydra.run.dir={other}"]
    ran(*words)
    assert "of different campaigns, in seed" in ran("merge", a, b, str(other), code=2).err
    forged(shards["c"], lambda columns: columns.update(case=columns["case"] + 1))
    assert "has other cases than its monte_carlo.only_cases" in ran("merge", a, b, c, code=2).err
    (shards["c"] / artifacts.SUMMARY).write_text("{}")
    assert "summary.json was changed since it was written" in ran("merge", a, b, c, code=2).err
    elsewhere = dict(maker.product()) | {"sources": "others"}
    monkeypatch.setattr(maker, "product", lambda: elsewhere)
    error = ran("merge", a, b, str(shards["d"]), code=2).err
    assert "was made by another program (other sources), so that the whole would mix two" in error


def test_a_shard_is_refused_where_the_number_of_flights_matters(ran):
    too_late = ran(*WORDS, "monte_carlo.only_cases=[30,41]", code=2).err
    assert "monte_carlo.only_cases ends at 41, and monte_carlo.num_cases is 40" in too_late
    stages = ran(*WORDS, "stages=[scenario,evaluate,optimum]", "monte_carlo.only_cases=[0,4]", code=2).err
    assert "a shard has evaluate, record, report, scenario alone" in stages
    stopped = ran(*WORDS, "monte_carlo.only_cases=[0,4]", "monte_carlo.stop_width=0.1", code=2).err
    assert "where the whole would stop, a shard of it does not know" in stopped
