"""scenarios.csv: where every flight of a run starts."""

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipeline.command_line.config import compose_experiment
from pipeline.command_line.overrides import rewrite_paths
from pipeline.flight.state.log import Scenario
from pipeline.report.contents import begins_with_training
from pipeline.run import artifacts, tables
from pipeline.scenarios import evaluation_scenarios, training_scenarios
from pipeline.settings.experiment import Experiment, SettingError
from pipeline.stages import scenario
from plain_files.file_access import MAX_BYTES
from tests.pipeline.stages.cases import prepared

NUMBERS = [f"position_{axis}_m" for axis in "xyz"] + [f"velocity_{axis}_m_s" for axis in "xyz"]
NUMBERS += ["sun_angle_rad", "sun_elevation_rad"]


def rows(folder: Path) -> list[dict[str, str]]:
    with (folder / artifacts.SCENARIOS).open(newline="", encoding="utf-8") as stream:
        reader = csv.DictReader(stream)
        assert reader.fieldnames == ["set", "case", *NUMBERS]
        return list(reader)


def assert_written(rows_written: list[dict[str, str]], name: str, expected: list[Scenario]) -> None:
    """The rows of one set, every number to the last bit."""
    written = [row for row in rows_written if row["set"] == name]
    assert [int(row["case"]) for row in written] == list(range(len(expected)))
    numbers = np.array([[float(row[column]) for column in NUMBERS] for row in written])
    starts = [[*s.position_m, *s.velocity_m_s, s.sun_angle_rad, s.sun_elevation_rad] for s in expected]
    np.testing.assert_array_equal(numbers, starts)


def test_a_training_writes_its_octants_and_its_evaluation(tmp_path: Path) -> None:
    run = prepared(tmp_path, "sun=random").experiment
    scenario.run(run, tmp_path)
    written = rows(tmp_path)
    assert [row["set"] for row in written] == ["training-0"] * 8 + ["evaluation"] * 5
    assert_written(written, "training-0", training_scenarios(run))
    assert_written(written, "evaluation", evaluation_scenarios(run))


def test_rounds_that_draw_anew_are_all_written(tmp_path: Path) -> None:
    words = ("starts.num_cases=3", "optimizer.rounds=2")
    run = prepared(tmp_path, *words, experiment="train_champion").experiment
    scenario.run(run, tmp_path)
    written = rows(tmp_path)
    assert [row["set"] for row in written] == ["training-0"] * 3 + ["training-1"] * 3 + ["evaluation"] * 5
    for index in (0, 1):
        assert_written(written, f"training-{index}", training_scenarios(run, index))
    # without training only the evaluation is written
    scenario.run(prepared(tmp_path, experiment="evaluate").experiment, tmp_path)
    assert {row["set"] for row in rows(tmp_path)} == {"evaluation"}


HEADER = "position_x_m,position_y_m,position_z_m,sun_angle_rad"


def composed(path: Path, *words: str) -> Experiment:
    return compose_experiment([*words, *rewrite_paths([f"starts={path}"])]).experiment


@pytest.mark.slow
def test_what_a_run_wrote_is_flown_again_to_the_last_bit(tmp_path: Path) -> None:
    run = prepared(tmp_path, "starts=random", "starts.num_cases=3", "sun=random").experiment
    scenario.run(run, tmp_path)
    again = composed(tmp_path / artifacts.SCENARIOS, "+experiment=train_paper")
    for starts_of, given in ((training_scenarios, again.starts), (evaluation_scenarios, again.monte_carlo)):
        first, second = starts_of(run), starts_of(again)
        assert len(first) == len(second) == given.num_cases
        for before, after in zip(first, second, strict=True):
            np.testing.assert_array_equal(before.position_m, after.position_m)
            np.testing.assert_array_equal(before.velocity_m_s, after.velocity_m_s)
            assert before.sun_angle_rad == after.sun_angle_rad


