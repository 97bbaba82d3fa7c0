"""What stages print of their results, from results made by hand: each number is computed beside it."""

from concurrent.futures import CancelledError
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats

from pipeline.command_line.config import compose_experiment
from pipeline.evaluation.statistics import Fraction
from pipeline.run import artifacts, tables
from pipeline.run.artifacts import ArtifactError
from pipeline.scenarios import evaluation_scenarios
from pipeline.stages import assure, compare, evaluate, fit, optimum
from pipeline.stages.record import FlightToRecord, _check_repeated, _in_words
from pipeline.stages.scenario import _rows_of
from pipeline.stages.train import FURTHER, _unimproved
from tests.pipeline.recording import cases


def mean(value, deviation=0.25, **others):
    return {
        "mean": value,
        "standard_deviation": deviation,
        "low": value - 0.02,
        "high": value + 0.03,
    } | others


def share(fraction, low=0.0, high=1.0):
    return {"fraction": fraction, "low": low, "high": high}


@pytest.mark.parametrize(("width", "words"), [(0.05, "stopped:"), (0.049, "not stopped within 1,234 cases:")])
def test_where_flights_stop_their_interval_is_told(width, words):
    stop = {"quantity": "delta_v_m_s", "width": width, "most_cases": 1234}
    line = evaluate._stopped_in_words({"stop": stop, "delta_v_m_s": {"low": 0.5, "high": 0.55 - 1e-12}})
    assert line.startswith(f"  {words} the interval of delta_v_m_s is 0.05 wide, and {width:g} was asked")
    assert evaluate._stopped_in_words({}) == ""


def test_flights_are_told_by_their_rate_or_their_end():
    assert evaluate._done_in_words({"inspection_rate_percent": mean(97.125)}) == "rate 97.12 ± 0.25 %"
    docked = {"end_s": mean(1234.4), "end_speed_m_s": mean(0.0456), "held": share(0.875)}
    assert (
        evaluate._done_in_words(docked)
        == "at the end after 1234 s with 0.046 m/s, never above the limit 87.5 %"
    )


def test_what_follows_and_what_fleets_do_is_in_lines():
    assert evaluate._after_in_words({}) == ""
    after = evaluate._after_in_words({"stays_orbit": share(0.125), "passively_safe": share(0.5)})
    assert after == "\n  without thrust from then on 12.5 % stay an orbit; 50.0 % are passively safe"
    words = ["+experiment=evaluate", "controller=coast", "fleet.deputies=3"]
    summary = {"nearest_pair_m": mean(40.0, minimum=12.34), "greatest_delta_v_m_s": mean(0.5)}
    fleet = evaluate._fleet_in_words(compose_experiment(words).experiment, summary)
    assert fleet.startswith("\n  3 deputies together")
    assert fleet.endswith("the most that one spends 0.500 ± 0.250 m/s; two come within 12.3 m")
    summary |= {"enough_s": mean(1800.4), "coasting_pair_m": mean(9.0, minimum=8.76)}
    fleet = evaluate._fleet_in_words(compose_experiment(words).experiment, summary)
    assert ", enough seen after 1800 s; two come within 12.3 m, 8.8 m in an orbit if" in fleet
    assert evaluate._fleet_in_words(compose_experiment(words[:2]).experiment, summary) == ""


def test_time_until_enough_is_seen_is_over_the_fleets_that_see_enough():
    experiment = compose_experiment(
        ["+experiment=evaluate", "controller=coast", "fleet.deputies=2"]
    ).experiment
    columns = {
        name: np.linspace(1.0, 2.0, 6)
        for name in ("delta_v_m_s", "inspection_rate_percent", "mean_distance_m")
    }
    columns |= {"case": np.arange(6), "success": np.ones(6, bool), "violated": np.zeros(6, bool)}
    columns |= {"min_distance_m": np.full(6, 20.0), "max_distance_m": np.full(6, 90.0)}
    columns |= {"enough_s": np.array([np.inf, 100.0, 300.0, 200.0, np.inf, 400.0])}
    columns |= {"inspectable_rate_percent": np.full(6, 99.0)}
    results = evaluate._results(experiment, columns)
    assert results["enough_s"]["mean"] == 250.0
    assert results["enough_s"]["maximum"] == 400.0
    low, high = stats.t.interval(0.95, 3, 250.0, stats.sem([100.0, 300.0, 200.0, 400.0]))
    assert (results["enough_s"]["low"], results["enough_s"]["high"]) == (
        pytest.approx(low),
        pytest.approx(high),
    )
    never = evaluate._results(experiment, columns | {"enough_s": np.full(6, np.inf)})
    assert "enough_s" not in never


