"""What n cases come to for a claim.

A requirement claims that, with some confidence, at least a share of all cases meets it. Hanson and Beard,
"Applying Monte Carlo Simulation to Launch Vehicle Design and Requirements Analysis", NASA/TP-2010-216447,
2010, give the number of cases that such a claim needs for each allowed failure; their consumer's risk is one
minus the confidence. The bounds are those of Clopper and Pearson, Biometrika 26, 1934, one-sided.
"""

from bisect import bisect_left
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from pipeline.array_types import Floats
from pipeline.evaluation import sequential

Verdict = Literal["shown", "shown in part", "not shown", "refuted"]
#: from the best to the worst
ORDER: tuple[Verdict, ...] = get_args(Verdict)


@dataclass(frozen=True)
class Tried:
    """What earlier tries of a claim leave to the next one.

    Parameters
    ----------
    num_tries : int
    num_known : int
        Of the cases, so many from the first on were flown before; they do not count again.
    risk : float
        That the claim is shown though it is not true.
    refuted_by : str
        Where it was refuted; empty if nowhere.
    """

    num_tries: int
    num_known: int
    risk: float
    refuted_by: str = ""


@dataclass(frozen=True)
class Judgement:
    """The result of n cases for a claim.

    Parameters
    ----------
    verdict : str
        ``shown``: the lower bound of the share that meets it is at least the claimed one; ``refuted``: the
        upper bound is below; else ``not shown``.
    num_cases, num_failed, num_allowed : int
        Flown, without those that earlier tries flew; not met; and most failures for which the claim would
        still be shown (-1: too few cases).
    low, high : float
        One-sided bounds of the share that meets it, each with the claim's confidence.
    margin : float, optional
        With the claim's confidence, at least the claimed share of cases has this margin or more; None if
        there are too few cases.
    worst_margin, median_margin : float
    premises : dict of str to int
        In how many cases the premise of each implication occurs, by its text.
    confidence : float
        With which the cases are judged: above the claim's after other tries.
    num_tries, num_known, num_known_failed : int
        Earlier tries; cases that these flew; and how many of them do not meet it.
    refuted_by : str
        Where another try refuted the claim.
    is_sequential : bool
        Whether the flights themselves decided when they end: bounds then hold for any number of flights.
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
    premises: dict[str, int] = field(default_factory=dict)
    confidence: float = 0.0
    num_tries: int = 0
    num_known: int = 0
    num_known_failed: int = 0
    refuted_by: str = ""
    is_sequential: bool = False

    @property
    def idle_premises(self) -> list[str]:
        """The premises that occur in no case, of which the cases show nothing."""
        return [text for text, count in self.premises.items() if not count]


def share_bounds(num_met: int, num_cases: int, confidence: float) -> tuple[float, float]:
    """Return the lower and the upper bound of a share, each one-sided, by Clopper and Pearson."""
    from scipy.special import betaincinv  # noqa: PLC0415 - slower to import than a thousand flights

    num_failed = num_cases - num_met
    low = betaincinv(num_met, num_failed + 1, 1.0 - confidence) if num_met else 0.0
    high = betaincinv(num_met + 1, num_failed, confidence) if num_failed else 1.0
    return float(low), float(high)


def cases_needed(
    probability: float, confidence: float, num_failed: int = 0, *, is_sequential: bool = False
) -> int:
    """Return the least number of cases that shows a claim with a number of failures.

    Parameters
    ----------
    probability, confidence : float
        Both between 0 and 1.
    num_failed : int
    is_sequential : bool
        Whether the flights themselves decide when they end, see `pipeline.evaluation.sequential`.
    """

    def is_enough(num_cases: int) -> bool:
        return _shows(num_cases, num_failed, probability, confidence, is_sequential)

    most = num_failed + 1
    while not is_enough(most):
        most *= 2
    return bisect_left(range(most), True, key=is_enough)


def failures_allowed(
    num_cases: int, probability: float, confidence: float, *, is_sequential: bool = False
) -> int:
    """Return the most failures with which a number of cases shows a claim; -1 if even zero are too many.

    They always are where all cases must meet it: no number of flights shows that. See `cases_needed` for the
    parameters.
    """

    def is_too_many(num_failed: int) -> bool:
        return not _shows(num_cases, num_failed, probability, confidence, is_sequential)

    return bisect_left(range(num_cases if probability < 1.0 else 0), True, key=is_too_many) - 1


def judge(
    margins: Floats,
    is_met: NDArray[np.bool_],
    probability: float,
    confidence: float,
    premises: Mapping[str, int] | None = None,
    tried: Tried | None = None,
    *,
    is_sequential: bool = False,
) -> Judgement:
    """Judge a claim by n cases.

    Parameters
    ----------
    margins, is_met : (n,)
        The margin of each case, and whether it meets the requirement.
    probability, confidence : float
        A probability of one means all cases; a single failure refutes it.
    premises : mapping of str to int, optional
        In how many cases the premise of each implication occurs; if one never does, the claim is not shown.
    tried : Tried, optional
        What earlier tries leave.
    is_sequential : bool
        Whether the flights themselves decided when they end, see `pipeline.evaluation.sequential`.
    """
    tried = Tried(0, 0, 1.0 - confidence) if tried is None else tried
    if tried.num_tries or is_sequential:
        confidence = 1.0 - tried.risk
    is_new = is_met[tried.num_known :]
    num_cases, num_failed = len(is_new), int(np.count_nonzero(~is_new))
    allowed = failures_allowed(num_cases, probability, confidence, is_sequential=is_sequential)
    bounds = _sequential_bounds if is_sequential else share_bounds
    low, high = bounds(num_cases - num_failed, num_cases, confidence)
    ascending = np.sort(margins[tried.num_known :])
    verdict: Verdict = "shown" if num_failed <= allowed else "refuted" if high < probability else "not shown"
    occurred = dict(premises or {})
    if verdict == "shown" and not all(occurred.values()):
        verdict = "not shown"
    if tried.refuted_by:
        verdict = "refuted"
    return Judgement(
        verdict=verdict,
        num_cases=num_cases,
        num_failed=num_failed,
        num_allowed=allowed,
        low=low,
        high=high,
        margin=float(ascending[allowed]) if allowed >= 0 else None,
        worst_margin=float(np.min(margins)),
        median_margin=float(np.median(margins)),
        premises=occurred,
        confidence=confidence,
        num_tries=tried.num_tries,
        num_known=tried.num_known,
        num_known_failed=int(np.count_nonzero(~is_met[: tried.num_known])),
        refuted_by=tried.refuted_by,
        is_sequential=is_sequential,
    )


def _sequential_bounds(num_met: int, num_cases: int, confidence: float) -> tuple[float, float]:
    """Return bounds of a share that hold for all numbers of cases at once; none of no case."""
    return sequential.share_interval(num_met, num_cases, 100.0 * confidence) if num_cases else (0.0, 1.0)


def needed_by(judgement: Judgement, probability: float) -> int:
    """Return how many cases without a failure would show the claim of a judgement."""
    return cases_needed(probability, judgement.confidence, is_sequential=judgement.is_sequential)


def _shows(
    num_cases: int, num_failed: int, probability: float, confidence: float, is_sequential: bool
) -> bool:
    """Return whether so few failures would be unlikely if the share were just below the claimed one."""
    from scipy.special import bdtr  # noqa: PLC0415 - as above

    if num_failed >= num_cases:
        return False
    if is_sequential:
        return _sequential_bounds(num_cases - num_failed, num_cases, confidence)[0] >= probability
    return bool(bdtr(num_failed, num_cases, 1.0 - probability) <= 1.0 - confidence)
