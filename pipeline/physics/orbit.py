"""The chief's orbit about the Earth, at the instants of the integration of the deputy's motion.

Axes are Hill's at the start, held fixed. The chief moves under the Earth's attraction, that of a point plus
its oblateness (D. A. Vallado, Fundamentals of Astrodynamics and Applications, 4th edition, section 8.6.1)::

    a = -mu R / r^3 - 3/2 J2 mu E^2 / r^5 ((1 - 5 w^2 / r^2) R + 2 w p)        w = R . p

with the Earth's radius E and its pole p. It is integrated by Nystrom's method of fourth order (Hairer,
Norsett and Wanner, Solving Ordinary Differential Equations I, II.14).
"""

from math import cos, exp, radians, sin, sqrt
from typing import NamedTuple

import numpy as np

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.three import Three, cross, dot, length, three_of, times, write_three
from pipeline.array_types import Floats
from pipeline.constants import EARTH_RADIUS_M

#: largest angle per step of the integration, on the fastest orbit through the perigee, rad
LONGEST_STEP_RAD = 0.02


class Elements(NamedTuple):
    """The chief's orbit at the start, and by how much more the deputy is accelerated than the chief."""

    eccentricity: float  # from 0 to less than 1
    true_anomaly_deg: float  # from the perigee
    inclination_deg: float  # to the Earth's equator
    latitude_argument_deg: float  # from the ascending node
    j2: float  # coefficient of oblateness, at the Earth's radius
    drag_m_s2: float  # deceleration by drag, at the speed of a circular orbit
    radiation_m_s2: float  # acceleration by sunlight
    scale_height_m: float | None  # over which the air thins by a factor e, from the perigee up; None: nowhere


class Air(NamedTuple):
    """How drag slows a craft, by its velocity and its distance from the Earth's centre; m and s.

    The air is as dense as at the perigee, or thins exponentially from there (Vallado, section 8.6.2).
    """

    drag_per_square: float  # at the perigee's density, 1/m
    thinning: float  # 1/m; 0: as dense everywhere
    lowest: float  # distance of the perigee, m


class Course(NamedTuple):
    """A chief's orbit at every half step of the integration, N instants; m and s."""

    is_on: bool  # whether it is used
    num_steps: int  # in a control period
    step: float
    gravity: float  # mu, m^3/s^2
    oblateness: float  # 3/2 J2 mu E^2, m^5/s^2
    pole: Floats  # (3,) the Earth's
    radiation: float  # excess of the deputy's acceleration by sunlight over the chief's
    has_shadow: bool  # whether the Earth hides the Sun
    positions: Floats  # (N, 3) of the chief
    axes: Floats  # (N, 3, 3) to Hill axes
    turning: Floats  # (N, 3) of Hill axes, rad/s, Hill axes
    # (N, 3) acceleration relative to the chief of a deputy near it: by drag, less the chief's by oblateness
    common: Floats
    # (m, K, 3) further acceleration by drag in each control period of flights, Hill axes; none if constant
    varying: Floats = np.zeros((0, 0, 3))
    # (K+1, 3, 3) from the Sun's direction at the start to that at each sample, axes fixed; none if it stays
    sun_turns: Floats = np.zeros((0, 3, 3))
    # by which the chief's distances are multiplied where the Earth stands for a planet that casts a shadow
    earths: float = 1.0


#: a course that is not used
NO_COURSE = Course(
    *(False, 1, 1.0, 0.0, 0.0, np.zeros(3), 0.0, False),
    *(np.zeros((0, 3)), np.zeros((0, 3, 3)), np.zeros((0, 3)), np.zeros((0, 3))),
)


@compiled(error_model="numpy", forceinline=True)
def oblate_attraction(course: Course, position: Three) -> Three:
    """Return the contribution of the Earth's oblateness to its attraction, m/s^2."""
    pole = three_of(course.pole)
    square, height = dot(position, position), dot(position, pole)
    scale = -course.oblateness / (square * square * sqrt(square))
    outward, poleward = (1.0 - 5.0 * height * height / square) * position, 2.0 * height * pole
    return scale * (outward + poleward)


@compiled(error_model="numpy", forceinline=True)
def attraction(course: Course, position: Three) -> Three:
    """Return the Earth's attraction at a position relative to its centre, m/s^2."""
    distance = length(position)
    return (-course.gravity / (distance * (distance * distance))) * position + oblate_attraction(
        course, position
    )


