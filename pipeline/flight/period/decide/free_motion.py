"""Signals of the free motion of all lanes: ellipse, centre, phase and closest approach.

Free motion is an ellipse, twice as long along the track as it is high, about a centre that drifts along the
track (Clohessy and Wiltshire, J. Aerospace Sci. 27, 1960). Plain version in
`pipeline.flight.reference.channels`.
"""

from math import cos, sin

import numpy as np
from numpy.typing import NDArray

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.vectors import least, most, select, store
from pipeline.flight.period.look.guidance import MIN_PROJECTION_M
from pipeline.flight.state.arrays import Law, Workspace, World
from pipeline.flight.state.lanes import three, two, write_three, write_two
from pipeline.flight.state.signals import constant, slot
from pipeline.physics.motion import ORBIT_PARTS, drifted_place, place_of

Floats = NDArray[np.float64]

CENTRE = slot("centre_radial", "centre_along_track")
PREDICTED_CENTRE, CLOSEST_APPROACH = slot("predicted_centre_along_track"), slot("closest_approach")
RING_ERROR = slot("ring_error_radial", "ring_error_along_track")
TARGET_DIRECTION = slot("target_radial", "target_along_track", "target_cross_track")
SUN_BEARING, TARGET_SETTING = slot("sun_alignment", "sun_ahead"), slot("target_setting")
RING_SIZE, RING_LEAD = constant("ring_size_m"), constant("ring_lead_rad")
PREDICTION_TIME = constant("prediction_time_s")


@compiled(error_model="numpy")
def sense_orbit(world: World, law: Law, values: Floats, work: Workspace) -> None:
    """Write the signals of free motion of every lane."""
    n = world.mean_motion
    size = values[law.constants + RING_SIZE] if law.constants >= 0 else 0.0
    lead = values[law.constants + RING_LEAD] if law.constants >= 0 else 0.0
    ahead_s = values[law.constants + PREDICTION_TIME] if law.constants >= 0 else 0.0
    drift = 1.5 * n * ahead_s
    along, across = size * cos(lead), size * sin(lead)
    signals = work.signals
    sun_cos, sun_sin = two(work.lanes.sun)
    rx, ry, _ = three(work.lanes.position)
    vx, vy, _ = three(work.lanes.velocity)
    ahead = 2.0 * vy / n
    centre_x, centre_y = 4.0 * rx + ahead, ry - 2.0 * vx / n
    write_two(signals, CENTRE, centre_x, centre_y)
    store(signals, PREDICTED_CENTRE, centre_y - drift * centre_x)
    reach = most(np.sqrt(rx * rx + ry * ry), MIN_PROJECTION_M)
    bearing_along, bearing_across = rx * sun_cos + ry * sun_sin, rx * sun_sin - ry * sun_cos
    write_two(signals, SUN_BEARING, bearing_along / reach, bearing_across / reach)
    tx, ty, tz = three(work.lanes.target)
    length = most(np.sqrt(tx * tx + ty * ty + tz * tz), MIN_PROJECTION_M)
    write_three(signals, TARGET_DIRECTION, tx / length, ty / length, tz / length)
    store(signals, TARGET_SETTING, (sun_cos * ty - sun_sin * tx) / length)
    place_cos, place_sin = sun_cos * along + sun_sin * across, sun_sin * along - sun_cos * across
    write_two(signals, RING_ERROR, -3.0 * rx - ahead - place_cos, vx / n - place_sin)


@compiled(error_model="numpy")
def sense_approach(world: World, work: Workspace) -> None:
    """Write every lane's closest approach to the chief within an orbit of free drift.

    Uses chords between places on the path, as in `pipeline.physics.motion.closest_approach`.
    """
    rx, ry, rz = three(work.lanes.position)
    vx, vy, vz = three(work.lanes.velocity)
    px, py, pz = rx, ry, rz
    nearest = rx * rx + ry * ry + rz * rz
    for part in range(ORBIT_PARTS):
        x, y, z = drifted_place(place_of(world.orbit_parts, part), rx, ry, rz, vx, vy, vz)
        dx, dy, dz = x - px, y - py, z - pz
        length = dx * dx + dy * dy + dz * dz
        share = -(px * dx + py * dy + pz * dz) / select(length > 0.0, length, 1.0)
        share = least(most(share, 0.0), 1.0)
        gx, gy, gz = px + share * dx, py + share * dy, pz + share * dz
        nearest = least(gx * gx + gy * gy + gz * gz, nearest)
        px, py, pz = x, y, z
    store(work.signals, CLOSEST_APPROACH, np.sqrt(nearest))
