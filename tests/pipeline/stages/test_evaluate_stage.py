"""An evaluation in miniature: its tables, its summary, and whose controller flies."""

import csv
from dataclasses import replace
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from fis_tools.formats import serialize
from pipeline.command_line.config import compose_experiment
from pipeline.controllers import source as controller_source
from pipeline.evaluation import blocks
from pipeline.evaluation.monte_carlo import summarise
from pipeline.evaluation.sequential import quantile
from pipeline.run import artifacts, maker, tables
from pipeline.run.artifacts import ArtifactError
from pipeline.settings.experiment import SettingError
from pipeline.stages import evaluate, search
from tests.pipeline.stages.cases import carried_out, prepared

SUN = ("sun=random", "monte_carlo.confidence_percent=90.0")


#: what follows the flights
AFTER = ("stays_orbit", "stays_three_orbits", "passively_safe")


@pytest.fixture(scope="module")
def evaluated(tmp_path_factory):
    folder = tmp_path_factory.mktemp("evaluated")
    run = prepared(folder, *SUN, experiment="evaluate")
    evaluate.run(run.experiment, folder)
    return run, folder


def test_episodes_have_a_row_a_case_and_the_promised_columns(evaluated):
    _, folder = evaluated
    table = pq.read_table(folder / artifacts.EPISODES)
    whole = {"case", "inspected_count", "safety_periods", "inspectable_count"}
    kinds = {name: pa.int64() for name in whole} | dict.fromkeys(("success", "violated", *AFTER), pa.bool_())
    names = """case position_x_m position_y_m position_z_m sun_angle_rad delta_v_m_s inspected_count
        inspection_rate_percent mean_distance_m min_distance_m max_distance_m success violated
        safety_periods safety_delta_v_m_s ahead_delta_v_m_s sun_elevation_rad inspectable_count
        inspectable_rate_percent"""
    assert table.column_names == [*names.split(), *AFTER]
    assert all(field.type == kinds.get(field.name, pa.float64()) for field in table.schema)
    assert table["case"].to_pylist() == [0, 1, 2, 3, 4]
    assert all(column.null_count == 0 for column in table.columns)
    # trajectories have a row a sample in single precision
    table = pq.read_table(folder / artifacts.TRAJECTORIES)
    kinds = dict.fromkeys(("case", "sample"), pa.int32())
    kinds |= {f"position_{axis}_m": pa.float32() for axis in "xyz"}
    assert {field.name: field.type for field in table.schema} == kinds
    assert table["case"].to_pylist() == [case for case in range(5) for _ in range(31)]
    assert table["sample"].to_pylist() == list(range(31)) * 5


def test_the_summary_tells_what_flew_and_how_well(evaluated, capsys):
    run, folder = evaluated
    evaluate.run(run.experiment, folder)
    summary = artifacts.read_json(folder, artifacts.SUMMARY)
    names = """controller controller_sha256 sun num_cases seed confidence_percent delta_v_m_s
        inspection_rate_percent mean_distance_m safety_periods safety_delta_v_m_s ahead_delta_v_m_s
        inspectable_count inspectable_rate_percent success violated success_and_within_limits safety_acted
        percentiles optimum"""
    expected = names.split()
    assert list(summary) == [*expected[:-2], *AFTER, *expected[-2:]]
    assert (summary["controller"], summary["sun"], summary["seed"]) == ("paper", "random", 1)
    assert (summary["num_cases"], summary["confidence_percent"]) == (5, 90.0)
    episodes = tables.read_parquet(folder, artifacts.EPISODES)
    assert {name: summary[name] for name in list(summary)[6:-2]} == summarise(episodes, 90.0)
    delta_v = episodes["delta_v_m_s"]
    output = capsys.readouterr().err
    assert f"delta-v {delta_v.mean():.3f} ± {delta_v.std(ddof=1):.3f} m/s" in output
    assert "5 cases in" in output
    assert "Sun random" in output


def test_a_champion_in_the_folder_flies_instead_of_the_configured_controller(tmp_path):
    run = prepared(tmp_path, *SUN, experiment="evaluate").experiment
    fuzzy = controller_source.load(run.controller, run.mission).fuzzy
    assert controller_source.controller_of_run(run, tmp_path).name == "paper"
    champion = replace(fuzzy, name="champion", systems=fuzzy.systems[:1])
    (tmp_path / artifacts.CHAMPION).write_text(serialize.dump_json(champion), encoding="utf-8")
    assert controller_source.controller_of_run(run, tmp_path).systems == fuzzy.systems[:1]
    evaluate.run(run, tmp_path)
    assert artifacts.read_json(tmp_path, artifacts.SUMMARY)["controller"] == "champion"


