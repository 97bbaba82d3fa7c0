"""Rows of lanes as vectors, and elementary functions of vectors.

Exponential and arctangent are accurate to rounding. The approximations are those of S. L. Moshier, "Methods
and Programs for Mathematical Functions" (Cephes library), 1989.
"""

from math import pi
from typing import Any

import numpy as np

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.three import Three
from fis_tools.compiled.vectors import Vector, least, load, most, power_of_two, select, store, width_of
from pipeline.array_types import Floats
from pipeline.flight.state.arrays import Moment
from pipeline.physics.quaternion import Quaternion


@compiled(forceinline=True)
def flight_of(now: Moment, lane: int) -> int:
    """Return the flight of a lane; those without one of their own repeat the last."""
    return now.first + min(lane, now.num_lanes - 1)


@compiled(forceinline=True)
def load_row(row: Floats) -> Vector:
    """Return a field of one row."""
    return load(row, 0, width_of(row))


@compiled(forceinline=True)
def load_pair(rows: Floats) -> tuple[Vector, Vector]:
    """Return the first two rows of a field."""
    width = width_of(rows)
    return load(rows, 0, width), load(rows, 1, width)


@compiled(forceinline=True)
def load_quaternion(rows: Floats) -> Quaternion:
    """Return the first four rows of a field."""
    width = width_of(rows)
    return load(rows, 0, width), load(rows, 1, width), load(rows, 2, width), load(rows, 3, width)


@compiled(forceinline=True)
def store_pair(rows: Floats, first: int, x: Vector, y: Vector) -> None:
    """Write two rows, from `first` on."""
    store(rows, first, x)
    store(rows, first + 1, y)


@compiled(forceinline=True)
def store_quaternion(rows: Floats, q: Quaternion) -> None:
    """Write the first four rows."""
    store(rows, 0, q[0])
    store(rows, 1, q[1])
    store(rows, 2, q[2])
    store(rows, 3, q[3])


@compiled(forceinline=True)
def attitude_of(rows: Floats, lane: int) -> Quaternion:
    """Return the attitude of one lane, of floats."""
    return rows[0, lane], rows[1, lane], rows[2, lane], rows[3, lane]


@compiled(forceinline=True)
def write_attitude(rows: Floats, lane: int, q: Any) -> None:
    """Write the attitude of one lane: four floats, or an array of them."""
    rows[0, lane], rows[1, lane], rows[2, lane], rows[3, lane] = q


@compiled(forceinline=True)
def write_row(target: Any, rows: Floats, lane: int) -> None:
    """Write the numbers of one lane into an array of shape (n,), from the first row on."""
    for i in range(len(target)):
        target[i] = rows[i, lane]


@compiled(error_model="numpy", forceinline=True)
def clip(x: Vector, limit: float) -> Vector:
    """Return x, limited to ± the limit."""
    return most(least(x, limit), -limit)


@compiled(error_model="numpy", forceinline=True)
def clip_three(a: Three, limit: float) -> Three:
    """Return a vector whose components are limited to ± the limit."""
    return Three(clip(a.x, limit), clip(a.y, limit), clip(a.z, limit))


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
