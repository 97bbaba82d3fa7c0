"""For all lanes, the direction to the points that will soon go dark, some for good.

A point's deadline is the last sample of the flight at which it is lit.
"""

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.elementary import exponential
from fis_tools.compiled.three import Three, length, load_at, same, totals, write_lane
from fis_tools.compiled.vectors import load, select, some, splat, store, total
from pipeline.array_types import Floats
from pipeline.flight.period.decide.motion import turned_aside
from pipeline.flight.period.look.guidance import MIN_PROJECTION_M, POINTS
from pipeline.flight.period.look.optics import beam_from, beam_now, lit_points, sun_after
from pipeline.flight.state.arrays import Control, FullOptics, Moment, constant_of
from pipeline.flight.state.signals import constant, slot

URGENT = slot("urgent_radial", "urgent_along_track", "urgent_cross_track")
URGENCY_TIME = constant("urgency_time_s")


@compiled(error_model="numpy")
def note_deadlines(now: Moment, optics: FullOptics | None, deadlines: Floats, lit_marks: Floats) -> None:
    """Write when each point is lit for the last time, s, for every lane; zero for points never lit.

    Called at the start, when nothing is inspected.
    """
    world, state, points = now.world, now.state, now.world.points
    at_start, heights = state.lanes.sun_at_start, state.lanes.height_at_start
    for lane in range(now.num_lanes):
        for j in range(0, points.shape[2], POINTS):
            store(deadlines, (lane, j), splat(0.0, POINTS))
        is_missing_some = True
        k = world.num_controls
        while is_missing_some and k > 0:
            height = heights[0, lane], heights[1, lane]
            sun, height = sun_after(world, (at_start[0, lane], at_start[1, lane]), height, k)
            beam = beam_from(world, optics, k, sun, height)
            is_missing_some = False
            for j in range(0, points.shape[2], POINTS):
                latest = load(deadlines, (lane, j), POINTS)
                missing = (latest == 0.0) & (load(state.unseen, (lane, j), POINTS) > 0.0)
                if some(missing):
                    near = load_at(points, beam.sample, 0, j, POINTS)
                    lit = lit_points(world, optics, lit_marks, j, near, missing, beam)
                    store(deadlines, (lane, j), select(lit, world.control_period * k, latest))
                    is_missing_some |= some(missing ^ lit)
            k -= 1


@compiled(error_model="numpy")
def sense_urgency(
    now: Moment,
    optics: FullOptics | None,
    control: Control,
    deadlines: Floats,
    lit_marks: Floats,
    signals: Floats,
) -> None:
    """Write the urgent direction of every lane that may fire."""
    world, state = now.world, now.state
    points, time = world.points, world.control_period * now.k
    rate = 1.0 / constant_of(control, URGENCY_TIME)
    for lane in range(now.num_lanes):
        write_lane(signals, URGENT, lane, Three(0.0, 0.0, 0.0))
        if state.lanes.coasts[lane] > 0.0:
            continue
        beam = beam_now(now, optics, lane)
        weights, sums = splat(0.0, POINTS), same(0.0, POINTS)
        for j in range(0, points.shape[2], POINTS):
            near = load_at(points, beam.sample, 0, j, POINTS)
            counts = load(state.unseen, (lane, j), POINTS) > 0.0
            counts = lit_points(world, optics, lit_marks, j, near, counts, beam)
            if some(counts):
                time_left = time - load(deadlines, (lane, j), POINTS)
                weight = select(counts, exponential(time_left * rate), 0.0)
                weights += weight
                sums += weight * near
        towards = totals(sums)
        if length(towards) > MIN_PROJECTION_M * total(weights):
            write_lane(signals, URGENT, lane, turned_aside(now, control, lane, towards, length(towards)))