@pytest.mark.slow
def test_a_table_without_sets_serves_training_and_evaluation(tmp_path: Path) -> None:
    path = tmp_path / "own.csv"
    path.write_text(f"velocity_y_m_s,{HEADER}\n-0.1,60,0,0,1.5\n0,0,-70,5,2\n")
    experiment = composed(path, "+experiment=train_paper")
    for starts in (training_scenarios(experiment, 4), evaluation_scenarios(replace(experiment, seed=9))):
        assert [start.sun_angle_rad for start in starts] == [1.5, 2.0]
        np.testing.assert_array_equal(starts[0].velocity_m_s, [0.0, -0.1, 0.0])
        np.testing.assert_array_equal(starts[1].position_m, [0.0, -70.0, 5.0])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "is no table of starts"),
        (HEADER, "has no row below its header"),
        ("position_x_m,position_y_m,position_z_m\n60,0,0", "lacks sun_angle_rad; its columns are set, case"),
        (f"{HEADER},velocity_x_ms\n60,0,0,0,0", "has a column 'velocity_x_ms'; did you mean velocity_x_m_s"),
        (f"case,{HEADER}\n0,60,0,0,0\n20,70,0,0,0", "row 2 is case '20', but would be flown as case 1"),
        (f"{HEADER}\n60,0,zero,0", "row 1 has position_z_m 'zero'; write a finite number"),
        (f"{HEADER}\n60,0,0,0\n60,0,0", "row 2 has 3 cells, the header 4"),
        (f"{HEADER}\n60,0,0,0\n0,9,0,0", "row 2 starts 9 m from the chief, outside the limits"),
    ],
)
def test_tables_that_cannot_be(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "own.csv"
    path.write_text(text)
    with pytest.raises(SettingError, match=message):
        composed(path, "+experiment=evaluate")
    with pytest.raises(SettingError, match=r"nowhere.csv cannot be read"):
        composed(tmp_path / "nowhere.csv", "+experiment=evaluate")


def test_starts_of_a_campaign_may_be_more_than_a_file_that_is_received(tmp_path: Path) -> None:
    path = tmp_path / artifacts.SCENARIOS
    assert not begins_with_training(tmp_path)
    many = "evaluation,0\n" * (MAX_BYTES // 10)
    for rows_of_training, expected in (("", False), ("training-0,0\n", True)):
        path.write_text(f"set,case\n{rows_of_training}{many}", encoding="utf-8")
        assert path.stat().st_size > MAX_BYTES
        assert begins_with_training(tmp_path) is expected


def test_more_starts_than_are_listed_are_drawn_where_they_are_flown(tmp_path, monkeypatch, capsys):
    run = prepared(tmp_path, experiment="evaluate").experiment
    scenario.run(run, tmp_path)
    assert (tmp_path / artifacts.SCENARIOS).exists()
    monkeypatch.setattr(scenario, "MOST_LISTED", run.monte_carlo.num_cases - 1)
    scenario.run(run, tmp_path)
    assert not (tmp_path / artifacts.SCENARIOS).exists()
    sentence = (
        f"the 5 starts of the evaluation are drawn where they are flown, and kept in {artifacts.EPISODES}"
    )
    assert sentence in capsys.readouterr().err
    # those of a training are listed all the same
    scenario.run(prepared(tmp_path).experiment, tmp_path)
    assert {row["set"] for row in rows(tmp_path)} == {"training-0"}


def test_starts_are_listed_in_blocks(tmp_path, monkeypatch, capsys):
    run = prepared(tmp_path, "sun=random", "monte_carlo.num_cases=23", experiment="evaluate").experiment
    monkeypatch.setattr(scenario, "BLOCK", 5)
    monkeypatch.setattr(tables, "CSV_ROWS", 3)
    scenario.run(run, tmp_path)
    assert_written(rows(tmp_path), "evaluation", evaluation_scenarios(run))
    assert "start: 23/23" in capsys.readouterr().err
