"""Whether points of the chief are lit and in view, for flights, previews, planners and plans.

The conditions are the paper's (Choi, Kim and Leeghim, AAS 25-727), without square roots, for floats or for
vectors of points.
"""

from typing import NamedTuple

import numpy as np

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.three import Three
from fis_tools.compiled.vectors import Mask, Vector, most
from pipeline.physics.illumination import ASTRONOMICAL_UNIT_M

#: rows of data on the surface at points: the unit normal out of it, ``n . p``, ``|p|^2``
NORMAL, HEIGHT, SQUARE, NUM_SURFACE = 0, 3, 4, 5


class Sight(NamedTuple):
    """The parameters that decide whether a point of the chief is lit and in view."""

    sun_threshold: float  # a point is lit where ``p . s`` exceeds it, m
    horizon: float  # square of the radius of the sphere of points, m^2
    cos_squared: float  # of the field of view's half angle, which is below 90 deg


def sight_of(radius: float, half_angle: float) -> Sight:
    """Return the sight of a camera with a half angle in rad, of points on a sphere with a radius in m."""
    return Sight(radius * radius / ASTRONOMICAL_UNIT_M, radius * radius, float(np.cos(half_angle) ** 2))


@compiled(inline="always")
def is_lit(sight: Sight, px: Vector, py: Vector, sun_x: float, sun_y: float) -> Mask:
    """Return which points sunlight reaches; the Sun's direction lies in Hill's i-j plane."""
    return px * sun_x + py * sun_y > sight.sun_threshold


@compiled(inline="always")
def is_facing(sight: Sight, along: Vector) -> Mask:
    """Return which points are above the horizon of a place r, by ``p . r``."""
    return along >= sight.horizon


@compiled(inline="always")
def is_in_cone(sight: Sight, towards: Vector, squared: Vector) -> Mask:
    """Return which points are in the field of view along b, by ``(p - r) . b`` and ``|p - r|^2 |b|^2``."""
    return (towards > 0.0) & (towards * towards >= sight.cos_squared * squared)


@compiled(inline="always")
def fits_from(sight: Sight) -> float:
    """Return the square of the distance from which all of the chief fits into the field of view, m^2.

    The camera looks at its centre: ``sin(half angle) >= radius / distance``.
    """
    return sight.horizon / (1.0 - sight.cos_squared)


class Optics(NamedTuple):
    """Further parameters of sight in a world whose light or camera are not the paper's."""

    least_height: float  # of the Sun's direction along i; below it the Earth's shadow begins
    cos_squared: float  # ``c |c|`` of the cosine c of the field of view's half angle, up to 180 deg
    incidence_squared: float  # of the cosine of the largest angle from a point's normal to the deputy
    range_squared: float  # of the range limit, m^2; infinite for none
    most_sunward: float  # cosine from boresight to Sun beyond which the camera is blinded; infinite for none
    past_terminator: float  # sine of the angle by which the Sun may be below the tangent plane of a point


@compiled(inline="always")
def sunlight(optics: Optics, sun_x: float, sun_y: float, cos_elevation: float, sin_elevation: float) -> Three:
    """Return the direction to the Sun, Hill axes, from that of its angle in the plane; zeros in shadow."""
    x = cos_elevation * sun_x
    shines = 1.0 if x >= optics.least_height else 0.0
    return Three(shines * x, shines * cos_elevation * sun_y, shines * sin_elevation)


@compiled(inline="always")
def is_sunlit(along_sun: Vector, height: Vector) -> Mask:
    """Return which points have the Sun above their tangent plane, by ``n . s`` and ``n . p``.

    If the plane passes behind the chief's centre, by ``n . s > 0``, which is also false without light.
    """
    return along_sun > most(height, 0.0) * (1.0 / ASTRONOMICAL_UNIT_M)


@compiled(inline="always")
def is_resolved(optics: Optics, above: Vector, towards: Vector, squared: Vector) -> Mask:
    """Return which points a camera resolves, by height ``n . (r - p)``, ``(p - r) . b``, ``|p - r|^2``."""
    is_facing_it = (above >= 0.0) & (above * above >= optics.incidence_squared * squared)
    is_in_field = towards * abs(towards) >= optics.cos_squared * squared
    return is_facing_it & is_in_field & (squared <= optics.range_squared)