@pytest.mark.parametrize(
    ("words", "is_in_parts"),
    [((), False), (("engine.part_cases=49",), True), (("engine.part_cases=50",), False)],
)
def test_more_cases_than_a_part_has_are_flown_in_parts(tmp_path, words, is_in_parts):
    few = ("+experiment=evaluate", "controller=coast", "monte_carlo.num_cases=50", *words)
    assert evaluate._is_in_parts(compose_experiment(list(few)).experiment, tmp_path) == is_in_parts


def row(case, spent, bound, *, feasible=True):
    plan = {"case": case, "delta_v_m_s": spent, "delta_v_bound_m_s": bound, "is_feasible": feasible}
    plan |= {"inspected_count": 90 + case, "points_asked": 95, "outside_m": 1.26, "restarts": 8}
    return plan | {"restarts_agreeing": 3 + case}


def test_a_solved_case_tells_its_plan_and_one_without_what_it_lacks():
    assert optimum._row_in_words(row(2, 0.12345, 0.1)) == (
        "case 2: 0.1235 m/s, found by 5 of 8 restarts, at least 0.1000 m/s"
    )
    assert optimum._row_in_words(row(2, 0.1, 0.1, feasible=False)) == (
        "case 2 has no plan: 92 of 95 points, 1.3 m outside"
    )


def test_plans_are_written_up_to_their_last_force_and_gathered_by_case(tmp_path, monkeypatch, capsys):
    experiment = compose_experiment(["+experiment=optimum", "duration_s=60"]).experiment
    made = {0: np.zeros((6, 3)), 12: np.zeros((6, 3))}
    made[0][[1, 3]], made[12][0] = (0.5, 0.0, 0.0), (0.0, -0.25, 0.125)
    monkeypatch.setattr(optimum, "case_row", lambda case, *_: row(case, 0.1 + case, 0.05))
    monkeypatch.setattr(
        optimum,
        "summarise",
        lambda rows: {
            "num_feasible": len(rows),
            "delta_v_m_s": {"mean": 6.1, "max": 12.1},
            "delta_v_bound_m_s": {"mean": 0.05},
        },
    )
    (tmp_path / artifacts.OPTIMUM_PLANS).mkdir(parents=True)
    rows = {}
    for case, forces in made.items():
        plan = SimpleNamespace(flight=SimpleNamespace(forces=forces))
        rows[case] = optimum._keep(experiment, tmp_path, case, None, plan)
    lines = optimum.plan_path(tmp_path, 0).read_text().splitlines()
    assert optimum.plan_path(tmp_path, 12).name == "case-0012.csv"
    assert [[float(cell) for cell in line.split(",")] for line in lines[1:]] == [
        [10.0 * k, *made[0][k]] for k in range(4)
    ]
    optimum._finish(experiment, tmp_path, rows)
    lines = (tmp_path / artifacts.OPTIMUM_FORCES).read_text().splitlines()
    assert [[float(cell) for cell in line.split(",")] for line in lines[1:]] == [
        [0.0, 10.0, 0.5, 0.0, 0.0],
        [0.0, 30.0, 0.5, 0.0, 0.0],
        [12.0, 0.0, 0.0, -0.25, 0.125],
    ]
    assert "2 of 2 cases solved: delta-v 6.1000 m/s on average, 12.1000 at most" in capsys.readouterr().err
    assert artifacts.read_json(tmp_path, artifacts.OPTIMUM_SUMMARY)["points_asked"] == 95
    optimum.write_cases(tmp_path, {7: row(7, 1.0, 0.5), 3: row(3, 2.0, 0.5)})
    assert tables.read_parquet(tmp_path, artifacts.OPTIMUM_CASES)["case"].tolist() == [3, 7]


