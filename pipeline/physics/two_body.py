"""Nonlinear motion of the deputy about the Earth, relative to a chief that orbits it as well.

The difference d of the positions of the two spacecraft is integrated, in axes that do not rotate, rather than
each position, where the difference would lose digits (J. F. Encke's idea). With Battin's function of
``q = d . (d + 2 R) / r^2`` (R. H. Battin, An Introduction to the Mathematics and Methods of Astrodynamics,
revised edition, section 8.4) the difference of the attractions of a point mass has no cancellation::

    -mu / |R + d|^3 (d - f(q) R)        f(q) = (1 + q)^(3/2) - 1 = q (3 + 3 q + q^2) / (1 + (1 + q)^(3/2))

Oblateness, drag and the Sun's pressure are those of `pipeline.physics.orbit.Course`. The steps are Nystrom's
of fourth order, as there. Functions marked ``forceinline`` work on floats and, in compiled flights, on
vectors.
"""

import numpy as np
from numpy.typing import NDArray

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.vectors import Vector
from pipeline.physics.illumination import share_at
from pipeline.physics.orbit import Course
from pipeline.physics.vectors import norm

Floats = NDArray[np.float64]
#: three components
Three = tuple[Vector, Vector, Vector]


@compiled(error_model="numpy", forceinline=True)
def to_inertial(course: Course, row: int, hill: Three) -> Three:
    """Return a vector in Hill axes in axes of the course."""
    c, (x, y, z) = course.axes, hill
    return (
        c[row, 0, 0] * x + c[row, 1, 0] * y + c[row, 2, 0] * z,
        c[row, 0, 1] * x + c[row, 1, 1] * y + c[row, 2, 1] * z,
        c[row, 0, 2] * x + c[row, 1, 2] * y + c[row, 2, 2] * z,
    )


@compiled(error_model="numpy", forceinline=True)
def to_hill(course: Course, row: int, inertial: Three) -> Three:
    """Return a vector in axes of the course in Hill axes."""
    c, (x, y, z) = course.axes, inertial
    return (
        c[row, 0, 0] * x + c[row, 0, 1] * y + c[row, 0, 2] * z,
        c[row, 1, 0] * x + c[row, 1, 1] * y + c[row, 1, 2] * z,
        c[row, 2, 0] * x + c[row, 2, 1] * y + c[row, 2, 2] * z,
    )


@compiled(error_model="numpy", forceinline=True)
def entered(course: Course, row: int, place: Three, velocity: Three) -> tuple[Three, Three]:
    """Return a position and velocity in rotating Hill axes in axes of the course."""
    (x, y, z), (u, v, w) = place, velocity
    wx, wz = course.turning[row, 0], course.turning[row, 2]
    moving = (u - wz * y, v + wz * x - wx * z, w + wx * y)
    return to_inertial(course, row, place), to_inertial(course, row, moving)


@compiled(error_model="numpy", forceinline=True)
def left(course: Course, row: int, place: Three, velocity: Three) -> tuple[Three, Three]:
    """Return a position and velocity in axes of the course in rotating Hill axes."""
    x, y, z = to_hill(course, row, place)
    u, v, w = to_hill(course, row, velocity)
    wx, wz = course.turning[row, 0], course.turning[row, 2]
    return (x, y, z), (u + wz * y, v - wz * x + wx * z, w - wx * y)


@compiled(error_model="numpy", forceinline=True)
def acceleration(course: Course, row: int, place: Three, force: Three, light: Three, shine: Vector) -> Three:
    """Return the acceleration relative to the chief of a deputy near it, axes of the course.

    See `stepped` for force, light and shine.
    """
    x, y, z = place
    rx, ry, rz = course.places[row, 0], course.places[row, 1], course.places[row, 2]
    p1, p2, p3 = course.pole[0], course.pole[1], course.pole[2]
    square = rx * rx + ry * ry + rz * rz
    q = (x * (x + 2.0 * rx) + y * (y + 2.0 * ry) + z * (z + 2.0 * rz)) / square
    far = (1.0 + q) * square
    root = np.sqrt(far)
    f = q * (3.0 + 3.0 * q + q * q) / (1.0 + (1.0 + q) * np.sqrt(1.0 + q))
    pull = -course.gravity / (far * root)
    dx, dy, dz = rx + x, ry + y, rz + z
    height = p1 * dx + p2 * dy + p3 * dz
    oblate = -course.oblateness / (far * far * root)
    outward, poleward = oblate * (1.0 - 5.0 * height * height / far), 2.0 * oblate * height
    fx, fy, fz = to_inertial(course, row, force)
    common = course.common
    return (
        pull * (x - f * rx) + outward * dx + poleward * p1 + common[row, 0] + fx + shine * light[0],
        pull * (y - f * ry) + outward * dy + poleward * p2 + common[row, 1] + fy + shine * light[1],
        pull * (z - f * rz) + outward * dz + poleward * p3 + common[row, 2] + fz + shine * light[2],
    )


