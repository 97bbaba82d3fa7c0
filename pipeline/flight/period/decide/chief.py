"""Turning aside near the chief: what every push towards points has in common."""

from math import sqrt

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.three import Three, dot, plus, scaled


@compiled(error_model="numpy", forceinline=True)
def turned_aside(push: Three, scale: float, place: Three, skirt: float, min_distance: float) -> Three:
    """Return ``push / scale``, turned outwards nearer to the chief than a skirt.

    At the skirt nothing changes; at the least distance and below, the part of the push that leads inwards is
    reversed; in between, as much of it as the distance is on its way from one to the other.

    Parameters
    ----------
    push : Three
        Hill axes.
    scale : float
        Above zero.
    place : Three
        The deputy's, m, Hill axes.
    skirt, min_distance : float
        m; with a skirt up to the least distance nothing is turned.
    """
    wanted = Three(push.x / scale, push.y / scale, push.z / scale)
    distance = sqrt(dot(place, place))
    if not min_distance < skirt or not distance < skirt:
        return wanted
    inward = max(0.0, -dot(push, place) / (scale * distance))
    nearness = min(1.0, (skirt - distance) / (skirt - min_distance))
    return plus(wanted, scaled(2.0 * nearness * inward / distance, place))
