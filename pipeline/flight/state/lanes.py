"""Rows of lanes as vectors, and their arctangent.

It is accurate to rounding. The approximation is that of S. L. Moshier, "Methods and Programs for Mathematical
Functions" (Cephes library), 1989.
"""

from math import pi
from typing import Any

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.three import Three
from fis_tools.compiled.vectors import Vector, least, load, most, select, store, width_of
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


TAN_PI_8 = 0.4142135623730950


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
