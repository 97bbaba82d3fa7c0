"""Tries of a claim share its risk, whoever tries how often, and how many cases at a time."""

import json

import numpy as np
import pytest

from pipeline.evaluation.assurance import repeats
from pipeline.evaluation.assurance.judgements import judge
from pipeline.evaluation.assurance.repeats import Try, tried
from pipeline.evaluation.assurance.requirements import Requirement
from pipeline.evaluation.sequential import Stop, share_interval
from pipeline.run import artifacts, sweep
from tests import night

CLAIM = Requirement("R1", "", "", "", "", "", "", ("cases",), "x > 1", None, 0.95, 0.95)
SHARE, CONFIDENCE = CLAIM.probability, CLAIM.confidence
#: of tries, and how many of them may show what is not so: four standard deviations above a risk of 5 %
NUM_HISTORIES = night.count(250, 1000)
MOST_WRONG = NUM_HISTORIES * 0.05 + 4 * np.sqrt(NUM_HISTORIES * 0.05 * 0.95)


def attempt(entry_of_seed, num_cases, seed, tries):
    """Judge the first cases of a seed, and enter the try."""
    is_met = entry_of_seed[seed][:num_cases]
    judged = judge(is_met - 0.5, is_met, SHARE, CONFIDENCE, tried=tried(CLAIM, (seed, num_cases), tries))
    tries.append(Try("x", seed, num_cases, {}, {"x>1": judged.verdict}))
    return judged


@pytest.mark.parametrize("plan", [[(1, 60), (2, 60)], [(1, 93), (1, 300), (2, 93), (2, 500)]])
def test_trying_until_it_is_shown_keeps_the_confidence(plan):
    """At a share just below the claimed one, in many histories of many tries."""
    rng = np.random.default_rng(1)
    num_shown = 0
    for _ in range(NUM_HISTORIES):
        cases = {seed: rng.random(500) < SHARE - 1e-9 for seed in range(1, 12)}
        tries = []
        for turn in range(5):
            shown = [
                attempt(cases, num_cases, seed + 2 * turn, tries).verdict == "shown"
                for seed, num_cases in plan
            ]
            if any(shown):
                num_shown += 1
                break
    assert num_shown <= MOST_WRONG
    # one test after the other without a memory is wrong more often
    alone = [any(judge(met - 0.5, met, SHARE, CONFIDENCE).verdict == "shown" for met in
                 rng.random((10, 93)) < SHARE) for _ in range(NUM_HISTORIES)]  # fmt: skip
    assert np.mean(alone) > 0.2


def watched(entry_of_seed, width, seed, tries):
    """Judge the cases of a seed until the interval is narrow, and enter the try."""
    whole, flights = entry_of_seed[seed], repeats.flights_of(seed, 0, is_sequential=True)
    stop = Stop("met", width, 100.0 * (1.0 - tried(CLAIM, flights, tries).risk))
    is_met = whole[: stop.take(0, {"met": whole})]
    before = tried(CLAIM, flights, tries, len(is_met))
    judged = judge(is_met - 0.5, is_met, SHARE, CONFIDENCE, tried=before, is_sequential=True)
    tries.append(Try("x", seed, len(is_met), {}, {"x>1": judged.verdict}, is_sequential=True))
    return judged


def test_stopping_at_a_width_and_going_on_until_it_is_shown_keeps_the_confidence():
    """At a share just below the claimed one: three widths of three seeds, and a fixed number after them."""
    rng = np.random.default_rng(2)
    num_shown = 0
    for _ in range(NUM_HISTORIES):
        cases = {seed: rng.random(6000) < SHARE - 1e-9 for seed in range(3)}
        tries = []
        verdicts = [
            watched(cases, width, seed, tries).verdict for seed in cases for width in (0.06, 0.04, 0.03)
        ]
        verdicts.append(attempt({3: rng.random(500) < SHARE - 1e-9}, 500, 3, tries).verdict)
        num_shown += "shown" in verdicts
    assert num_shown <= MOST_WRONG


