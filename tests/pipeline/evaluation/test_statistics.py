"""Statistics against numbers worked out by hand, and intervals against scipy's."""

import numpy as np
import pytest
from scipy import stats

from pipeline.evaluation.statistics import fraction, statistic


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
