"""Means with their intervals, and shares of cases with theirs."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.array_types import Floats


@dataclass(frozen=True)
class Statistic:
    """A mean with its spread: standard deviation (ddof = 1) and confidence interval of the mean."""

    mean: float
    standard_deviation: float
    minimum: float
    maximum: float
    low: float
    high: float


@dataclass(frozen=True)
class Fraction:
    """A share of cases with its Wilson interval."""

    count: int
    fraction: float
    low: float
    high: float


def statistic(values: Floats, confidence_percent: float) -> Statistic:
    """Return the statistics of a sample of at least one value; the interval of the mean is normal."""
    values = np.asarray(values, dtype=np.float64)
    spread = float(values.std(ddof=1)) if len(values) > 1 else 0.0
    mean = float(values.mean())
    reach = _z(confidence_percent) * spread / math.sqrt(len(values))
    return Statistic(mean, spread, float(values.min()), float(values.max()), mean - reach, mean + reach)


def fraction(is_so: NDArray[np.bool_], confidence_percent: float) -> Fraction:
    """Return the share of true values, with the interval of Wilson (J. Am. Stat. Assoc. 22, 1927)."""
    count, number = int(np.sum(is_so)), len(is_so)
    z = _z(confidence_percent)
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
    return Percentile(
        percent,
        float(np.quantile(ordered, share, method="inverted_cdf")),
        float(ordered[below - 1]) if below >= 1 else None,
        float(ordered[above - 1]) if above <= number else None,
    )


def binomial_quantile(probability: float, number: int, share: float) -> int:
    """Return the quantile of a binomial distribution."""
    # as `scipy.stats.binom.ppf` computes it, which takes half a second to import
    from scipy.special import bdtr, bdtrik  # noqa: PLC0415 - slower to import than a thousand flights

    count = math.ceil(bdtrik(probability, number, share))
    return count - 1 if count > 0 and bdtr(count - 1, number, share) >= probability else count


def rank_correlation(first: Floats, second: Floats, confidence_percent: float) -> Correlation:
    """Return Spearman's correlation, zero if one of the two is constant.

    Its interval is by Fisher's transformation, with the variance of Bonett and
    Wright (Psychometrika 65, 2000).
    """
    from scipy.stats import rankdata  # noqa: PLC0415 - as in `binomial_quantile`

    ranks = [rankdata(values) - (len(values) + 1) / 2.0 for values in (first, second)]
    spread = math.sqrt(float(ranks[0] @ ranks[0]) * float(ranks[1] @ ranks[1]))
    value = float(ranks[0] @ ranks[1]) / spread if spread > 0.0 else 0.0
    if len(first) < 4:
        return Correlation(value, -1.0, 1.0)
    reach = _z(confidence_percent) * math.sqrt((1.0 + value * value / 2.0) / (len(first) - 3))
    middle = math.atanh(max(-1.0 + 1e-12, min(1.0 - 1e-12, value)))
    return Correlation(value, math.tanh(middle - reach), math.tanh(middle + reach))


def _z(confidence_percent: float) -> float:
    from scipy.special import ndtri  # noqa: PLC0415 - slower to import than a thousand flights

    return float(ndtri(0.5 + confidence_percent / 200.0))
