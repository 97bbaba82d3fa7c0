"""By how much flights satisfy a formula, and which of its parts flights decide at all.

Robustness: Fainekos and Pappas, "Robustness of temporal logic specifications for continuous-time signals",
Theoretical Computer Science 410, 2009; Donze and Maler, FORMATS 2010. A predicate's is its margin, ``and``
and ``always`` take the minimum, ``or`` and ``eventually`` the maximum. A formula holds above zero and fails
below, and this remains so while no predicate's value changes by as much as the margin. Windows are cut at
the end of a flight, as in rtamt: beyond it ``always`` requires nothing, and ``eventually`` finds nothing.
Formulas whose windows can end there are refused before anything flies, see `requirements.check_formulas`.
"""

from collections.abc import Callable, Iterator, Mapping
from math import ceil, floor, isinf

import numpy as np
from numpy.typing import NDArray

from pipeline.array_types import Floats
from pipeline.evaluation.assurance.formula import (
    Always,
    Conjunction,
    Disjunction,
    Eventually,
    Formula,
    Negation,
    Predicate,
    Until,
    Window,
    predicates,
)

Samples = Mapping[str, Floats]
Atom = Callable[[Predicate, Samples], Floats]

#: tolerance for a window's end on a sample, as a fraction of the sample period
NEAR_A_SAMPLE = 1e-9


def robustness(formula: Formula, quantities: Samples, period_s: float) -> Floats:
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
    return _evaluate(formula, quantities, period_s, _margin)[:, 0]


def holds(formula: Formula, quantities: Samples, period_s: float) -> NDArray[np.bool_]:
    """Return whether each flight satisfies a formula, (n,); unlike a zero margin, this tells > from >=."""
    return _evaluate(formula, quantities, period_s, _truth)[:, 0] > 0.0


def idle_window(formula: Formula, duration_s: float, period_s: float) -> Window | None:
    """Return the first window of a formula that contains no sample of a flight, None without one.

    Parameters
    ----------
    formula : Formula
    duration_s : float
        Of the flight.
    period_s : float
        Between two samples.
    """
    num_periods = round(duration_s / period_s)
    for window, earliest, _ in _windows(formula, period_s):
        first, last = _in_samples(window, period_s)
        if (last is not None and last < first) or earliest + first > num_periods:
            return window
    return None


def late_window(formula: Formula, duration_s: float, period_s: float) -> Window | None:
    """Return the first window of a formula that can end after a flight, as `idle_window`."""
    num_periods = round(duration_s / period_s)
    for window, _, latest in _windows(formula, period_s, num_periods):
        _, last = _in_samples(window, period_s)
        if last is not None and latest + last > num_periods:
            return window
    return None


def _windows(
    formula: Formula, period_s: float, num_periods: int = 0, earliest: int = 0, latest: int = 0
) -> Iterator[tuple[Window, int, int]]:
    """Yield the windows of a formula, each with the earliest and the latest sample at which it begins.

    One without an end ends with the flight, after `num_periods`.
    """
    parts: list[tuple[Formula, int, int]] = []
    match formula:
        case Negation(part):
            parts = [(part, earliest, latest)]
        case Conjunction(left, right) | Disjunction(left, right):
            parts = [(left, earliest, latest), (right, earliest, latest)]
        case Always(window, part) | Eventually(window, part) | Until(window, _, part):
            yield window, earliest, latest
            first, last = _in_samples(window, period_s)
            end = num_periods if last is None else latest + last
            parts = [(part, earliest + first, end)]
            parts += [(formula.left, earliest, end)] if isinstance(formula, Until) else []
    for inner, begins, ends in parts:
        yield from _windows(inner, period_s, num_periods, begins, ends)


def premises(formula: Formula, quantities: Samples, period_s: float) -> dict[Formula, NDArray[np.bool_]]:
    """Return the premise of each implication in a formula, and whether it occurs in each flight, (n,)."""
    first = next(iter(quantities.values()))
    now = np.zeros(first.shape[1], dtype=np.bool_)
    now[0] = True
    occurred: dict[Formula, NDArray[np.bool_]] = {}
    for premise, is_evaluated in _implications(formula, now, period_s):
        values = _evaluate(premise, quantities, period_s, _truth)
        holds_there = np.any((values > 0.0) & is_evaluated, axis=1)
        occurred[premise] = occurred.get(premise, False) | holds_there
    return occurred


def _implications(
    formula: Formula, now: NDArray[np.bool_], period_s: float
) -> Iterator[tuple[Formula, NDArray[np.bool_]]]:
    """Yield the premise of each implication, and the samples, (S,), at which it is evaluated.

    Parameters
    ----------
    formula : Formula
    now : (S,)
        The samples at which the formula is evaluated.
    period_s : float
    """
    match formula:
        case Negation(part):
            yield from _implications(part, now, period_s)
        case Conjunction(left, right) | Disjunction(left, right):
            if isinstance(formula, Disjunction) and isinstance(left, Negation):
                yield left.part, now
            yield from _implications(left, now, period_s)
            yield from _implications(right, now, period_s)
        case Always(window, part) | Eventually(window, part):
            yield from _implications(part, _ahead_of(now, *_in_samples(window, period_s)), period_s)
        case Until(window, left, right):
            first, last = _in_samples(window, period_s)
            yield from _implications(left, _ahead_of(now, 0, last), period_s)
            yield from _implications(right, _ahead_of(now, first, last), period_s)


