"""Numbers of operators, hedges, defuzzifiers and shapes in programs, and the compiled operators."""

from typing import get_args

import numpy as np

from fis_tools import model
from fis_tools.compiled.decorator import compiled

#: By which the strengths that an average weighs by are multiplied: a power of two changes no digit, and
#: products of the faintest keep theirs.
RAISED_WEIGHT = 2.0**128
#: Operations as numbers, since compiled functions have no strings.
AND_CODES = range(7)
OR_CODES = range(7, 14)
NOT = 14
UNBOUNDED_SUM = 15
HEDGE_CODES = range(16, 21)
MIN, PRODUCT, BOUNDED_DIFFERENCE, EINSTEIN_PRODUCT, HAMACHER_PRODUCT, DRASTIC_PRODUCT, NILPOTENT_MINIMUM = (
    AND_CODES
)
MAX, PROBABILISTIC_SUM, BOUNDED_SUM, EINSTEIN_SUM, HAMACHER_SUM, DRASTIC_SUM, NILPOTENT_MAXIMUM = OR_CODES
VERY, SOMEWHAT, EXTREMELY, INTENSELY, SELDOM = HEDGE_CODES
OPERATORS: dict[str, int] = {
    **dict(zip(get_args(model.AndOperator), AND_CODES, strict=True)),
    **dict(zip(get_args(model.OrOperator), OR_CODES, strict=True)),
    "unbounded_sum": UNBOUNDED_SUM,
    **dict(zip(get_args(model.Hedge), HEDGE_CODES, strict=True)),
}


@compiled(error_model="numpy", forceinline=True)
def combine(operator: int, a: float, b: float) -> float:  # noqa: PLR0911, PLR0912 - one line per operator
    """Apply an operator of `fis_tools.model.operators` to two degrees of truth; a hedge changes the first."""
    if operator == MIN:
        return a if a < b else b
    if operator == MAX:
        return a if a > b else b
    both, either = a * b, a + b
    if operator == PRODUCT:
        return both
    if operator == PROBABILISTIC_SUM:
        return either - both
    if operator == BOUNDED_DIFFERENCE:
        return max(either - 1.0, 0.0)
    if operator == BOUNDED_SUM:
        return min(either, 1.0)
    if operator == EINSTEIN_PRODUCT:
        return both / (2.0 - (either - both))
    if operator == EINSTEIN_SUM:
        return either / (1.0 + both)
    if operator == HAMACHER_PRODUCT:
        return 0.0 if either - both == 0.0 else both / (either - both)
    if operator == HAMACHER_SUM:
        if both < 0.5:  # two forms of one formula, against cancellation near 1
            return min((either - 2.0 * both) / (1.0 - both), 1.0)
        return 1.0 if both == 1.0 else 1.0 - (1.0 - a) * (1.0 - b) / (1.0 - both)
    if operator == DRASTIC_PRODUCT:
        return a if b >= 1.0 else b if a >= 1.0 else 0.0
    if operator == DRASTIC_SUM:
        return a if b <= 0.0 else b if a <= 0.0 else 1.0
    if operator == NILPOTENT_MINIMUM:
        return min(a, b) if either > 1.0 else 0.0
    if operator == NILPOTENT_MAXIMUM:
        return max(a, b) if either < 1.0 else 1.0
    if operator == UNBOUNDED_SUM:
        return either
    return change(operator, a)


@compiled(error_model="numpy", forceinline=True)
def change(operator: int, a: float) -> float:  # noqa: PLR0911 - one line per hedge
    """Apply a hedge, or the complement, to a degree of truth."""
    if operator == VERY:
        return a * a
    if operator == SOMEWHAT:
        return float(np.sqrt(max(a, 0.0)))
    if operator == EXTREMELY:
        return a * a * a
    if operator == INTENSELY:
        if a <= 0.5:
            return 2.0 * a * a
        return 1.0 - 2.0 * (1.0 - a) * (1.0 - a)
    if operator == SELDOM:
        half = max(a if a <= 0.5 else 1.0 - a, 0.0)
        return float(np.sqrt(0.5 * half)) if a <= 0.5 else float(1.0 - np.sqrt(0.5 * half))
    return max(1.0 - a, 0.0)


DEFUZZIFIERS: dict[str, int] = {name: code for code, name in enumerate(get_args(model.Defuzzifier))}
CENTROID, BISECTOR, MEAN_OF_MAXIMUM, SMALLEST_OF_MAXIMUM, LARGEST_OF_MAXIMUM = range(5)
WEIGHTED_AVERAGE, WEIGHTED_SUM = range(5, 7)
#: How an output is computed: from the polygon of scikit-fuzzy, or as a sum over points as a program has it.
SAMPLING: dict[str, int] = {name: code for code, name in enumerate(model.ALL_SEMANTICS)}
POLYGON, MATLAB, FUZZYLITE, FCL = SAMPLING.values()
#: Conclusions of weighted outputs: a number, the point where one of these shapes has the strength (each with
#: two parameters),
#: or a formula, whose first parameter is its index.
NUMBER, FORMULA = -1, -2
INVERTED = (model.Ramp, model.Sigmoid, model.SShape, model.ZShape, model.Concave, model.Arc)
RAMP, SIGMOID, S_SHAPE, Z_SHAPE, CONCAVE, ARC = range(6)
