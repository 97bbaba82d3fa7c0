"""Competing controllers of a fit: drawn, flown, ranked and tuned, with tallies by hand."""

import math
from dataclasses import replace

import pytest
from scipy.stats import binomtest

from fis_tools.formats import serialize
from pipeline.evaluation import fitting
from pipeline.evaluation.fitting import FlightTally, Variant
from pipeline.evaluation.statistics import Fraction
from pipeline.flight.control.controller import from_fuzzy
from pipeline.flight.goals.flights import fly_all
from pipeline.settings.checks import SettingError
from pipeline.training.similarity import sizes_worth_trying
from tests.pipeline.stages.test_fit_stage import SHIPPED, composed, tally


def test_success_counts_first_then_exits_then_fuel():
    order = [tally(1.0, delta_v=2.0), tally(0.9), tally(0.9, delta_v=0.5), tally(0.9, exits=0.1, delta_v=0.5)]
    scores = [each.score for each in order]
    assert scores == sorted(scores, reverse=True)


def test_tallies_join_as_if_their_flights_were_one_set():
    experiment, base = composed().experiment, serialize.load(SHIPPED)
    starts = fitting.rung_scenarios(experiment, 2)
    first, second, both = (
        fitting.tally_of(experiment.mission, base, part, 95.0, 1) for part in (starts[:2], starts[2:], starts)
    )
    together = fitting.joined(first, second, 95.0)
    assert (together.success, together.exits, together.misses) == (both.success, both.exits, both.misses)
    for name in ("num_cases", "seen", "delta_v", "ahead_percent"):
        assert getattr(together, name) == pytest.approx(getattr(both, name), rel=1e-12)


@pytest.mark.parametrize(("goal", "confidence"), [(95.0, 95.0), (99.0, 90.0), (50.0, 99.0), (95.001, 95.0)])
def test_a_goal_that_the_flights_given_cannot_show_is_refused_with_the_number_that_can(goal, confidence):
    words = f"fit.goal_percent={goal}", f"monte_carlo.confidence_percent={confidence}"
    with pytest.raises(SettingError, match="cannot show: if all succeed") as refused:
        fitting.check_goal(composed(*words, "fit.num_cases=2").experiment)
    enough = int(str(refused.value).rpartition("give ")[2].partition(" ")[0].replace(",", ""))

    def least(number):
        interval = binomtest(number, number).proportion_ci(confidence / 100.0, method="wilson")
        return 100.0 * interval.low

    assert least(enough) >= goal > least(enough - 1)
    fitting.check_goal(composed(*words, f"fit.num_cases={enough}").experiment)
    with pytest.raises(SettingError, match=f"give {enough} or lower the goal"):
        fitting.check_goal(composed(*words, f"fit.num_cases={enough - 1}").experiment)


def test_a_goal_of_all_flights_is_refused_as_no_number_shows_it():
    with pytest.raises(SettingError, match="confidence; lower the goal"):
        fitting.check_goal(composed("fit.goal_percent=100", "fit.num_cases=1000").experiment)


def test_sizes_and_tempos_are_told_by_their_significant_digits():
    words = Variant("champion_27", 0.00341, 12.345).words
    assert words == "champion_27 at 0.00341 times its size and 12.3 times its tempo"


def test_halving_keeps_the_best_as_shipped():
    experiment = composed().experiment
    variants = [Variant("champion_27", size, is_shipped=size == 0) for size in range(4)]
    rates = dict(zip(variants, (0.1, 0.5, 0.9, 0.8), strict=True))
    flown = []

    def judge(rung, variant):
        flown.append((rung, variant))
        return tally(rates[variant])

    last = [variant for variant, _ in fitting.halve(experiment, variants, judge)]
    assert last == [variants[2], variants[3], variants[0]]
    assert [rung for rung, _ in flown] == [0] * 4 + [1] * 3
    assert fitting.num_flights(experiment, 4) == 4 * 3 + 3 * 4


def test_neighbours_are_near_the_best_and_begin_at_a_later_rung():
    experiment, base = composed("fit.neighbours=12").experiment, serialize.load(SHIPPED)
    best = Variant("champion_27", 0.4, 1.6)
    near = fitting.neighbours_of(experiment, best, {"champion_27": base})
    assert len(set(near)) == 12
    sizes, tempos = (sorted(getattr(variant, name) for variant in near) for name in ("size", "tempo"))
    assert (sizes[0], sizes[-1]) == (pytest.approx(0.4 * 0.8, rel=0.05), pytest.approx(0.4 * 1.25, rel=0.05))
    assert 1.359 < tempos[0] < 1.6 < tempos[-1] < 1.841
    flown = []
    fitting.halve(experiment, near[:4], lambda rung, _: flown.append(rung) or tally(0.5), slice(1, None))
    assert flown == [1] * 4
    assert fitting.num_flights(experiment, 4, slice(1, None)) == 4 * 4


