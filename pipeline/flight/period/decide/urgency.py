"""For all lanes, the direction to the points that will soon go dark, some for good.

A point's deadline is the last sample of the flight at which it is lit.
"""

from math import sqrt

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.three import Three, dot, lane_of, plus, same, scaled, write_lane
from fis_tools.compiled.vectors import load, select, some, splat, store, total
from pipeline.array_types import Floats
from pipeline.flight.period.decide.chief import turned_aside
from pipeline.flight.period.look.guidance import MIN_PROJECTION_M, POINTS
from pipeline.flight.period.look.optics import beam_at, beam_from, lit_points, points_at, sun_after
from pipeline.flight.state.arrays import Beyond, Law, State, Workspace, World
from pipeline.flight.state.elementary import exponential
from pipeline.flight.state.signals import constant, slot

URGENT = slot("urgent_radial", "urgent_along_track", "urgent_cross_track")
URGENCY_TIME, SKIRT_DISTANCE = constant("urgency_time_s"), constant("skirt_distance_m")


@compiled(error_model="numpy")
def note_deadlines(
    world: World, optics: Beyond | None, state: State, work: Workspace, num_lanes: int
) -> None:
    """Write when each point is lit for the last time, s, for every lane; zero for points never lit.

    Called at the start, when nothing is inspected.
    """
    points, deadlines = world.points, work.deadlines
    at_start, heights = state.lanes.sun_at_start, state.lanes.height_at_start
    for lane in range(num_lanes):
        for j in range(0, points.shape[2], POINTS):
            store(deadlines, (lane, j), splat(0.0, POINTS))
        is_missing_some = True
        k = world.num_controls
        while is_missing_some and k > 0:
            sample = k if len(points) > 1 else 0
            sun, height = sun_after(
                world, (at_start[0, lane], at_start[1, lane]), (heights[0, lane], heights[1, lane]), k
            )
            beam = beam_from(world, optics, k, sun, height)
            is_missing_some = False
            for j in range(0, points.shape[2], POINTS):
                latest = load(deadlines, (lane, j), POINTS)
                missing = (latest == 0.0) & (load(state.unseen, (lane, j), POINTS) > 0.0)
                if some(missing):
                    some_points = points_at(points, sample, j)
                    lit = lit_points(world, optics, work, sample, j, some_points, missing, beam)
                    store(deadlines, (lane, j), select(lit, world.control_period * k, latest))
                    is_missing_some |= some(missing ^ lit)
            k -= 1


@compiled(error_model="numpy")
def sense_urgency(
    world: World,
    optics: Beyond | None,
    law: Law,
    values: Floats,
    state: State,
    work: Workspace,
    num_lanes: int,
    k: int,
) -> None:
    """Write the urgent direction of every lane that may fire."""
    lanes, signals, points, now = state.lanes, work.signals, world.points, world.control_period * k
    rate = 1.0 / values[law.constants + URGENCY_TIME]
    skirt = values[law.constants + SKIRT_DISTANCE]
    sample = k if len(points) > 1 else 0
    for lane in range(num_lanes):
        write_lane(signals, URGENT, lane, Three(0.0, 0.0, 0.0))
        if lanes.coasts[lane] > 0.0:
            continue
        beam = beam_at(world, optics, state, lane, k, (lanes.sun[0, lane], lanes.sun[1, lane]))
        weights, sums = splat(0.0, POINTS), same(0.0, POINTS)
        for j in range(0, points.shape[2], POINTS):
            some_points = points_at(points, sample, j)
            counts = load(state.unseen, (lane, j), POINTS) > 0.0
            counts = lit_points(world, optics, work, sample, j, some_points, counts, beam)
            if some(counts):
                time_left = now - load(work.deadlines, (lane, j), POINTS)
                weight = select(counts, exponential(time_left * rate), 0.0)
                weights += weight
                sums = plus(sums, scaled(weight, some_points))
        towards = Three(total(sums.x), total(sums.y), total(sums.z))
        length = sqrt(dot(towards, towards))
        if length <= MIN_PROJECTION_M * total(weights):
            continue
        place = lane_of(state.belief.position, 0, lane)
        write_lane(signals, URGENT, lane, turned_aside(towards, length, place, skirt, world.min_distance))
