"""Rows of lanes as vectors, and rotations of three-vectors of lanes by attitudes."""

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.three import Three
from fis_tools.compiled.vectors import Vector, least, load, most, store, width_of
from pipeline.array_types import Floats
from pipeline.flight.state.arrays import Moment

#: an attitude, Hill to body, scalar last
Quaternion = tuple[Vector, Vector, Vector, Vector]


@compiled(forceinline=True)
def flight_of(now: Moment, lane: int) -> int:
    """Return the flight of a lane; those without one of their own repeat the last."""
    return now.first + min(lane, now.num_lanes - 1)


@compiled(forceinline=True)
def one(row: Floats) -> Vector:
    """Return a field of one row."""
    return load(row, 0, width_of(row))


@compiled(forceinline=True)
def two(rows: Floats) -> tuple[Vector, Vector]:
    """Return the first two rows of a field."""
    width = width_of(rows)
    return load(rows, 0, width), load(rows, 1, width)


@compiled(forceinline=True)
def four(rows: Floats) -> Quaternion:
    """Return the first four rows of a field."""
    width = width_of(rows)
    return load(rows, 0, width), load(rows, 1, width), load(rows, 2, width), load(rows, 3, width)


@compiled(forceinline=True)
def write_two(rows: Floats, first: int, x: Vector, y: Vector) -> None:
    """Write two rows, from `first` on."""
    store(rows, first, x)
    store(rows, first + 1, y)


@compiled(forceinline=True)
def write_four(rows: Floats, q: Quaternion) -> None:
    """Write the first four rows."""
    store(rows, 0, q[0])
    store(rows, 1, q[1])
    store(rows, 2, q[2])
    store(rows, 3, q[3])


@compiled(error_model="numpy", forceinline=True)
def clip(x: Vector, limit: float) -> Vector:
    """Return x, limited to ± the limit."""
    return most(least(x, limit), -limit)


@compiled(error_model="numpy", forceinline=True)
def clip_three(a: Three, limit: float) -> Three:
    """Return a vector whose components are limited to ± the limit."""
    return Three(clip(a.x, limit), clip(a.y, limit), clip(a.z, limit))


@compiled(error_model="numpy", forceinline=True)
def rows_of(q: Quaternion) -> tuple[Three, Three, Three]:
    """Return the body axes of attitudes in Hill axes: the rows of the matrix from Hill to body."""
    q1, q2, q3, q4 = q
    return (
        Three(q1 * q1 - q2 * q2 - q3 * q3 + q4 * q4, 2 * (q1 * q2 + q3 * q4), 2 * (q1 * q3 - q2 * q4)),
        Three(2 * (q1 * q2 - q3 * q4), -q1 * q1 + q2 * q2 - q3 * q3 + q4 * q4, 2 * (q2 * q3 + q1 * q4)),
        Three(2 * (q1 * q3 + q2 * q4), 2 * (q2 * q3 - q1 * q4), -q1 * q1 - q2 * q2 + q3 * q3 + q4 * q4),
    )


@compiled(error_model="numpy", forceinline=True)
def to_hill(q: Quaternion, a: Three) -> Three:
    """Return vectors in body axes in Hill axes."""
    x, y, z = rows_of(q)
    return Three(
        x.x * a.x + (y.x * a.y + z.x * a.z),  # in this order, so that recorded flights stay as they are
        x.y * a.x + y.y * a.y + z.y * a.z,
        x.z * a.x + y.z * a.y + z.z * a.z,
    )


@compiled(error_model="numpy", forceinline=True)
def to_body(q: Quaternion, a: Three) -> Three:
    """Return vectors in Hill axes in body axes."""
    x, y, z = rows_of(q)
    return Three(
        x.x * a.x + x.y * a.y + x.z * a.z,
        y.x * a.x + y.y * a.y + y.z * a.z,
        z.x * a.x + z.y * a.y + z.z * a.z,
    )


@compiled(error_model="numpy", forceinline=True)
def turned(q: Quaternion, turn: Quaternion, way: float) -> Quaternion:
    """Return attitudes turned about their body axes, or turned back if way is -1."""
    q1, q2, q3, q4 = q
    a, b, c, d = way * turn[0], way * turn[1], way * turn[2], turn[3]
    return (
        q4 * a + q1 * d + q2 * c - q3 * b,
        q4 * b + q2 * d + q3 * a - q1 * c,
        q4 * c + q3 * d + q1 * b - q2 * a,
        q4 * d - q1 * a - q2 * b - q3 * c,
    )
