"""Intervals that hold for all numbers of flights, and where flights end that ask for a width."""

import math

import numpy as np
import pytest
from scipy.stats import binom

from pipeline.evaluation import sequential
from pipeline.evaluation.assurance.judgements import cases_needed, failures_allowed
from pipeline.evaluation.sequential import LOOK_CASES, Stop, order_ranks, quantile, share_interval


@pytest.mark.parametrize("confidence", [80.0, 95.0, 99.9])
@pytest.mark.parametrize("number", [1, 12, 1000, 10**8])
def test_the_interval_of_a_share_that_was_never_seen_has_a_closed_form(number, confidence):
    # (n + 1) (1 - p)^n = risk
    highest = -math.expm1(math.log((1.0 - confidence / 100.0) / (number + 1)) / number)
    assert share_interval(0, number, confidence) == (0.0, pytest.approx(highest, rel=1e-9))
    low, high = share_interval(number, number, confidence)
    assert (low, high) == (pytest.approx(1.0 - highest, rel=1e-9), 1.0)


@pytest.mark.parametrize(("share", "confidence"), [(0.9, 0.95), (0.99, 0.9), (0.5, 0.99)])
def test_the_failures_of_a_claim_are_those_whose_interval_lies_above_it(share, confidence):
    for number in (1, 40, 500, 3000):
        lows = [share_interval(number - failed, number, 100.0 * confidence)[0] for failed in range(number)]
        most = sum(low >= share for low in lows) - 1
        assert failures_allowed(number, share, confidence, is_sequential=True) == most
    needed = [cases_needed(share, confidence, failed, is_sequential=True) for failed in (0, 1, 2)]
    for failed, number in enumerate(needed):
        ends = [share_interval(n - failed, n, 100.0 * confidence)[0] for n in (number - 1, number)]
        assert ends[0] < share <= ends[1]
    # closed form: (n + 1) p^n is the risk
    assert (needed[0] + 1) * share ** needed[0] <= 1.0 - confidence < needed[0] * share ** (needed[0] - 1)


@pytest.mark.parametrize(("count", "number"), [(1, 2), (3, 1000), (990, 1000), (500, 1000)])
def test_the_ends_of_the_interval_of_a_share_are_where_its_likelihood_is_the_risk(count, number):
    for end in share_interval(count, number, 95.0):
        assert (number + 1) * binom.pmf(count, number, end) == pytest.approx(0.05, rel=1e-6)


def test_the_interval_of_a_share_misses_it_at_any_look_no_more_often_than_the_risk():
    generator, missed, num_sequences, share = np.random.default_rng(5), 0, 400, 0.3
    for counts in np.cumsum(generator.random((num_sequences, 2000)) < share, axis=1):
        numbers = np.arange(1, 2001)
        # the interval contains the share if its likelihood exceeds the risk
        is_missed = np.any((numbers + 1) * binom.pmf(counts, numbers, share) <= 0.1)
        missed += is_missed
        at = [9, 99, 1999]
        held = [low <= share <= high for low, high in (share_interval(counts[n], n + 1, 90.0) for n in at)]
        assert all(held) or is_missed
    # by Ville's inequality at most a tenth, which so many sequences exceed by this with a chance of 0.1 %
    assert missed <= binom.ppf(0.999, num_sequences, 0.1)


def test_the_interval_of_a_mean_misses_it_at_any_look_no_more_often_than_the_risk():
    generator, numbers = np.random.default_rng(6), np.arange(LOOK_CASES, 40_001, LOOK_CASES)
    missed, num_sequences = 0, 300
    for values in generator.exponential(size=(num_sequences, 40_000)):
        means = np.cumsum(values)[numbers - 1] / numbers
        reach = np.array([quantile(number, 90.0) / math.sqrt(number) for number in numbers])
        missed += bool(np.any(np.abs(means - 1.0) > reach))
    assert missed <= binom.ppf(0.999, num_sequences, 0.1)


def test_means_need_wider_intervals_than_for_a_number_that_was_fixed_narrowest_at_ten_thousand_flights():
    widths = {number: quantile(number, 95.0) for number in (100, 1000, 10_000, 100_000, 10**7)}
    assert all(width > 1.96 for width in widths.values())
    assert min(widths, key=widths.get) == 10_000


@pytest.mark.parametrize(("number", "share"), [(10, 0.5), (1000, 0.01), (1000, 0.9), (5, 0.99)])
def test_the_ranks_of_a_percentile_are_counts_that_are_likely(number, share):
    likely = (number + 1) * binom.pmf(np.arange(number + 1), number, share) > 0.05
    low, high = order_ranks(number, share, 95.0)
    assert (low, high) == (np.flatnonzero(likely)[0] - 1, np.flatnonzero(likely)[-1])


def of_flights(values):
    return {"success": values > 0.3, "violated": values > 0.95, "delta_v_m_s": values}


@pytest.mark.parametrize("quantity", ["success_and_within_limits", "violated", "delta_v_m_s"])
@pytest.mark.parametrize("length", [300, 1000, 7001])
def test_flights_end_at_the_first_look_at_which_the_interval_is_narrow_in_any_cut_and_order(quantity, length):
    values = np.random.default_rng(7).random(20_000)
    inside = (values > 0.3) & (values <= 0.95)
    column = of_flights(values).get(quantity, inside)

    def width(number):
        seen = column[:number].astype(float)
        if quantity == "delta_v_m_s":
            return 2.0 * quantile(number, 95.0) * seen.std(ddof=1) / math.sqrt(number)
        low, high = share_interval(int(seen.sum()), number, 95.0)
        return high - low

    end = next(number for number in range(LOOK_CASES, 20_001, LOOK_CASES) if width(number) <= 0.03)
    stop, came = Stop(quantity, 0.03, 95.0), []
    cut = [(first, values[first : first + length]) for first in range(0, 20_000, length)]
    for first, part in [*cut[1::2], *cut[::2]]:
        came.append(stop.take(first, of_flights(part)))
        if came[-1]:
            break
    assert came[-1] == end
    assert 1000 < end < 20_000


def test_a_summary_keeps_all_but_its_intervals():
    summary = {
        "success": {"count": 40, "fraction": 0.4, "low": 0.3, "high": 0.5},
        "delta_v_m_s": {"mean": 0.1, "standard_deviation": 2.0, "low": 0.0, "high": 0.2},
        "inspection_rate_percent": {"mean": 99.0, "standard_deviation": 9.0, "low": 98.0, "high": 99.5},
        "mean_distance_m": {"mean": 9.0, "standard_deviation": None, "low": None, "high": None},
    }
    widened = sequential.for_any_number(summary, 100, 95.0)
    assert widened["success"] == {"count": 40, "fraction": 0.4} | dict(
        zip(("low", "high"), share_interval(40, 100, 95.0), strict=True)
    )
    # no mean is below 0, nor one of percents above 100
    assert widened["delta_v_m_s"]["low"] == 0.0
    assert widened["delta_v_m_s"]["high"] == pytest.approx(0.1 + quantile(100, 95.0) * 0.2)
    assert widened["inspection_rate_percent"]["high"] == 100.0
    assert widened["mean_distance_m"] == summary["mean_distance_m"]
