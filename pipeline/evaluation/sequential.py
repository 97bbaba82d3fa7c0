"""Flights that end once an interval is narrow enough, and intervals that hold for all numbers of flights.

An interval for a fixed number of flights does not hold where the flights themselves decide when they end.
Those here contain the truth for all numbers at once with the asked confidence. Of a share p: all values under
which ``(n + 1) C(n, k) p^k (1 - p)^(n - k)`` exceeds one minus the confidence (H. Robbins, Statistical
methods related to the law of the iterated logarithm, Annals of Mathematical Statistics 41, 1970). Of a mean,
as the number grows: the asymptotic confidence sequence of I. Waudby-Smith, D. Arbour, R. Sinha, E. Kennedy
and A. Ramdas (Time-uniform central limit theory and asymptotic confidence sequences, Annals of Statistics 52,
2024).
"""

import math
from bisect import bisect_left
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np

from pipeline.array_types import Floats
from pipeline.evaluation.monte_carlo import SUCCESS, greatest_mean
from pipeline.evaluation.statistics import RANKED, Columns, correlation_ends, succeeds

#: cases between two looks at the interval, counted from the first
LOOK_CASES: Final = 1000
#: the number of flights at which intervals of means are relatively narrowest
NARROWEST: Final = 10_000


def share_interval(count: int, number: int, confidence_percent: float) -> tuple[float, float]:
    """Return the interval of a share of which `count` of `number` flights have been seen."""
    return (
        0.0 if count == 0 else _end(count, number, confidence_percent, 0.0),
        1.0 if count == number else _end(count, number, confidence_percent, 1.0),
    )


def _end(count: int, number: int, confidence_percent: float, outer: float) -> float:
    """Return the end of the interval of a share between what was seen and an outer value, 0 or 1."""
    from scipy.optimize import brentq  # noqa: PLC0415 - slower to import than a thousand flights

    seen = count / number
    ways = math.lgamma(number + 1) - math.lgamma(count + 1) - math.lgamma(number - count + 1)
    least = math.log1p(-confidence_percent / 100.0) - math.log1p(number) - ways

    def excess(share: float) -> float:
        with np.errstate(divide="ignore"):
            of_seen = count * np.log(share) if count else 0.0
            of_others = (number - count) * np.log1p(-share) if count < number else 0.0
        return max(float(of_seen + of_others - least), -1e300)

    return float(brentq(excess, outer, seen, xtol=1e-15, rtol=1e-12))


def quantile(number: int, confidence_percent: float) -> float:
    """Return what takes the place of the normal quantile of a two-sided confidence for a mean."""
    risk = 1.0 - confidence_percent / 100.0
    spread = (-2.0 * math.log(risk) + math.log(-2.0 * math.log(risk) + 1.0)) / NARROWEST
    times = number * spread + 1.0
    return math.sqrt(2.0 * times / (number * spread) * math.log(math.sqrt(times) / risk))


def order_ranks(number: int, share: float, confidence_percent: float) -> tuple[int, int]:
    """Return the ranks, from 0, of the values between which a quantile lies; -1, and the number, if none.

    For all numbers at once: how many values are below a quantile is a count of trials with its share, which
    is one of those whose `share_interval` contains it.
    """
    least = math.log1p(-confidence_percent / 100.0) - math.log1p(number)

    def is_likely(count: int) -> bool:
        ways = math.lgamma(number + 1) - math.lgamma(count + 1) - math.lgamma(number - count + 1)
        return ways + count * math.log(share) + (number - count) * math.log1p(-share) > least

    middle = min(number, int((number + 1) * share))
    lowest = bisect_left(range(middle), True, key=is_likely)
    above = range(middle + 1, number + 1)
    return lowest - 1, middle + bisect_left(above, True, key=lambda count: not is_likely(count))


@dataclass
class Stop:
    """Where flights end: as soon as the interval of a quantity is narrow enough, at a look.

    Parameters
    ----------
    quantity : str
        Of `pipeline.settings.experiment.MonteCarlo.stop_quantity`, or another column of true and false.
    width : float
    confidence_percent : float
    """

    quantity: str
    width: float
    confidence_percent: float
    _number: int = field(default=0, init=False)
    _sums: Floats = field(default_factory=lambda: np.zeros(2), init=False)
    _waiting: dict[int, Floats] = field(default_factory=dict, init=False)

    def take(self, first: int, columns: Columns) -> int | None:
        """Take the flights of a part, of cases counted from 0 up; return their number at the end, if it is.

        Parts may come in any order, and are looked at in that of their cases.
        """
        self._waiting[first] = self._values(columns)
        while (values := self._waiting.pop(self._number, None)) is not None:
            while len(values):
                block, values = np.split(values, [LOOK_CASES - self._number % LOOK_CASES])
                self._number += len(block)
                self._sums += math.fsum(block), math.fsum(block * block)
                if self._number % LOOK_CASES == 0 and self._is_narrow():
                    return self._number
        return None

    def _values(self, columns: Columns) -> Floats:
        of = succeeds(columns) if self.quantity == SUCCESS else columns[self.quantity]
        return np.asarray(of, dtype=np.float64)

    def _is_narrow(self) -> bool:
        number, (first, second) = self._number, self._sums.tolist()
        if self.quantity != "delta_v_m_s":
            low, high = share_interval(round(first), number, self.confidence_percent)
            return high - low <= self.width
        deviation = math.sqrt(max(0.0, second - first * first / number) / (number - 1))
        return 2.0 * quantile(number, self.confidence_percent) * deviation / math.sqrt(number) <= self.width


def for_any_number(
    summary: Mapping[str, Any], number: int, confidence_percent: float
) -> dict[str, dict[str, Any]]:
    """Return a summary with intervals that hold for all numbers of flights, see `monte_carlo.summarise`."""
    return {
        name: _between(entry, _ends(name, entry, number, confidence_percent))
        for name, entry in summary.items()
    }


def _between(entry: Mapping[str, Any], ends: tuple[float | None, float | None]) -> dict[str, Any]:
    """Return an entry of a summary with another interval."""
    return {**entry, "low": ends[0], "high": ends[1]}


def _ends(
    name: str, entry: Mapping[str, Any], number: int, confidence_percent: float
) -> tuple[float | None, float | None]:
    """Return the interval of a share or of a mean in a summary."""
    if "fraction" in entry:
        return share_interval(entry["count"], number, confidence_percent)
    if entry["standard_deviation"] is None:
        return None, None
    reach = quantile(number, confidence_percent) * entry["standard_deviation"] / math.sqrt(number)
    return max(entry["mean"] - reach, 0.0), min(entry["mean"] + reach, greatest_mean(name))


def correlations_for_any_number(
    ranked: Mapping[str, Any], number: int, confidence_percent: float
) -> dict[str, Any]:
    """Return an entry of `statistics.sensitivity` with intervals that hold for all numbers of flights."""
    factor = quantile(number, confidence_percent)
    return {
        name: _between(entry, correlation_ends(entry["value"], number, factor)) if name in RANKED else entry
        for name, entry in ranked.items()
    }
