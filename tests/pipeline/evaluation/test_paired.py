"""Paired differences against their definitions, scipy, and what they promise of many tables."""

import math

import numpy as np
import pytest
from scipy import optimize, stats

from pipeline.evaluation import paired


def score(won: int, lost: int, count: int, difference: float) -> float:
    """Tango's statistic by its definition: the share of lost cases is found by maximising the likelihood."""

    def unlikely(share: float) -> float:
        both, rest = share + difference, 1.0 - 2.0 * share - difference
        terms = ((won, both), (lost, share), (count - won - lost, rest))
        return -sum(number * math.log(max(part, 1e-300)) for number, part in terms if number)

    low, high = max(0.0, -difference), (1.0 - difference) / 2.0
    best = optimize.minimize_scalar(unlikely, bounds=(low, high), method="bounded", options={"xatol": 1e-12})
    share = min((low, high, best.x), key=unlikely)
    variance = count * (2.0 * share + difference * (1.0 - difference))
    return (won - lost - count * difference) / math.sqrt(variance)


@pytest.mark.parametrize(
    ("won", "lost", "count"),
    [(0, 0, 20), (4, 0, 1000), (12, 2, 50), (1, 9, 30), (30, 30, 60), (2, 0, 2), (0, 40, 40)],
)
def test_the_ends_of_an_interval_are_where_the_score_test_turns(won: int, lost: int, count: int) -> None:
    low, high = paired.tango_interval(won, lost, count, 95.0)
    assert -1.0 <= low < (won - lost) / count + 1e-12
    assert (won - lost) / count - 1e-12 < high <= 1.0
    for end, sign in ((low, 1.0), (high, -1.0)):
        if abs(end) < 1.0:
            assert score(won, lost, count, end) == pytest.approx(sign * stats.norm.ppf(0.975), abs=2e-4)
    assert paired.tango_interval(lost, won, count, 95.0) == pytest.approx((-high, -low), abs=1e-9)


@pytest.mark.parametrize(("won_share", "lost_share"), [(0.02, 0.0), (0.3, 0.1), (0.01, 0.01)])
def test_an_interval_holds_the_difference_about_as_often_as_it_says(
    won_share: float, lost_share: float
) -> None:
    """Summed over all outcomes of 40 cases, not sampled."""
    count, true, held = 40, won_share - lost_share, 0.0
    shares = [won_share, lost_share, 1.0 - won_share - lost_share]
    for won in range(count + 1):
        for lost in range(count + 1 - won):
            chance = float(stats.multinomial.pmf([won, lost, count - won - lost], count, shares))
            if chance > 1e-9:
                low, high = paired.tango_interval(won, lost, count, 95.0)
                held += chance * (low <= true <= high)
    assert 0.93 <= held <= 1.0


def test_no_difference_of_shares_is_told_without_width() -> None:
    """Two cases that one wins, and four of a thousand: the interval and the exact test say the same."""
    both = paired.of_shares(2, 0, 2, 95.0)
    assert (both.mean, both.p_value) == (100.0, 0.5)
    assert both.low < 0.0 < both.high <= 100.0
    few = paired.of_shares(0, 4, 1000, 95.0)
    assert few.p_value == pytest.approx(stats.binomtest(0, 4).pvalue)
    assert few.low < few.mean == -0.4 < few.high
    assert paired.shown([few.p_value], 95.0) == [False]
    alone = paired.of_shares(1, 0, 1, 95.0)
    assert not alone.has_interval
    assert alone.in_words(1) == "+100.0 (one pair)"


def test_numbers_have_students_interval_and_wilcoxons_test() -> None:
    values = np.random.default_rng(3).normal(0.1, 1.0, 17)
    gain = paired.of_numbers(values, 90.0)
    interval = stats.ttest_1samp(values, 0.0).confidence_interval(0.9)
    assert (gain.low, gain.high) == pytest.approx((interval.low, interval.high))
    assert gain.count == 17
    assert gain.p_value == pytest.approx(stats.wilcoxon(values).pvalue)
    assert paired.of_runs(values, 90.0).p_value == pytest.approx(stats.ttest_1samp(values, 0.0).pvalue)
    for alike in (values[:1], np.full(5, 0.25)):
        assert not paired.of_numbers(alike, 90.0).has_interval
    assert paired.of_runs(values[:1], 90.0).p_value == 1.0


def test_averages_have_no_narrower_interval_than_their_cases() -> None:
    agreeing = np.array([-1.0, -1.0, -1.0])
    gain = paired.of_averaged_shares(agreeing, 1, 4, 300, 95.0)
    cases = paired.of_shares(1, 4, 300, 95.0)
    assert (gain.mean, gain.count, gain.low, gain.high) == (-1.0, 3, cases.low, cases.high)
    spread = paired.of_averaged_shares(np.array([-90.0, 0.0, 80.0]), 1, 4, 300, 95.0)
    assert (spread.low, spread.high) == (-100.0, 100.0)


def test_holms_method_rejects_step_by_step() -> None:
    """0.01 is below 0.05/4, 0.015 below 0.05/3, 0.03 not below 0.05/2, so 0.04 stays too."""
    assert paired.shown([0.03, 0.01, 0.04, 0.015], 95.0) == [False, True, False, True]
    assert paired.shown([], 95.0) == []
