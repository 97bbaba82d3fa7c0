"""The elements of signal temporal logic formulas.

Maler and Nickovic, "Monitoring temporal properties of continuous signals", FORMATS 2004. Their
notation: `pipeline.evaluation.assurance.parser`.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from math import inf


@dataclass(frozen=True)
class Window:
    """First and last second ahead, both included; without a last, the rest of the flight."""

    first_s: float = 0.0
    last_s: float = inf


@dataclass(frozen=True)
class Comparison:
    """``sum of factor times quantity + constant >= 0``, or ``> 0``; the left side is its margin."""

    factors: tuple[tuple[str, float], ...]
    constant: float
    is_strict: bool
    unit: str


@dataclass(frozen=True)
class Not:
    """The opposite."""

    part: "Formula"


@dataclass(frozen=True)
class And:
    """Both."""

    left: "Formula"
    right: "Formula"


@dataclass(frozen=True)
class Or:
    """One of two or both."""

    left: "Formula"
    right: "Formula"


@dataclass(frozen=True)
class Always:
    """At all samples of a window."""

    window: Window
    part: "Formula"


@dataclass(frozen=True)
class Eventually:
    """At some sample of a window."""

    window: Window
    part: "Formula"


@dataclass(frozen=True)
class Until:
    """The right operand at some sample of a window, and the left from now to the sample before that."""

    window: Window
    left: "Formula"
    right: "Formula"


Formula = Comparison | Not | And | Or | Always | Eventually | Until


def comparisons(formula: Formula) -> Iterator[Comparison]:
    """Return the comparisons of a formula from left to right."""
    match formula:
        case Comparison():
            yield formula
        case Not(part) | Always(_, part) | Eventually(_, part):
            yield from comparisons(part)
        case And(left, right) | Or(left, right) | Until(_, left, right):
            yield from comparisons(left)
            yield from comparisons(right)


def quantities_of(formula: Formula) -> tuple[str, ...]:
    """Return the quantities of a formula, each once."""
    return tuple(dict.fromkeys(name for one in comparisons(formula) for name, _ in one.factors))


def unit_of(formula: Formula) -> str | None:
    """Return the unit of a formula's margin; None if it compares quantities of several units."""
    units = {one.unit for one in comparisons(formula)}
    return units.pop() if len(units) == 1 else None
