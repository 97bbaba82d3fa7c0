"""What the deputies of all lanes know of their free motion: its ellipse, its centre, phase, closest approach.

Free motion is an ellipse, twice as long along the track as it is high, about a centre that drifts along the
track (Clohessy and Wiltshire, J. Aerospace Sci. 27, 1960). Written out plainly in
`pipeline.flight.reference.channels`.
"""

from math import cos, sin, sqrt

import numpy as np
from numpy.typing import NDArray

from fis_tools.engines.compiled import compiled
from fis_tools.engines.kernel import LANES
from pipeline.flight.guidance import MIN_PROJECTION_M
from pipeline.flight.kernel.arrays import (
    RX,
    RY,
    RZ,
    SUN_COS,
    SUN_SIN,
    VX,
    VY,
    VZ,
    Law,
    Workspace,
    World,
)
from pipeline.flight.signals import constant, slot
from pipeline.physics.motion import ORBIT_PARTS, drifted_place, place_of

Floats = NDArray[np.float64]

CENTRE = slot("centre_radial", "centre_along_track")
PREDICTED_CENTRE, CLOSEST_APPROACH = slot("predicted_centre_along_track"), slot("closest_approach")
RING_ERROR = slot("ring_error_radial", "ring_error_along_track")
TARGET_DIRECTION = slot("target_radial", "target_along_track", "target_cross_track")
SUN_BEARING, TARGET_SETTING = slot("sun_alignment", "sun_ahead"), slot("target_setting")
RING_SIZE, RING_LEAD = constant("ring_size_m"), constant("ring_lead_rad")
PREDICTION_TIME = constant("prediction_time_s")


@compiled(error_model="numpy", fastmath={"contract"})
def sense_orbit(world: World, law: Law, values: Floats, work: Workspace, k: int) -> None:
    """Write the signals of natural motion of every lane."""
    n = world.mean_motion
    size = values[law.constants + RING_SIZE] if law.constants >= 0 else 0.0
    lead = values[law.constants + RING_LEAD] if law.constants >= 0 else 0.0
    ahead_s = values[law.constants + PREDICTION_TIME] if law.constants >= 0 else 0.0
    drift = 1.5 * n * ahead_s
    turned = n * world.control_period * k
    turned_cos, turned_sin = cos(turned), sin(turned)
    along, across = size * cos(lead), size * sin(lead)
    lanes, signals = work.lanes, work.signals
    for i in range(LANES):
        sun_cos = lanes[SUN_COS + i] * turned_cos + lanes[SUN_SIN + i] * turned_sin
        sun_sin = lanes[SUN_SIN + i] * turned_cos - lanes[SUN_COS + i] * turned_sin
        rx, ry, vx, vy = lanes[RX + i], lanes[RY + i], lanes[VX + i], lanes[VY + i]
        ahead = 2.0 * vy / n
        signals[LANES * CENTRE + i] = 4.0 * rx + ahead
        signals[LANES * (CENTRE + 1) + i] = ry - 2.0 * vx / n
        signals[LANES * PREDICTED_CENTRE + i] = (
            signals[LANES * (CENTRE + 1) + i] - drift * signals[LANES * CENTRE + i]
        )
        reach = max(sqrt(rx * rx + ry * ry), MIN_PROJECTION_M)
        signals[LANES * SUN_BEARING + i] = (rx * sun_cos + ry * sun_sin) / reach
        signals[LANES * (SUN_BEARING + 1) + i] = (rx * sun_sin - ry * sun_cos) / reach
        tx = signals[LANES * TARGET_DIRECTION + i]
        ty = signals[LANES * (TARGET_DIRECTION + 1) + i]
        tz = signals[LANES * (TARGET_DIRECTION + 2) + i]
        length = max(sqrt(tx * tx + ty * ty + tz * tz), MIN_PROJECTION_M)
        signals[LANES * TARGET_DIRECTION + i] = tx / length
        signals[LANES * (TARGET_DIRECTION + 1) + i] = ty / length
        signals[LANES * (TARGET_DIRECTION + 2) + i] = tz / length
        signals[LANES * TARGET_SETTING + i] = (sun_cos * ty - sun_sin * tx) / length
        place_cos, place_sin = sun_cos * along + sun_sin * across, sun_sin * along - sun_cos * across
        signals[LANES * RING_ERROR + i] = -3.0 * rx - ahead - place_cos
        signals[LANES * (RING_ERROR + 1) + i] = vx / n - place_sin


@compiled(error_model="numpy", fastmath={"contract"})
def sense_approach(world: World, work: Workspace) -> None:
    """Write how near every lane comes to the chief within an orbit of free drift.

    Chords between places on the way, as in `pipeline.physics.motion.closest_approach`.
    """
    lanes, passing = work.lanes, work.passing
    for i in range(LANES):
        rx, ry, rz = lanes[RX + i], lanes[RY + i], lanes[RZ + i]
        passing[i], passing[LANES + i], passing[2 * LANES + i] = rx, ry, rz
        passing[3 * LANES + i] = rx * rx + ry * ry + rz * rz
    for part in range(ORBIT_PARTS):
        place = place_of(world.orbit_parts, part)
        for i in range(LANES):
            px, py, pz = passing[i], passing[LANES + i], passing[2 * LANES + i]
            rx, ry, rz = lanes[RX + i], lanes[RY + i], lanes[RZ + i]
            x, y, z = drifted_place(place, rx, ry, rz, lanes[VX + i], lanes[VY + i], lanes[VZ + i])
            dx, dy, dz = x - px, y - py, z - pz
            length = dx * dx + dy * dy + dz * dz
            share = -(px * dx + py * dy + pz * dz) / (length if length > 0.0 else 1.0)
            share = share if share > 0.0 else 0.0
            share = share if share < 1.0 else 1.0
            gx, gy, gz = px + share * dx, py + share * dy, pz + share * dz
            squared = gx * gx + gy * gy + gz * gz
            nearest = passing[3 * LANES + i]
            passing[3 * LANES + i] = squared if squared < nearest else nearest
            passing[i], passing[LANES + i], passing[2 * LANES + i] = x, y, z
    for i in range(LANES):
        work.signals[LANES * CLOSEST_APPROACH + i] = sqrt(passing[3 * LANES + i])
