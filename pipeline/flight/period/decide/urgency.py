"""For all lanes, the direction to the points that will soon go dark, some for good.

A point's deadline is the last sample of the flight at which it is lit. Plain version in
`pipeline.flight.reference.urgency`.
"""

from math import cos, sin, sqrt

import numpy as np
from numpy.typing import NDArray

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.vectors import load, select, some, splat, store, total
from pipeline.flight.period.look.guidance import MIN_PROJECTION_M, POINTS
from pipeline.flight.period.look.optics import any_beam, lit_points
from pipeline.flight.state.arrays import Beyond, Law, Workspace, World
from pipeline.flight.state.elementary import exponential
from pipeline.flight.state.signals import constant, slot

Floats = NDArray[np.float64]

URGENT = slot("urgent_radial", "urgent_along_track", "urgent_cross_track")
URGENCY_TIME, SKIRT_DISTANCE = constant("urgency_time_s"), constant("skirt_distance_m")


@compiled(error_model="numpy")
def note_deadlines(world: World, optics: Beyond | None, work: Workspace, num_lanes: int) -> None:
    """Write when each point is lit for the last time, s, for every lane; zero for points never lit.

    Called at the start, when nothing is inspected.
    """
    lanes, points, deadlines = work.lanes, world.points, work.deadlines
    for lane in range(num_lanes):
        start_x, start_y = lanes.sun_at_start[0, lane], lanes.sun_at_start[1, lane]
        for j in range(0, points.shape[2], POINTS):
            store(deadlines, (lane, j), splat(0.0, POINTS))
        is_missing_some = True
        k = world.num_controls
        while is_missing_some and k > 0:
            now = world.control_period * k
            turned_cos, turned_sin = cos(world.mean_motion * now), sin(world.mean_motion * now)
            sun_x, sun_y = (
                start_x * turned_cos + start_y * turned_sin,
                start_y * turned_cos - start_x * turned_sin,
            )
            sample = k if len(points) > 1 else 0
            beam = any_beam(world, optics, work, lane, k, sun_x, sun_y)
            is_missing_some = False
            for j in range(0, points.shape[2], POINTS):
                latest = load(deadlines, (lane, j), POINTS)
                missing = (latest == 0.0) & (load(work.unseen, (lane, j), POINTS) > 0.0)
                if some(missing):
                    px, py = load(points, (sample, 0, j), POINTS), load(points, (sample, 1, j), POINTS)
                    lit = lit_points(world, optics, work, sample, j, missing, px, py, sun_x, sun_y, beam)
                    store(deadlines, (lane, j), select(lit, now, latest))
                    is_missing_some |= some(missing ^ lit)
            k -= 1


@compiled(error_model="numpy")
def sense_urgency(
    world: World,
    optics: Beyond | None,
    law: Law,
    values: Floats,
    work: Workspace,
    num_lanes: int,
    k: int,
    is_logged: bool,
) -> None:
    """Write the urgent direction of every lane that may fire; of all if logged."""
    lanes, signals, points, now = work.lanes, work.signals, world.points, world.control_period * k
    rate = 1.0 / values[law.constants + URGENCY_TIME]
    skirt = values[law.constants + SKIRT_DISTANCE]
    sample = k if len(points) > 1 else 0
    for lane in range(num_lanes):
        for component in range(3):
            signals[URGENT + component, lane] = 0.0
        if lanes.coasts[lane] > 0.0 and not is_logged:
            continue
        sun_x, sun_y = lanes.sun[0, lane], lanes.sun[1, lane]
        beam = any_beam(world, optics, work, lane, k, sun_x, sun_y)
        nothing = splat(0.0, POINTS)
        weights, sum_x, sum_y, sum_z = nothing, nothing, nothing, nothing
        for j in range(0, points.shape[2], POINTS):
            px, py = load(points, (sample, 0, j), POINTS), load(points, (sample, 1, j), POINTS)
            counts = load(work.unseen, (lane, j), POINTS) > 0.0
            counts = lit_points(world, optics, work, sample, j, counts, px, py, sun_x, sun_y, beam)
            if some(counts):
                time_left = now - load(work.deadlines, (lane, j), POINTS)
                weight = select(counts, exponential(time_left * rate), 0.0)
                weights += weight
                sum_x += weight * px
                sum_y += weight * py
                sum_z += weight * load(points, (sample, 2, j), POINTS)
        ux, uy, uz = total(sum_x), total(sum_y), total(sum_z)
        length = sqrt(ux * ux + uy * uy + uz * uz)
        if length <= MIN_PROJECTION_M * total(weights):
            continue
        rx, ry, rz = lanes.position[0, lane], lanes.position[1, lane], lanes.position[2, lane]
        distance = sqrt(rx * rx + ry * ry + rz * rz)
        turned_away = 0.0
        if distance < skirt and skirt > world.min_distance:
            inward = max(0.0, -(ux * rx + uy * ry + uz * rz) / (length * distance))
            nearness = min(1.0, (skirt - distance) / (skirt - world.min_distance))
            turned_away = 2.0 * nearness * inward / distance
        signals[URGENT, lane] = ux / length + turned_away * rx
        signals[URGENT + 1, lane] = uy / length + turned_away * ry
        signals[URGENT + 2, lane] = uz / length + turned_away * rz
