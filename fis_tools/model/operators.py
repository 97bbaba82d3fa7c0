"""Operators on degrees of truth, by name: those behind `and` and `or`, and hedges.

Each takes arrays, or numbers, in [0, 1], or above by rounding. Except for rounding none falls when an
argument rises, so that bounds of the arguments bound the result, also across a jump: tests are for one or
more, zero or less. The or-operators are the duals of the and-operators at the same place in the list:
``or(a, b) = 1 - and(1 - a, 1 - b)``. Definitions as in Klement, Mesiar and Pap, *Triangular Norms* (2000),
names as in fuzzylite and Octave's fuzzy-logic-toolkit. Hedges are those of IEEE 1855, annex A, whose
`intensify` is `intensely` here; each keeps 0 and 1 and increases in between.
"""

from collections.abc import Callable
from typing import Literal

import numpy as np

from fis_tools.array_types import Floats

#: How an interval type-2 output becomes a number; see `fis_tools.model.intervals`.
TypeReduction = Literal["karnik-mendel", "nie-tan"]
Defuzzifier = Literal["centroid", "bisector", "mom", "som", "lom", "weighted_average", "weighted_sum"]
AndOperator = Literal[
    "min",
    "product",
    "bounded_difference",
    "einstein_product",
    "hamacher_product",
    "drastic_product",
    "nilpotent_minimum",
]
OrOperator = Literal[
    "max",
    "probabilistic_sum",
    "bounded_sum",
    "einstein_sum",
    "hamacher_sum",
    "drastic_sum",
    "nilpotent_maximum",
]
Accumulation = Literal[OrOperator, "product", "unbounded_sum"]
Aggregation = Literal[OrOperator, "unbounded_sum"]
Hedge = Literal["very", "somewhat", "extremely", "intensely", "seldom"]

#: Defuzzifiers that weight conclusions by firing strengths and form no fuzzy set.
WEIGHING: tuple[Defuzzifier, ...] = ("weighted_average", "weighted_sum")

Operator = Callable[[Floats, Floats], Floats]


def bounded_difference(a: Floats, b: Floats) -> Floats:
    """Return ``max(a + b - 1, 0)``, the conjunction of Łukasiewicz."""
    return np.fmax(a + b - 1.0, 0.0)


def einstein_product(a: Floats, b: Floats) -> Floats:
    """Return ``a b / (2 - (a + b - a b))``."""
    return a * b / (2.0 - (a + b - a * b))


def hamacher_product(a: Floats, b: Floats) -> Floats:
    """Return ``a b / (a + b - a b)``; zero where both are zero."""
    both = a * b
    either = a + b - both
    return both / np.where(either == 0.0, 1.0, either)


def drastic_product(a: Floats, b: Floats) -> Floats:
    """Return one operand where the other is one, or more by rounding; else zero."""
    return np.where(b >= 1.0, a, np.where(a >= 1.0, b, 0.0))


def nilpotent_minimum(a: Floats, b: Floats) -> Floats:
    """Return the smaller where ``a + b > 1``, else zero."""
    return np.where(a + b > 1.0, np.fmin(a, b), 0.0)


def probabilistic_sum(a: Floats, b: Floats) -> Floats:
    """Return ``a + b - a b``, the dual of the product."""
    return a + b - a * b


def bounded_sum(a: Floats, b: Floats) -> Floats:
    """Return ``min(a + b, 1)``, the disjunction of Łukasiewicz."""
    return np.fmin(a + b, 1.0)


def einstein_sum(a: Floats, b: Floats) -> Floats:
    """Return ``(a + b) / (1 + a b)``."""
    return (a + b) / (1.0 + a * b)


def hamacher_sum(a: Floats, b: Floats) -> Floats:
    """Return ``(a + b - 2 a b) / (1 - a b)``; one where both are one.

    The formula loses digits near one, the complement of complements near zero.
    """
    both = a * b
    rest = np.where(both == 1.0, 1.0, 1.0 - both)
    near_zero = np.minimum((a + b - 2.0 * both) / rest, 1.0)
    return np.where(both < 0.5, near_zero, 1.0 - (1.0 - a) * (1.0 - b) / rest)


def drastic_sum(a: Floats, b: Floats) -> Floats:
    """Return one operand where the other is zero, or less by rounding; else one."""
    return np.where(b <= 0.0, a, np.where(a <= 0.0, b, 1.0))


def nilpotent_maximum(a: Floats, b: Floats) -> Floats:
    """Return the larger where ``a + b < 1``, else one."""
    return np.where(a + b < 1.0, np.fmax(a, b), 1.0)


def complement(a: Floats) -> Floats:
    """Return ``1 - a``; zero of what rounding has made more than one."""
    return np.fmax(1.0 - a, 0.0)


def somewhat(a: Floats) -> Floats:
    """Return the square root of `a`."""
    return np.sqrt(np.fmax(a, 0.0))


def extremely(a: Floats) -> Floats:
    """Return ``a a a``, as in MATLAB; in fuzzylite this name means `intensely`."""
    return a * a * a


def intensely(a: Floats) -> Floats:
    """Return ``2 a a`` up to a half, ``1 - 2 (1 - a) (1 - a)`` above: contrast is intensified."""
    return np.where(a <= 0.5, 2.0 * a * a, 1.0 - 2.0 * (1.0 - a) * (1.0 - a))


def seldom(a: Floats) -> Floats:
    """Return the inverse of `intensely`: ``sqrt(a / 2)`` up to a half, ``1 - sqrt((1 - a) / 2)`` above."""
    low, high = np.sqrt(0.5 * np.fmax(a, 0.0)), 1.0 - np.sqrt(0.5 * np.fmax(1.0 - a, 0.0))
    return np.where(a <= 0.5, low, high)


AND_OPERATORS: dict[AndOperator, Operator] = {
    "min": np.fmin,
    "product": np.multiply,
    "bounded_difference": bounded_difference,
    "einstein_product": einstein_product,
    "hamacher_product": hamacher_product,
    "drastic_product": drastic_product,
    "nilpotent_minimum": nilpotent_minimum,
}
OR_OPERATORS: dict[OrOperator, Operator] = {
    "max": np.fmax,
    "probabilistic_sum": probabilistic_sum,
    "bounded_sum": bounded_sum,
    "einstein_sum": einstein_sum,
    "hamacher_sum": hamacher_sum,
    "drastic_sum": drastic_sum,
    "nilpotent_maximum": nilpotent_maximum,
}
ACCUMULATIONS: dict[Accumulation, Operator] = {"product": np.multiply, "unbounded_sum": np.add}
ACCUMULATIONS.update(OR_OPERATORS.items())
#: The unbounded sum is not a disjunction: it is MATLAB's aggregation by sum.
AGGREGATIONS: dict[Aggregation, Operator] = {"unbounded_sum": np.add}
AGGREGATIONS.update(OR_OPERATORS.items())
HEDGES: dict[Hedge, Callable[[Floats], Floats]] = {
    "very": np.square,
    "somewhat": somewhat,
    "extremely": extremely,
    "intensely": intensely,
    "seldom": seldom,
}
