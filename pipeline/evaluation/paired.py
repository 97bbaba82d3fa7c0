"""Differences between runs on the same cases: how large, how sure, and which are shown.

An interval says how large a difference may be; whether there is one is said by a test, which is exact where
flights succeed or fail. Where several differences stand in one table, each is a chance to be wrong, so that
their tests are judged together (`shown`).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.array_types import Floats
from pipeline.evaluation.statistics import normal_quantile, students_half_width

#: shares differ by at most so many percentage points
MOST_POINTS = 100.0
#: relative differences below which numbers are alike
ROUNDING = 1e-12
#: relative step from a mean into its interval
BESIDE = 1e-9


@dataclass(frozen=True)
class PairedDifference:
    """A mean difference with its interval, and the p-value of there being none.

    Parameters
    ----------
    mean, low, high : float
        The ends are NaN where the pairs tell nothing about the spread: of a single pair, or of numbers that
        all differ alike.
    count : int
        Pairs.
    p_value : float
        1 where the pairs cannot tell.
    """

    mean: float
    low: float
    high: float
    count: int
    p_value: float

    @property
    def has_interval(self) -> bool:
        """Whether the pairs tell how large the difference may be."""
        return not math.isnan(self.low)

    def in_words(self, decimals: int) -> str:
        """Return the mean with its interval, each with its sign and a number of decimals."""
        mean = f"{self.mean:+.{decimals}f}"
        if self.has_interval:
            return f"{mean} ({self.low:+.{decimals}f} to {self.high:+.{decimals}f})"
        return f"{mean} ({'one pair' if self.count < 2 else 'all pairs alike'})"


def of_numbers(gained: Floats, confidence_percent: float) -> PairedDifference:
    """Return the mean of paired differences, at least one, with Student's t interval and Wilcoxon's test.

    Parameters
    ----------
    gained : (n,) array
        Second minus first.
    confidence_percent : float
    """
    return _of_means(gained, confidence_percent, wilcoxon(gained))


def of_runs(gained: Floats, confidence_percent: float) -> PairedDifference:
    """Return the mean over pairs of runs, each a mean of many flights, with Student's interval and t test."""
    from scipy.special import stdtr  # noqa: PLC0415 - slower to import than a thousand flights

    number, p_value = len(gained), 1.0
    if _tells(gained):
        t = float(gained.mean()) / (float(gained.std(ddof=1)) / math.sqrt(number))
        p_value = 2.0 * float(stdtr(number - 1, -abs(t)))
    return _of_means(gained, confidence_percent, p_value)


def _tells(gained: Floats) -> bool:
    """Return whether numbers tell their spread: there are two, and they differ by more than rounding."""
    return len(gained) > 1 and bool(np.ptp(gained) > ROUNDING * np.abs(gained).max())


def _of_means(gained: Floats, confidence_percent: float, p_value: float) -> PairedDifference:
    mean, number = float(gained.mean()), len(gained)
    if not _tells(gained):
        return PairedDifference(mean, math.nan, math.nan, number, p_value)
    reach = students_half_width(gained, confidence_percent)
    return PairedDifference(mean, mean - reach, mean + reach, number, p_value)


def of_shares(won: int, lost: int, count: int, confidence_percent: float) -> PairedDifference:
    """Return the difference of two shares of the same cases, in percentage points.

    The interval is Tango's by scores (Statistics in Medicine 17, 1998, 891-908), which exists at 0 and 100 %,
    the test McNemar's exact one.

    Parameters
    ----------
    won, lost : int
        Cases in which the second alone is true, and the first alone.
    count : int
        Cases, at least one.
    confidence_percent : float
    """
    mean, p_value = MOST_POINTS * (won - lost) / count, mcnemar(won, lost)
    if count < 2:
        return PairedDifference(mean, math.nan, math.nan, count, p_value)
    low, high = tango_interval(won, lost, count, confidence_percent)
    return PairedDifference(mean, MOST_POINTS * low, MOST_POINTS * high, count, p_value)


