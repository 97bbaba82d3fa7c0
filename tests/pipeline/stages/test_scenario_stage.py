"""scenarios.csv: where every flight of a run starts."""

import csv
from pathlib import Path

import numpy as np

from pipeline.flight.cases.starts import evaluation_scenarios, training_scenarios
from pipeline.flight.state.log import Scenario
from pipeline.run import artifacts
from pipeline.stages import scenario
from tests.pipeline.stages.cases import prepared

COLUMNS = [
    "set", "case", "position_x_m", "position_y_m", "position_z_m",
    "velocity_x_m_s", "velocity_y_m_s", "velocity_z_m_s", "sun_angle_rad", "sun_elevation_rad",
]  # fmt: skip


def rows(folder: Path) -> list[dict[str, str]]:
    with (folder / artifacts.SCENARIOS).open(newline="", encoding="utf-8") as stream:
        reader = csv.DictReader(stream)
        assert reader.fieldnames == COLUMNS
        return list(reader)


def assert_written(found: list[dict[str, str]], name: str, expected: list[Scenario]) -> None:
    """The rows of one set, every number to the last bit."""
    written = [row for row in found if row["set"] == name]
    assert [int(row["case"]) for row in written] == list(range(len(expected)))
    numbers = np.array([[float(row[column]) for column in COLUMNS[2:]] for row in written])
    starts = [
        [*start.position_m, *start.velocity_m_s, start.sun_angle_rad, start.sun_elevation_rad]
        for start in expected
    ]
    np.testing.assert_array_equal(numbers, starts)


def test_a_training_writes_its_octants_and_its_evaluation(tmp_path: Path) -> None:
    run = prepared(tmp_path, "sun=random").experiment
    scenario.run(run, tmp_path)
    found = rows(tmp_path)
    assert [row["set"] for row in found] == ["training-0"] * 8 + ["evaluation"] * 5
    assert_written(found, "training-0", training_scenarios(run.starts, run.sun, run.seed))
    assert_written(found, "evaluation", evaluation_scenarios(run.monte_carlo, run.sun, run.seed))


def test_rounds_that_draw_anew_are_all_written(tmp_path: Path) -> None:
    run = prepared(
        tmp_path, "starts.num_cases=3", "optimizer.rounds=2", experiment="train_champion"
    ).experiment
    scenario.run(run, tmp_path)
    found = rows(tmp_path)
    assert [row["set"] for row in found] == ["training-0"] * 3 + ["training-1"] * 3 + ["evaluation"] * 5
    for index in (0, 1):
        assert_written(found, f"training-{index}", training_scenarios(run.starts, run.sun, run.seed, index))


def test_without_training_only_the_evaluation_is_written(tmp_path: Path) -> None:
    run = prepared(tmp_path, experiment="evaluate").experiment
    scenario.run(run, tmp_path)
    assert {row["set"] for row in rows(tmp_path)} == {"evaluation"}