def test_more_flights_of_a_seed_are_the_same_try_where_a_width_ends_them():
    cases = {seed: np.random.default_rng(seed).random(9000) < 0.99 for seed in (1, 2)}
    tries = []
    first, second = (watched(cases, width, 1, tries) for width in (0.05, 0.02))
    assert second.num_cases > first.num_cases
    assert (second.num_tries, second.num_known, second.verdict) == (0, 0, "shown")
    assert first.confidence == second.confidence == pytest.approx(0.975)
    third = watched(cases, 0.05, 2, tries)
    assert (third.num_tries, third.confidence) == (1, pytest.approx(1.0 - 0.0125))
    # a fixed number of them counts those alone that were not flown
    assert tried(CLAIM, (1, 9000), tries).num_known == second.num_cases
    low, high = share_interval(second.num_cases - second.num_failed, second.num_cases, 97.5)
    assert (second.low, second.high) == (low, high)


def test_the_first_try_has_the_whole_risk_and_too_few_cases_spend_none():
    cases = {1: np.ones(500, bool), 2: np.ones(500, bool)}
    tries = []
    assert attempt(cases, 58, 1, tries).verdict == "not shown"
    assert tried(CLAIM, (2, 59), tries).risk == pytest.approx(0.05)
    again = attempt(cases, 59, 2, tries)
    assert (again.verdict, again.num_cases, again.num_tries) == ("shown", 59, 1)
    # 0.95 ** 59 of 0.05 is spent, and half of what is left may be
    assert tried(CLAIM, (3, 59), tries).risk == pytest.approx((0.05 - 0.95**59) / 2)
    # the same flights again are the same try
    assert attempt(cases, 59, 2, tries) == again


def test_cases_that_were_flown_do_not_count_again():
    cases = {1: np.r_[np.ones(66, bool), np.zeros(49, bool), np.ones(285, bool)]}
    tries = []
    assert attempt(cases, 400, 1, tries).verdict == "refuted"
    second = attempt(cases, 66, 1, tries)
    assert (second.verdict, second.num_cases, second.num_known) == ("refuted", 0, 66)


def entry(formula="x > 1", **conditions):
    claims = [{"id": "R1", "formula": formula, "verdict": "refuted", "by_cases": "refuted"}]
    conditions = {"seed": 1, "num_cases": 9, "sun": "fixed"} | conditions
    return {"controller": {"name": "a", "sha256": "0"}, "conditions": conditions, "claims": claims}


def test_tries_count_wherever_they_stand_below_the_folder_of_the_runs(tmp_path, monkeypatch):
    names = ["outputs/a/1", "outputs/b/c/2", "s/x/3", "w/4/5", "s/x/.hidden"]
    for name in names:
        path = tmp_path / name / artifacts.LEDGER
        path.parent.mkdir(parents=True)
        path.write_text(json.dumps(entry()) + "\n" + json.dumps(entry(sun="random")) + "\n")
    (tmp_path / "s" / sweep.SWEEP).write_text("{}")
    monkeypatch.chdir(tmp_path / "w")
    holds_runs = repeats._holds_runs  # of what others left around the folder of this test nothing counts
    monkeypatch.setattr(repeats, "_holds_runs", lambda it: it.is_relative_to(tmp_path) and holds_runs(it))
    subject = {name: entry()[name] for name in ("controller", "conditions")}
    for run, expected in (
        ("outputs/d/6", ["a/1", "b/c/2"]), ("s/7/8", ["x/3"]), ("w/9", ["4/5"]),
        ("outputs/a/1", ["this run", "b/c/2"]),
    ):  # fmt: skip
        tries = repeats.earlier_tries(tmp_path / run, subject)
        assert sorted(each.folder for each in tries) == sorted(expected)
    assert tried(CLAIM, (2, 59), tries).refuted_by.endswith("(seed 1, 9 cases)")
    other = Requirement("R1", "", "", "", "", "", "", ("cases",), "x > 2", None, 0.95, 0.95)
    assert tried(other, (2, 59), tries).num_tries == 0
