"""What the report reads, in any order and as far as it is there."""

import re

import numpy as np
import pytest
import yaml

from pipeline.evaluation.monte_carlo import summarise
from pipeline.flight.cases.starts import training_scenarios
from pipeline.report.contents import command_of, gather, read_evaluation, tracks_of
from pipeline.run.artifacts import SUMMARY, ArtifactError, write_json
from tests.pipeline.report.runs import run_of, write_training


def test_trajectories_are_sorted_into_their_cases():
    generator = np.random.default_rng(3)
    positions = generator.normal(size=(4, 5, 3)).astype(np.float32)
    rows = {
        "case": np.repeat(np.array([7, 2, 9, 4], dtype=np.int32), 5),
        "sample": np.tile(np.arange(5, dtype=np.int32), 4),
        **{f"position_{axis}_m": positions[:, :, i].ravel() for i, axis in enumerate("xyz")},
    }
    mixed = generator.permutation(20)
    tracks = tracks_of({name: column[mixed] for name, column in rows.items()}, np.array([9, 2, 4, 7]))
    np.testing.assert_array_equal(tracks, positions[[2, 1, 3, 0]])


@pytest.mark.parametrize("kept", [slice(0, 9), slice(0, 5)])
def test_trajectories_of_other_flights_are_refused(kept):
    rows = {"case": np.repeat([0, 1], 5), "sample": np.tile(np.arange(5), 2)}
    rows |= {f"position_{axis}_m": np.zeros(10) for axis in "xyz"}
    rows = {name: column[kept] for name, column in rows.items()}
    with pytest.raises(ArtifactError, match="different flights; repeat the stage evaluate"):
        tracks_of(rows, np.array([0, 1]))


@pytest.mark.parametrize(
    ("change", "missing"),
    [
        (lambda _: {}, "num_cases"),
        (lambda _: [], "num_cases"),
        (lambda whole: whole | {"violated": {}}, "violated.count"),
        (lambda whole: whole | {"success": 0.5}, "success.count"),
        (lambda whole: whole | {"delta_v_m_s": whole["delta_v_m_s"] | {"low": "none"}}, "delta_v_m_s.low"),
    ],
)
def test_a_summary_without_its_numbers_is_refused_in_words(tmp_path, change, missing):
    episodes = {name: np.array([1.0, 2.0]) for name in ("delta_v_m_s", "inspection_rate_percent")}
    episodes |= {"mean_distance_m": np.array([70.0, 71.0])}
    episodes |= {"success": np.array([True, False]), "violated": np.array([False, False])}
    whole = {"num_cases": 2, **summarise(episodes, 95.0)}
    write_json(tmp_path / SUMMARY, whole)
    assert read_evaluation(tmp_path, 95.0).summary == whole
    write_json(tmp_path / SUMMARY, change(whole))
    with pytest.raises(ArtifactError, match=rf"no number {re.escape(missing)},.*repeat the stage evaluate"):
        read_evaluation(tmp_path, 95.0)


def test_the_command_is_the_one_that_was_typed(tmp_path):
    assert command_of(tmp_path, None) == command_of(tmp_path, {}) == ""
    words = ["+experiment=evaluate", "controller=file", "controller.path=a b.json", "hydra.run.dir=here"]
    expected = "python -m pipeline +experiment=evaluate controller=file 'controller.path=a b.json'"
    assert command_of(tmp_path, {"command": words}) == expected
    words = ["--config-dir", "/my conf", *words[:2], "controller.path='/a/b.json'"]
    expected = "python -m pipeline --config-dir '/my conf' +experiment=evaluate controller=/a/b.json"
    assert command_of(tmp_path, {"command": words}) == expected


def test_the_command_of_a_run_from_before_manifests_told_it(tmp_path):
    kept = tmp_path / ".hydra"
    kept.mkdir()
    (kept / "overrides.yaml").write_text(yaml.safe_dump(["+experiment=evaluate", "hydra.run.dir=here"]))
    assert command_of(tmp_path, {"seed": 1}) == "python -m pipeline +experiment=evaluate"
    sources = [{"path": "/ours", "provider": "main"}, {"path": "/my conf", "provider": "command-line"}]
    (kept / "hydra.yaml").write_text(yaml.safe_dump({"hydra": {"runtime": {"config_sources": sources}}}))
    assert command_of(tmp_path, None) == "python -m pipeline --config-dir '/my conf' +experiment=evaluate"


@pytest.mark.slow
def test_training_flights_start_where_the_last_round_did(tmp_path):
    write_training(tmp_path)
    overrides = ("+experiment=train", "starts=random", "starts.num_cases=3", "optimizer.rounds=2")
    experiment = run_of(tmp_path, ("scenario",), *overrides)
    told = gather(experiment, tmp_path)
    assert told.training_round == 2
    assert told.shown[0].title == "Training case 0 of round 2"
    expected = training_scenarios(experiment.starts, experiment.sun, experiment.seed, 1)
    np.testing.assert_array_equal(told.shown[0].scenario.position_m, expected[0].position_m)
    assert told.training is not None
    assert told.training.episodes is not None
    xs = [scenario.position_m[0] for scenario in expected]
    np.testing.assert_array_equal(told.training.episodes["position_x_m"], xs)
