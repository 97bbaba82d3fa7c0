"""Controllers and functions judged on held-out starts, against the environment and an evaluation."""

import json

import numpy as np
import pytest

from pipeline.command_line.cli import main as pipeline
from pipeline.command_line.config import compose_experiment
from pipeline.evaluation.monte_carlo import SUCCESS
from pipeline.flight.control.controller import ControllerError
from pipeline.gym import InspectionVectorEnv, judge
from pipeline.gym.parallel import MultiInspectionEnv, parallel_env
from pipeline.gym.suite import FLEETS, NUM_DEPUTIES, REWARDS
from pipeline.run import artifacts, tables
from pipeline.scenarios import EVALUATION, evaluation_scenarios

pytestmark = pytest.mark.slow


def act(seen):
    """Fly slowly to 60 m above the chief, and stay."""
    wanted = np.array([60.0, 0.0, 0.0], dtype=np.float32)
    return np.clip(1e-3 * (wanted - seen[:, :3]) - 0.05 * seen[:, 3:6], -1.0, 1.0)


def test_a_function_flies_what_it_flies_in_the_environment() -> None:
    result = judge.judge(act, num_cases=5, workers=1)
    words = [*judge.TASKS["paper"], f"seed={result['seed']}", "monte_carlo.num_cases=5"]
    starts = evaluation_scenarios(compose_experiment(["+experiment=evaluate", *words]).experiment)
    many = InspectionVectorEnv(5, judge.TASKS["paper"])
    many.reset(seed=1)
    episodes = many._episodes
    for flight, start in enumerate(starts):
        episodes.start(flight, start)
    episodes.begin()
    has_ended, spent = np.zeros(5, dtype=bool), np.zeros(5)
    while not has_ended.all():
        _, terminated, truncated = episodes.step(act(episodes.flights.seen))
        spent = np.where(has_ended, spent, episodes.facts["delta_v_m_s"])
        has_ended |= truncated
        assert not terminated.any()
    assert result["figures"]["delta_v_m_s"]["mean"] == pytest.approx(spent.mean(), rel=1e-6)
    assert result["controller"]["name"] == "act"
    # starts of environments have another place in the spawn key
    assert {start.noise[1] for start in starts} == {EVALUATION}


@pytest.mark.parametrize("task", FLEETS)
def test_a_function_flies_each_deputy_as_it_does_in_the_environment(task, monkeypatch) -> None:
    """The same forces, to the last bit, until the environment's episode ends."""
    monkeypatch.setattr(judge, "BESIDE", 2)
    words = [*judge.TASKS[task], f"seed={judge.seed_of(task)}", "monte_carlo.num_cases=3"]
    composed = compose_experiment(["+experiment=evaluate", "controller=coast", *words])
    mission, starts = composed.experiment.mission.of_each, evaluation_scenarios(composed.experiment)
    env = MultiInspectionEnv(FLEETS[task], NUM_DEPUTIES, collision_m=0.0)
    pilot = judge.ActingPilot(act, judge.Task(composed.experiment, composed.config, judge.Reward(), None))
    forces = pilot.together(mission, [start.fleet for start in starts], 1)
    lengths = list[int]()
    for start, fired in zip(starts, forces, strict=True):
        assert {deputy.noise[1] for deputy in start.fleet} == {EVALUATION}
        # parked: a closed ellipse of Clohessy and Wiltshire's equations
        along = [-2.0 * mission.orbit.mean_motion_rad_s * deputy.position_m[0] for deputy in start.fleet]
        closed = [(0.0, speed, 0.0) for speed in along]
        is_parked = np.allclose([deputy.velocity_m_s for deputy in start.fleet], closed, atol=1e-12)
        assert is_parked == (task == "fleet_parked")
        seen, _ = env.reset(options={"scenarios": start.fleet})
        k = 0
        while env.agents:
            actions = {agent: act(seen[agent][np.newaxis])[0] for agent in env.agents}
            given = np.array([actions[agent] for agent in env.agents], dtype=np.float64)
            np.testing.assert_array_equal(fired[:, k], given * mission.deputy.max_force_n)
            seen, *_ = env.step(actions)
            k += 1
        lengths.append(k)
    assert max(lengths) > 50


@pytest.mark.parametrize("task", FLEETS)
def test_fleets_are_judged_as_an_evaluation_has_them(task, tmp_path, capsys) -> None:
    result = judge.judge("champion_27", task, num_cases=12)
    words = [*judge.TASKS[task], f"seed={result['seed']}", "monte_carlo.num_cases=12"]
    words += ["stages=[scenario,evaluate]", f"hydra.run.dir={tmp_path}"]
    assert pipeline(["+experiment=evaluate", "controller=champion_27", *words]) == 0
    summary = json.loads((tmp_path / artifacts.SUMMARY).read_text())
    columns = tables.read_parquet(tmp_path, artifacts.EPISODES)
    is_near = columns["nearest_pair_m"] < parallel_env(task).collision_m
    figures = dict(result["figures"])
    apart, collided = figures.pop(judge.APART), figures.pop(judge.COLLIDED)
    assert collided["count"] == is_near.sum()
    assert apart["count"] == (columns["success"] & ~columns["violated"] & ~is_near).sum()
    assert {"delta_v_m_s", "nearest_pair_m", SUCCESS, "violated"} < figures.keys()
    for name, measure in figures.items():
        assert measure == summary[name], name
    assert result["regret"] == {"not_compared": "the plans are of one deputy"}
    assert "within 10 m of another (%)" in judge.table([result])
    capsys.readouterr()


