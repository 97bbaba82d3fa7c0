"""Files of a run: written whole, accounted for, read back with clear errors."""

import hashlib
import subprocess
import tracemalloc
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import yaml

from fis_tools.errors import ControllerFileError
from fis_tools.source import read_controller
from pipeline.run import artifacts, configuration, maker, manifests, tables, writing
from pipeline.run.artifacts import ArtifactError
from pipeline.run.runner import manifest_of
from pipeline.settings.schema import experiment_from
from telemetry import RecordingError
from telemetry.scene import runs
from tests.pipeline.command_line.cases import plain_config


def test_a_write_that_fails_leaves_the_old_file_and_nothing_else(tmp_path, monkeypatch):
    path = tmp_path / "new" / "file.txt"
    writing.write_atomically(path, "old\r\n")
    assert path.read_bytes() == b"old\r\n"

    def fail(*_arguments):
        raise OSError("no space left")

    monkeypatch.setattr("os.replace", fail)
    with pytest.raises(OSError, match="no space left"):
        writing.write_atomically(path, b"new")
    assert [p.name for p in path.parent.iterdir()] == ["file.txt"]
    assert path.read_bytes() == b"old\r\n"


def test_config_hash_is_that_of_sorted_json_without_hydra():
    config = {"b": [1, 2.5, None], "a": {"y": "ü", "x": True}}
    by_hand = '{"a": {"x": true, "y": "\\u00fc"}, "b": [1, 2.5, null]}'
    assert configuration.config_hash(config) == hashlib.sha256(by_hand.encode()).hexdigest()
    assert configuration.config_hash({**config, "hydra": {"run": 1}}) == configuration.config_hash(config)
    assert configuration.config_hash({**config, "b": []}) != configuration.config_hash(config)


def test_the_written_configuration_reads_back_to_the_same_hash(tmp_path):
    config = plain_config("optimizer.penalty.missed_point_m_s=1e-5", "report.title='Ångström: yes'")
    configuration.write(tmp_path, config)
    assert configuration.read(tmp_path) == config
    read = yaml.safe_load((tmp_path / "config.yaml").read_text(encoding="utf-8"))
    assert configuration.config_hash(read) == configuration.config_hash(config)


def test_manifest_accounts_for_finished_files_only(tmp_path):
    config = plain_config("seed=3")
    configuration.write(tmp_path, config)
    others = ("train/checkpoint.npz", "episodes/b.mcap.partial", ".hydra/x")
    for name in ("champion.json", "episodes/a.mcap", *others):
        writing.write_atomically(tmp_path / name, name)
    (tmp_path / "pipeline.log").write_text("x")
    earlier = {"finished_stages": ["scenario"]}
    manifests.write(tmp_path, manifest_of(experiment_from(config), config, earlier))
    manifest = manifests.read(tmp_path)
    assert set(manifest["sha256"]) == {"config.yaml", "champion.json", "episodes/a.mcap"}
    assert manifest["sha256"]["champion.json"] == hashlib.sha256(b"champion.json").hexdigest()
    assert manifest["config_hash"] == configuration.config_hash(config)
    assert (manifest["seed"], manifest["finished_stages"], manifest["name"]) == (3, ["scenario"], "evaluate")
    assert manifest["versions"]["product"] == maker.product_version()
    assert manifest["versions"]["numpy"] != "absent"


def test_git_revision_is_that_of_the_sources_or_none(tmp_path, monkeypatch):
    monkeypatch.setattr(maker, "SOURCES", tmp_path)
    assert maker.git_revision() is None
    git = ["git", "-C", str(tmp_path), "-c", "user.name=n", "-c", "user.email=e@x"]
    for words in (["init", "-q"], ["commit", "-q", "--allow-empty", "-m", "x"]):
        subprocess.run([*git, *words], check=True)  # noqa: S603
    revision = maker.git_revision()
    assert len(revision) == 40
    (tmp_path / "a").write_text("1")
    subprocess.run([*git, "add", "a"], check=True)  # noqa: S603
    assert maker.git_revision() == f"{revision}+changes"


