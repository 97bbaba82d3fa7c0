"""Points of the chief that the deputy's camera sees (Choi, Kim and Leeghim, AAS 25-727)."""

from math import inf

from fis_tools.compiled.decorator import compiled
from pipeline.physics.vectors import dot, norm
from pipeline.typing import Floats


@compiled
def is_in_view(
    point_h: Floats, position_h: Floats, boresight_h: Floats, cos_half_angle: float, radius: float
) -> bool:
    """Return whether a point faces the deputy and lies inside its field of view.

    The first condition, ``p . r/(|p| |r|) >= d_c/|r|``, holds between the tangents from the deputy to the
    sphere of points; the second is ``(p - r) . b/|p - r| >= cos(beta)``.

    Parameters
    ----------
    point_h, position_h : array, shape (3,)
        The point and the deputy, m, Hill axes.
    boresight_h : array, shape (3,)
        Unit vector along the camera's axis, Hill axes.
    cos_half_angle : float
        Cosine of the field of view's half angle, beta.
    radius : float
        Of the sphere of points, m.

    Returns
    -------
    bool
        Equality in either condition counts as in view.
    """
    if dot(point_h, position_h) < radius * norm(point_h):
        return False
    line_of_sight = point_h - position_h
    return bool(dot(line_of_sight, boresight_h) >= cos_half_angle * norm(line_of_sight))


@compiled
def is_resolved(
    point_h: Floats,
    normal_h: Floats,
    position_h: Floats,
    boresight_h: Floats,
    sun_h: Floats,
    cos_max_incidence: float,
    max_range: float,
    cos_min_sun_angle: float,
) -> bool:
    """Return whether a camera resolves a point in its view: near, not too obliquely, and not blinded.

    Parameters
    ----------
    point_h, position_h : array, shape (3,)
        The point and the deputy, m, Hill axes.
    normal_h : array, shape (3,)
        Unit vector out of the surface at the point, Hill axes.
    boresight_h, sun_h : array, shape (3,)
        Unit vectors along the camera's axis, and towards the Sun, Hill axes.
    cos_max_incidence : float
        Of the largest angle between the normal and the direction to the deputy.
    max_range : float
        m; infinite for none.
    cos_min_sun_angle : float
        Of the least angle between boresight and Sun; 1 for none.
    """
    line_of_sight = point_h - position_h
    distance = norm(line_of_sight)
    is_near = distance <= max_range
    is_steep = -dot(normal_h, line_of_sight) >= cos_max_incidence * distance
    blinded = dot(boresight_h, sun_h) > (inf if cos_min_sun_angle == 1.0 else cos_min_sun_angle)
    return bool(is_near and is_steep and not blinded)
