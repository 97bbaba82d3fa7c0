"""Elementary functions: the exponential of vectors, accurate to rounding, and whole numbers within limits.

The approximation is that of S. L. Moshier, "Methods and Programs for Mathematical Functions" (Cephes
library), 1989.
"""

import numpy as np

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.vectors import Vector, most, power_of_two, select

#: below this the exponential is zero
LEAST_EXPONENT = -700.0
#: ln 2 as the sum of two floats, the first with few digits
LN2_HIGH, LN2_LOW = 6.93145751953125e-1, 1.42860682030941723212e-6
LOG2_E = 1.4426950408889634074


@compiled(error_model="numpy", forceinline=True)
def exponential(x: Vector) -> Vector:
    """Return e to the power of x, for x up to 700; 0 below -700."""
    bounded = most(x, LEAST_EXPONENT)
    whole = np.rint(bounded * LOG2_E)
    rest = (bounded - whole * LN2_HIGH) - whole * LN2_LOW
    square = rest * rest
    p = rest * ((1.26177193074810590878e-4 * square + 3.02994407707441961300e-2) * square + 1.0)
    q = (3.00198505138664455042e-6 * square + 2.52448340349684104192e-3) * square
    q = (q + 2.27265548208155028766e-1) * square + 2.00000000000000000009e0
    return select(x < LEAST_EXPONENT, 0.0, (1.0 + 2.0 * (p / (q - p))) * power_of_two(whole))


@compiled(error_model="numpy", forceinline=True)
def whole_within(value: float, most: int) -> int:
    """Return the whole part of a number, from 0 to `most`, whatever the number is; 0 of NaN."""
    whole = most if value >= most else 0
    if value == value and 0.0 < value < most:  # noqa: PLR0124 - NaN is told apart on board
        whole = int(value)
    return whole
