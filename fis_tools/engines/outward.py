"""Bounds rounded outward, compiled, so that they hold for the numbers that inference computes."""

import numpy as np

from fis_tools.compiled.decorator import compiled
from fis_tools.engines import codes
from fis_tools.engines.codes import combine

EPSILON = float(np.finfo(np.float64).eps)
#: Rounding of an interpolation between two numbers, in units of the larger.
INTERPOLATION_ERROR = 16 * EPSILON
#: Below this a product may have lost its digits.
FAINT_PRODUCT = 1e-290


@compiled(error_model="numpy", nogil=True)
def widened(low: float, high: float) -> tuple[float, float]:
    """Widen bounds by the rounding of some operations on nonnegative numbers; zero stays zero."""
    return low * (1.0 - 8 * EPSILON), high * (1.0 + 8 * EPSILON)


@compiled(error_model="numpy", nogil=True)
def combine_bounds(operator: int, a: tuple[float, float], b: tuple[float, float]) -> tuple[float, float]:
    """Bound an operator applied to two bounded degrees: it increases with both; what rounds is widened.

    Where an operator jumps, its arguments' bounds lie on the right sides of the jump, since they are never
    rounded inward.
    """
    if operator == codes.NOT:
        return combine(operator, a[1], a[1]), combine(operator, a[0], a[0])
    low, high = combine(operator, a[0], b[0]), combine(operator, a[1], b[1])
    if operator in (codes.MIN, codes.MAX):
        return low, high
    if operator == codes.HAMACHER_PRODUCT and a[0] * b[0] < FAINT_PRODUCT:
        # the quotient of a faint product may be twice as much as the smaller degree, which is faint itself
        low, high = 0.0, max(high, min(2.0 * min(a[1], b[1]), 2.0 * np.sqrt(FAINT_PRODUCT)))
    return widened(low, high)
