"""Controllers and functions judged on held-out starts, against the environment and an evaluation."""

import json

import numpy as np
import pytest

from pipeline.command_line.cli import main as pipeline
from pipeline.command_line.config import compose_experiment
from pipeline.gym import InspectionVectorEnv, judge
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
    with pytest.raises(ValueError, match="shape"):
        judge.judge(lambda seen: np.zeros(3), num_cases=1)