def of_averaged_shares(
    gained: Floats, won: int, lost: int, count: int, confidence_percent: float
) -> PairedDifference:
    """Return the mean of differences that are averages of shares themselves, in percentage points.

    Averages that agree by chance would have an interval of no width. So it is at least as wide as that of
    the cases behind them, and the p-value at least as large.

    Parameters
    ----------
    gained : (n,) array
        Difference of each pair of runs, or of each case over several pairs, in percentage points.
    won, lost, count : int
        Of the cases behind them, see `of_shares`; a count of 0 where runs share no cases.
    confidence_percent : float
    """
    between = of_runs(gained, confidence_percent)
    if not count or between.count < 2:
        return between
    within = of_shares(won, lost, count, confidence_percent)
    ends = [(each.low, each.high) for each in (within, between) if each.has_interval]
    low, high = (
        max(-MOST_POINTS, min(low for low, _ in ends)),
        min(MOST_POINTS, max(high for _, high in ends)),
    )
    # averages that all differ alike leave the test to the cases
    p_value = max(between.p_value, within.p_value) if between.has_interval else within.p_value
    return PairedDifference(between.mean, low, high, between.count, p_value)


def tango_interval(won: int, lost: int, count: int, confidence_percent: float) -> tuple[float, float]:
    """Return Tango's interval of the difference of two shares of the same cases, won / count - lost / count.

    It holds the differences d that the score test does not reject: those of which
    ``(won - lost - count d)^2 <= z^2 count (2 q + d - d^2)``, q being the most likely share of lost cases
    if the difference is d (Tango, Statistics in Medicine 17, 1998, equations 9 and 10).
    """
    from scipy.optimize import brentq  # noqa: PLC0415 - slower to import than a thousand flights

    z, mean = normal_quantile(confidence_percent), (won - lost) / count

    def excess(difference: float) -> float:
        b = -won - lost + (2 * count - won + lost) * difference
        c = -lost * difference * (1.0 - difference)
        share = (math.sqrt(max(0.0, b * b - 8 * count * c)) - b) / (4 * count)
        variance = count * max(0.0, 2.0 * share + difference * (1.0 - difference))
        return (won - lost - count * difference) ** 2 - z * z * variance

    def end(limit: float) -> float:
        # where no case differs, the mean itself solves the equation, and bounds nothing
        inside = mean + BESIDE * (limit - mean)
        return limit if excess(limit) <= 0.0 else float(brentq(excess, inside, limit, xtol=1e-12))

    return end(-1.0), end(1.0)


def mcnemar(won: int, lost: int) -> float:
    """Return McNemar's exact p-value (Psychometrika 12, 1947): discordant pairs are like fair coin tosses."""
    from scipy.stats import binom  # noqa: PLC0415 - slower to import than a thousand flights

    return min(1.0, 2.0 * float(binom.cdf(min(won, lost), won + lost, 0.5)))


def wilcoxon(gained: Floats) -> float:
    """Return the p-value of Wilcoxon's signed-rank test; 1 where nothing differs."""
    from scipy import stats  # noqa: PLC0415 - slower to import than a thousand flights

    return float(stats.wilcoxon(gained, axis=None).pvalue) if np.any(gained) else 1.0


def shown(p_values: Sequence[float], confidence_percent: float) -> list[bool]:
    """Return which of several differences are shown, by Holm's method (Scand. J. Statist. 6, 1979).

    With the confidence none of those that are shown is due to chance alone.
    """
    risk, order = 1.0 - confidence_percent / 100.0, np.argsort(p_values, kind="stable")
    is_shown = [False] * len(p_values)
    for rank, index in enumerate(order):
        if p_values[index] > risk / (len(p_values) - rank):
            break
        is_shown[index] = True
    return is_shown