@pytest.mark.parametrize("task", FLEETS)
def test_the_environment_of_fleets_draws_no_start_that_is_held_out(task) -> None:
    """It draws from another place in the spawn key, of the same world, and pays as the suite says."""
    env, seed = parallel_env(task), judge.seed_of(task)
    drawn = [env.task.draw(np.random.default_rng(number)) for number in (seed, 1)]
    assert all(start.noise[1] != EVALUATION for start in drawn)
    assert env.task.reward == REWARDS.get(task, judge.Reward())
    judged = compose_experiment(["+experiment=evaluate", "controller=coast", *judge.TASKS[task]]).experiment
    assert judged.mission.of_each == env.task.mission
    assert judged.sun == env.task.experiment.sun
    assert judged.monte_carlo == env.task.experiment.monte_carlo
    assert len(env.possible_agents) == judged.mission.fleet.deputies


def test_a_controller_is_judged_as_an_evaluation_has_it(tmp_path, capsys) -> None:
    file = tmp_path / "judged.json"
    assert judge.main(["lqr", "--task", "paper", "--task", "leo", "--cases", "20", "-o", str(file)]) == 0
    printed = capsys.readouterr().out
    results = json.loads(file.read_text())
    assert [result["task"] for result in results] == ["paper", "leo"]
    for result in results:
        words = [*judge.TASKS[result["task"]], f"seed={result['seed']}", "monte_carlo.num_cases=20"]
        words += ["stages=[scenario,evaluate]", f"hydra.run.dir={tmp_path / result['task']}"]
        assert pipeline(["+experiment=evaluate", "controller=lqr", *words]) == 0
        summary = json.loads((tmp_path / result["task"] / artifacts.SUMMARY).read_text())
        for name, measure in result["figures"].items():
            assert measure == summary[name], name
        assert f"{summary['delta_v_m_s']['mean']:.3f} (" in printed
    paper, leo = (result["regret"] for result in results)
    assert paper["num_cases"] == 50
    assert paper["regret_m_s"]["low"] < paper["regret_m_s"]["mean"] < paper["regret_m_s"]["high"]
    assert leo["not_compared"]
    # the same plans stand beside every evaluation
    columns = tables.read_parquet(tmp_path / "paper", artifacts.BESIDE_OPTIMUM)
    beyond = np.subtract(columns["delta_v_m_s"], columns["optimum_as_seen_delta_v_m_s"])
    assert paper["regret_m_s"]["mean"] == pytest.approx(beyond.mean(), rel=1e-12)


def test_of_fuel_that_is_chosen_ahead_it_is_told_what_rules_fire(tmp_path, capsys) -> None:
    result = judge.judge("champion_27_one_push", num_cases=4)
    words = [*judge.TASKS["paper"], f"seed={result['seed']}", "monte_carlo.num_cases=4"]
    words += ["stages=[scenario,evaluate]", f"hydra.run.dir={tmp_path}"]
    assert pipeline(["+experiment=evaluate", "controller=champion_27_one_push", *words]) == 0
    columns = tables.read_parquet(tmp_path, artifacts.EPISODES)
    by_rules = 1.0 - np.sum(columns["ahead_delta_v_m_s"]) / np.sum(columns["delta_v_m_s"])
    assert 0.0 < by_rules < 1.0
    assert result["fuel_by_rules_percent"] == pytest.approx(100.0 * by_rules)
    assert f"{100.0 * by_rules:.1f}" in judge.table([result]).splitlines()[-1]
    capsys.readouterr()


@pytest.mark.parametrize("task", judge.TASKS)
def test_each_task_is_flown(task) -> None:
    result = judge.judge("coast", task, num_cases=2)
    assert result["figures"]["delta_v_m_s"]["mean"] == 0.0
    assert result["overrides"] == list(judge.TASKS[task])


def test_what_cannot_be_judged_is_refused(capsys) -> None:
    with pytest.raises(ValueError, match="there is no task 'mars'; there are paper, parked"):
        judge.judge("coast", "mars")
    with pytest.raises(SystemExit, match="2"):
        judge.main(["no_such_controller", "--cases", "1"])
    assert "there is no controller no_such_controller" in capsys.readouterr().err
    with pytest.raises(SystemExit, match="2"):
        judge.main(["coast", "--cases", "1", "-o", "nowhere/judged.json"])
    refusal = capsys.readouterr()
    assert "nowhere/judged.json cannot be written; -o takes a file in a folder that there is" in refusal.err
    assert "paper: coast" not in refusal.err  # before anything is flown
    with pytest.raises(SystemExit, match="2"):
        judge.main(["coast", "--cases", "1", "-o", "/dev/full"])
    assert "/dev/full cannot be written: " in capsys.readouterr().err
    with pytest.raises(ControllerError, match=r"'fleet' is of 2 deputies; .* plans for one .*such as paper"):
        judge.judge("lqr", "fleet", num_cases=1)
    with pytest.raises(ValueError, match="'paper' is no task of fleets; those are fleet, "):
        parallel_env("paper")
    with pytest.raises(ValueError, match="shape"):
        judge.judge(lambda seen: np.zeros(3), num_cases=1)
