"""Statistics of many flights: means, shares, percentiles and correlations, with their intervals."""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.array_types import Floats


@dataclass(frozen=True)
class Statistic:
    """A mean with its spread: standard deviation (ddof = 1) and confidence interval of the mean.

    A single value has no spread and no interval: they are None.
    """

    mean: float
    standard_deviation: float | None
    minimum: float
    maximum: float
    low: float | None
    high: float | None


@dataclass(frozen=True)
class Fraction:
    """A share of cases with its Wilson interval."""

    count: int
    fraction: float
    low: float
    high: float


def statistic(
    values: Floats, confidence_percent: float, least: float = -math.inf, most: float = math.inf
) -> Statistic:
    """Return the statistics of a sample of at least one value.

    The interval of the mean is Student's t, cut off at the least and the most that a mean can be.
    """
    values = np.asarray(values, dtype=np.float64)
    mean, ends = float(values.mean()), (float(values.min()), float(values.max()))
    if len(values) < 2:
        return Statistic(mean, None, *ends, None, None)
    reach = students_half_width(values, confidence_percent)
    low, high = max(mean - reach, least), min(mean + reach, most)
    return Statistic(mean, float(values.std(ddof=1)), *ends, low, high)


#: resamples of a bootstrap, and the seed with which they are drawn: the same flights have the same interval
NUM_RESAMPLES, RESAMPLING_SEED = 10_000, 0


def bootstrap_interval(values: Floats, confidence_percent: float) -> tuple[float, float] | None:
    """Return the interval of a mean by percentiles of resampled means, for numbers whose law is skewed.

    (Efron and Tibshirani, An Introduction to the Bootstrap, 1993, chapter 13.) None of a single value.
    """
    if len(values) < 2:
        return None
    rows = np.random.default_rng(RESAMPLING_SEED).integers(0, len(values), (NUM_RESAMPLES, len(values)))
    tail = 50.0 - confidence_percent / 2.0
    low, high = np.percentile(values[rows].mean(axis=1), (tail, 100.0 - tail))
    return float(low), float(high)


def students_half_width(values: Floats, confidence_percent: float) -> float:
    """Return half the width of Student's t interval of the mean of at least two values."""
    from scipy.special import stdtrit  # noqa: PLC0415 - slower to import than a thousand flights

    number = len(values)
    quantile = float(stdtrit(number - 1, 0.5 + confidence_percent / 200.0))
    return quantile * float(values.std(ddof=1)) / math.sqrt(number)


def fraction(is_so: NDArray[np.bool_], confidence_percent: float) -> Fraction:
    """Return the share of true values with its interval, see `share_of`."""
    return share_of(int(np.sum(is_so)), len(is_so), confidence_percent)


def share_of(count: int, number: int, confidence_percent: float) -> Fraction:
    """Return a share of some number, with the interval of Wilson (J. Am. Stat. Assoc. 22, 1927)."""
    z = normal_quantile(confidence_percent)
    share = count / number
    scale = 1.0 + z * z / number
    middle = (share + z * z / (2 * number)) / scale
    reach = z / scale * math.sqrt(share * (1.0 - share) / number + z * z / (4.0 * number * number))
    # the interval contains the share; at 0 and 1 rounding must not exclude it
    low, high = min(share, middle - reach), max(share, middle + reach)
    return Fraction(count, share, max(0.0, low), min(1.0, high))


@dataclass(frozen=True)
class Percentile:
    """A value that a share of all flights does not exceed, with a distribution-free interval.

    Parameters
    ----------
    percent : float
    value : float
        Of the sample.
    low, high : float, optional
        None if the sample is too small.
    """

    percent: float
    value: float
    low: float | None
    high: float | None


@dataclass(frozen=True)
class Correlation:
    """Spearman's rank correlation with its interval."""

    value: float
    low: float
    high: float


def percentile(values: Floats, percent: float, confidence_percent: float) -> Percentile:
    """Return a percentile by order statistics: the number of values below it is binomial.

    Each tail of the interval has half of the remaining probability (Hanson and Beard,
    NASA/TP-2010-216447; Wilks, Ann. Math. Stat. 12, 1941).
    """
    ordered, share, number = np.sort(values), percent / 100.0, len(values)
    tail = 0.5 - confidence_percent / 200.0
    # P(fewer than r of n lie below the percentile) is at most the tail, for the greatest such r; and so above
    below = binomial_quantile(tail, number, share)
    above = binomial_quantile(1.0 - tail, number, share) + 1
    value = float(np.quantile(ordered, share, method="inverted_cdf"))
    low = float(ordered[below - 1]) if below >= 1 else None
    return Percentile(percent, value, low, float(ordered[above - 1]) if above <= number else None)


def binomial_quantile(probability: float, number: int, share: float) -> int:
    """Return the quantile of a binomial distribution."""
    # as `scipy.stats.binom.ppf` computes it, which takes half a second to import
    from scipy.special import bdtr, bdtrik  # noqa: PLC0415 - slower to import than a thousand flights

    count = math.ceil(bdtrik(probability, number, share))
    return count - 1 if count > 0 and bdtr(count - 1, number, share) >= probability else count


def correlation_ends(value: float, number: int, quantile: float) -> tuple[float, float]:
    """Return the interval of a rank correlation, of a number of pairs and a normal quantile."""
    if number < 4:
        return -1.0, 1.0
    reach = quantile * math.sqrt((1.0 + value * value / 2.0) / (number - 3))
    middle = math.atanh(max(-1.0 + 1e-12, min(1.0 - 1e-12, value)))
    return math.tanh(middle - reach), math.tanh(middle + reach)


def normal_quantile(confidence_percent: float) -> float:
    """Return the standard normal quantile of a two-sided confidence."""
    from scipy.special import ndtri  # noqa: PLC0415 - slower to import than a thousand flights

    return float(ndtri(0.5 + confidence_percent / 200.0))


Column = NDArray[Any]
Columns = Mapping[str, Column]

#: percentiles of the flights: upper ones of delta-v and greatest distance, lower ones of rate
#: and least distance
PERCENTS: Mapping[str, tuple[float, ...]] = {
    "delta_v_m_s": (50.0, 90.0, 99.0),
    "inspectable_rate_percent": (50.0, 10.0, 1.0),
    "max_distance_m": (50.0, 90.0, 99.0),
    "min_distance_m": (50.0, 10.0, 1.0),
}
#: quantities that dispersions are ranked by
RANKED = ("delta_v_m_s", "inspectable_rate_percent")


def percentiles(episodes: Columns, confidence_percent: float) -> dict[str, list[dict[str, Any]]]:
    """Return percentiles with intervals by column, see `PERCENTS`."""
    return {
        name: [asdict(percentile(episodes[name], percent, confidence_percent)) for percent in percents]
        for name, percents in PERCENTS.items()
    }


def percent_ahead(delta_v_m_s: Floats | float, ahead_m_s: Floats | float) -> float:
    """Return which share of the fuel of flights was chosen ahead, by foresight or rehearsals, in per cent."""
    ahead = float(np.sum(ahead_m_s))
    return min(100.0, 100.0 * ahead / float(np.sum(delta_v_m_s))) if ahead > 0.0 else 0.0


def by_rules(percent: float) -> str:
    """Return which share of the fuel rules fired, in words, where some was chosen ahead, in per cent."""
    return f", {100.0 - percent:.1f} % of it by rules" if percent > 0.0 else ""


def succeeds(episodes: Columns) -> NDArray[np.bool_]:
    """Return which flights succeed: they inspect enough, and stay inside the limits."""
    return np.asarray(episodes["success"]) & ~np.asarray(episodes["violated"])
