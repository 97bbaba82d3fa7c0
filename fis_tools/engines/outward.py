"""Bounds rounded outward, compiled, so that they hold for the numbers that inference computes."""

import numpy as np

from fis_tools.compiled.decorator import compiled
from fis_tools.engines import codes
from fis_tools.engines.codes import combine

EPSILON = float(np.finfo(np.float64).eps)
#: Rounding of an interpolation between two numbers, in units of the larger.
INTERPOLATION_ERROR = 16 * EPSILON


@compiled(error_model="numpy", nogil=True)
def widened(low: float, high: float) -> tuple[float, float]:
    """Widen bounds by the rounding of some operations on nonnegative numbers; zero stays zero."""
    return low * (1.0 - 8 * EPSILON), high * (1.0 + 8 * EPSILON)


@compiled(error_model="numpy", nogil=True)
def combine_bounds(operator: int, a: tuple[float, float], b: tuple[float, float]) -> tuple[float, float]:
    """Bound an operator applied to two bounded degrees: it increases with both; what rounds is widened."""
    if operator == codes.NOT:
        return max(0.0, 1.0 - a[1]), 1.0 - a[0]
    if operator in (codes.MIN, codes.MAX):
        return combine(operator, a[0], b[0]), combine(operator, a[1], b[1])
    if operator == codes.DRASTIC_PRODUCT:  # it tests whether a degree is one
        a, b = (a[0], min(a[1], 1.0)), (b[0], min(b[1], 1.0))
    return widened(combine(operator, a[0], b[0]), combine(operator, a[1], b[1]))
