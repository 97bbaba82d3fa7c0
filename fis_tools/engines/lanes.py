"""Operators and membership functions for many samples side by side, a sample in each lane of a vector."""

from fis_tools.array_types import Floats
from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.elementary import exponential
from fis_tools.compiled.vectors import Vector, least, load, most, select, store
from fis_tools.engines import codes, degrees
from fis_tools.engines.codes import combine
from fis_tools.engines.degrees import Shapes
from fis_tools.model.shapes import SMALLEST_MEMBERSHIP

#: samples that are inferred side by side: a constant, so that the compiler vectorises
LANES = 16


@compiled(error_model="numpy", forceinline=True)
def combine_lanes(operator: int, degrees: Floats, left: int, right: int, result: int) -> None:
    """Apply an operator or a hedge to the degrees of `LANES` samples, which begin at indices."""
    a, b = load(degrees, left, LANES), load(degrees, right, LANES)
    if operator == codes.MIN:
        store(degrees, result, least(a, b))
    elif operator == codes.MAX:
        store(degrees, result, most(a, b))
    elif operator == codes.PRODUCT:
        store(degrees, result, a * b)
    elif operator == codes.PROBABILISTIC_SUM:
        store(degrees, result, (a + b) - a * b)
    elif operator == codes.NOT:
        store(degrees, result, most(1.0 - a, 0.0))
    else:
        for lane in range(LANES):
            degrees[result + lane] = combine(operator, degrees[left + lane], degrees[right + lane])


@compiled(error_model="numpy", forceinline=True)
def write_degrees(shapes: Shapes, term: int, inputs: Floats, at: int, out: Floats, slot: int) -> None:
    """Write the memberships of `LANES` values, from an index on, in a term: from a slot on."""
    row = shapes.numbers[term]
    kind, a, b, c, d = shapes.kinds[term], row[0], row[1], row[2], row[3]
    x = load(inputs, at, LANES)
    if kind == degrees.GAUSSIAN:
        store(out, slot, _told_from_zero(exponential(-((x - a) * (x - a)) / (2.0 * (b * b)))))
    elif kind == degrees.TRIANGULAR:
        store(out, slot, _told_from_zero(_trapezoid(x, a, b, b, c)))
    elif kind == degrees.TRAPEZOIDAL:
        store(out, slot, _told_from_zero(_trapezoid(x, a, b, c, d)))
    elif kind == degrees.SIGMOID:
        power = -b * (x - a)
        rising = 1.0 / (1.0 + exponential(least(power, degrees.HIGHEST_POWER)))
        store(out, slot, _told_from_zero(select(power < degrees.HIGHEST_POWER, rising, 0.0)))
    else:
        for lane in range(LANES):
            out[slot + lane] = degrees.degree(shapes, term, inputs[at + lane])


@compiled(error_model="numpy", forceinline=True)
def _trapezoid(x: Vector, left: float, left_top: float, right_top: float, right: float) -> Vector:
    """Return the degrees on a trapezoid; both flanks are computed, and one is chosen."""
    rising, falling = (x - left) / (left_top - left), (right - x) / (right - right_top)
    slope = select((left < x) & (x < left_top), rising, select((right_top < x) & (x < right), falling, 0.0))
    return select((left_top <= x) & (x <= right_top), 1.0, slope)


@compiled(error_model="numpy", forceinline=True)
def _told_from_zero(degree: Vector) -> Vector:
    """Return degrees with those below `SMALLEST_MEMBERSHIP` as zero."""
    return select(degree >= SMALLEST_MEMBERSHIP, degree, 0.0)
