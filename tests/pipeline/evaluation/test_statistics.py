"""Statistics against numbers worked out by hand, and intervals against scipy's."""

import numpy as np
import pytest
from scipy import stats

from pipeline.evaluation import ranks, statistics


@pytest.mark.parametrize("confidence_percent", [90.0, 95.0, 99.0])
@pytest.mark.parametrize(("count", "number"), [(0, 20), (1, 20), (8, 8), (960, 1000), (1, 1), (50, 99)])
def test_the_interval_of_a_fraction_is_wilsons(count: int, number: int, confidence_percent: float) -> None:
    is_so = np.arange(number) < count
    expected = stats.binomtest(count, number).proportion_ci(confidence_percent / 100.0, method="wilson")
    share = statistics.fraction(is_so, confidence_percent)
    assert (share.count, share.fraction) == (count, count / number)
    assert share.low == pytest.approx(expected.low, rel=1e-12, abs=1e-15)
    assert share.high == pytest.approx(expected.high, rel=1e-12)
    assert 0.0 <= share.low <= share.fraction <= share.high <= 1.0


def test_a_statistic_has_the_spread_of_a_sample() -> None:
    """Of 1, 2, 3, 6: mean 3, sum of squares 14, divided by 3; the interval is Student's."""
    computed = statistics.statistic(np.array([1.0, 2.0, 3.0, 6.0]), 95.0)
    spread = np.sqrt(14.0 / 3.0)
    assert (computed.mean, computed.minimum, computed.maximum) == (3.0, 1.0, 6.0)
    assert computed.standard_deviation == pytest.approx(spread, rel=1e-14)
    # the quantile of three degrees of freedom, as tables have it
    assert computed.high - 3.0 == pytest.approx(3.182446305284263 * spread / 2.0, rel=1e-12)
    assert computed.low + computed.high == pytest.approx(6.0, rel=1e-14)
    alone = statistics.statistic(np.array([4.0]), 95.0)
    assert (alone.mean, alone.standard_deviation, alone.low, alone.high) == (4.0, None, None, None)


def test_an_interval_ends_where_a_mean_can_be() -> None:
    nearly_all = np.array([100.0] * 19 + [90.0])
    unbounded = statistics.statistic(nearly_all, 99.0)
    bounded = statistics.statistic(nearly_all, 99.0, least=0.0, most=100.0)
    assert unbounded.high > 100.0 == bounded.high
    assert bounded.low == unbounded.low


def test_the_bootstrap_is_scipys() -> None:
    ratios = np.random.default_rng(8).lognormal(1.0, 0.8, 50)
    expected = stats.bootstrap(
        (ratios,), np.mean, n_resamples=10_000, method="percentile", random_state=np.random.default_rng(4)
    ).confidence_interval
    computed = statistics.bootstrap_interval(ratios, 95.0)
    assert computed == pytest.approx((expected.low, expected.high), rel=0.02)
    assert computed == statistics.bootstrap_interval(ratios, 95.0)
    assert statistics.bootstrap_interval(ratios[:1], 95.0) is None


@pytest.mark.parametrize(("percent", "number"), [(50.0, 21), (99.0, 200), (99.0, 1000), (1.0, 1000)])
def test_the_interval_of_a_percentile_holds_it_as_often_as_it_says(percent: float, number: int) -> None:
    """Of a uniform sample the r-th value is beta distributed, whatever the law of the flights."""
    share = percent / 100.0
    interval = statistics.percentile(np.arange(1.0, number + 1.0), percent, 90.0)
    assert interval.value == np.ceil(share * number - 1e-9)
    for end, is_low in ((interval.low, True), (interval.high, False)):
        if end is None:
            continue
        passed = stats.beta(end, number + 1 - end)
        # the chance that the end lies on the wrong side of the percentile, and that the next would
        wrong = passed.sf(share) if is_low else passed.cdf(share)
        assert wrong <= 0.05
        nearer = end + 1 if is_low else end - 1
        law = stats.beta(nearer, number + 1 - nearer)
        assert (law.sf(share) if is_low else law.cdf(share)) > 0.05
    assert (interval.high is None) == (share**number > 0.05)
    assert (interval.low is None) == ((1.0 - share) ** number > 0.05)


def test_rank_correlation_is_scipys() -> None:
    generator = np.random.default_rng(5)
    first = generator.normal(size=300)
    second = np.round(np.exp(0.7 * first + generator.normal(size=300)), 1)
    columns = {"first": first, "second": second, "ones": np.ones(300)}
    pairs = [("first", "second"), ("first", "ones")]
    correlation, of_constant = ranks.rank_correlations(lambda: [columns], pairs, 95.0)
    assert correlation.value == pytest.approx(stats.spearmanr(first, second).statistic, rel=1e-12)
    bootstrap = stats.bootstrap(
        (first, second), lambda x, y: stats.spearmanr(x, y).statistic, paired=True, vectorized=False,
        n_resamples=400, method="percentile", random_state=generator,
    )  # fmt: skip
    assert correlation.low == pytest.approx(bootstrap.confidence_interval.low, abs=0.03)
    assert correlation.high == pytest.approx(bootstrap.confidence_interval.high, abs=0.03)
    assert of_constant.value == 0.0


def test_three_pairs_say_nothing_of_a_rank_correlation():
    assert statistics.correlation_ends(0.9, 3, 1.96) == (-1.0, 1.0)
    low, high = statistics.correlation_ends(0.9, 4, 1.96)
    assert -1.0 < low < 0.0
    assert 0.9 < high < 1.0
