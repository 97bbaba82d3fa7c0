"""Rounding of the numbers of a system to a few digits."""

import math
from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise
from typing import Any

from fis_tools.analysis.measures import centre
from fis_tools.model import (
    FuzzySystem,
    Sampled,
    Term,
    Variable,
)
from fis_tools.model.validate import parameter_problems
from fis_tools.model.variables import shape_values

#: What is rounded together: the numbers of a term, by variable and term, or the ends of a range ("").
Unit = tuple[str, str]
#: The most digits of a rounded number; beyond, it is not rounded.
MOST_DIGITS = 6


def units(system: FuzzySystem) -> list[Unit]:
    """List what can be rounded: for each variable the ends of its range, and each of its terms."""
    found: list[Unit] = []
    for variable in (*system.inputs, *system.outputs):
        is_sampled = any(isinstance(term.membership, Sampled) for term in variable.terms)
        found += [] if is_sampled or variable.points is not None else [(variable.name, "")]
        found += [
            (variable.name, term.name) for term in variable.terms if not isinstance(term.membership, Sampled)
        ]
    return found


def rounded(system: FuzzySystem, digits: Mapping[Unit, int]) -> FuzzySystem:
    """Round the numbers of a system.

    Digits count from the first one of the variable's largest end, so that all numbers of a variable are
    rounded to the same places: 2 digits of a range from 0 to 200 are tens. Slopes have digits of their own.
    A number that equals an end of the range stays equal to it. A term keeps more digits where it would
    vanish, lose its shape or change its place among its neighbours.

    Parameters
    ----------
    system : FuzzySystem
        A system without problems.
    digits : mapping
        How many, for some of `units`; the others are not rounded.
    """
    inputs = tuple(_rounded_variable(variable, digits) for variable in system.inputs)
    outputs = tuple(_rounded_variable(variable, digits) for variable in system.outputs)
    return replace(system, inputs=inputs, outputs=outputs)


def _rounded_variable(variable: Variable, digits: Mapping[Unit, int]) -> Variable:
    range_digits = digits.get((variable.name, ""))
    ends = {end: _to_place(variable, end, range_digits) for end in (variable.minimum, variable.maximum)}
    while range_digits is not None and not ends[variable.minimum] < ends[variable.maximum]:
        range_digits += 1
        ends = {end: _to_place(variable, end, range_digits) for end in ends}
    bare = replace(variable, minimum=ends[variable.minimum], maximum=ends[variable.maximum])
    kept = [digits.get((variable.name, term.name), MOST_DIGITS + 1) for term in variable.terms]
    terms = [
        _rounded_term(bare, variable, term, count, ends)
        for term, count in zip(variable.terms, kept, strict=True)
    ]
    while (crossed := _first_crossed(variable, bare, terms)) is not None:
        for place in (crossed, crossed + 1):
            kept[place] = min(kept[place] + 1, MOST_DIGITS + 1)
            terms[place] = _rounded_term(bare, variable, variable.terms[place], kept[place], ends)
        if kept[crossed] == kept[crossed + 1] == MOST_DIGITS + 1:
            break
    return replace(bare, terms=tuple(terms))


def _to_place(variable: Variable, value: float, digits: int | None) -> float:
    if digits is None or digits > MOST_DIGITS:
        return value
    largest = max(abs(variable.minimum), abs(variable.maximum))
    return round(value, digits - 1 - math.floor(math.log10(largest))) + 0.0


def _rounded_term(
    bare: Variable, variable: Variable, term: Term, digits: int, ends: Mapping[float, float]
) -> Term:
    """Round a term, with more digits if it would lose its shape."""
    if isinstance(term.membership, Sampled):
        return term
    for count in range(digits, MOST_DIGITS + 2):
        numbers: dict[str, Any] = {}
        for name, kind in term.membership.entry.kinds.items():
            value = getattr(term.membership, name)
            if kind in {"slope", "exponent"}:
                numbers[name] = float(f"{value:.{count}g}") if count <= MOST_DIGITS else value
            else:
                numbers[name] = ends.get(value, _to_place(variable, value, count))
        candidate = Term(term.name, replace(term.membership, **numbers))
        if _keeps_shape(bare, term, candidate):
            return candidate
    return term


def _keeps_shape(variable: Variable, before: Term, after: Term) -> bool:
    """Return whether a rounded shape is valid, keeps its flanks, and is nowhere below zero."""
    old, shape = before.membership, after.membership
    if any(parameter_problems(shape)):
        return False
    for left, right in pairwise(shape.entry.ascending):
        if getattr(old, left) < getattr(old, right) and getattr(shape, left) == getattr(shape, right):
            return False
    return bool(shape_values(variable.universe, shape).min() >= 0.0)


def _first_crossed(variable: Variable, bare: Variable, terms: list[Term]) -> int | None:
    """Find the first term that was below the next one and no longer is."""
    before = [centre(variable, term) for term in variable.terms]
    after = [centre(bare, term) for term in terms]
    for place, ((a, b), (c, d)) in enumerate(zip(pairwise(before), pairwise(after), strict=True)):
        if a < b and not c < d:
            return place
    return None