@compiled(error_model="numpy", forceinline=True)
def ahead(place: Three, velocity: Three, pull: Three, time: float) -> Three:
    """Return the position after a time of constant acceleration."""
    half = 0.5 * time * time
    return (
        place[0] + time * velocity[0] + half * pull[0],
        place[1] + time * velocity[1] + half * pull[1],
        place[2] + time * velocity[2] + half * pull[2],
    )


@compiled(error_model="numpy", forceinline=True)
def stepped(
    course: Course, row: int, place: Three, velocity: Three, force: Three, light: Three, shine: Three
) -> tuple[Three, Three]:
    """Move a deputy by one step.

    Parameters
    ----------
    course : Course
    row : int
        Even: the start of the step; it ends two rows further.
    place, velocity : three numbers or vectors
        Relative to the chief, m and m/s, axes of the course.
    force : three numbers or vectors
        Held in Hill axes, per mass, m/s^2.
    light : three numbers or vectors
        Acceleration by the full Sun, m/s^2, axes of the course.
    shine : three numbers or vectors
        Visible share of its disc at the beginning, in the middle and at the end of the step.

    Returns
    -------
    place, velocity : three numbers or vectors each
    """
    time = course.step
    first = acceleration(course, row, place, force, light, shine[0])
    middle = acceleration(course, row + 1, ahead(place, velocity, first, 0.5 * time), force, light, shine[1])
    last = acceleration(course, row + 2, ahead(place, velocity, middle, time), force, light, shine[2])
    mean = (
        (first[0] + 2.0 * middle[0]) / 3.0,
        (first[1] + 2.0 * middle[1]) / 3.0,
        (first[2] + 2.0 * middle[2]) / 3.0,
    )
    sixth = time / 6.0
    after = (
        velocity[0] + sixth * (first[0] + 4.0 * middle[0] + last[0]),
        velocity[1] + sixth * (first[1] + 4.0 * middle[1] + last[1]),
        velocity[2] + sixth * (first[2] + 4.0 * middle[2] + last[2]),
    )
    return ahead(place, velocity, mean, time), after


@compiled
def sunshine(course: Course, row: int, sun: Floats) -> float:
    """Return the visible share of the Sun's disc at a row; 1 if nothing hides it.

    `sun`, shape (3,), is the direction towards it in axes of the course.
    """
    if not course.has_shadow:
        return 1.0
    height = 0.0
    for axis in range(3):
        height += course.axes[row, 0, axis] * sun[axis]
    return share_at(height, norm(course.places[row]))


@compiled(error_model="numpy")
def move_beside(course: Course, period: int, state: Floats, force: Floats, sun: Floats) -> Floats:
    """Move a deputy by a control period.

    Parameters
    ----------
    course : Course
    period : int
        Its index, from 0.
    state : array, shape (6,)
        Position (m) and velocity (m/s), Hill axes.
    force : array, shape (3,)
        Held over the period, per mass, m/s^2, Hill axes.
    sun : array, shape (3,)
        Direction towards the Sun at the start of the flight, Hill axes.

    Returns
    -------
    array, shape (6,)
    """
    row = 2 * course.num_steps * period
    place, velocity = entered(course, row, (state[0], state[1], state[2]), (state[3], state[4], state[5]))
    push = (force[0], force[1], force[2])
    light = (-course.radiation * sun[0], -course.radiation * sun[1], -course.radiation * sun[2])
    for _ in range(course.num_steps):
        shine = sunshine(course, row, sun), sunshine(course, row + 1, sun), sunshine(course, row + 2, sun)
        place, velocity = stepped(course, row, place, velocity, push, light, shine)
        row += 2
    place, velocity = left(course, row, place, velocity)
    return np.array([place[0], place[1], place[2], velocity[0], velocity[1], velocity[2]])
