"""For all lanes, the push that leads onto the tour: a closed path as a function of the Sun's angle.

Plain version in `pipeline.flight.reference.tour`.
"""

from math import atan2, cos, pi, sin, sqrt

import numpy as np
from numpy.typing import NDArray

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.vectors import width_of
from pipeline.flight.state.arrays import Law, Workspace, World
from pipeline.flight.state.signals import constant, slot
from pipeline.physics.motion import drifted_place, place_over, push_by

Floats = NDArray[np.float64]

TOUR_PUSH = slot("tour_push_radial", "tour_push_along_track", "tour_push_cross_track")
URGENT = slot("urgent_radial", "urgent_along_track", "urgent_cross_track")
TOUR_TIME, TOUR_WAIT, TOUR_LEAN = constant("tour_time_s"), constant("tour_wait_s"), constant("tour_lean_m")
SKIRT_DISTANCE = constant("skirt_distance_m")
RADIAL, ALONG_TRACK = constant("tour_radial_mean_m"), constant("tour_along_track_mean_m")
CROSS_TRACK, LIFT = constant("tour_cross_track_mean_m"), constant("tour_lift_mean_m")


@compiled(error_model="numpy", forceinline=True)
def waves(values: Floats, first: int, c: float, s: float) -> float:
    """Return a component of the tour from its constants and the cosine and sine of the Sun's angle."""
    once: float = values[first] + values[first + 1] * c + values[first + 2] * s
    # cosine and sine of twice the angle
    twice: float = values[first + 3] * (c * c - s * s) + values[first + 4] * (2.0 * c * s)
    return once + twice


@compiled(error_model="numpy", inline="always")
def time_ahead(
    least_height: float, mean_motion: float, time: float, wait: float, x: float, y: float, level: float
) -> float:
    """Return the time until a lane is to be on the tour, s; zero if it need not move yet.

    If it would be dark after `time`, the arrival is when the shadow ends, unless that is later than `wait`.

    Parameters
    ----------
    least_height : float
        Component of the Sun's direction along i below which it is dark.
    mean_motion, time, wait : float
        rad/s, s, s; with a `wait` of zero darkness is ignored.
    x, y, level : float
        Cosine and sine of the Sun's angle, and cosine of its elevation.
    """
    turned_cos, turned_sin = cos(mean_motion * time), sin(mean_motion * time)
    if wait == 0.0 or (x * turned_cos + y * turned_sin) * level >= least_height:
        return time
    # end of the shadow
    end_cos = least_height / level
    end_sin = sqrt(1.0 - end_cos * end_cos)
    turn = atan2(y * end_cos - x * end_sin, x * end_cos + y * end_sin)
    ahead = (turn if turn > 0.0 else turn + 2.0 * pi) / mean_motion
    return ahead if ahead <= wait else 0.0


@compiled(error_model="numpy")
def sense_tour(world: World, law: Law, values: Floats, work: Workspace) -> None:
    """Write the push that leads every lane onto the tour."""
    width = width_of(work.lanes)
    lanes, signals, own = work.lanes, work.signals, law.constants
    lean, skirt = values[own + TOUR_LEAN], values[own + SKIRT_DISTANCE]
    for lane in range(width):
        x, y = lanes.sun[0, lane], lanes.sun[1, lane]
        level, height = lanes.sun_height[0, lane], lanes.sun_height[1, lane]
        time = time_ahead(
            world.optics.least_height,
            world.mean_motion,
            values[own + TOUR_TIME],
            values[own + TOUR_WAIT],
            x,
            y,
            level,
        )
        if time == 0.0:
            for axis in range(3):
                signals[TOUR_PUSH + axis, lane] = 0.0
            continue
        turned_cos, turned_sin = cos(world.mean_motion * time), sin(world.mean_motion * time)
        c, s = x * turned_cos + y * turned_sin, y * turned_cos - x * turned_sin
        rx, ry, rz = lanes.position[0, lane], lanes.position[1, lane], lanes.position[2, lane]
        place = place_over(world.mean_motion, time)
        px, py, pz = drifted_place(
            place, rx, ry, rz, lanes.velocity[0, lane], lanes.velocity[1, lane], lanes.velocity[2, lane]
        )
        wanted_z = waves(values, own + CROSS_TRACK, c, s) + height * waves(values, own + LIFT, c, s)
        dx, dy, dz = push_by(
            place,
            waves(values, own + RADIAL, c, s) + lean * signals[URGENT, lane] - px,
            waves(values, own + ALONG_TRACK, c, s) + lean * signals[URGENT + 1, lane] - py,
            wanted_z + lean * signals[URGENT + 2, lane] - pz,
        )
        distance = sqrt(rx * rx + ry * ry + rz * rz)
        if distance < skirt:
            inward = max(-(dx * rx + dy * ry + dz * rz) / distance, 0.0)
            nearness = min((skirt - distance) / max(skirt - world.min_distance, 1.0), 1.0)
            away = 2.0 * nearness * inward / distance
            dx, dy, dz = dx + away * rx, dy + away * ry, dz + away * rz
        signals[TOUR_PUSH, lane] = dx
        signals[TOUR_PUSH + 1, lane] = dy
        signals[TOUR_PUSH + 2, lane] = dz
