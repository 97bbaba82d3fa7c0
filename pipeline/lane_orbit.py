"""What the deputies of all lanes know of their free motion: its ellipse, the centre, the phase to the Sun.

Free motion is an ellipse, twice as long along the track as it is high, about a centre that drifts along the
track (Clohessy and Wiltshire, J. Aerospace Sci. 27, 1960). Written out plainly in
`pipeline.reference_channels`.
"""

from math import cos, sin, sqrt

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fis_tools.kernel import LANES
from pipeline.guidance import MIN_PROJECTION_M
from pipeline.lanes import (
    CENTRE,
    RING_ERROR,
    RING_LEAD,
    RING_SIZE,
    RX,
    RY,
    SUN_BEARING,
    SUN_COS,
    SUN_SIN,
    TARGET_DIRECTION,
    VX,
    VY,
    Law,
    Workspace,
    World,
)

Floats = NDArray[np.float64]


@njit(cache=True, error_model="numpy", fastmath={"contract"})
def sense_orbit(world: World, law: Law, values: Floats, work: Workspace, k: int) -> None:
    """Write the signals of natural motion of every lane."""
    n = world.mean_motion
    size = values[law.constants + RING_SIZE] if law.constants >= 0 else 0.0
    lead = values[law.constants + RING_LEAD] if law.constants >= 0 else 0.0
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
        signals[LANES * RING_ERROR + i] = -3.0 * rx - ahead - (sun_cos * along + sun_sin * across)
        signals[LANES * (RING_ERROR + 1) + i] = vx / n - (sun_sin * along - sun_cos * across)
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
