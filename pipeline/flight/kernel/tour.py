"""The push that leads the deputies of all lanes onto the tour: a closed path keyed to the Sun's angle.

Written out plainly in `pipeline.flight.reference.tour`.
"""

from math import cos, sin

import numpy as np
from numpy.typing import NDArray

from fis_tools.engines.compiled import compiled
from fis_tools.engines.kernel import LANES
from fis_tools.engines.vectors import Vector, least, load, most, select
from pipeline.flight.kernel.arrays import Law, Workspace, World
from pipeline.flight.kernel.lanes import three, two, write_three
from pipeline.flight.signals import constant, slot
from pipeline.physics.motion import drifted_place, place_over, push_by

Floats = NDArray[np.float64]

TOUR_PUSH = slot("tour_push_radial", "tour_push_along_track", "tour_push_cross_track")
URGENT = slot("urgent_radial", "urgent_along_track", "urgent_cross_track")
TOUR_TIME, TOUR_LEAN = constant("tour_time_s"), constant("tour_lean_m")
SKIRT_DISTANCE = constant("skirt_distance_m")
RADIAL, ALONG_TRACK = constant("tour_radial_mean_m"), constant("tour_along_track_mean_m")
CROSS_TRACK, LIFT = constant("tour_cross_track_mean_m"), constant("tour_lift_mean_m")


@compiled(error_model="numpy", forceinline=True)
def waves(values: Floats, first: int, c: Vector, s: Vector) -> Vector:
    """Return a component of the tour from its constants, where cosine and sine of the Sun's angle are."""
    once = values[first] + values[first + 1] * c + values[first + 2] * s
    # cosine and sine of twice the angle
    return once + values[first + 3] * (c * c - s * s) + values[first + 4] * (2.0 * c * s)


@compiled(error_model="numpy")
def sense_tour(world: World, law: Law, values: Floats, work: Workspace) -> None:
    """Write the push that leads every lane onto the tour."""
    lanes, signals, own = work.lanes, work.signals, law.constants
    time, lean, skirt = values[own + TOUR_TIME], values[own + TOUR_LEAN], values[own + SKIRT_DISTANCE]
    turned_cos, turned_sin = cos(world.mean_motion * time), sin(world.mean_motion * time)
    sun_cos, sun_sin = two(lanes.sun)
    c, s = sun_cos * turned_cos + sun_sin * turned_sin, sun_sin * turned_cos - sun_cos * turned_sin
    _, height = two(lanes.sun_height)
    ux, uy = load(signals, URGENT, LANES), load(signals, URGENT + 1, LANES)
    uz = load(signals, URGENT + 2, LANES)
    rx, ry, rz = three(lanes.position)
    vx, vy, vz = three(lanes.velocity)
    place = place_over(world.mean_motion, time)
    px, py, pz = drifted_place(place, rx, ry, rz, vx, vy, vz)
    wanted_z = waves(values, own + CROSS_TRACK, c, s) + height * waves(values, own + LIFT, c, s)
    dx, dy, dz = push_by(
        place,
        waves(values, own + RADIAL, c, s) + lean * ux - px,
        waves(values, own + ALONG_TRACK, c, s) + lean * uy - py,
        wanted_z + lean * uz - pz,
    )
    distance = np.sqrt(rx * rx + ry * ry + rz * rz)
    inward = most(-(dx * rx + dy * ry + dz * rz) / distance, 0.0)
    nearness = least(most((skirt - distance) / max(skirt - world.min_distance, 1.0), 0.0), 1.0)
    turned_away = select(distance < skirt, 2.0 * nearness * inward / distance, 0.0)
    write_three(signals, TOUR_PUSH, dx + turned_away * rx, dy + turned_away * ry, dz + turned_away * rz)