def test_rows_of_the_table_are_read_as_they_were_written(monkeypatch):
    variant = Variant("champion_27", 0.37, 1.6, decides_always=True)
    experiment = composed().experiment
    base = serialize.load(SHIPPED)

    def planned(*of):
        """Fly, as if three quarters of the fuel had been chosen ahead."""
        flown = fly_all(*of)
        return replace(flown, ahead_delta_v_m_s=0.75 * flown.delta_v_m_s)

    monkeypatch.setattr(fitting, "fly_all", planned)
    flown = fitting.tally_of(experiment.mission, base, fitting.rung_scenarios(experiment, 0), 95.0, 1)
    assert flown.sentence.endswith(" m/s, 25.0 % of it by rules")
    row = dict(zip(fitting.COLUMNS, map(str, fitting.row_of(1, variant, flown)), strict=True))
    assert fitting.read_row(row, 95.0) == ((1, variant), flown)


def test_no_start_of_the_judgement_was_flown_before():
    experiment = composed().experiment
    rungs = [fitting.rung_scenarios(experiment, rung) for rung in range(3)]
    assert [len(starts) for starts in rungs] == [3, 4, 5]
    positions = [tuple(start.position_m) for starts in rungs for start in starts]
    assert len(set(positions)) == len(positions)


def test_tuning_moves_the_constants_of_the_controller_alone():
    experiment, given = composed().experiment, serialize.load(SHIPPED)
    tuning = fitting.tuning_of(experiment, given, tally(0.5, delta_v=0.2))
    encoding = tuning.optimizer.encoding
    assert encoding.urgency_time_s == (145.0, 580.0)
    assert encoding.tour_m is None
    assert encoding.ring_size_m is None
    assert encoding.dead_band_n == (0.5 * 0.0013, 2 * 0.023)
    assert tuning.optimizer.penalty.outside_m_s == 0.2 * experiment.optimizer.penalty.outside_m_s


def test_a_score_is_success_with_what_exits_sight_and_fuel_are_worth():
    flown = FlightTally(10, *(Fraction(round(10 * end), end, end, end) for end in (0.6, 0.3, 0.1)), 0.9, 0.25)
    assert flown.score == pytest.approx(0.6 - 0.3 * 0.3 + 0.4 * 0.9 - 0.03 * math.log(0.25))
    # sight beyond what is enough is worth no more, and no fuel at all no end of it
    assert replace(flown, seen=1.0).score == replace(flown, seen=0.97).score
    assert replace(flown, delta_v=0.0).score == pytest.approx(0.51 + 0.36 - 0.03 * math.log(1e-6))
    assert flown.sentence == (
        "60.0 % of 10 flights succeed (60.0 to 60.0), 3 left the limits, 1 missed points, delta-v 0.250 m/s"
    )


def test_a_tally_counts_how_flights_end():
    experiment, base = composed().experiment, serialize.load(SHIPPED)
    starts = fitting.rung_scenarios(experiment, 2)
    flown = fly_all(experiment.mission, from_fuzzy(base), starts, 1)
    counted = fitting.tally_of(experiment.mission, base, starts, 95.0, 1)
    shares = flown.inspected_count / flown.inspectable_count
    is_seen = shares >= experiment.mission.inspection_threshold_percent / 100.0
    ends = is_seen & ~flown.is_violated, flown.is_violated, ~is_seen & ~flown.is_violated
    assert [each.count for each in (counted.success, counted.exits, counted.misses)] == [
        end.sum() for end in ends
    ]
    assert counted.num_cases == len(starts) == 5
    assert counted.seen == pytest.approx(shares.mean())
    assert counted.delta_v == pytest.approx(flown.delta_v_m_s.mean())


def test_sizes_are_drawn_one_in_each_part_of_what_is_worth_trying():
    experiment, base = composed("fit.draws=8").experiment, serialize.load(SHIPPED)
    variants = fitting.drawn_variants(experiment, {"champion_27": base, "again": base})
    for name in ("champion_27", "again"):
        shipped, *others = (variant for variant in variants if variant.base == name)
        assert shipped.is_shipped
        low, high = sizes_worth_trying(experiment.mission)
        shares = [math.log(variant.size / low) / math.log(high / low) for variant in others]
        assert [math.floor(8 * share + 1e-2 * (share < 0.01)) for share in shares] == [*range(8)]
        assert {variant.tempo for variant in others} <= set(fitting.TEMPOS)
    assert [each.size for each in variants[1:9]] != [each.size for each in variants[10:]]


def test_what_plans_is_scaled_by_the_chief_and_the_turns_of_a_flight():
    base = serialize.load(SHIPPED.with_stem("champion_81"))
    experiment = composed().experiment
    variants = fitting.planning_variants(experiment, {"champion_81": base})
    # a chief of 2 m instead of 10, and half an hour instead of an hour
    assert variants[0].is_shipped
    assert {variant.size for variant in variants[1:]} == {0.2}
    assert {variant.tempo for variant in variants[1:]} == {1.0, 3.4}
    assert len(variants) == 1 + 2 * 2
    longer = fitting.planning_variants(composed("duration_s=3600").experiment, {"champion_81": base})
    assert {variant.tempo for variant in longer} == {1.0}


def test_flights_of_rungs_are_those_of_what_is_left():
    experiment = composed("fit.cases=[3,4,6]", "fit.kept=[5,2]").experiment
    assert fitting.rungs_of(experiment) == [(3, 5), (4, 2), (6, 1)]
    # of ten fly five and the best as shipped, then two and that
    assert fitting.num_flights(experiment, 10) == 10 * 3 + 6 * 4 + 3 * 6
    assert fitting.num_flights(experiment, 4) == 4 * 3 + 4 * 4 + 3 * 6