@compiled(error_model="numpy", forceinline=True)
def sun_moved(course: Course, k: int, at_start: Three) -> Three:
    """Return the direction of the Sun at a sample from that at the start, axes fixed."""
    return times(course.sun_turns[k], at_start) if len(course.sun_turns) > 0 else at_start


@compiled(error_model="numpy", forceinline=True)
def ahead(position: Three, velocity: Three, pull: Three, time: float) -> Three:
    """Return the position after a time of constant acceleration."""
    return position + time * velocity + 0.5 * time * time * pull


@compiled(error_model="numpy", forceinline=True)
def velocity_at_end(velocity: Three, first: Three, middle: Three, last: Three, time: float) -> Three:
    """Return the velocity after a step of Nystrom's method, by the accelerations at its three instants."""
    return velocity + (time / 6.0) * (first + 4.0 * middle + last)


@compiled(error_model="numpy", forceinline=True)
def drag_of(air: Air, distance: float, velocity: Three) -> Three:
    """Return the acceleration by drag, m/s^2."""
    slowed = -air.drag_per_square * length(velocity) * velocity
    return exp(air.thinning * (air.lowest - distance)) * slowed if air.thinning > 0.0 else slowed


@compiled(error_model="numpy")
def revolve(course: Course, air: Air, velocity: Three) -> None:
    """Integrate the chief's orbit from its first position, which the course holds, and its velocity there."""
    duration, positions, axes, turning = 0.5 * course.step, course.positions, course.axes, course.turning
    position = three_of(positions[0])
    for at in range(len(positions)):
        pull, normal = attraction(course, position), cross(position, velocity)
        momentum = length(normal)
        upward, normal = position / length(position), normal / momentum
        write_three(positions[at], position)
        write_three(axes[at, 0], upward)
        write_three(axes[at, 1], cross(normal, upward))
        write_three(axes[at, 2], normal)
        turned = length(position) * dot(pull, normal) / momentum
        write_three(turning[at], Three(turned, 0.0, momentum / dot(position, position)))
        slowed = drag_of(air, length(position), velocity)
        write_three(course.common[at], slowed - oblate_attraction(course, position))
        middle = attraction(course, ahead(position, velocity, pull, 0.5 * duration))
        last = attraction(course, ahead(position, velocity, middle, duration))
        moved = (duration * duration / 6.0) * (pull + 2.0 * middle)
        position = position + duration * velocity + moved
        velocity = velocity_at_end(velocity, pull, middle, last, duration)


def course_of(
    mean_motion: float, radius: float, elements: Elements, has_shadow: bool, period: float, num_periods: int
) -> Course:
    """Return the course of a chief over some control periods, s.

    Mean motion (rad/s) and radius, the semi-major axis (m), are those at the start; together they give the
    Earth's gravity, ``n^2 a^3``. A shadow removes the Sun's pressure from the deputy.
    """
    e, anomaly = elements.eccentricity, radians(elements.true_anomaly_deg)
    slope, latitude = radians(elements.inclination_deg), radians(elements.latitude_argument_deg)
    gravity, parameter = mean_motion**2 * radius**3, radius * (1.0 - e * e)
    fastest = sqrt(gravity / (radius * (1.0 - e)) ** 3)
    num_steps = int(np.ceil(period * fastest / LONGEST_STEP_RAD))
    num_rows, step = 2 * num_steps * num_periods + 1, period / num_steps
    positions, axes, turning, common = (np.zeros((num_rows, *shape)) for shape in ((3,), (3, 3), (3,), (3,)))
    positions[0, 0] = parameter / (1.0 + e * cos(anomaly))
    pole = np.array([sin(slope) * sin(latitude), sin(slope) * cos(latitude), cos(slope)])
    earth = gravity, 1.5 * elements.j2 * gravity * EARTH_RADIUS_M**2, pole
    sunlight = elements.radiation_m_s2, has_shadow
    course = Course(True, num_steps, step, *earth, *sunlight, positions, axes, turning, common)
    velocity = sqrt(gravity / parameter) * Three(e * sin(anomaly), 1.0 + e * cos(anomaly), 0.0)
    revolve(course, air_of(elements, radius, gravity), velocity)
    return course


def air_of(elements: Elements, radius: float, gravity: float) -> Air:
    """Return the air of an orbit by its semi-major axis, m, and the Earth's gravity, m^3/s^2."""
    thinning = 1.0 / elements.scale_height_m if elements.scale_height_m else 0.0
    return Air(elements.drag_m_s2 * radius / gravity, thinning, radius * (1.0 - elements.eccentricity))
