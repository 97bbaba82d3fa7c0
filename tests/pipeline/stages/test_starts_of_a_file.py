"""Starts of a file: read into the configuration, flown as they are, refused in words."""

from pathlib import Path

import numpy as np
import pytest

from pipeline.command_line.config import compose_experiment
from pipeline.command_line.overrides import ConfigError, rewrite_paths
from pipeline.flight.cases.starts import evaluation_scenarios, training_scenarios
from pipeline.run import artifacts
from pipeline.settings.experiment import Experiment, SettingError
from pipeline.stages import scenario
from tests.pipeline.stages.cases import prepared

pytestmark = pytest.mark.slow

HEADER = "position_x_m,position_y_m,position_z_m,sun_angle_rad"


def composed(path: Path, *words: str) -> Experiment:
    return compose_experiment([*words, *rewrite_paths([f"starts={path}"])]).experiment


def test_what_a_run_wrote_is_flown_again_to_the_last_bit(tmp_path: Path) -> None:
    run = prepared(tmp_path, "starts=random", "starts.num_cases=3", "sun=random").experiment
    scenario.run(run, tmp_path)
    again = composed(tmp_path / artifacts.SCENARIOS, "+experiment=train")
    pairs = [
        (training_scenarios, run.starts, again.starts),
        (evaluation_scenarios, run.monte_carlo, again.monte_carlo),
    ]
    for starts_of, drawn, given in pairs:
        first, second = starts_of(drawn, run.sun, run.seed), starts_of(given, again.sun, again.seed)
        assert len(first) == len(second) == given.num_cases
        for one, other in zip(first, second, strict=True):
            np.testing.assert_array_equal(one.position_m, other.position_m)
            np.testing.assert_array_equal(one.velocity_m_s, other.velocity_m_s)
            assert one.sun_angle_rad == other.sun_angle_rad


def test_a_table_without_sets_serves_training_and_evaluation(tmp_path: Path) -> None:
    path = tmp_path / "own.csv"
    path.write_text(f"velocity_y_m_s,{HEADER}\n-0.1,60,0,0,1.5\n0,0,-70,5,2\n")
    experiment = composed(path, "+experiment=train")
    for starts in (
        training_scenarios(experiment.starts, experiment.sun, 1, 4),
        evaluation_scenarios(experiment.monte_carlo, experiment.sun, 9),
    ):
        assert [start.sun_angle_rad for start in starts] == [1.5, 2.0]
        np.testing.assert_array_equal(starts[0].velocity_m_s, [0.0, -0.1, 0.0])
        np.testing.assert_array_equal(starts[1].position_m, [0.0, -70.0, 5.0])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "is no table of starts"),
        (HEADER, "has no row below its header"),
        ("position_x_m,position_y_m,position_z_m\n60,0,0", "lacks sun_angle_rad; its columns are set, case"),
        (f"{HEADER},velocity_x_ms\n60,0,0,0,0", "has a column 'velocity_x_ms'; did you mean velocity_x_m_s"),
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
    with pytest.raises(ConfigError, match=r"nowhere.csv cannot be read"):
        composed(tmp_path / "nowhere.csv", "+experiment=evaluate")
