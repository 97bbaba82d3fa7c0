"""What flights demonstrate of a claim about a share of all cases.

A requirement claims that, with some confidence, at least a share of all cases meets it. Hanson and Beard,
"Applying Monte Carlo Simulation to Launch Vehicle Design and Requirements Analysis", NASA/TP-2010-216447,
2010, give the number of cases that such a claim needs for each allowed failure; their consumer's risk is one
minus the confidence. The bounds are those of Clopper and Pearson, Biometrika 26, 1934, one-sided.
"""

from bisect import bisect_left
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pipeline.array_types import Floats

Verdict = Literal["shown", "refuted", "open"]


@dataclass(frozen=True)
class Judgement:
    """The result of n cases for a claim.

    Parameters
    ----------
    verdict : str
        ``shown``: the lower bound of the share that meets it is at least the claimed one; ``refuted``: the
        upper bound is below; else ``open``.
    num_cases, num_failed, num_allowed : int
        Flown; not met; and most failures for which the claim would still be shown (-1: too few cases).
    low, high : float
        One-sided bounds of the share that meets it, each with the claim's confidence.
    margin : float, optional
        With the claim's confidence, at least the claimed share of cases has this margin or more; None if
        there are too few cases.
    worst_margin, median_margin : float
    """

    verdict: Verdict
    num_cases: int
    num_failed: int
    num_allowed: int
    low: float
    high: float
    margin: float | None
    worst_margin: float
    median_margin: float


def share_bounds(num_met: int, num_cases: int, confidence: float) -> tuple[float, float]:
    """Return the lower and the upper bound of a share, each one-sided, by Clopper and Pearson."""
    from scipy.special import betaincinv  # noqa: PLC0415 - slower to import than a thousand flights

    num_failed = num_cases - num_met
    low = betaincinv(num_met, num_failed + 1, 1.0 - confidence) if num_met else 0.0
    high = betaincinv(num_met + 1, num_failed, confidence) if num_failed else 1.0
    return float(low), float(high)


def cases_needed(probability: float, confidence: float, num_failed: int = 0) -> int:
    """Return the least number of cases that shows a claim with a number of failures.

    Parameters
    ----------
    probability, confidence : float
        Both between 0 and 1.
    num_failed : int
    """
    most = num_failed + 1
    while not _shows(most, num_failed, probability, confidence):
        most *= 2
    return bisect_left(range(most), True, key=lambda num: _shows(num, num_failed, probability, confidence))


def failures_allowed(num_cases: int, probability: float, confidence: float) -> int:
    """Return the most failures with which a number of cases shows a claim; -1 if even zero are too many.

    They always are where all cases must meet it: no number of flights shows that.
    """

    def is_too_many(num_failed: int) -> bool:
        return not _shows(num_cases, num_failed, probability, confidence)

    return bisect_left(range(num_cases if probability < 1.0 else 0), True, key=is_too_many) - 1


def judge(margins: Floats, is_met: NDArray[np.bool_], probability: float, confidence: float) -> Judgement:
    """Evaluate a claim from the margins of its cases, (n,), and whether each meets it, (n,).

    A probability of one means all cases; a single failure refutes it.
    """
    num_cases, num_failed = len(margins), int(np.count_nonzero(~is_met))
    allowed = failures_allowed(num_cases, probability, confidence)
    low, high = share_bounds(num_cases - num_failed, num_cases, confidence)
    ascending = np.sort(margins)
    return Judgement(
        verdict="shown" if num_failed <= allowed else "refuted" if high < probability else "open",
        num_cases=num_cases,
        num_failed=num_failed,
        num_allowed=allowed,
        low=low,
        high=high,
        margin=float(ascending[allowed]) if allowed >= 0 else None,
        worst_margin=float(ascending[0]),
        median_margin=float(np.median(margins)),
    )


def _shows(num_cases: int, num_failed: int, probability: float, confidence: float) -> bool:
    """Return whether so few failures would be unlikely if the share were just below the claimed one."""
    from scipy.special import bdtr  # noqa: PLC0415 - as above

    return bool(num_failed < num_cases and bdtr(num_failed, num_cases, 1.0 - probability) <= 1.0 - confidence)
