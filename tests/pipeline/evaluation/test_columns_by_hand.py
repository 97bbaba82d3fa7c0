"""Columns of episodes, ratios to plans, and tables of comparisons, each recomputed from what was flown."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats

from pipeline.command_line.config import compose_experiment
from pipeline.controllers.source import load
from pipeline.evaluation import comparison, monte_carlo
from pipeline.evaluation.beside_optimum import beside_optimum, summarise_times, times_in_words
from pipeline.evaluation.comparison import FLOWN, PLANNED, PUBLISHED, ComparisonRow
from pipeline.evaluation.contenders import labelled
from pipeline.flight.fly.fleet_logs import fly_logged_fleet
from pipeline.flight.fly.simulation import fly_logged
from pipeline.scenarios import evaluation_scenarios

WORDS = ("+experiment=evaluate", "controller=champion_27", "duration_s=900", "monte_carlo.num_cases=4")


def composed(*words):
    experiment = compose_experiment([*WORDS, *words]).experiment
    return experiment, load(experiment.controller, experiment.mission), evaluation_scenarios(experiment)


def test_episodes_are_those_of_the_logged_flights():
    limits = ("deputy.max_distance_m=85", "sun=random", "inspection_threshold_percent=90")
    experiment, controller, starts = composed(*limits)
    episodes, tracks = monte_carlo.fly_cases(experiment.mission, controller, starts, 1)
    assert tracks.shape == (4, 91, 3)
    for case, start in enumerate(starts):
        log = fly_logged(experiment.mission, controller, start)
        distances = np.linalg.norm(log.position_m, axis=1)
        lit = int(log.is_inspectable.sum())
        seen = int(log.is_inspected[-1].sum())
        expected = {
            "case": case,
            "delta_v_m_s": np.abs(log.force_hill_n).sum() * 10.0 / 12.0,
            "inspected_count": seen,
            "inspection_rate_percent": 100.0 * seen / 99.0,
            "inspectable_count": lit,
            "inspectable_rate_percent": 100.0 * seen / lit,
            "mean_distance_m": distances.mean(),
            "min_distance_m": distances.min(),
            "max_distance_m": distances.max(),
            "success": seen >= 0.9 * lit,
            "violated": distances[1:].min() < 15.0 or distances[1:].max() > 85.0,
            "sun_angle_rad": start.sun_angle_rad,
            "sun_elevation_rad": start.sun_elevation_rad,
            "position_x_m": start.position_m[0],
            "position_z_m": start.position_m[2],
            "safety_periods": 0,
        }
        for name, value in expected.items():
            assert episodes[name][case] == pytest.approx(value, rel=1e-6), name
        np.testing.assert_allclose(tracks[case], log.position_m, rtol=1e-5, atol=1e-4)
    for name in ("success", "violated"):
        assert set(episodes[name].tolist()) == {False, True}


def test_episodes_of_fleets_are_of_all_deputies_together():
    experiment, controller, starts = composed("fleet.deputies=3")
    episodes, deputies = monte_carlo.fly_fleets(experiment.mission, controller, starts[:2], 1)
    assert deputies["case"].tolist() == [0, 0, 0, 1, 1, 1]
    assert deputies["deputy"].tolist() == [1, 2, 3] * 2
    for case, start in enumerate(starts[:2]):
        fleet = fly_logged_fleet(experiment.mission, controller, start)
        rows = slice(3 * case, 3 * case + 3)
        spent = np.array([each.flight.delta_v_m_s[-1] for each in fleet])
        np.testing.assert_allclose(deputies["delta_v_m_s"][rows], spent, rtol=1e-9)
        assert episodes["delta_v_m_s"][case] == pytest.approx(spent.sum())
        assert episodes["greatest_delta_v_m_s"][case] == pytest.approx(spent.max())
        by = fleet[0].seen_by[-1]
        counts = [np.count_nonzero(by == each.deputy) for each in fleet]
        assert deputies["inspected_count"][rows].tolist() == counts
        assert episodes["inspected_count"][case] == sum(counts)
        paths = [each.flight.position_m for each in fleet]
        pairs = [np.linalg.norm(paths[i] - paths[j], axis=1).min() for i in range(3) for j in range(i)]
        assert episodes["nearest_pair_m"][case] == pytest.approx(min(pairs), rel=1e-6)
        means = [np.linalg.norm(path, axis=1).mean() for path in paths]
        np.testing.assert_allclose(deputies["mean_distance_m"][rows], means, rtol=1e-6)


def test_a_summary_has_each_mean_and_share_that_columns_allow():
    draw = np.random.default_rng(3)
    names = ("delta_v_m_s", "inspection_rate_percent", "mean_distance_m", "safety_delta_v_m_s")
    names += ("ahead_delta_v_m_s", "full_wheel_s", "propellant_kg", "inspectable_rate_percent")
    columns = {name: draw.random(30) for name in names} | {"success": draw.random(30) < 0.7}
    columns |= {"violated": draw.random(30) < 0.3, "safety_periods": draw.integers(0, 3, 30)}
    columns |= {
        "full_wheel_s": draw.integers(0, 2, 30) * 10.0,
        "inspectable_count": draw.integers(80, 99, 30),
    }
    summary = monte_carlo.summarise(columns, 90.0)
    for name in (*names, "safety_periods", "inspectable_count"):
        values = columns[name].astype(float)
        of = summary[name]
        low, high = stats.t.interval(0.9, 29, values.mean(), stats.sem(values))
        assert of["mean"] == pytest.approx(values.mean())
        assert of["standard_deviation"] == pytest.approx(values.std(ddof=1))
        assert (of["minimum"], of["maximum"]) == (values.min(), values.max())
        assert (of["low"], of["high"]) == (pytest.approx(max(low, 0.0)), pytest.approx(high))
    shares = {
        "success": columns["success"],
        "violated": columns["violated"],
        "success_and_within_limits": columns["success"] & ~columns["violated"],
        "safety_acted": columns["safety_periods"] > 0,
        "wheel_full": columns["full_wheel_s"] > 0.0,
    }
    for name, is_so in shares.items():
        interval = stats.binomtest(int(is_so.sum()), 30).proportion_ci(0.9, method="wilson")
        expected = {
            "count": is_so.sum(),
            "fraction": is_so.mean(),
            "low": interval.low,
            "high": interval.high,
        }
        assert summary[name] == pytest.approx(expected)
    docked = {name: draw.random(30) for name in ("end_s", "end_speed_m_s", "excess_m_s")}
    docked["excess_m_s"][:12] = 0.0
    assert monte_carlo.summarise(columns | docked, 90.0)["held"]["count"] == 12


def flown_and_plans():
    flown = {"case": np.arange(4), "delta_v_m_s": np.array([0.3, 0.4, 0.6, 1.0])}
    flown |= {"inspected_count": np.array([95, 97, 99, 96]), "success": np.array([True, True, True, False])}
    flown |= {"violated": np.array([False, True, False, False])}
    plans = {"case": np.array([7, 8, 9, 10]), "delta_v_m_s": np.array([0.1, 0.2, 0.2, 0.4])}
    plans |= {
        "inspected_count": np.array([95, 95, 95, 95]),
        "delta_v_bound_m_s": np.array([0.05, 0.1, 0.0, 0.2]),
    }
    harder = [
        {"delta_v_m_s": np.array([0.9, 0.25, 0.3, 0.5]), "inspected_count": np.array([97, 97, 97, 96])},
        {"delta_v_m_s": np.array([0.9, 0.9, 0.5, 0.9]), "inspected_count": np.array([98, 98, 98, 98])},
    ]
    return flown, plans, harder


def test_ratios_are_to_the_plan_of_the_case_and_to_that_which_sees_as_much():
    columns = beside_optimum(*flown_and_plans())
    assert columns["case"].tolist() == [7, 8, 9, 10]
    np.testing.assert_allclose(columns["times_optimum"], [3.0, 2.0, 3.0, 2.5])
    # the third saw 99 points, which no plan does: the one of most points counts
    np.testing.assert_allclose(columns["optimum_as_seen_delta_v_m_s"], [0.1, 0.25, 0.5, 0.5])
    np.testing.assert_allclose(columns["times_optimum_as_seen"], [3.0, 1.6, 1.2, 2.0])
    times = summarise_times(columns, 95.0)
    assert (times["num_cases"], times["num_successful"]) == (4, 2)
    whole = times["times_optimum"]
    assert whole["mean"] == pytest.approx(2.625)
    assert (whole["median"], whole["min"], whole["max"], whole["max_case"]) == pytest.approx(
        (2.75, 2.0, 3.0, 7)
    )
    assert times["times_optimum_of_successful"]["mean"] == pytest.approx(3.0)
    assert times["times_optimum_as_seen"]["mean"] == pytest.approx(1.95)
    # of the third case no bound is known
    assert times["times_bound"]["mean"] == pytest.approx((6.0 + 4.0 + 5.0) / 3.0)
    assert times["delta_v_m_s"]["mean"] == pytest.approx(0.575)
    assert times["optimum_delta_v_m_s"]["mean"] == pytest.approx(0.225)
    none = summarise_times(columns | {"violated": np.ones(4, dtype=bool)}, 95.0)
    assert none["times_optimum_of_successful"] is None
    assert times_in_words({"mean": 2.345, "low": 2.0, "high": 3.04}, 1) == "2.3 (2.0–3.0)"
    assert times_in_words({"mean": 2.346}, 2) == "2.35"
    assert times_in_words(None, 2) == ""


def share(count, number=100):
    return {
        "count": count,
        "fraction": count / number,
        "low": count / number - 0.05,
        "high": count / number + 0.05,
    }


def row(controller="a", success=90, violated=2, **others):
    summary = {"delta_v_m_s": {"mean": 0.5, "standard_deviation": 0.125}}
    summary |= {"inspection_rate_percent": {"mean": 97.5, "standard_deviation": 1.5}}
    summary |= {
        "success_and_within_limits": share(success),
        "violated": share(violated),
        "safety_acted": share(7),
    }
    summary |= others.pop("summary", {})
    values = {"source": FLOWN, "sun": "random", "safety": "none", "num_cases": 100, "rules": 27, "world": ""}
    return ComparisonRow(controller=controller, summary=summary, **values | others)


def test_a_line_tells_a_controller_with_and_without_the_layer():
    after = {"stays_orbit": share(12), "passively_safe": share(34)}
    lit = {"inspectable_rate_percent": {"mean": 98.25, "standard_deviation": 1.0}}
    times = {
        "times_optimum": {"mean": 2.34, "low": 2.0, "high": 2.6},
        "times_bound": {"mean": 3.0},
        "num_cases": 50,
    }
    plain = row(times=times, summary=after | lit)
    guarded = row(violated=0, safety="filter", summary={"ahead_delta_v_m_s": {"mean": 0.125}})
    assert comparison.cells_in_words(plain, guarded) == [
        *("a", "27", "0.500 ± 0.125", "97.50 ± 1.50, of lit 98.25", "90.0 (85.0-95.0)", "2.0 (-3.0-7.0)"),
        *("12 / 34", "2.3 (2.0–2.6)", "3.0"),
        *("0.0 (-5.0-5.0)", "0.500 ± 0.125, 75.0 % of it by rules", "7.0 (2.0-12.0)"),
    ]
    heads, lines = comparison.table_of([plain, guarded], "random")
    assert heads == list(comparison.HEADINGS)
    assert len(lines) == 1
    # without the layer no column tells of it, and with it alone none of flights without
    heads, (line,) = comparison.table_of([row(rules=None)], "random")
    assert (heads, line[1]) == (list(comparison.HEADINGS[:6]), "-")
    (line,) = comparison.lines_of([guarded], "random")
    assert (line[2], line[5], line[9]) == ("", "", "0.0 (-5.0-5.0)")
    paper, plans = row("p", source=PUBLISHED, sun=""), row("o", source=PLANNED, num_cases=50)
    lines = comparison.lines_of([paper, plans, row(sun="fixed")], "random")
    assert [each[0] for each in lines] == ["p*", "o, 50 cases"]
    assert comparison.suns_of([paper, plans, row(sun="fixed")]) == ["random", "fixed"]
    cells = dict(zip(comparison.HEADER, comparison.as_cells(plain), strict=True))
    assert (cells["times_optimum_mean"], cells["times_bound_low"], cells["solved_cases"]) == (2.34, "", 50)
    assert (cells["violated_count"], cells["delta_v_m_s_mean"]) == (2, 0.5)


def test_a_world_breaks_a_controller_where_fisher_s_test_shows_it():
    rows = [
        row("a", world="home"),
        row(
            "a", world="away", success=60, summary={"delta_v_m_s": {"mean": 0.75, "standard_deviation": 0.1}}
        ),
        row("b", world="home"),
        row("b", world="away", success=88, violated=3),
        row("c", world="home"),
        row("c", world="away", violated=30),
    ]
    for of, first in ((rows[1], rows[0]), (rows[3], rows[2]), (rows[5], rows[4])):
        p_values = []
        for name, side in (("success_and_within_limits", "less"), ("violated", "greater")):
            counts = [each.summary[name]["count"] for each in (of, first)]
            table = [[count, 100 - count] for count in counts]
            p_values.append(stats.fisher_exact(table, alternative=side).pvalue)
        assert comparison.worse_p_values(of, first) == pytest.approx(p_values, rel=1e-9)
    assert comparison.broken_worlds(rows) == {("random", "none", name, "away") for name in ("a", "c")}
    assert comparison.verdicts(rows) == [
        'a, Sun random, layer none: breaks in "away"; "away": +50 % delta-v',
        'b, Sun random, layer none: no break shown by 100 cases; "away": +0 % delta-v',
        'c, Sun random, layer none: breaks in "away"; "away": +0 % delta-v',
    ]
    ((sun, layer, lines),) = comparison.matrices(rows)
    assert (sun, layer) == ("random", "none")
    assert lines[0] == ["world", "a", "b", "c"]
    assert lines[1:] == [
        ["home", *["90 / 0.50 / 2"] * 3],
        ["away", "60 / 0.75 / 2", "88 / 0.50 / 3", "90 / 0.50 / 30"],
    ]


def test_plans_are_successes_where_they_see_enough_within_the_limits():
    experiment = compose_experiment(list(WORDS)).experiment
    cases = {
        "case": np.arange(4),
        "delta_v_m_s": np.full(4, 0.2),
        "inspection_rate_percent": np.full(4, 96.0),
    }
    cases |= {"mean_distance_m": np.full(4, 60.0), "inspected_count": np.array([94, 95, 95, 99])}
    cases |= {"outside_m": np.array([0.0, 0.0, 0.1, 0.0])}
    planned = comparison.planned_row(experiment, SimpleNamespace(cases=cases))
    # 95 % of 99 points are 95
    assert planned.summary["success"]["count"] == 3
    assert planned.summary["violated"]["count"] == 1
    assert planned.summary["success_and_within_limits"]["count"] == 2
    assert (planned.num_cases, planned.source, planned.rules) == (4, PLANNED, None)


def test_flights_of_rows_are_joined_under_their_names():
    parts = [
        (row("a", num_cases=2), {"x": np.array([1.0, 2.0])}),
        (row("b", num_cases=1), {"y": np.array([3.0])}),
    ]
    columns = comparison.concatenate(parts)
    assert columns["controller"].tolist() == ["a", "a", "b"]
    np.testing.assert_array_equal(columns["x"], [1.0, 2.0, np.nan])
    np.testing.assert_array_equal(columns["y"], [np.nan, np.nan, 3.0])


def test_controllers_of_one_name_are_told_apart_by_their_files():
    law = SimpleNamespace(fuzzy=None)
    names = ["a/x.yaml", "b/x.yaml", "c/y.yaml"]
    assert [labelled(name, names, law) for name in names] == ["a/x.yaml", "b/x.yaml", "y"]
