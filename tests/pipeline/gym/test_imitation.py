"""Learners of the leaderboard that imitate plans: what is taught, and what is written of it."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks import apprentice, leaderboard
from benchmarks.contenders import told_of
from benchmarks.teacher import Teacher
from fis_tools.formats import serialize
from pipeline.controllers.learned import answer
from pipeline.controllers.source import named
from pipeline.flight.control.controller import open_loop
from pipeline.flight.fly.simulation import fly_all
from pipeline.gym import task_of
from pipeline.gym.suite import FLEETS

pytestmark = pytest.mark.slow

WORDS = ("sun=random",)
#: little, and quickly
TINY = replace(apprentice.NETWORK, rounds=2, epochs=3, layers=(8,))


def starts_of(count):
    task = task_of([*apprentice.NETWORK.words, *WORDS], decision_period_s=60.0)
    generator = np.random.default_rng(4)
    return task, [task.draw(generator) for _ in range(count)]


def test_plans_fly_from_where_a_learner_has_come_to() -> None:
    """Up to the switch its forces are kept; from there a few pushes at decisions see what is left."""
    task, starts = starts_of(12)
    mission, period = task.mission, task.num_periods
    teacher = Teacher(mission, period, slack_m_s=0.01, margin_m=4.1)
    flown = np.zeros((12, mission.num_controls, 3))
    flown[:, 0] = 0.02
    switches = np.array([0, 60, 120] * 4)
    forces = teacher.finish(starts, flown, switches, 1, heeds=False)
    num_inspected = []
    for start, fired, switch in zip(starts, forces, switches, strict=True):
        np.testing.assert_array_equal(fired[:switch], flown[0, :switch])
        at = switch + np.flatnonzero(fired[switch:].any(axis=1))
        assert len(at) <= 2
        assert not (at % period).any()
        planned = fly_all(mission, open_loop("planned", fired), [start])
        coasting = np.where(np.arange(mission.num_controls)[:, np.newaxis] < switch, fired, 0.0)
        coasted = fly_all(mission, open_loop("coasting", coasting), [start])
        num_inspected.append((planned.inspected_count[0], coasted.inspected_count[0]))
    planned, coasted = np.array(num_inspected).T
    assert planned[switches == 0].min() >= 95
    assert planned.mean() > coasted.mean() + 10


def test_of_plans_that_cost_alike_the_one_nearest_to_the_learners_is_taught() -> None:
    task, starts = starts_of(6)
    generous = Teacher(task.mission, task.num_periods, slack_m_s=10.0, margin_m=4.1)
    strict = replace(generous, slack_m_s=0.0)
    flown, switches = np.zeros((6, task.mission.num_controls, 3)), np.zeros(6, dtype=np.int64)
    cheapest = generous.finish(starts, flown, switches, 1, heeds=False)[:, 0]
    np.testing.assert_array_equal(strict.finish(starts, flown, switches, 1, heeds=True)[:, 0], cheapest)
    heeding = generous.finish(starts, flown, switches, 1, heeds=True)[:, 0]
    assert np.abs(heeding).sum() < np.abs(cheapest).sum()  # the learner fires nothing


@pytest.mark.parametrize("kind", apprentice.KINDS)
def test_a_training_keeps_its_budget_and_writes_what_flies(kind, tmp_path) -> None:
    budget = 10_000
    path = apprentice.KINDS[kind][0](tmp_path, TINY, seed=3, budget=budget, words=WORDS).run()
    facts, (task, starts) = told_of(path), starts_of(4)
    assert facts["done"] == facts["flights"] * task.mission.num_controls
    assert 0 < facts["done"] <= budget
    assert facts["processor_s"] > 0.0
    flown = fly_all(task.mission, named(str(path), task.mission), starts)
    assert np.isfinite(flown.delta_v_m_s).all()
    if kind == "rules":
        systems = serialize.load(path).systems
        assert {len(system.inputs) for system in systems} <= {1, 2}
        assert 3 <= sum(len(system.rules) for system in systems) <= 27
    else:
        written = sorted(each.name for each in tmp_path.glob("*.onnx"))
        assert written == [f"{facts['done'] // 2}.onnx", "policy.onnx"]


def test_what_a_network_is_written_as_answers_as_scikit_learn_predicts(tmp_path) -> None:
    """Scales are in its layers; what it predicts beyond silence, up to the greatest force, is fired, in N."""
    rng = np.random.default_rng(1)
    rows, answers = rng.normal(3.0, 20.0, (40, 19)), rng.choice([0.0, 0.5, -1.0], (40, 3))
    silent = 0.1
    training = apprentice.NetworkTraining(tmp_path, replace(TINY, epochs=300, silent=silent), words=WORDS)
    path = training.learn(rows, answers, 1, "policy")
    loud = answers + silent * np.sign(answers)
    shares = training._network.predict((rows - rows.mean(axis=0)) / rows.std(axis=0)) * loud.std(axis=0)
    shares = np.clip(shares, -1.0, 1.0)
    expected = np.sign(shares) * np.maximum(np.abs(shares) - silent, 0.0)
    network, forces = named(str(path), training.task.mission).pilot.network, np.empty((40, 3))
    answer(network, rows, np.zeros((2, network.widths.max())), forces)
    np.testing.assert_allclose(forces / training.task.mission.deputy.max_force_n, expected, atol=1e-4)
    assert (forces == 0.0).any()
    assert np.corrcoef(expected.ravel(), answers.ravel())[0, 1] > 0.5


def test_what_cannot_be_trained_is_refused(tmp_path, capsys) -> None:
    with pytest.raises(ValueError, match="a budget of 100 control periods is less than 2 flights of 360"):
        apprentice.NetworkTraining(tmp_path, TINY, budget=100, words=WORDS).run()
    for task in FLEETS:
        with pytest.raises(SystemExit):
            leaderboard.main(["--task", task, "-l", "cma_es", "--folder", str(tmp_path)])
        assert f"task {task} is of fleets, and these learners train one deputy" in capsys.readouterr().err
