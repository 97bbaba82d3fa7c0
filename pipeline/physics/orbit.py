"""The chief's orbit about the Earth, at the instants of the integration of the deputy's motion.

Axes are Hill's at the start, held fixed. The chief moves under the Earth's attraction, that of a point plus
its oblateness (D. A. Vallado, Fundamentals of Astrodynamics and Applications, 4th edition, section 8.6.1)::

    a = -mu R / r^3 - 3/2 J2 mu E^2 / r^5 ((1 - 5 w^2 / r^2) R + 2 w p)        w = R . p

with the Earth's radius E and its pole p. It is integrated by Nystrom's method of fourth order (Hairer,
Norsett and Wanner, Solving Ordinary Differential Equations I, II.14).
"""

from math import cos, radians, sin, sqrt
from typing import NamedTuple, Protocol

import numpy as np

from fis_tools.compiled.decorator import compiled
from pipeline.array_types import Floats
from pipeline.physics.illumination import EARTH_RADIUS_M
from pipeline.physics.quaternion import assign, cross, dot, norm

#: largest angle per step of the integration, on the fastest orbit through the perigee, rad
LONGEST_STEP_RAD = 0.02


class Elements(Protocol):
    """The parameters of the chief's orbit and of the deputy's accelerations."""

    @property
    def eccentricity(self) -> float:
        """At the start, from 0 to less than 1."""

    @property
    def true_anomaly_deg(self) -> float:
        """At the start, from the perigee."""

    @property
    def inclination_deg(self) -> float:
        """At the start, to the Earth's equator."""

    @property
    def latitude_argument_deg(self) -> float:
        """At the start, from the ascending node."""

    @property
    def j2(self) -> float:
        """Coefficient of the Earth's oblateness."""

    @property
    def drag_m_s2(self) -> float:
        """Excess of the deputy's drag deceleration over the chief's, at the speed of a circular orbit."""

    @property
    def radiation_m_s2(self) -> float:
        """Excess of the deputy's acceleration by sunlight over the chief's."""


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
    places: Floats  # (N, 3) of the chief
    axes: Floats  # (N, 3, 3) to Hill axes
    turning: Floats  # (N, 3) of Hill axes, rad/s, Hill axes
    # (N, 3) acceleration relative to the chief of a deputy near it: by drag, less the chief's by oblateness
    common: Floats
    # (m, K, 3) further acceleration by drag in each control period of flights, Hill axes; none if constant
    varying: Floats = np.zeros((0, 0, 3))


#: a course that is not used
NO_COURSE = Course(
    *(False, 1, 1.0, 0.0, 0.0, np.zeros(3), 0.0, False),
    *(np.zeros((0, 3)), np.zeros((0, 3, 3)), np.zeros((0, 3)), np.zeros((0, 3))),
)


@compiled
def oblate_attraction(course: Course, place: Floats) -> Floats:
    """Return the contribution of the Earth's oblateness to its attraction, shape (3,), m/s^2."""
    square, height = dot(place, place), dot(place, course.pole)
    scale = -course.oblateness / (square * square * sqrt(square))
    return scale * ((1.0 - 5.0 * height * height / square) * place + 2.0 * height * course.pole)


@compiled
def attraction(course: Course, place: Floats) -> Floats:
    """Return the Earth's attraction at a place, shape (3,), m/s^2."""
    return -course.gravity / norm(place) ** 3 * place + oblate_attraction(course, place)


@compiled
def revolve(course: Course, drag_per_square: float, velocity: Floats) -> None:
    """Fill the arrays of a course from the first place on, where the chief has a velocity, shape (3,)."""
    duration, places, axes, turning = 0.5 * course.step, course.places, course.axes, course.turning
    for at in range(len(places)):
        place = places[at].copy()
        pull = attraction(course, place)
        upward, normal = place / norm(place), cross(place, velocity)
        momentum = norm(normal)
        normal = normal / momentum
        assign(axes[at, 0], upward)
        assign(axes[at, 1], cross(normal, upward))
        assign(axes[at, 2], normal)
        turning[at, 0] = norm(place) * dot(pull, normal) / momentum
        turning[at, 1], turning[at, 2] = 0.0, momentum / dot(place, place)
        slowed = drag_per_square * norm(velocity) * velocity
        assign(course.common[at], -slowed - oblate_attraction(course, place))
        if at + 1 == len(places):
            break
        halfway = place + 0.5 * duration * velocity + 0.125 * duration**2 * pull
        middle = attraction(course, halfway)
        last = attraction(course, place + duration * velocity + 0.5 * duration**2 * middle)
        assign(places[at + 1], place + duration * velocity + duration**2 / 6.0 * (pull + 2.0 * middle))
        velocity = velocity + duration / 6.0 * (pull + 4.0 * middle + last)


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
    places, axes, turning, common = (np.zeros((num_rows, *shape)) for shape in ((3,), (3, 3), (3,), (3,)))
    places[0, 0] = parameter / (1.0 + e * cos(anomaly))
    pole = np.array([sin(slope) * sin(latitude), sin(slope) * cos(latitude), cos(slope)])
    earth = gravity, 1.5 * elements.j2 * gravity * EARTH_RADIUS_M**2, pole
    sunlight = elements.radiation_m_s2, has_shadow
    course = Course(True, num_steps, step, *earth, *sunlight, places, axes, turning, common)
    velocity = sqrt(gravity / parameter) * np.array([e * sin(anomaly), 1.0 + e * cos(anomaly), 0.0])
    revolve(course, elements.drag_m_s2 * radius / gravity, velocity)
    return course