def test_a_run_that_trains_is_not_evaluated_without_its_champion(tmp_path):
    with pytest.raises(ArtifactError, match=r"has no champion.json; the stage train writes it"):
        evaluate.run(prepared(tmp_path).experiment, tmp_path)
    assert not (tmp_path / artifacts.EPISODES).exists()


def test_a_controller_file_changed_later_does_not_change_the_run(tmp_path):
    source = tmp_path / "mine.json"
    original = serialize.load(Path("conf/controller/paper.yaml"))
    source.write_text(serialize.dump_json(original), encoding="utf-8")
    overrides = ("controller=file", f"controller.path={source}")
    run = prepared(tmp_path, *overrides, experiment="evaluate").experiment
    evaluate.run(run, tmp_path)
    source.write_text(serialize.dump_json(replace(original, name="changed")), encoding="utf-8")
    assert controller_source.controller_of_run(run, tmp_path).name == original.name


@pytest.mark.slow
def test_the_best_trial_is_told_and_its_champion_kept(tmp_path):
    space = "+hparams_search.space.optimizer.initial_step={low: 0.01, high: 0.5, log: true}"
    few = "++hparams_search={trials: 3, trains: true, num_cases: 8, block_cases: 4}"
    run = prepared(tmp_path, "stages=[search]", few, space, "optimizer.mutation=local")
    carried_out(run, tmp_path)
    with (tmp_path / artifacts.SEARCH_TRIALS).open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert [row["trial"] for row in rows] == ["0", "1", "2"]
    complete = {float(row["cost_m_s"]): row for row in rows if row["state"] == "complete"}
    best = artifacts.read_json(tmp_path, artifacts.SEARCH_BEST)
    assert best["cost_m_s"] == min(complete)
    assert best["words"] == [f"optimizer.initial_step={complete[min(complete)]['optimizer.initial_step']}"]
    champion = serialize.load(tmp_path / artifacts.CHAMPION)
    # going on has nothing left to try, and comes to the same
    search.run(replace(run.experiment, resume=True), tmp_path)
    assert artifacts.read_json(tmp_path, artifacts.SEARCH_BEST) == best
    assert serialize.load(tmp_path / artifacts.CHAMPION) == champion
    with pytest.raises(SettingError, match=r"stages has search, and hparams_search.space is empty"):
        compose_experiment(["+experiment=evaluate", "controller=coast", "stages=[search]"])


def test_a_summary_does_not_depend_on_the_parts_of_a_campaign(tmp_path, monkeypatch):
    monkeypatch.setattr(tables, "GROUP_ROWS", 16)
    monkeypatch.setattr(blocks, "BLOCK_ROWS", 16)
    dispersed = "+dispersions.deputy.mass_kg={kind: normal, mean: 12, std: 0.2, low: 11, high: 13}"
    summaries = []
    for part_cases in (7, 33, 50):
        folder = tmp_path / str(part_cases)
        words = ("monte_carlo.num_cases=50", f"engine.part_cases={part_cases}", dispersed, *SUN)
        evaluate.run(prepared(folder, *words, experiment="evaluate").experiment, folder)
        assert sum(1 for _ in tables.Columns(folder, artifacts.EPISODES).blocks()) == 4
        assert not (folder / artifacts.EPISODE_PARTS).exists()
        summaries.append((folder / artifacts.SUMMARY).read_text())
    assert "sensitivity" in summaries[0]
    assert summaries[0] == summaries[1] == summaries[2]


def test_a_table_larger_than_is_read_at_once_is_recorded_and_reported(tmp_path, monkeypatch):
    run = prepared(tmp_path, *SUN, experiment="evaluate")
    carried_out(run, tmp_path, "evaluate")
    size = (tmp_path / artifacts.EPISODES).stat().st_size
    monkeypatch.setattr(tables, "MOST_BYTES", 300)
    with pytest.raises(ArtifactError, match="unpacks to"):
        tables.read_parquet(tmp_path, artifacts.EPISODES)
    assert size > 300
    (tmp_path / artifacts.TRAJECTORIES).unlink()
    carried_out(run, tmp_path, "record", "report")
    assert (tmp_path / artifacts.REPORT).exists()
    monkeypatch.setattr(tables, "MOST_BYTES", 30)
    with pytest.raises(ArtifactError, match="unpacks to"):
        tables.Columns(tmp_path, artifacts.EPISODES)["delta_v_m_s"]


