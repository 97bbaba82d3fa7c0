"""What the deputy's camera sees of the chief (Choi, Kim and Leeghim, AAS 25-727).

`is_in_view` and `pipeline.physics.illumination.is_illuminated` say it as the paper does, for one point.
Compiled flights, previews and planners ask the functions that take a `Sight`: the same conditions without
roots, for floats or for vectors of points.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fis_tools.engines.compiled import compiled
from fis_tools.engines.vectors import Mask, Vector
from pipeline.physics.illumination import ASTRONOMICAL_UNIT_M
from pipeline.physics.vectors import dot, norm

Floats = NDArray[np.float64]


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


@compiled
def is_in_view(
    point_h: Floats, position_h: Floats, boresight_h: Floats, cos_half_angle: float, radius: float
) -> bool:
    """Tell whether a point faces the deputy and lies inside its field of view.

    The first condition, ``p . r/(|p| |r|) >= d_c/|r|``, holds between the tangents from the deputy to the
    sphere of points; the second is ``(p - r) . b/|p - r| >= cos(beta)``.

    Parameters
    ----------
    point_h, position_h : array, shape (3,)
        The point and the deputy, m, Hill axes.
    boresight_h : array, shape (3,)
        Unit vector along which the camera looks, Hill axes.
    cos_half_angle : float
        Cosine of the field of view's half angle, beta.
    radius : float
        Of the sphere of points, m.

    Returns
    -------
    bool
        Both ends of both conditions count as in view.
    """
    if dot(point_h, position_h) < radius * norm(point_h):
        return False
    line_of_sight = point_h - position_h
    return bool(dot(line_of_sight, boresight_h) >= cos_half_angle * norm(line_of_sight))
