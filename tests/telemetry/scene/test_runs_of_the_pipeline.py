"""Runs as the pipeline leaves them: what it writes is what telemetry shows."""

from pathlib import Path

import numpy as np
import pytest

from pipeline.command_line.config import Composed
from pipeline.run import artifacts
from pipeline.stages import evaluate, train
from telemetry.scene import campaign, runs, training, viewer
from tests.pipeline.stages.cases import prepared


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> tuple[Composed, Path]:
    folder = tmp_path_factory.mktemp("run")
    run = prepared(folder)
    train.run(run.experiment, folder)
    evaluate.run(run.experiment, folder)
    return run, folder


def test_both_call_the_files_the_same() -> None:
    assert runs.CONFIG == artifacts.CONFIG
    assert runs.EVALUATION_TRAJECTORIES == artifacts.TRAJECTORIES
    assert f"evaluate/{runs.EPISODES}" == artifacts.EPISODES
    assert runs.HISTORY == artifacts.HISTORY
    assert runs.CHAMPION_TRAJECTORIES == artifacts.CHAMPION_TRAJECTORIES
    assert runs.CHAMPION == artifacts.CHAMPION


def test_an_evaluation_is_read_with_its_surroundings(run: tuple[Composed, Path]) -> None:
    composed, folder = run
    mission, evaluation = composed.experiment.mission, runs.read_evaluation(folder)
    assert evaluation.position_m.shape == (5, mission.num_controls + 1, 3)
    assert evaluation.time_s[-1] == 300.0
    around = evaluation.surroundings
    assert around.min_distance_m == mission.deputy.min_distance_m
    assert around.max_distance_m == mission.deputy.max_distance_m
    assert around.threshold_percent == mission.inspection_threshold_percent
    assert around.chief_radius_m == mission.chief.inspection_radius_m


def test_a_training_is_read_with_its_champions_flights(run: tuple[Composed, Path]) -> None:
    composed, folder = run
    read = runs.read_training(folder)
    assert len(read) == 4
    start = composed.experiment.mission.deputy.initial_position_m
    np.testing.assert_allclose(read.tracks[0][0], start, rtol=1e-6)
    assert {"delta_v_m_s", "points", "outside", "outside_m", "short"} <= set(read.columns)
    assert runs.is_finished(folder)


def test_both_are_shown(run: tuple[Composed, Path], tmp_path: Path) -> None:
    for scene in (campaign.scene(run[1]), training.scene(run[1])):
        viewer.save(scene, tmp_path / "x.rrd")
        assert (tmp_path / "x.rrd").stat().st_size > 10_000
