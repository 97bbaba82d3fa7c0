"""Elementary functions for vectors: the exponential and the two-argument arctangent.

Accurate to rounding. The approximations are those of S. L. Moshier, "Methods and Programs for Mathematical
Functions" (Cephes library), 1989.
"""

from math import pi

import numpy as np

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.vectors import Vector, least, most, power_of_two, select

#: below this the exponential is zero
LEAST_EXPONENT = -700.0
#: ln 2 as the sum of two floats, the first with few digits
LN2_HIGH, LN2_LOW = 6.93145751953125e-1, 1.42860682030941723212e-6
LOG2_E = 1.4426950408889634074
TAN_PI_8 = 0.4142135623730950


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
def arctangent(y: Vector, x: Vector) -> Vector:
    """Return the angle of a point from the x axis, rad, in (-pi, pi]; x and y must not both be zero."""
    across, along = abs(y), abs(x)
    small, large = least(across, along), most(across, along)
    is_steep = small > TAN_PI_8 * large
    t = select(is_steep, small - large, small) / select(is_steep, small + large, large)
    z = t * t
    p = -8.750608600031904122785e-1 * z - 1.615753718733365076637e1
    p = (p * z - 7.500855792314704667340e1) * z - 1.228866684490136173410e2
    p = p * z - 6.485021904942025371773e1
    q = (z + 2.485846490142306297962e1) * z + 1.650270098316988542046e2
    q = (q * z + 4.328810604912902668951e2) * z + 4.853903996359136964868e2
    q = q * z + 1.945506571482613964425e2
    angle = select(is_steep, 0.25 * pi, 0.0) + (t + t * (z * p / q))
    angle = select(across > along, 0.5 * pi - angle, angle)
    angle = select(x < 0.0, pi - angle, angle)
    return select(y < 0.0, -angle, angle)
