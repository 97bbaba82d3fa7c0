"""The trajectories of an evaluation, made by hand or by the pipeline, read back with rerun's own reader."""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fis_tools import source
from pipeline.command_line.config import Job
from pipeline.run import artifacts, manifests, writing
from pipeline.run.runner import manifest_of
from pipeline.stages import evaluate
from telemetry import RecordingError
from telemetry.scene import campaign, runs, viewer
from telemetry.scene.campaign import OUTCOME_COLOURS
from telemetry.scene.runs import CaseOutcome
from tests.pipeline.report.runs import small_controller
from tests.pipeline.stages.cases import prepared
from tests.telemetry import synthetic_run
from tests.telemetry.scene.rrd_content import Content, saved, views


@pytest.fixture
def run(tmp_path: Path) -> Path:
    return synthetic_run.write_evaluation(tmp_path / "evaluated")


@pytest.fixture(scope="module")
def content(tmp_path_factory: pytest.TempPathFactory) -> Content:
    folder = tmp_path_factory.mktemp("campaign")
    return saved(campaign.scene(synthetic_run.write_evaluation(folder / "evaluated")), folder)


def test_cases_are_read_with_their_outcomes(run: Path) -> None:
    evaluation = runs.read_evaluation(run)
    assert evaluation.name == "evaluated"
    assert evaluation.case.tolist() == [3, 5, 8, 13]
    np.testing.assert_array_equal(evaluation.position_m, synthetic_run.positions())
    assert evaluation.outcome is not None
    # 99 and 95 of 99 points are at least 95 %; 96 were inspected outside the limits, which counts more
    kinds = CaseOutcome
    assert evaluation.outcome.tolist() == [kinds.SUCCESS, kinds.SUCCESS, kinds.OUTSIDE, kinds.SHORT]
    assert evaluation.time_s.tolist() == [0.0, 20.0, 40.0, 60.0, 80.0, 100.0, 120.0]
    assert evaluation.distance_m[:, 3].tolist() == [50.0, 60.0, 10.0, 80.0]


def test_samples_of_an_unknown_period_are_counted(run: Path) -> None:
    evaluation = runs.read_evaluation(run)
    unknown = replace(evaluation, surroundings=replace(evaluation.surroundings, sample_period_s=None))
    assert unknown.time_s.tolist() == [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0]


def test_the_telling_cases_are_named(run: Path) -> None:
    assert {extreme.label: extreme.sample for extreme in campaign.extremes(runs.read_evaluation(run))} == {
        "nearest: case 8, 10.0 m": 3,
        "farthest: case 13, 120.0 m": 5,
        "most delta-v: case 5, 4.000 m/s": 6,
        "least inspected: case 13, 70 points": 6,
    }


def test_words_count_the_outcomes(run: Path) -> None:
    text = campaign.in_words(runs.read_evaluation(run))
    for row in (
        "| cases | 4 |",
        "| green: success, 95 % inspected | 2 (50.0 %) |",
        "| orange: short of 95 % | 1 (25.0 %) |",
        "| red: outside 15 to 200 m | 1 (25.0 %) |",
        # of 1, 2, 3, 4 the standard deviation is the square root of 5/3
        "| delta-v | 2.500 ± 1.291 m/s, 1.000 to 4.000 |",
        "| least inspected | case 13, 70 points |",
    ):
        assert row in text.splitlines()


def test_all_paths_are_there_in_the_colour_of_their_outcome(content: Content) -> None:
    positions = synthetic_run.positions()
    for kind, rows in ((CaseOutcome.SUCCESS, [0, 1]), (CaseOutcome.SHORT, [3]), (CaseOutcome.OUTSIDE, [2])):
        entity = f"/scene/paths/{kind.name.lower()}"
        np.testing.assert_array_equal(content.column(entity, "LineStrips3D:strips")[0], positions[rows])
        (colour,) = content.column(entity, "LineStrips3D:colors")[0]
        assert colour >> 8 == int.from_bytes(bytes(OUTCOME_COLOURS[kind]), "big")


def test_deputies_fly_together(content: Content) -> None:
    assert sorted(kind for kind, _ in views(*content.paths)) == ["3D", "TextDocument", "TimeSeries"]
    entity = "/scene/deputies"
    assert content.times(entity, "Points3D:positions").tolist() == [20.0 * k for k in range(7)]
    flown = content.numbers(entity, "Points3D:positions")
    np.testing.assert_array_equal(flown.transpose(1, 0, 2), synthetic_run.positions())
    assert len(set(content.column(entity, "Points3D:colors")[0])) == 3


def test_named_cases_are_drawn_with_their_labels(content: Content) -> None:
    assert content.column("/scene/named/nearest/label", "Points3D:labels") == [["nearest: case 8, 10.0 m"]]
    assert content.column("/scene/named/nearest/label", "Points3D:positions") == [[[0.0, 0.0, 10.0]]]
    (strip,) = content.column("/scene/named/most_delta_v", "LineStrips3D:strips")[0]
    np.testing.assert_array_equal(strip, synthetic_run.positions()[1])


