"""Membership functions evaluated by their formulas, compiled: at a number, and bounded over an interval.

The formulas are those of `fis_tools.model.shapes`, the readable twin. They hold at any value, also beyond a
variable's range, as in programs that do not clip inputs.
"""

from collections.abc import Sequence
from dataclasses import replace
from math import cos, exp, pi, sqrt
from typing import NamedTuple

import numpy as np

from fis_tools import model
from fis_tools.array_types import Floats, Integers
from fis_tools.compiled.decorator import compiled
from fis_tools.model.shapes import SMALLEST_MEMBERSHIP

EPSILON = float(np.finfo(np.float64).eps)
#: Rounding of a formula as a share of its value: an exponential of -670 errs by its power's last digits.
ROUNDING = 4096 * EPSILON
#: From this exponent on the exponential is not computed.
HIGHEST_POWER = 700.0

#: Kinds of shapes, in the order of their codes, by their names in our own files. Both last, and shapes
#: that are not among these, are tables.
_NAMES = (
    *("gaussian", "triangular", "trapezoidal", "two_sided_gaussian", "generalized_bell", "sigmoid"),
    *("sigmoid_difference", "sigmoid_product", "s_shape", "z_shape", "pi_shape", "spike", "cosine"),
    *("concave", "semi_ellipse", "arc", "ramp", "polyline", "sampled"),
)
GAUSSIAN, TRIANGULAR, TRAPEZOIDAL, TWO_SIDED_GAUSSIAN, GENERALIZED_BELL, SIGMOID = range(6)
SIGMOID_DIFFERENCE, SIGMOID_PRODUCT, S_SHAPE, Z_SHAPE, PI_SHAPE, SPIKE, COSINE = range(6, 13)
CONCAVE, SEMI_ELLIPSE, ARC, RAMP, TABLE = range(13, 18)
KINDS: dict[str, int] = {name: min(code, TABLE) for code, name in enumerate(_NAMES)}


class Shapes(NamedTuple):
    """Membership functions as numbers.

    Attributes
    ----------
    kinds : (s,) int
        Kind of each term's shape, of `KINDS`.
    numbers : (s, 4) float
        Its parameters; of a table the start of its points in `tables`, and how many they are.
    tables : (2, t) float
        Points of all tables, and the memberships at these.
    """

    kinds: Integers
    numbers: Floats
    tables: Floats


def tabulated(variable: model.Variable) -> model.Variable:
    """Return a variable in which shapes without a compiled formula are tables of points."""
    tables = {
        term: model.Sampled(tuple(model.sample(variable, term).tolist()))
        for term in variable.terms
        if not (term.membership.entry.name in KINDS or isinstance(term.membership, model.Between))
    }
    if not tables:
        return variable
    terms = (replace(term, membership=tables.get(term, term.membership)) for term in variable.terms)
    return replace(variable, terms=tuple(terms))


def shapes_of(variables: Sequence[model.Variable]) -> Shapes:
    """Return the membership functions of variables as numbers, one term after the other."""
    kinds: list[int] = []
    rows: list[tuple[float, ...]] = []
    tables: list[Floats] = []
    row: tuple[float, ...]
    for variable in variables:
        for term in variable.terms:
            shape = term.membership
            kinds.append(KINDS.get(shape.entry.name, TABLE))
            if kinds[-1] == TABLE:
                points = shape.x if isinstance(shape, model.Polyline) else variable.universe
                values = shape.y if isinstance(shape, model.Polyline) else model.sample(variable, term)
                row = (float(sum(table.shape[1] for table in tables)), float(len(points)))
                tables.append(np.array([points, values], dtype=np.float64))
            else:
                row = tuple(float(getattr(shape, name)) for name in shape.entry.kinds)
            rows.append(row + (0.0,) * (4 - len(row)))
    return Shapes(
        kinds=np.array(kinds, dtype=np.int64),
        numbers=np.array(rows, dtype=np.float64).reshape(-1, 4),
        tables=np.concatenate(tables, axis=1) if tables else np.empty((2, 0)),
    )


@compiled(error_model="numpy")
def degree(shapes: Shapes, term: int, x: float) -> float:
    """Return the membership of a number in a term, zero below `SMALLEST_MEMBERSHIP`."""
    return counted(_value(shapes, term, x))


@compiled(error_model="numpy")
def counted(value: float) -> float:
    """Return a degree of truth, zero where it is too small to count."""
    return value if value >= SMALLEST_MEMBERSHIP else 0.0


@compiled(error_model="numpy")
def _value(shapes: Shapes, term: int, x: float) -> float:
    """Return the membership of a number in a term by the formula of its shape, or by its table."""
    row, kind = shapes.numbers[term], shapes.kinds[term]
    if kind == TABLE:
        start, end = int(row[0]), int(row[0]) + int(row[1])
        return interpolated(shapes.tables[0, start:end], shapes.tables[1, start:end], x)
    return formula(kind, x, row[0], row[1], row[2], row[3])