@pytest.mark.parametrize(
    ("read", "name", "content", "message"),
    [
        (artifacts.read_json, "champion.json", None, r"has no champion.json; the stage train writes it"),
        (artifacts.read_json, "x/summary.json", b'{"a": ', r"summary.json cannot be read .*; repeat the"),
        (manifests.read, "manifest.json", b'{"manifest_version": 99}', "version 99, this program reads 1"),
        (tables.read_parquet, artifacts.EPISODES, None, "has no evaluate/episodes.parquet; the stage eval"),
    ],
)
def test_reading_what_is_not_there_or_cut(read, name, content, message, tmp_path):
    if content is not None:
        writing.write_atomically(tmp_path / name, content)
    with pytest.raises(ArtifactError, match=message):
        read(tmp_path, *[name] * (read is not manifests.read))


def test_numbers_that_json_does_not_have_are_refused(tmp_path):
    with pytest.raises(ArtifactError, match=r"x\.json is not written, for cases\[1\]\.mean is not finite"):
        writing.write_json(tmp_path / "x.json", {"seed": 1, "cases": [{"mean": 0.5}, {"mean": float("nan")}]})
    assert list(tmp_path.iterdir()) == []


def test_columns_come_back_as_they_were(tmp_path: Path) -> None:
    columns = {
        "count": np.arange(3),
        "single": np.array([0.1, np.nan, -0.0], dtype=np.float32),
        "exact": np.array([0.1, np.nextafter(1.0, 2.0), 5e-324]),
        "is_so": np.array([True, False, True]),
        "word": ["a", "ü", ""],
    }
    tables.write_parquet(tmp_path / "sub" / "table.parquet", columns)
    results = tables.read_parquet(tmp_path, "sub/table.parquet")
    with pytest.raises(ArtifactError, match="has no column success; repeat the stage"):
        results["success"]
    assert list(results) == list(columns)
    for name, values in columns.items():
        np.testing.assert_array_equal(results[name], values)
        assert name == "word" or results[name].dtype == np.asarray(values).dtype
    # a matrix becomes a list a row
    rows = np.random.default_rng(1).random((3, 4))
    tables.write_parquet(tmp_path / "table.parquet", {"genome": rows})
    np.testing.assert_array_equal(np.stack(tables.read_parquet(tmp_path, "table.parquet")["genome"]), rows)


@pytest.mark.parametrize("kept", [0, 10, -20])
def test_a_cut_table_is_refused(kept: int, tmp_path: Path) -> None:
    path = tmp_path / "table.parquet"
    tables.write_parquet(path, {"count": np.arange(100)})
    path.write_bytes(path.read_bytes()[:kept])
    with pytest.raises(ArtifactError, match=r"table.parquet cannot be read .*; repeat the stage that writes"):
        tables.read_parquet(tmp_path, "table.parquet")


def test_numbers_in_csv_read_back_to_the_same_bits(tmp_path: Path) -> None:
    numbers = [0.1 + 0.2, 1e-310, 1.7976931348623157e308, -0.0, np.float64(1.0) / 3.0]
    tables.write_csv(tmp_path / "table.csv", ["name", "value"], [[f"n{i}", x] for i, x in enumerate(numbers)])
    lines = (tmp_path / "table.csv").read_bytes().decode().split("\n")
    assert (lines[0], lines[-1]) == ("name,value", "")
    assert [float(line.split(",")[1]).hex() for line in lines[1:-1]] == [float(x).hex() for x in numbers]


@pytest.mark.parametrize("cuts", [(4,), (1, 2, 3), (10, 20, 23), (7, 14)])
def test_a_table_in_parts_becomes_the_bytes_of_one_written_whole(cuts, tmp_path, monkeypatch):
    monkeypatch.setattr(tables, "GROUP_ROWS", 5)
    columns = {"case": np.arange(23), "cost": np.linspace(0.0, 1.0, 23), "at": np.ones((23, 3))}
    tables.write_parquet(tmp_path / "whole", columns)
    bounds = [0, *cuts, 23]
    parts = [tmp_path / f"part-{first}" for first in bounds[:-1]]
    for part, first, last in zip(parts, bounds, bounds[1:], strict=False):
        tables.write_parquet(part, {name: column[first:last] for name, column in columns.items()})
    tables.join_parquet(tmp_path / "joined", parts)
    assert (tmp_path / "joined").read_bytes() == (tmp_path / "whole").read_bytes()
    assert pq.read_metadata(tmp_path / "joined").num_row_groups == 5