def _ahead_of(now: NDArray[np.bool_], first: int, last: int | None) -> NDArray[np.bool_]:
    """Return the samples that lie `first` to `last` samples ahead of any of some samples, (S,)."""
    ahead = np.zeros_like(now)
    for sample in np.flatnonzero(now):
        ahead[sample + first : None if last is None else sample + last + 1] = True
    return ahead


def deciding_units(formula: Formula, quantities: Samples, margins: Floats) -> NDArray[np.str_]:
    """Return the unit of the predicate that decides each flight's margin, (n,).

    A robustness is the value of a predicate at some sample, or its opposite.
    """
    units = np.full(len(margins), "", dtype=object)
    is_open = np.ones(len(margins), dtype=np.bool_)
    for predicate in predicates(formula):
        values = np.abs(_margin(predicate, quantities))
        decides = is_open & np.any(values == np.abs(margins)[:, np.newaxis], axis=1)
        units[decides] = predicate.unit
        is_open &= ~decides
    return units.astype(np.str_)


def _margin(comparison: Predicate, quantities: Samples) -> Floats:
    """Return the linear form of a comparison, positive where it holds."""
    total = np.zeros(np.shape(quantities[comparison.factors[0][0]])) + comparison.constant
    for name, factor in comparison.factors:
        total += factor * np.asarray(quantities[name], dtype=np.float64)
    return total


def _truth(comparison: Predicate, quantities: Samples) -> Floats:
    """Return 1 where a comparison holds and -1 where it does not."""
    margin = _margin(comparison, quantities)
    return np.where(margin > 0.0 if comparison.is_strict else margin >= 0.0, 1.0, -1.0)


def _evaluate(  # noqa: PLR0911 - one for each kind of formula
    formula: Formula, quantities: Samples, period_s: float, atom: Atom
) -> Floats:
    """Return the value of a formula at all samples, (n, S)."""

    def value(part: Formula) -> Floats:
        return _evaluate(part, quantities, period_s, atom)

    match formula:
        case Predicate():
            return atom(formula, quantities)
        case Negation(part):
            return -value(part)
        case Conjunction(left, right):
            return np.minimum(value(left), value(right))
        case Disjunction(left, right):
            return np.maximum(value(left), value(right))
        case Always(window, part):
            return _window_minimum(value(part), *_in_samples(window, period_s))
        case Eventually(window, part):
            return -_window_minimum(-value(part), *_in_samples(window, period_s))
        case Until(window, left, right):
            return _until(value(left), value(right), *_in_samples(window, period_s))


def _in_samples(window: Window, period_s: float) -> tuple[int, int | None]:
    """Return the first and the last sample of a window, counted from now; None for the flight's last."""
    first = ceil(window.first_s / period_s - NEAR_A_SAMPLE)
    return first, None if isinf(window.last_s) else floor(window.last_s / period_s + NEAR_A_SAMPLE)


def _window_minimum(values: Floats, first: int, last: int | None) -> Floats:
    """Return at each sample the minimum from `first` to `last` samples ahead; infinity without any."""
    num_samples = values.shape[1]
    ahead = _shift(values, first, np.inf)
    if last is not None and last < first:
        return np.full_like(values, np.inf)
    if last is None or last - first >= num_samples - 1:
        return np.minimum.accumulate(ahead[:, ::-1], axis=1)[:, ::-1]
    from scipy.ndimage import minimum_filter1d  # noqa: PLC0415 - slow to import, and few windows end

    width = last - first + 1
    least: Floats = minimum_filter1d(ahead, width, axis=1, mode="constant", cval=np.inf, origin=-(width // 2))
    return least


def _until(left: Floats, right: Floats, first: int, last: int | None) -> Floats:
    """Return the value of `Until` at each sample."""
    value = right.copy()
    for k in range(right.shape[1] - 2, -1, -1):
        value[:, k] = np.maximum(right[:, k], np.minimum(left[:, k], value[:, k + 1]))
    value = _shift(value, first, -np.inf)
    if first > 0:
        value = np.minimum(value, _window_minimum(left, 0, first - 1))
    # a window ends by what must come within it (Donzé, Ferrère and Maler, CAV 2013)
    return value if last is None else np.minimum(value, -_window_minimum(-right, first, last))


def _shift(values: Floats, count: int, beyond: float) -> Floats:
    """Return the values `count` samples later, with `beyond` after the last."""
    if count == 0:
        return values
    later = np.full_like(values, beyond)
    later[:, :-count] = values[:, count:]
    return later
