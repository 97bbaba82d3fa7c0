"""Trials: what is proposed, the race, and a search that goes on as if it had not been stopped."""

import json

import numpy as np
import pytest
from scipy.stats import binomtest

from pipeline.evaluation.monte_carlo import episode_columns, summarise
from pipeline.evaluation.trials import trials
from pipeline.flight.state.log import Outcomes, Scenario
from pipeline.settings.checks import SettingError
from pipeline.settings.experiment import HparamsSearch
from pipeline.settings.training import dimensions
from tests.pipeline.flight.cases import mission

SPACE = {
    "optimizer": {"initial_step": {"low": 0.001, "high": 1.0, "log": True}, "rounds": {"low": 1, "high": 9}},
    "sun": {"mode": {"choices": ["fixed", "random"]}},
}


def search(**changes):
    return HparamsSearch(**({"space": SPACE, "trials": 25, "num_cases": 400, "block_cases": 20} | changes))


def cost(values):
    """A bowl around 0.1, 5 and a random Sun."""
    away = np.log10(values["optimizer.initial_step"]) + 1.0, (values["optimizer.rounds"] - 5) / 4.0
    return 1.0 + away[0] ** 2 + away[1] ** 2 + (values["sun.mode"] == "fixed")


def judge(values):
    """Blocks that are harder or easier alike for all trials, with a little noise of each trial's own."""
    hard = np.random.default_rng(1).normal(0.0, 1.0, 20)
    cost_of = np.random.default_rng(int(1e6 * cost(values))).normal(0.0, 0.05, 20)
    yield from (cost(values) + hard + cost_of).tolist()


def test_a_search_finds_the_bowl_and_drops_the_worse_early(tmp_path):
    tried = list(trials(tmp_path / "journal.log", search(), 1, judge))
    complete = [trial for trial in tried if trial.state == "complete"]
    best = min(complete, key=lambda trial: trial.cost)
    # of 25 random trials the best is expected at about 1.2
    assert cost(best.values) < 1.15
    assert best.values["sun.mode"] == "random"
    assert isinstance(best.values["optimizer.rounds"], int)
    assert all(len(trial.blocks) == 20 for trial in complete)
    pruned = [trial for trial in tried if trial.state == "pruned"]
    assert len(pruned) > 5
    assert all(len(trial.blocks) < 20 for trial in pruned)
    assert all(cost(trial.values) > cost(best.values) for trial in pruned)
    unpruned = trials(tmp_path / "other.log", search(trials=12, prune_below=0.0), 1, judge)
    assert {trial.state for trial in unpruned} == {"complete"}


def test_an_interrupted_search_ends_as_if_it_had_not_been(tmp_path):
    whole = list(trials(tmp_path / "whole.log", search(trials=14), 3, judge))
    flown = []

    def interrupted(values):
        for block in judge(values):
            flown.append(values)
            if len(flown) == 70:
                raise KeyboardInterrupt
            yield block

    with pytest.raises(KeyboardInterrupt):
        list(trials(tmp_path / "journal.log", search(trials=14), 3, interrupted))
    assert list(trials(tmp_path / "journal.log", search(trials=14), 3, judge)) == whole
    assert [trial.number for trial in whole] == list(range(14))


def test_settings_that_do_not_fit_fail_their_trial_alone(tmp_path):
    def refuse(values):
        if values["sun.mode"] == "fixed":
            raise SettingError("it does not fit")
        yield from judge(values)

    tried = list(trials(tmp_path / "journal.log", search(trials=12), 2, refuse))
    assert {trial.state for trial in tried if trial.values["sun.mode"] == "fixed"} == {"fail"}
    assert {bool(trial.why) for trial in tried if trial.state == "fail"} == {True}
    assert "complete" in {trial.state for trial in tried if trial.values["sun.mode"] == "random"}


def test_the_keys_of_a_space_are_told_in_their_order():
    keys = [number.key for number in dimensions(SPACE)]
    assert keys == ["optimizer.initial_step", "optimizer.rounds", "sun.mode"]


@pytest.mark.parametrize(
    "damage", [lambda text: text[:-7], lambda text: text.rpartition("{")[0], lambda _: "5"]
)
def test_a_damaged_journal_is_begun_anew_with_the_same_trials(damage, tmp_path, capsys):
    journal = tmp_path / "journal.log"
    whole = list(trials(journal, search(trials=6), 3, judge))
    journal.write_text(damage(journal.read_text()))
    assert list(trials(journal, search(trials=6), 3, judge)) == whole
    assert "the search begins anew" in capsys.readouterr().err