@pytest.mark.parametrize(
    ("flown", "is_repeated"),
    [((90, 0.5), True), ((90, 0.5 + 4e-10), True), ((90, 0.5 + 1e-8), False), ((91, 0.5), False)],
)
def test_a_flight_repeats_its_evaluation_but_for_the_last_digits(flown, is_repeated):
    flight = FlightToRecord("best-case-3", "case-3", None, (90, 0.5))
    if is_repeated:
        _check_repeated(flight, flown)
    else:
        with pytest.raises(ArtifactError, match=f"case-3 now achieves {flown[0]} for {flown[1]:.6f} m/s"):
            _check_repeated(flight, flown)
    _check_repeated(replace(flight, expected=None), (0, 9.0))


def test_a_recorded_flight_is_told_with_where_it_left_the_limits():
    mission = cases.composed("duration_s=100.0").experiment.mission
    log = cases.flown("duration_s=100.0")
    path = np.zeros((11, 3))
    path[:, 0] = 75.0
    words = _in_words(mission, log._replace(position_m=path))
    assert words == f"{log.is_inspected[-1].sum()} of {_inspectable(log)}, {log.delta_v_m_s[-1]:.3f} m/s"
    for sample, is_told in ((0, False), (1, True), (10, True)):  # the start is given
        out = path.copy()
        out[sample, 0] = 201.0
        told_words = _in_words(mission, log._replace(position_m=out))
        assert told_words.endswith(", outside the limits") == is_told


def _inspectable(log):
    count = log.is_inspectable.sum()
    return "99 points" if count == 99 else f"the {count} points that can be inspected (99 in all)"


def least_cases(probability, confidence, failures):
    """The least number of cases of which so few fail more rarely than the risk, by SciPy's binomial law."""
    number = failures + 1
    while stats.binom.cdf(failures, number, 1.0 - probability) > 1.0 - confidence:
        number += 1
    return number


def requirement(probability, confidence, *, methods=("cases",)):
    return SimpleNamespace(id="R1", verified_by=methods, probability=probability, confidence=confidence)


@pytest.mark.parametrize("num_cases", [100, 500])
def test_needs_are_told_before_anything_flies(capsys, num_cases):
    settings = SimpleNamespace(num_cases=num_cases, stop_width=None)
    assure._print_needs(
        [requirement(0.99, 0.9), requirement(1.0, 0.0), requirement(0.5, 0.9, methods=())], settings
    )
    first, second = capsys.readouterr().err.splitlines()
    needed = ", ".join(f"{least_cases(0.99, 0.9, failures):,}" for failures in (0, 1, 2))
    assert first.startswith(f"  R1: 99 % with 90 % confidence needs {needed} cases with 0, 1, 2 failures; ")
    allowed = max((k for k in range(10) if least_cases(0.99, 0.9, k) <= num_cases), default=-1)
    assert first.endswith(f"{num_cases} allow {allowed}" if allowed >= 0 else f"{num_cases} are too few")
    assert second == "  R1: all cases must meet it, which only a proof shows"


def tally(fraction, low, high, count=0):
    success = Fraction(count, fraction, low, high)
    return SimpleNamespace(
        success=success,
        exits=SimpleNamespace(count=3),
        misses=SimpleNamespace(count=2),
        score=(count,),
        sentence="so many",
    )


