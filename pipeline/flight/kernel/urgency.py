"""Where the deputies of all lanes should look before it is too late: what is lit goes dark, some for good.

A point's deadline is the last sample of the flight at which it is lit. Written out plainly in
`pipeline.flight.reference.urgency`.
"""

from math import cos, exp, sin, sqrt

import numpy as np
from numpy.typing import NDArray

from fis_tools.engines.compiled import compiled
from fis_tools.engines.kernel import LANES
from pipeline.flight.guidance import MIN_PROJECTION_M
from pipeline.flight.kernel.arrays import (
    COASTS,
    RX,
    RY,
    RZ,
    SUN_COS,
    SUN_SIN,
    Law,
    Workspace,
    World,
)
from pipeline.flight.signals import constant, slot

Floats = NDArray[np.float64]

URGENT = slot("urgent_radial", "urgent_along_track", "urgent_cross_track")
URGENCY_TIME, SKIRT_DISTANCE = constant("urgency_time_s"), constant("skirt_distance_m")


@compiled(error_model="numpy", fastmath={"contract"})
def note_deadlines(world: World, work: Workspace, num_lanes: int) -> None:
    """Write when each point is lit for the last time, s, for every lane; zero for points never lit."""
    is_turning = len(world.points) > 1
    for lane in range(num_lanes):
        work.deadlines[lane] = 0.0
        num_missing = world.num_points
        k = world.num_controls
        while num_missing > 0 and k > 0:
            now = world.control_period * k
            turned_cos, turned_sin = cos(world.mean_motion * now), sin(world.mean_motion * now)
            sx = work.lanes[SUN_COS + lane] * turned_cos + work.lanes[SUN_SIN + lane] * turned_sin
            sy = work.lanes[SUN_SIN + lane] * turned_cos - work.lanes[SUN_COS + lane] * turned_sin
            sample = k if is_turning else 0
            num_missing = 0
            for j in range(world.num_points):
                is_missing = work.deadlines[lane, j] == 0.0
                is_lit = (
                    world.points[sample, 0, j] * sx + world.points[sample, 1, j] * sy > world.sun_threshold
                )
                work.deadlines[lane, j] = now if is_missing and is_lit else work.deadlines[lane, j]
                num_missing += is_missing and not is_lit
            k -= 1


@compiled(error_model="numpy", fastmath={"contract"})
def sense_urgency(
    world: World, law: Law, values: Floats, work: Workspace, num_lanes: int, k: int, is_logged: bool
) -> None:
    """Write the urgent direction of every lane that may fire; of all where it is logged."""
    signals, now = work.signals, world.control_period * k
    turned_cos, turned_sin = cos(world.mean_motion * now), sin(world.mean_motion * now)
    rate = 1.0 / values[law.constants + URGENCY_TIME]
    skirt = values[law.constants + SKIRT_DISTANCE]
    sample = k if len(world.points) > 1 else 0
    for lane in range(num_lanes):
        for component in range(3):
            signals[LANES * (URGENT + component) + lane] = 0.0
        if work.lanes[COASTS + lane] > 0.0 and not is_logged:
            continue
        sx = work.lanes[SUN_COS + lane] * turned_cos + work.lanes[SUN_SIN + lane] * turned_sin
        sy = work.lanes[SUN_SIN + lane] * turned_cos - work.lanes[SUN_COS + lane] * turned_sin
        total, ux, uy, uz = 0.0, 0.0, 0.0, 0.0
        for j in range(world.num_points):
            px, py, pz = world.points[sample, 0, j], world.points[sample, 1, j], world.points[sample, 2, j]
            if work.unseen[lane, j] == 0.0 or px * sx + py * sy <= world.sun_threshold:
                continue
            weight = exp((now - work.deadlines[lane, j]) * rate)
            total += weight
            ux += weight * px
            uy += weight * py
            uz += weight * pz
        length = sqrt(ux * ux + uy * uy + uz * uz)
        if length <= MIN_PROJECTION_M * total:
            continue
        rx, ry, rz = work.lanes[RX + lane], work.lanes[RY + lane], work.lanes[RZ + lane]
        distance = sqrt(rx * rx + ry * ry + rz * rz)
        turned_away = 0.0
        if distance < skirt and skirt > world.min_distance:
            inward = max(0.0, -(ux * rx + uy * ry + uz * rz) / (length * distance))
            nearness = min(1.0, (skirt - distance) / (skirt - world.min_distance))
            turned_away = 2.0 * nearness * inward / distance
        signals[LANES * URGENT + lane] = ux / length + turned_away * rx
        signals[LANES * (URGENT + 1) + lane] = uy / length + turned_away * ry
        signals[LANES * (URGENT + 2) + lane] = uz / length + turned_away * rz