BILLION = b"a0: &a0 [x, x, x, x, x, x, x, x, x]\n" + b"".join(
    b"a%d: &a%d [%s]\n" % (level, level, b", ".join([b"*a%d" % (level - 1)] * 9)) for level in range(1, 9)
)
TRACK = {"case": [0, 0], "sample": [0, 1], **{f"position_{axis}_m": [0.0, 1.0] for axis in "xyz"}}


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, "has no config.yaml; choose the folder of a run"),
        (b"- 1\n", "holds no configuration"),
        (b"a: [1", r"\); restore it, or start a new run"),
        (b"a: !!python/object/apply:os.getcwd []", "cannot be read"),
        (b"1: 2\na: 3", "is no text; write it in quotes"),
        (b"a: [{on: 3}]", "is no text; write it in quotes"),
        (BILLION, r"it has an alias \(\*\)"),
        (b"a: " + b"[" * 100_000, "nested more than 64 deep"),
        (b"#" * 3_000_000, "it has 3000000 bytes, and at most"),
        (b"\xff\xfe\x00", "cannot be read"),
        (b"a: 99-99-99T\nb: 2001-99-99\n", "cannot be read"),
    ],
)
def test_configurations_that_are_none(content, message, tmp_path):
    if content is not None:
        (tmp_path / artifacts.CONFIG).write_bytes(content)
    tracemalloc.start()
    with pytest.raises(ArtifactError, match=message):
        configuration.read(tmp_path)
    assert tracemalloc.get_traced_memory()[1] < 50e6
    tracemalloc.stop()


@pytest.mark.parametrize("name", ["../secret.json", "/etc/passwd"])
def test_a_manifest_leads_nowhere_else(name, tmp_path):
    files = {"champion": name, "evaluation_episodes": name}
    writing.write_json(tmp_path / artifacts.MANIFEST, {"files": files})
    with pytest.raises(RecordingError, match="lies outside the folder"):
        runs.file_of(tmp_path, "evaluation_episodes")
    with pytest.raises(ControllerFileError, match="names a champion outside the folder"):
        read_controller(tmp_path)


@pytest.mark.parametrize(
    ("column", "values", "message"),
    [
        ("sample", ["a", "b"], "no column sample of numbers without gaps"),
        ("sample", [0, None], "no column sample of numbers without gaps"),
        ("sample", [0.0, float("nan")], "no whole numbers in its column sample"),
        ("sample", [0, 2**62], "does not hold whole trajectories"),
        ("position_x_m", [[1.0], [2.0]], "no column position_x_m of numbers"),
        ("case", [{"a": 1}, {"a": 2}], "no column case of numbers"),
    ],
)
def test_tables_of_other_types(column, values, message, tmp_path):
    path = tmp_path / "trajectories.parquet"
    pq.write_table(pa.table({**TRACK, column: values}), path)
    with pytest.raises(RecordingError, match=message):
        runs.read_evaluation(path)


def test_a_table_that_unpacks_to_more_than_is_read(tmp_path, monkeypatch):
    monkeypatch.setattr(runs, "MOST_BYTES", 10_000_000)
    path = tmp_path / "trajectories.parquet"
    zeros = pa.array(np.zeros(2_000_000, dtype=np.int64))
    pq.write_table(pa.table(dict.fromkeys(TRACK, zeros)), path, compression="zstd", use_dictionary=True)
    assert path.stat().st_size < 100_000
    with pytest.raises(RecordingError, match=r"unpacks to .* bytes; at most"):
        runs.read_evaluation(path)
