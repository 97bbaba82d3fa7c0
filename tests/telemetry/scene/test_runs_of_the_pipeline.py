"""Runs as the pipeline leaves them: what it writes is what telemetry shows."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from fis_tools import source
from pipeline.command_line.config import Job
from pipeline.run import artifacts, manifests, writing
from pipeline.run.runner import scene_of
from pipeline.stages import evaluate, train
from telemetry.scene import campaign, runs, viewer
from tests.pipeline.stages.cases import prepared


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> tuple[Job, Path]:
    folder = tmp_path_factory.mktemp("run")
    run = prepared(folder)
    train.run(run.experiment, folder)
    evaluate.run(run.experiment, folder)
    return run, folder


def test_both_call_the_files_the_same() -> None:
    assert {role: manifests.ROLES[role] for role in runs.FILES} == runs.FILES
    assert (runs.MANIFEST, source.MANIFEST) == (artifacts.MANIFEST,) * 2
    assert manifests.ROLES["champion"] == source.CHAMPION


def test_files_and_scene_are_what_the_manifest_says(run: tuple[Job, Path], tmp_path: Path) -> None:
    composed, folder = run
    moved = shutil.copytree(folder, tmp_path / "moved")
    (moved / artifacts.CONFIG).unlink(missing_ok=True)
    named = {
        "evaluation_trajectories": "evaluate/paths.parquet",
        "evaluation_episodes": "evaluate/ends.parquet",
        "champion": "best.json",
    }
    for role, name in named.items():
        (moved / manifests.ROLES[role]).rename(moved / name)
    scene = scene_of(replace(composed.experiment.mission, control_period_s=20.0))
    manifests.write(moved, composed.config, [], scene=scene)
    told = json.loads((moved / artifacts.MANIFEST).read_text())
    assert told["files"].items() >= manifests.ROLES.items()
    told["files"] |= named
    writing.write_json(moved / artifacts.MANIFEST, told)
    evaluation = runs.read_evaluation(moved)
    assert evaluation.surroundings.sample_period_s == 20.0
    assert evaluation.surroundings.chief_radius_m == composed.experiment.mission.chief.inspection_radius_m
    assert set(evaluation.episodes) == set(runs.read_evaluation(folder).episodes)
    assert source.read_controller(moved).systems == source.read_controller(folder).systems


def test_an_evaluation_is_read_with_its_surroundings_and_shown(run: tuple[Job, Path], tmp_path: Path) -> None:
    composed, folder = run
    mission, evaluation = composed.experiment.mission, runs.read_evaluation(folder)
    assert evaluation.position_m.shape == (5, mission.num_controls + 1, 3)
    assert evaluation.time_s[-1] == 300.0
    around = evaluation.surroundings
    assert around.min_distance_m == mission.deputy.min_distance_m
    assert around.max_distance_m == mission.deputy.max_distance_m
    assert around.threshold_percent == mission.inspection_threshold_percent
    assert around.chief_radius_m == mission.chief.inspection_radius_m
    viewer.save(campaign.scene(folder), tmp_path / "x.rrd")
    assert (tmp_path / "x.rrd").stat().st_size > 10_000
