"""Whether points of the chief are lit and in view, as flights, previews, planners and plans ask for it.

The conditions are those of `pipeline.physics.illumination.is_illuminated` and
`pipeline.physics.visibility.is_in_view`, without roots, for floats or for vectors of points.
"""

from typing import NamedTuple

import numpy as np

from fis_tools.engines.compiled import compiled
from fis_tools.engines.vectors import Mask, Vector
from pipeline.physics.illumination import ASTRONOMICAL_UNIT_M


class Sight(NamedTuple):
    """What it depends on whether a point of the chief is lit and in view.

    Attributes
    ----------
    sun_threshold : float
        A point is lit where ``p . s`` exceeds it, m.
    horizon : float
        Square of the radius of the sphere of points, m^2.
    cos_squared : float
        Of the field of view's half angle, which is less than a right one.
    """

    sun_threshold: float
    horizon: float
    cos_squared: float


def sight_of(radius: float, half_angle: float) -> Sight:
    """Return the sight of a camera with a half angle in rad, of points on a sphere with a radius in m."""
    return Sight(radius * radius / ASTRONOMICAL_UNIT_M, radius * radius, float(np.cos(half_angle) ** 2))


@compiled(inline="always")
def is_lit(sight: Sight, px: Vector, py: Vector, sun_x: float, sun_y: float) -> Mask:
    """Tell which points sunlight reaches; the Sun's direction lies in Hill's i-j plane."""
    return px * sun_x + py * sun_y > sight.sun_threshold


@compiled(inline="always")
def is_facing(sight: Sight, along: Vector) -> Mask:
    """Tell which points are above the horizon of a place r, by ``p . r``."""
    return along >= sight.horizon


@compiled(inline="always")
def is_in_cone(sight: Sight, towards: Vector, squared: Vector) -> Mask:
    """Tell which points are in the field of view along b, by ``(p - r) . b`` and ``|p - r|^2 |b|^2``."""
    return (towards > 0.0) & (towards * towards >= sight.cos_squared * squared)


@compiled(inline="always")
def fits_from(sight: Sight) -> float:
    """Return the square of the distance from which all of the chief fits into the field of view, m^2.

    The camera looks at its centre: ``sin(half angle) >= radius / distance``.
    """
    return sight.horizon / (1.0 - sight.cos_squared)
