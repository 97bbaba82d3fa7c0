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
from pipeline.physics.vectors import assign, cross, dot, norm

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
    """A chief's orbit at every half step of the integration, N instants.

    Attributes
    ----------
    is_on : bool
        Whether it is used.
    num_steps : int
        In a control period.
    step : float
        s.
    gravity : float
        mu, m^3/s^2.
    oblateness : float
        3/2 J2 mu E^2, m^5/s^2.
    pole : (3,)
        The Earth's.
    radiation : float
        Excess of the deputy's acceleration by sunlight over the chief's, m/s^2.
    has_shadow : bool
        Whether the Earth hides the Sun.
    places : (N, 3)
        Of the chief, m.
    axes : (N, 3, 3)
        To Hill axes.
    turning : (N, 3)
        Of Hill axes, rad/s, Hill axes.
    common : (N, 3)
        Acceleration relative to the chief of a deputy anywhere near it, m/s^2: that of drag, minus that of
        the chief by oblateness.
    varying : (m, K, 3)
        Further acceleration by drag in each control period of each flight, m/s^2, Hill axes; no flights if it
        does not vary.
    """

    is_on: bool
    num_steps: int
    step: float
    gravity: float
    oblateness: float
    pole: Floats
    radiation: float
    has_shadow: bool
    places: Floats
    axes: Floats
    turning: Floats
    common: Floats
    varying: Floats = np.zeros((0, 0, 3))


#: a course that is not used
NO_COURSE = Course(
    *(False, 1, 1.0, 0.0, 0.0, np.zeros(3), 0.0, False),
    *(np.zeros((0, 3)), np.zeros((0, 3, 3)), np.zeros((0, 3)), np.zeros((0, 3))),
)


@compiled
def oblate_attraction(oblateness: float, pole: Floats, place: Floats) -> Floats:
    """Return the contribution of the Earth's oblateness to its attraction, shape (3,), m/s^2."""
    square, height = dot(place, place), dot(place, pole)
    scale = -oblateness / (square * square * sqrt(square))
    return scale * ((1.0 - 5.0 * height * height / square) * place + 2.0 * height * pole)


@compiled
def attraction(gravity: float, oblateness: float, pole: Floats, place: Floats) -> Floats:
    """Return the Earth's attraction at a place, shape (3,), m/s^2."""
    return -gravity / norm(place) ** 3 * place + oblate_attraction(oblateness, pole, place)


@compiled
def revolve(
    gravity: float,
    oblateness: float,
    pole: Floats,
    drag_per_square: float,
    duration: float,
    places: Floats,
    velocity: Floats,
    axes: Floats,
    turning: Floats,
    common: Floats,
) -> None:
    """Fill the arrays of a `Course` from the first place on, by steps of a duration, s."""
    for at in range(len(places)):
        place = places[at].copy()
        pull = attraction(gravity, oblateness, pole, place)
        upward, normal = place / norm(place), cross(place, velocity)
        momentum = norm(normal)
        normal = normal / momentum
        assign(axes[at, 0], upward)
        assign(axes[at, 1], cross(normal, upward))
        assign(axes[at, 2], normal)
        turning[at, 0] = norm(place) * dot(pull, normal) / momentum
        turning[at, 1], turning[at, 2] = 0.0, momentum / dot(place, place)
        slowed = drag_per_square * norm(velocity) * velocity
        assign(common[at], -slowed - oblate_attraction(oblateness, pole, place))
        if at + 1 == len(places):
            break
        halfway = place + 0.5 * duration * velocity + 0.125 * duration**2 * pull
        middle = attraction(gravity, oblateness, pole, halfway)
        last = attraction(gravity, oblateness, pole, place + duration * velocity + 0.5 * duration**2 * middle)
        assign(places[at + 1], place + duration * velocity + duration**2 / 6.0 * (pull + 2.0 * middle))
        velocity = velocity + duration / 6.0 * (pull + 4.0 * middle + last)


def course_of(
    mean_motion: float, radius: float, elements: Elements, has_shadow: bool, period: float, num_periods: int
) -> Course:
    """Return the course of a chief over some control periods.

    Parameters
    ----------
    mean_motion : float
        At the start, rad/s.
    radius : float
        Semi-major axis at the start, m; with the mean motion it gives the Earth's gravity, ``n^2 a^3``.
    elements : Elements
    has_shadow : bool
        Whether the Earth's shadow removes the Sun's pressure from the deputy.
    period : float
        A control period, s.
    num_periods : int
    """
    e, anomaly = elements.eccentricity, radians(elements.true_anomaly_deg)
    slope, latitude = radians(elements.inclination_deg), radians(elements.latitude_argument_deg)
    gravity, parameter = mean_motion**2 * radius**3, radius * (1.0 - e * e)
    fastest = sqrt(gravity / (radius * (1.0 - e)) ** 3)
    num_steps = int(np.ceil(period * fastest / LONGEST_STEP_RAD))
    num_rows, oblateness = 2 * num_steps * num_periods + 1, 1.5 * elements.j2 * gravity * EARTH_RADIUS_M**2
    pole = np.array([sin(slope) * sin(latitude), sin(slope) * cos(latitude), cos(slope)])
    places, axes, turning, common = (np.zeros((num_rows, *shape)) for shape in ((3,), (3, 3), (3,), (3,)))
    places[0, 0] = parameter / (1.0 + e * cos(anomaly))
    velocity = sqrt(gravity / parameter) * np.array([e * sin(anomaly), 1.0 + e * cos(anomaly), 0.0])
    step, drag_per_square = period / num_steps, elements.drag_m_s2 * radius / gravity
    revolve(gravity, oblateness, pole, drag_per_square, 0.5 * step, places, velocity, axes, turning, common)
    return Course(
        True,
        num_steps,
        step,
        gravity,
        oblateness,
        pole,
        elements.radiation_m_s2,
        has_shadow,
        places,
        axes,
        turning,
        common,
    )
