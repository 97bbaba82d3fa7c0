"""A start in the middle of a flight: what was given to it, held against what a step is given."""

from math import radians, sin
from typing import Any

from fis_tools.compiled.decorator import compiled
from pipeline.array_types import Floats
from pipeline.flight.period.look.optics import Pair, sun_after
from pipeline.flight.state.arrays import Moment, World
from pipeline.onboard.messages import APART_DEG
from pipeline.onboard.translator import Translator
from pipeline.onboard.values import Expression

#: the square of the distance between two unit vectors that are as far apart as the Sun may be
MOST_APART = (2.0 * sin(radians(APART_DEG / 2.0))) ** 2


@compiled(error_model="numpy")
def suns_apart(
    world: World,
    sun_at_start: Floats,
    height_at_start: Floats,
    angle: Pair,
    elevation: Pair,
    k: int,
    is_in_plane: bool,
) -> float:
    """Return the square of the distance between unit vectors to the Sun: a step's, and the start's turned on.

    In the orbit plane the elevation is not read.
    """
    angle_at_start = sun_at_start[0, 0], sun_at_start[1, 0]
    due, high = sun_after(world, angle_at_start, (height_at_start[0, 0], height_at_start[1, 0]), k)
    if is_in_plane:
        radial, along_track, cross_track = angle[0] - due[0], angle[1] - due[1], 0.0
    else:
        radial = elevation[0] * angle[0] - high[0] * due[0]
        along_track = elevation[0] * angle[1] - high[0] * due[1]
        cross_track = elevation[1] - high[1]
    return radial * radial + along_track * along_track + cross_track * cross_track


def write_restart(translator: Translator, now: Moment, *, is_in_plane: bool) -> None:
    """Write as C how far a step's Sun is from that of the start, if anything is computed from the latter."""
    if "sun_at_start" not in translator.members:
        return

    def pair(name: str) -> Any:
        return tuple(Expression(f"{name}_{part}", is_name=True) for part in ("cosine", "sine"))

    lanes = now.state.lanes
    arguments = {
        **{"world": now.world, "k": now.k, "is_in_plane": is_in_plane},
        **{"sun_at_start": lanes.sun_at_start, "height_at_start": lanes.height_at_start},
        **{"angle": pair("angle"), "elevation": pair("elevation")},
    }
    translator.write("suns_apart", suns_apart, arguments)