@pytest.mark.parametrize(
    ("goal", "low", "high", "num_flown"),
    [(80.0, 0.75, 0.9, 10), (80.0, 0.8, 0.9, 4), (80.0, 0.75, 0.79, 4), (80.0, 0.75, 0.8, 10)],
)
def test_what_plans_flies_from_more_starts_where_the_goal_is_open(monkeypatch, goal, low, high, num_flown):
    """First from two in five of the starts that no choice has seen."""
    flown = []
    monkeypatch.setattr(fit, "_tally", lambda *words: flown.extend(words[3]) or tally(0.8, low, high))
    monkeypatch.setattr(fit.fitting, "joined", lambda first, more, _: first)
    settings = SimpleNamespace(
        fit=SimpleNamespace(goal_percent=goal), monte_carlo=SimpleNamespace(confidence_percent=95.0)
    )
    whole = SimpleNamespace(_experiment=settings, _unseen=[*range(10)])
    fit._Fit._judged(whole, "planned", "a plan", None, None)
    assert flown == [*range(num_flown)]
    flown.clear()
    fit._Fit._judged(whole, "fitted", "rules", None, None)
    assert flown == [*range(10)]


def test_what_is_hopeless_and_what_reaches_a_goal():
    settings = SimpleNamespace(fit=SimpleNamespace(goal_percent=80.0))
    fits = SimpleNamespace(_experiment=settings)
    assert [fit._Fit._is_hopeless(fits, tally(0.7, 0.6, high)) for high in (0.79, 0.8, 0.81)] == [
        True,
        False,
        False,
    ]
    assert [fit._reaches_goal(settings, tally(0.9, low, 0.95)) for low in (0.79, 0.8, 0.81)] == [
        False,
        True,
        True,
    ]


def test_the_last_line_of_a_fit_names_what_limits_it():
    limits = [{"kept": kept, "sentence": f"sentence {kept}"} for kept in (True, False)]
    last = SimpleNamespace(words="the law", tally=tally(0.5, 0.4, 0.6))
    missed = str(fit._missed({"limits": limits, "goal_percent": 95.0}, last))
    assert "goal missed: the best, the law, is not shown to succeed in 95 % of flights; so many" in missed
    assert missed.endswith("limited by the sentence False")
    kept = str(fit._missed({"limits": limits[:1], "goal_percent": 95.0}, last))
    assert kept.endswith("no limit told above explains it")


def test_rows_of_starts_count_cases_and_deputies():
    experiment = compose_experiment(
        ["+experiment=evaluate", "controller=coast", "monte_carlo.num_cases=4"]
    ).experiment
    starts = evaluation_scenarios(experiment)
    rows = [*_rows_of("evaluation", 5, starts)]
    assert [line[:2] for line in rows] == [["evaluation", 5 + k] for k in range(4)]
    for line, start in zip(rows, starts, strict=True):
        assert line[2:5] == start.position_m.tolist()
        assert line[5:8] == start.velocity_m_s.tolist()
        assert line[8:] == [start.sun_angle_rad, start.sun_elevation_rad]
    words = ["+experiment=evaluate", "controller=coast", "monte_carlo.num_cases=2", "fleet.deputies=3"]
    fleets = evaluation_scenarios(compose_experiment(words).experiment)
    labels = [line[:3] for line in _rows_of("x", 1, fleets)]
    assert labels == [["x", 1 + case, deputy] for case in range(2) for deputy in (1, 2, 3)]


def test_an_unimproved_training_says_from_how_many_starts():
    candidate = SimpleNamespace(num_cases=2000, sentence="it does well", where="generation 3")
    selection = SimpleNamespace(best_champion=candidate, chosen=candidate, best_fails_more=True)
    words = str(_unimproved(selection))
    assert (
        "From 2,000 validation starts it does well; with the best champion (generation 3) it does well"
        in words
    )
    assert f"; from {FURTHER * 2000:,} further starts it fails more often" in words
    assert "further" not in str(_unimproved(SimpleNamespace(**{**vars(selection), "best_fails_more": False})))


def test_flights_of_a_comparison_are_counted_as_they_are_flown_until_it_ends():
    shown = []
    flights = compare._Flights(SimpleNamespace(show=lambda *words: shown.append(words)))
    flights.note(3, "a")
    flights.note(4, "b")
    assert shown == [(3, "a"), (7, "b")]
    flights.has_ended.set()
    with pytest.raises(CancelledError):
        flights.note(1, "c")
