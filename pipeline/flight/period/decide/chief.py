"""Turning aside near the chief: what every push towards points has in common."""

from math import sqrt

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.three import Three, dot, lane_of, plus, scaled
from pipeline.flight.state.arrays import Control, Moment, constant_of
from pipeline.flight.state.signals import constant

SKIRT_DISTANCE = constant("skirt_distance_m")


@compiled(error_model="numpy", forceinline=True)
def turned_aside(now: Moment, control: Control, lane: int, push: Three, scale: float) -> Three:
    """Return ``push / scale`` of a lane, Hill axes, turned outwards nearer to the chief than the skirt.

    At the skirt nothing changes; at the least distance and below, the part of the push that leads inwards is
    reversed; in between, as much of it as the distance is on its way from one to the other. With a skirt up
    to the least distance nothing is turned.
    """
    place, skirt = lane_of(now.state.belief.position, 0, lane), constant_of(control, SKIRT_DISTANCE)
    wanted, min_distance = Three(push.x / scale, push.y / scale, push.z / scale), now.world.min_distance
    distance = sqrt(dot(place, place))
    if not min_distance < skirt or not distance < skirt:
        return wanted
    inward = max(0.0, -dot(push, place) / (scale * distance))
    nearness = min(1.0, (skirt - distance) / (skirt - min_distance))
    return plus(wanted, scaled(2.0 * nearness * inward / distance, place))
