"""Discrete-time robustness: by how much recorded flights satisfy a formula, for many flights at once.

Robustness: Fainekos and Pappas, "Robustness of temporal logic specifications for continuous-time signals",
Theoretical Computer Science 410, 2009; Donze and Maler, FORMATS 2010. A comparison's is its margin, ``and``
and ``always`` take the minimum, ``or`` and ``eventually`` the maximum. A formula holds above zero and fails
below, and this remains so while no comparison's value changes by as much as the margin.

Windows are cut at the end of a flight, as in rtamt: beyond it ``always`` requires nothing, and
``eventually`` finds nothing.
"""

from collections.abc import Callable, Mapping
from math import ceil, floor, isinf

import numpy as np
from numpy.typing import NDArray

from pipeline.array_types import Floats
from pipeline.evaluation.assurance.formula import (
    Always,
    And,
    Comparison,
    Eventually,
    Formula,
    Not,
    Or,
    Until,
    Window,
)

Quantities = Mapping[str, Floats]
Atom = Callable[[Comparison, Quantities], Floats]

#: tolerance for a window's end on a sample, as a fraction of the sample period
NEAR_A_SAMPLE = 1e-9


def robustness(formula: Formula, quantities: Quantities, period_s: float) -> Floats:
    """Return the margin by which each flight satisfies a formula at its first sample.

    Parameters
    ----------
    formula : Formula
    quantities : mapping of str to (n, S) array
        Samples of each quantity, one row per flight.
    period_s : float
        Between two samples.

    Returns
    -------
    (n,) array
        In the formula's unit; infinite if the flight does not determine it.
    """
    return _over(formula, quantities, period_s, _margin)[:, 0]


def holds(formula: Formula, quantities: Quantities, period_s: float) -> NDArray[np.bool_]:
    """Return whether each flight satisfies a formula, (n,); unlike a zero margin, this tells > from >=."""
    return _over(formula, quantities, period_s, _truth)[:, 0] > 0.0


def idle_window(formula: Formula, duration_s: float, period_s: float, now: int = 0) -> Window | None:
    """Return the first window of a formula that holds no sample of a flight, so that its part says nothing.

    Parameters
    ----------
    formula : Formula
    duration_s : float
        Of the flight.
    period_s : float
        Between two samples.
    now : int
        The first sample at which the formula is asked for.
    """
    match formula:
        case Not(part):
            asked = [(part, now)]
        case And(left, right) | Or(left, right):
            asked = [(left, now), (right, now)]
        case Always(window, part) | Eventually(window, part) | Until(window, _, part):
            first, last = _in_samples(window, period_s)
            if (last is not None and last < first) or now + first > round(duration_s / period_s):
                return window
            asked = [(part, now + first), *([(formula.left, now)] if isinstance(formula, Until) else [])]
        case _:
            asked = []
    found = (idle_window(part, duration_s, period_s, begins) for part, begins in asked)
    return next((window for window in found if window is not None), None)


def _margin(comparison: Comparison, quantities: Quantities) -> Floats:
    total = np.zeros(np.shape(quantities[comparison.factors[0][0]])) + comparison.constant
    for name, factor in comparison.factors:
        total += factor * np.asarray(quantities[name], dtype=np.float64)
    return total


def _truth(comparison: Comparison, quantities: Quantities) -> Floats:
    """Return 1 where a comparison holds and -1 where it does not."""
    margin = _margin(comparison, quantities)
    return np.where(margin > 0.0 if comparison.is_strict else margin >= 0.0, 1.0, -1.0)


def _over(  # noqa: PLR0911 - one for each kind of formula
    formula: Formula, quantities: Quantities, period_s: float, atom: Atom
) -> Floats:
    """Return the value of a formula at all samples, (n, S)."""

    def value(part: Formula) -> Floats:
        return _over(part, quantities, period_s, atom)

    match formula:
        case Comparison():
            return atom(formula, quantities)
        case Not(part):
            return -value(part)
        case And(left, right):
            return np.minimum(value(left), value(right))
        case Or(left, right):
            return np.maximum(value(left), value(right))
        case Always(window, part):
            return _least_ahead(value(part), *_in_samples(window, period_s))
        case Eventually(window, part):
            return -_least_ahead(-value(part), *_in_samples(window, period_s))
        case Until(window, left, right):
            return _until(value(left), value(right), *_in_samples(window, period_s))


def _in_samples(window: Window, period_s: float) -> tuple[int, int | None]:
    """Return the first and the last sample of a window, counted from now; None for the flight's last."""
    first = ceil(window.first_s / period_s - NEAR_A_SAMPLE)
    return first, None if isinf(window.last_s) else floor(window.last_s / period_s + NEAR_A_SAMPLE)


def _least_ahead(values: Floats, first: int, last: int | None) -> Floats:
    """Return at each sample the minimum from `first` to `last` samples ahead; infinity without any."""
    num_samples = values.shape[1]
    ahead = _ahead(values, first, np.inf)
    if last is not None and last < first:
        return np.full_like(values, np.inf)
    if last is None or last - first >= num_samples - 1:
        return np.minimum.accumulate(ahead[:, ::-1], axis=1)[:, ::-1]
    # minima over 1, 2, 4 ... samples; the window is covered by two of the longest that fit
    width, covered = last - first + 1, 1
    while 2 * covered <= width:
        ahead = np.minimum(ahead, _ahead(ahead, covered, np.inf))
        covered *= 2
    return np.minimum(ahead, _ahead(ahead, width - covered, np.inf))


def _until(left: Floats, right: Floats, first: int, last: int | None) -> Floats:
    """Return the value of `Until` at each sample."""
    num_samples = left.shape[1]
    last = num_samples - 1 if last is None else min(last, num_samples - 1)
    found = np.full_like(left, -np.inf)
    before = np.full_like(left, np.inf)
    for count in range(last + 1):
        if count >= first:
            found = np.maximum(found, np.minimum(before, _ahead(right, count, -np.inf)))
        before = np.minimum(before, _ahead(left, count, -np.inf))
    return found


def _ahead(values: Floats, count: int, beyond: float) -> Floats:
    """Return the values `count` samples later, with `beyond` after the last."""
    if count == 0:
        return values
    later = np.full_like(values, beyond)
    later[:, :-count] = values[:, count:]
    return later
