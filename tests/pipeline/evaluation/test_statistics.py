"""Statistics against numbers worked out by hand, and intervals against scipy's."""

import numpy as np
import pytest
from scipy import stats

from pipeline.evaluation.statistics import fraction, percentile, rank_correlation, statistic


@pytest.mark.parametrize("confidence_percent", [90.0, 95.0, 99.0])
@pytest.mark.parametrize(
    ("count", "number"), [(0, 20), (1, 20), (8, 8), (960, 1000), (1000, 1000), (1, 1), (50, 99)]
)
def test_the_interval_of_a_fraction_is_wilsons(count: int, number: int, confidence_percent: float) -> None:
    is_so = np.arange(number) < count
    expected = stats.binomtest(count, number).proportion_ci(confidence_percent / 100.0, method="wilson")
    found = fraction(is_so, confidence_percent)
    assert (found.count, found.fraction) == (count, count / number)
    assert found.low == pytest.approx(expected.low, rel=1e-12, abs=1e-15)
    assert found.high == pytest.approx(expected.high, rel=1e-12)
    assert 0.0 <= found.low <= found.fraction <= found.high <= 1.0


def test_a_published_wilson_interval() -> None:
    """Newcombe, Statistics in Medicine 17 (1998), table I: 81 of 263 gives 0.2553 to 0.3662."""
    found = fraction(np.arange(263) < 81, 95.0)
    assert (round(found.low, 4), round(found.high, 4)) == (0.2553, 0.3662)


def test_a_statistic_has_the_spread_of_a_sample() -> None:
    """Of 1, 2, 3, 6: mean 3, sum of squares 14, divided by 3; the interval is 1.96 spreads of the mean."""
    found = statistic(np.array([1.0, 2.0, 3.0, 6.0]), 95.0)
    spread = np.sqrt(14.0 / 3.0)
    assert (found.mean, found.minimum, found.maximum) == (3.0, 1.0, 6.0)
    assert found.standard_deviation == pytest.approx(spread, rel=1e-14)
    assert found.high - 3.0 == pytest.approx(1.959963984540054 * spread / 2.0, rel=1e-12)
    assert found.low + found.high == pytest.approx(6.0, rel=1e-14)


def test_one_case_alone_has_no_spread() -> None:
    found = statistic(np.array([4.0]), 95.0)
    assert (found.mean, found.standard_deviation, found.low, found.high) == (4.0, 0.0, 4.0, 4.0)


@pytest.mark.parametrize(
    ("percent", "number"), [(50.0, 21), (90.0, 200), (99.0, 200), (99.0, 1000), (1.0, 1000)]
)
def test_the_interval_of_a_percentile_holds_it_as_often_as_it_says(percent: float, number: int) -> None:
    """Of a uniform sample the r-th value is beta distributed, whatever the law of the flights."""
    share, found = percent / 100.0, percentile(np.arange(1.0, number + 1.0), percent, 90.0)
    assert found.value == np.ceil(share * number - 1e-9)
    for end, is_low in ((found.low, True), (found.high, False)):
        if end is None:
            continue
        passed = stats.beta(end, number + 1 - end)
        # the chance that the end lies on the wrong side of the percentile, and that the next would
        wrong = passed.sf(share) if is_low else passed.cdf(share)
        assert wrong <= 0.05
        nearer = end + 1 if is_low else end - 1
        law = stats.beta(nearer, number + 1 - nearer)
        assert (law.sf(share) if is_low else law.cdf(share)) > 0.05
    assert (found.high is None) == (share**number > 0.05)
    assert (found.low is None) == ((1.0 - share) ** number > 0.05)


def test_rank_correlation_is_scipys() -> None:
    generator = np.random.default_rng(5)
    first = generator.normal(size=300)
    second = np.round(np.exp(0.7 * first + generator.normal(size=300)), 1)
    found = rank_correlation(first, second, 95.0)
    assert found.value == pytest.approx(stats.spearmanr(first, second).statistic, rel=1e-12)
    bootstrap = stats.bootstrap(
        (first, second), lambda x, y: stats.spearmanr(x, y).statistic, paired=True, vectorized=False,
        n_resamples=400, method="percentile", random_state=generator,
    )  # fmt: skip
    assert found.low == pytest.approx(bootstrap.confidence_interval.low, abs=0.03)
    assert found.high == pytest.approx(bootstrap.confidence_interval.high, abs=0.03)
    assert rank_correlation(first, np.ones(300), 95.0).value == 0.0