def test_the_distances_are_those_of_the_cases(content: Content) -> None:
    spread = content.numbers("/curves/distance/spread", "Scalars:scalars")
    assert spread[3].tolist() == [80.0, 55.0, 10.0]
    assert spread[5].tolist() == [120.0, 55.0, 40.0]
    assert content.column("/curves/distance/limit_15", "Scalars:scalars") == [[15.0], [15.0]]


def test_a_table_alone_is_shown_in_one_colour(run: Path, tmp_path: Path) -> None:
    table = tmp_path / "elsewhere" / "some" / "trajectories.parquet"
    table.parent.mkdir(parents=True)
    (run / "evaluate/trajectories.parquet").rename(table)
    evaluation = runs.read_evaluation(table)
    assert evaluation.outcome is None
    assert {extreme.what for extreme in campaign.extremes(evaluation)} == {"nearest", "farthest"}
    assert "outcome | unknown" in campaign.in_words(evaluation)
    content = saved(campaign.scene(table), tmp_path)
    assert len(content.column("/scene/paths/all", "LineStrips3D:strips")[0]) == 4
    assert "/scene/limits/nearest" not in content.batches


def test_what_is_no_evaluation_is_refused(run: Path, tmp_path: Path, short_file: Path) -> None:
    missing = "trajectories.parquet does not exist; give the folder of a run"
    with pytest.raises(RecordingError, match=missing):
        campaign.scene(tmp_path)
    with pytest.raises(RecordingError, match=r"to look at a flight: python -m telemetry replay "):
        campaign.scene(short_file)
    table = run / "evaluate/trajectories.parquet"
    table.write_bytes(table.read_bytes()[:-20])
    with pytest.raises(RecordingError, match=r"trajectories.parquet cannot be read.* repeat the stage"):
        campaign.scene(run)
    table.unlink()
    with pytest.raises(
        RecordingError, match=r"does not exist: campaigns of more cases than engine.part_cases"
    ):
        campaign.scene(run)


def test_episodes_of_other_cases_are_refused(run: Path) -> None:
    numbers = {name: [1.0] for name in ("delta_v_m_s", "inspected_count", "inspection_rate_percent")}
    columns = {"case": [3], **numbers, "success": [True], "violated": [False]}
    synthetic_run.write_table(run / "evaluate/episodes.parquet", columns)
    with pytest.raises(RecordingError, match="holds other cases than the trajectories"):
        campaign.scene(run)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Job, Path]:
    folder = tmp_path_factory.mktemp("run")
    run = prepared(folder)
    small_controller(folder).rename(folder / artifacts.CHAMPION)
    evaluate.run(run.experiment, folder)
    return run, folder


def test_both_call_the_files_the_same() -> None:
    assert {role: manifests.ROLES[role] for role in runs.FILES} == runs.FILES
    assert (runs.MANIFEST, source.MANIFEST) == (artifacts.MANIFEST,) * 2
    assert manifests.ROLES["champion"] == source.CHAMPION


def test_files_and_scene_are_what_the_manifest_says(made: tuple[Job, Path], tmp_path: Path) -> None:
    composed, folder = made
    moved = shutil.copytree(folder, tmp_path / "moved")
    (moved / artifacts.CONFIG).unlink(missing_ok=True)
    named = {
        "evaluation_trajectories": "evaluate/paths.parquet",
        "evaluation_episodes": "evaluate/ends.parquet",
        "champion": "best.json",
    }
    for role, name in named.items():
        (moved / manifests.ROLES[role]).rename(moved / name)
    mission = replace(composed.experiment.mission, control_period_s=20.0)
    manifests.write(moved, manifest_of(replace(composed.experiment, mission=mission), composed.config, {}))
    manifest = artifacts.read_json(moved, artifacts.MANIFEST)
    assert manifest["files"].items() >= manifests.ROLES.items()
    manifest["files"] |= named
    writing.write_json(moved / artifacts.MANIFEST, manifest)
    evaluation = runs.read_evaluation(moved)
    assert evaluation.surroundings.sample_period_s == 20.0
    assert evaluation.surroundings.chief_radius_m == composed.experiment.mission.chief.inspection_radius_m
    assert set(evaluation.episodes) == set(runs.read_evaluation(folder).episodes)
    assert source.read_controller(moved).systems == source.read_controller(folder).systems


def test_an_evaluation_is_read_with_its_surroundings(made: tuple[Job, Path], tmp_path: Path) -> None:
    composed, folder = made
    mission, evaluation = composed.experiment.mission, runs.read_evaluation(folder)
    assert evaluation.position_m.shape == (5, mission.num_controls + 1, 3)
    assert evaluation.time_s[-1] == 300.0
    around, deputy = evaluation.surroundings, mission.deputy
    assert (around.min_distance_m, around.max_distance_m) == (deputy.min_distance_m, deputy.max_distance_m)
    assert around.threshold_percent == mission.inspection_threshold_percent
    assert around.chief_radius_m == mission.chief.inspection_radius_m
    viewer.save(campaign.scene(folder), tmp_path / "x.rrd")
    assert (tmp_path / "x.rrd").stat().st_size > 10_000