@compiled(error_model="numpy")
def formula(  # noqa: PLR0911, PLR0912 - one line per shape
    kind: int, x: float, a: float, b: float, c: float, d: float
) -> float:
    """Return the membership of a number in a shape with up to four numbers."""
    if kind == GAUSSIAN:
        return _gaussian(x, a, b)
    if kind == TRIANGULAR:
        return _trapezoid(x, a, b, b, c)
    if kind == TRAPEZOIDAL:
        return _trapezoid(x, a, b, c, d)
    if kind == TWO_SIDED_GAUSSIAN:
        left = _gaussian(x, a, b) if x <= a else 1.0
        return left * _gaussian(x, c, d) if x > c else left
    if kind == GENERALIZED_BELL:
        return float(1.0 / (1.0 + np.power(abs((x - c) / a), 2.0 * b)))
    if kind == SIGMOID:
        return _sigmoid(x, a, b)
    if kind == SIGMOID_DIFFERENCE:
        return abs(_sigmoid(x, a, b) - _sigmoid(x, c, d))
    if kind == SIGMOID_PRODUCT:
        return _sigmoid(x, a, b) * _sigmoid(x, c, d)
    if kind == S_SHAPE:
        return _parabolas(x, a, b)
    if kind == Z_SHAPE:
        return _parabolas(-x, -b, -a)
    if kind == PI_SHAPE:
        rising = _parabolas(x, a, b) if x <= b else 1.0
        return _parabolas(-x, -d, -c) if x >= c else rising
    if kind == SPIKE:
        return exp(-abs(10.0 / b * (x - a)))
    if kind == COSINE:
        return 0.5 * (1.0 + cos(2.0 / b * pi * (x - a))) if abs(x - a) <= 0.5 * b else 0.0
    if kind == CONCAVE:
        is_below = x < b if b >= a else x > b
        return (b - a) / (2.0 * b - a - x) if is_below else 1.0
    if kind == SEMI_ELLIPSE:
        radius = 0.5 * (b - a)
        return _circle(x, a + radius, radius)
    if kind == ARC:
        is_beyond = x > b if b > a else x < b
        return 1.0 if is_beyond else _circle(x, b, abs(b - a))
    return min(max((x - a) / (b - a), 0.0), 1.0)  # a ramp


@compiled(error_model="numpy")
def _gaussian(x: float, mean: float, deviation: float) -> float:
    return exp(-((x - mean) * (x - mean)) / (2.0 * (deviation * deviation)))


@compiled(error_model="numpy")
def _trapezoid(x: float, left: float, left_top: float, right_top: float, right: float) -> float:
    """Return the degree on a trapezoid; flanks of zero width are steps."""
    if left_top <= x <= right_top:
        return 1.0
    if left < x < left_top:
        return (x - left) / (left_top - left)
    return (right - x) / (right - right_top) if right_top < x < right else 0.0


@compiled(error_model="numpy")
def _sigmoid(x: float, inflection: float, slope: float) -> float:
    power = -slope * (x - inflection)
    return 1.0 / (1.0 + exp(power)) if power < HIGHEST_POWER else 0.0


@compiled(error_model="numpy")
def _parabolas(x: float, foot: float, top: float) -> float:
    """Return the degree on two parabolas that rise from `foot` to `top`, one half in the middle."""
    if x <= foot:
        return 0.0
    if x >= top:
        return 1.0
    width = top - foot
    if x >= 0.5 * (foot + top):
        return 1.0 - 2.0 * ((x - top) / width) * ((x - top) / width)
    return 2.0 * ((x - foot) / width) * ((x - foot) / width)


@compiled(error_model="numpy")
def _circle(x: float, centre: float, radius: float) -> float:
    return sqrt(max(radius * radius - (x - centre) * (x - centre), 0.0)) / radius


@compiled(error_model="numpy")
def interpolated(points: Floats, values: Floats, x: float) -> float:
    """Return the value at a number between points, level beyond; at a jump the first of both."""
    if x <= points[0]:
        return float(values[0])
    right = len(points) - 1
    if x > points[right]:
        return float(values[right])
    below = 0
    while right - below > 1:
        middle = (below + right) // 2
        if points[middle] < x:
            below = middle
        else:
            right = middle
    if x == points[right]:  # exact, also where its value is faint beside its neighbour's
        return float(values[right])
    share = (x - points[below]) / (points[right] - points[below])
    return float(values[below] + (values[right] - values[below]) * share)


