"""Nonlinear motion of the deputy about the Earth, relative to a chief that orbits it as well.

The difference d of the positions of the two spacecraft is integrated, in axes that do not rotate, rather than
each position, where the difference would lose digits (J. F. Encke's idea). With Battin's function of
``q = d . (d + 2 R) / r^2`` (R. H. Battin, An Introduction to the Mathematics and Methods of Astrodynamics,
revised edition, section 8.4) the difference of the attractions of a point mass has no cancellation::

    -mu / |R + d|^3 (d - f(q) R)        f(q) = (1 + q)^(3/2) - 1 = q (3 + 3 q + q^2) / (1 + (1 + q)^(3/2))

Everything else, and the method of the steps, is that of `pipeline.physics.orbit`.
"""

import numpy as np

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.three import Three, dot, three_of, times
from pipeline.physics.orbit import Course, ahead, velocity_at_end


@compiled(error_model="numpy", forceinline=True)
def to_inertial(course: Course, row: int, hill: Three) -> Three:
    """Transform a vector from Hill axes to axes of the course."""
    return times(course.axes[row].T, hill)


@compiled(error_model="numpy", forceinline=True)
def inertial_from_hill(course: Course, row: int, position: Three, velocity: Three) -> tuple[Three, Three]:
    """Transform position and velocity from rotating Hill axes to the inertial axes of a `Course`."""
    (x, y, z), (u, v, w) = position, velocity
    wx, wz = course.turning[row, 0], course.turning[row, 2]
    moving = Three(u - wz * y, v + wz * x - wx * z, w + wx * y)
    return to_inertial(course, row, position), to_inertial(course, row, moving)


@compiled(error_model="numpy", forceinline=True)
def hill_from_inertial(course: Course, row: int, position: Three, velocity: Three) -> tuple[Three, Three]:
    """Transform position and velocity from the inertial axes of a `Course` to rotating Hill axes."""
    x, y, z = times(course.axes[row], position)
    u, v, w = times(course.axes[row], velocity)
    wx, wz = course.turning[row, 0], course.turning[row, 2]
    return Three(x, y, z), Three(u + wz * y, v - wz * x + wx * z, w - wx * y)


@compiled(error_model="numpy", forceinline=True)
def acceleration(course: Course, row: int, d: Three, force: Three, light: Three, shine: float) -> Three:
    """Return the acceleration relative to the chief of a deputy at d from it, axes of the course.

    See `stepped` for force, light and shine.
    """
    chief, pole = three_of(course.positions[row]), three_of(course.pole)
    square = dot(chief, chief)
    q = dot(d, d + 2.0 * chief) / square
    far = (1.0 + q) * square
    root: float = np.sqrt(far)
    f: float = q * (3.0 + 3.0 * q + q * q) / (1.0 + (1.0 + q) * np.sqrt(1.0 + q))
    pull = -course.gravity / (far * root)
    deputy = chief + d
    height = dot(pole, deputy)
    oblate = -course.oblateness / (far * far * root)
    outward, poleward = oblate * (1.0 - 5.0 * height * height / far), 2.0 * oblate * height
    push, common = to_inertial(course, row, force), three_of(course.common[row])
    # summed in this order, so that recorded flights stay as they are
    pulled = pull * (d - f * chief) + outward * deputy + poleward * pole + common
    return pulled + push + shine * light


@compiled(error_model="numpy", forceinline=True)
def stepped(
    course: Course, row: int, position: Three, velocity: Three, force: Three, light: Three, shine: Three
) -> tuple[Three, Three]:
    """Return a deputy's position (m) and velocity (m/s) relative to the chief a step later, course axes.

    The step begins at a row, even, and ends two rows further. The force is held in Hill axes, per mass,
    m/s^2; light is the acceleration by the full Sun, m/s^2, course axes, and shine the visible share of its
    disc at the beginning, in the middle and at the end of the step.
    """
    time = course.step
    first = acceleration(course, row, position, force, light, shine.x)
    middle = acceleration(
        course, row + 1, ahead(position, velocity, first, 0.5 * time), force, light, shine.y
    )
    last = acceleration(course, row + 2, ahead(position, velocity, middle, time), force, light, shine.z)
    mean = (first + 2.0 * middle) / 3.0
    return ahead(position, velocity, mean, time), velocity_at_end(velocity, first, middle, last, time)
