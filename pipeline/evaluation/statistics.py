"""Means with their intervals, and shares of cases with theirs."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


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
    """Describe a sample of at least one value; the interval of the mean is normal."""
    values = np.asarray(values, dtype=np.float64)
    spread = float(values.std(ddof=1)) if len(values) > 1 else 0.0
    mean = float(values.mean())
    reach = _z(confidence_percent) * spread / math.sqrt(len(values))
    return Statistic(mean, spread, float(values.min()), float(values.max()), mean - reach, mean + reach)


def fraction(is_so: NDArray[np.bool_], confidence_percent: float) -> Fraction:
    """Describe how often something happens, with the interval of Wilson (J. Am. Stat. Assoc. 22, 1927)."""
    count, number = int(np.sum(is_so)), len(is_so)
    z = _z(confidence_percent)
    share = count / number
    scale = 1.0 + z * z / number
    middle = (share + z * z / (2 * number)) / scale
    reach = z / scale * math.sqrt(share * (1.0 - share) / number + z * z / (4.0 * number * number))
    # the interval holds the share; at 0 and 1 rounding must not part them
    low, high = min(share, middle - reach), max(share, middle + reach)
    return Fraction(count, share, max(0.0, low), min(1.0, high))


def _z(confidence_percent: float) -> float:
    from scipy.special import ndtri  # noqa: PLC0415 - takes longer to import than a thousand flights take

    return float(ndtri(0.5 + confidence_percent / 200.0))