@compiled(error_model="numpy")
def degree_bounds(shapes: Shapes, term: int, low: float, high: float) -> tuple[float, float]:
    """Bound the membership of the numbers from `low` to `high` in a term, rounding included.

    A shape rises to its top and falls beyond, or is a product or a difference of two that do; so the ends of
    the interval, and a top inside of it, are its extremes.
    """
    row = shapes.numbers[term]
    kind, a, b, c, d = shapes.kinds[term], row[0], row[1], row[2], row[3]
    left, right = _value(shapes, term, low), _value(shapes, term, high)
    least, greatest = min(left, right), max(left, right)
    if kind in (SIGMOID_DIFFERENCE, SIGMOID_PRODUCT):
        first = _ordered(_sigmoid(low, a, b), _sigmoid(high, a, b))
        second = _ordered(_sigmoid(low, c, d), _sigmoid(high, c, d))
        if kind == SIGMOID_PRODUCT:
            least, greatest = first[0] * second[0], first[1] * second[1]
        else:
            least = max(first[0] - second[1], second[0] - first[1], 0.0)
            greatest = max(first[1] - second[0], second[1] - first[0])
    elif kind == TABLE:
        for point in range(int(a), int(a) + int(b)):
            if low <= shapes.tables[0, point] <= high:  # at a jump both values count
                least = min(least, shapes.tables[1, point])
                greatest = max(greatest, shapes.tables[1, point])
    elif kind == TWO_SIDED_GAUSSIAN and c < a:
        first = _gaussian_bounds(low, min(high, a), a, b) if low <= a else (1.0, 1.0)
        second = _gaussian_bounds(max(low, c), high, c, d) if high > c else (1.0, 1.0)
        if high > a:
            first = (first[0], 1.0)
        if low <= c:
            second = (second[0], 1.0)
        least, greatest = first[0] * second[0], first[1] * second[1]
    else:
        first_top, last_top = _tops(kind, a, b, c)
        if first_top <= high and last_top >= low:
            greatest = 1.0
    return _outward(kind, row, least, greatest)


@compiled(error_model="numpy")
def _gaussian_bounds(low: float, high: float, mean: float, deviation: float) -> tuple[float, float]:
    """Bound the memberships of the numbers from `low` to `high` in a Gaussian."""
    left, right = _gaussian(low, mean, deviation), _gaussian(high, mean, deviation)
    return min(left, right), 1.0 if low <= mean <= high else max(left, right)


@compiled(error_model="numpy")
def _tops(kind: int, a: float, b: float, c: float) -> tuple[float, float]:
    """Return between which numbers a shape is one; an empty range for one that only rises or only falls."""
    if kind in (TRAPEZOIDAL, PI_SHAPE, TWO_SIDED_GAUSSIAN):
        return (a if kind == TWO_SIDED_GAUSSIAN else b), c
    top = np.nan
    if kind in (GAUSSIAN, SPIKE, COSINE):
        top = a
    if kind in (TRIANGULAR, GENERALIZED_BELL):
        top = b if kind == TRIANGULAR else c
    if kind == SEMI_ELLIPSE:
        top = 0.5 * (a + b)
    return top, top


@compiled(error_model="numpy")
def _ordered(a: float, b: float) -> tuple[float, float]:
    return min(a, b), max(a, b)


@compiled(error_model="numpy")
def _outward(kind: int, row: Floats, least: float, greatest: float) -> tuple[float, float]:
    """Widen bounds by the rounding of a formula; a greatest membership of zero stays zero."""
    if greatest <= 0.0:
        return 0.0, 0.0
    a, b = row[0], row[1]
    absolute, relative = 0.0, ROUNDING
    if kind in (TABLE, COSINE, SIGMOID_DIFFERENCE, S_SHAPE, Z_SHAPE, PI_SHAPE):
        absolute = 16.0 * EPSILON
    if kind == COSINE:
        absolute = 16.0 * EPSILON * (1.0 + abs(a) / b)
    if kind == GENERALIZED_BELL:
        relative += 16.0 * EPSILON * b
    if kind == CONCAVE and b != a:  # of no width it is exactly zero or one
        relative += 8.0 * EPSILON * (2.0 * abs(b) + abs(a)) / abs(b - a)
    if kind in (SEMI_ELLIPSE, ARC) and b != a:  # a root loses half of the digits near zero
        square = 16.0 * EPSILON * (1.0 + (abs(a) + abs(b)) / abs(b - a))
        least, greatest = sqrt(max(least * least - square, 0.0)), sqrt(greatest * greatest + square)
    least = max(least - relative * least - absolute, 0.0)
    greatest = min(greatest + relative * greatest + absolute, 1.0)
    return least if least >= SMALLEST_MEMBERSHIP else 0.0, greatest