def test_parts_that_are_flown_no_more_name_their_makers(tmp_path, monkeypatch):
    run = prepared(tmp_path, "engine.part_cases=2", *SUN, experiment="evaluate")
    # as a process that is killed leaves them: the last part is missing, the manifest names no other maker
    elsewhere = maker.present_maker() | {"git_revision": "of another machine"}
    with monkeypatch.context() as patched:
        patched.setattr(maker, "present_maker", lambda: elsewhere)
        patched.setattr(tables, "join_parquet", lambda *_: (_ for _ in ()).throw(KeyError("killed")))
        with pytest.raises(KeyError, match="killed"):
            evaluate.run(run.experiment, tmp_path)
    parts = sorted((tmp_path / artifacts.EPISODE_PARTS).rglob("*.parquet"))
    assert [part.stem for part in parts] == [
        "000000000-000000002",
        "000000002-000000004",
        "000000004-000000005",
    ]
    parts[2].unlink()
    # a part that certifies nothing is flown again
    tables.write_parquet(parts[1], dict(tables.Columns(parts[1].parent, parts[1].name)))
    kept = parts[0].stat().st_ino
    resumed = replace(run, experiment=replace(run.experiment, resume=True))
    inodes, join = [], tables.join_parquet
    monkeypatch.setattr(
        tables, "join_parquet",
        lambda path, of, *more: (inodes.extend(part.stat().st_ino for part in of), join(path, of, *more)),
    )  # fmt: skip
    carried_out(resumed, tmp_path, "evaluate")
    assert inodes[0] == kept
    manifest = artifacts.read_json(tmp_path, artifacts.MANIFEST)
    assert manifest["makers"] == [maker.present_maker(), elsewhere]
    assert sorted(manifest["made_by"]["evaluate"]) == [0, 1]
    assert not pq.read_schema(tmp_path / artifacts.EPISODES).metadata


WHOLE = ("monte_carlo.num_cases=2500", "duration_s=100.0", "engine.part_cases=900")


@pytest.mark.parametrize(("part_cases", "width"), [(300, 0.03), (5000, 0.03), (900, 0.004)])
def test_flights_end_where_the_interval_is_as_narrow_as_asked_in_any_cut(tmp_path, capsys, part_cases, width):
    words = (*WHOLE, "monte_carlo.stop_quantity=delta_v_m_s", f"monte_carlo.stop_width={width}", *SUN)
    run = prepared(tmp_path, *words, f"engine.part_cases={part_cases}", experiment="evaluate")
    evaluate.run(run.experiment, tmp_path)
    summary = artifacts.read_json(tmp_path, artifacts.SUMMARY)
    delta_v = tables.read_parquet(tmp_path, artifacts.EPISODES)["delta_v_m_s"]
    assert summary["stop"] == {"quantity": "delta_v_m_s", "width": width, "most_cases": 2500}
    assert summary["num_cases"] == len(delta_v)
    widths = {
        number: 2.0 * quantile(number, 90.0) * delta_v[:number].std(ddof=1) / number**0.5
        for number in range(1000, len(delta_v) + 1, 1000)
    }
    assert summary["num_cases"] == next((number for number in widths if widths[number] <= width), 2500)
    assert (summary["num_cases"] < 2500) == (width == 0.03)
    mean = summary["delta_v_m_s"]
    reach = quantile(len(delta_v), 90.0) * mean["standard_deviation"] / len(delta_v) ** 0.5
    assert mean["high"] - mean["mean"] == pytest.approx(reach)
    assert "all intervals hold for any number of flights" in capsys.readouterr().err


def test_parts_beyond_a_look_go_on_where_no_width_is_given(tmp_path):
    run = prepared(tmp_path, *WHOLE, *SUN, experiment="evaluate")
    evaluate.run(run.experiment, tmp_path)
    summary = artifacts.read_json(tmp_path, artifacts.SUMMARY)
    assert (summary["num_cases"], summary.get("stop")) == (2500, None)


def test_splitting_tells_the_share_outside_the_limits_with_its_interval(tmp_path, capsys):
    words = ("controller=lqr", "safety=none", "deputy.min_distance_m=50.0", "monte_carlo.num_cases=300", *SUN)
    run = prepared(tmp_path, *words, "monte_carlo.splitting_flights=1500", experiment="evaluate")
    evaluate.run(run.experiment, tmp_path)
    summary = artifacts.read_json(tmp_path, artifacts.SUMMARY)
    rare, plain = summary["violated_by_splitting"], summary["violated"]
    assert rare["low"] < plain["high"]
    assert plain["low"] < rare["high"]
    assert rare["num_flights"] <= 1530
    assert f"outside: {rare['share']:.3g} by splitting" in capsys.readouterr().err