def test_a_trial_is_kept_once_it_has_been_taken(tmp_path):
    journal, flown = tmp_path / "journal.log", []

    def counted(values):
        flown.append(values)
        yield from judge(values)

    taking = trials(journal, search(trials=3), 3, counted)
    first = next(taking)
    taking.close()  # killed before the first was taken in
    assert not journal.exists()
    assert next(trials(journal, search(trials=3), 3, counted)) == first
    assert flown[0] == flown[1]
    assert {path.name for path in tmp_path.iterdir()} <= {"journal.log"}


def four_cases() -> dict[str, np.ndarray]:
    """94, 95, 99 and 97 points; the last one leaves the limits."""
    scenarios = [Scenario(np.array([10.0 * case, 60.0, -7.0]), np.zeros(3), 0.5 * case) for case in range(4)]
    columns = {
        "delta_v_m_s": [1.0, 2.0, 3.0, 6.0],
        "inspected_count": [94, 95, 99, 97],
        "inspectable_count": [99, 99, 99, 99],
        "mean_distance_m": [60.0, 70.0, 80.0, 90.0],
        "min_distance_m": [50.0, 60.0, 70.0, 14.0],
        "max_distance_m": [70.0, 80.0, 90.0, 100.0],
        "outside_m": [0.0, 0.0, 0.0, 1.0],
        "safety_periods": [0, 2, 0, 6],
        "safety_delta_v_m_s": [0.0, 0.01, 0.0, 0.03],
        "ahead_delta_v_m_s": [0.0, 0.0, 0.1, 0.0],
        "full_wheel_s": [0.0, 0.0, 40.0, 0.0],
    }
    episodes = Outcomes(**{name: np.array(values) for name, values in columns.items()})
    return episode_columns(mission(), scenarios, episodes)


def test_a_row_a_case() -> None:
    columns = four_cases()
    starts = np.transpose([columns[name] for name in list(columns)[:5]])
    np.testing.assert_array_equal(starts, [[k, 10.0 * k, 60.0, -7.0, 0.5 * k] for k in range(4)])
    np.testing.assert_allclose(columns["inspection_rate_percent"], [9400 / 99, 9500 / 99, 100.0, 9700 / 99])
    assert columns["success"].tolist() == [False, True, True, True]
    assert columns["violated"].tolist() == [False, False, False, True]


def test_a_summary_by_hand() -> None:
    summary = summarise(four_cases(), 90.0)
    assert json.loads(json.dumps(summary)) == summary
    assert summary["delta_v_m_s"]["mean"] == 3.0
    assert summary["delta_v_m_s"]["standard_deviation"] == pytest.approx(np.sqrt(14.0 / 3.0))
    assert summary["mean_distance_m"]["minimum"] == 60.0
    assert summary["inspection_rate_percent"]["mean"] == pytest.approx(100.0 * 385 / 396)
    shares = {name: summary[name]["count"] for name in ("success", "violated", "success_and_within_limits")}
    assert shares == {"success": 3, "violated": 1, "success_and_within_limits": 2}
    assert summary["safety_periods"]["mean"] == 2.0
    assert summary["safety_delta_v_m_s"]["mean"] == pytest.approx(0.01)
    assert summary["safety_acted"]["count"] == 2
    both, expected = summary["success_and_within_limits"], binomtest(2, 4).proportion_ci(0.9, "wilson")
    assert (both["low"], both["high"]) == pytest.approx((expected.low, expected.high))


def test_a_journal_of_another_search_space_is_not_gone_on_with(tmp_path, capsys):
    """Such as a received one, whose trials would become the best."""
    journal = tmp_path / "journal.log"
    other = {"sun": {"mode": {"choices": ["mixed", "random"]}}, "optimizer": SPACE["optimizer"]}
    list(trials(journal, search(trials=3, space=other), 3, judge))
    again = list(trials(journal, search(trials=3), 3, judge))
    assert "it is of another search space" in capsys.readouterr().err
    assert again == list(trials(tmp_path / "new.log", search(trials=3), 3, judge))
