"""Many flights, compiled: every controller of a population from every start, to the end."""

from math import cos, sin, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.three import Three, lane_of, same, store_three, three_of, write_lane
from fis_tools.compiled.vectors import borrowed, splat, store, width_of
from pipeline.array_types import Bytes, Floats, Integers
from pipeline.flight.fly.logged import is_logged, write_period, write_sample
from pipeline.flight.period.act.attitude import attitude_of, relative_rate
from pipeline.flight.period.decide.urgency import note_deadlines
from pipeline.flight.period.steps import act, decide, look
from pipeline.flight.state.arrays import (
    DELTA_V,
    INSPECTED,
    MAX_DISTANCE,
    MEAN_DISTANCE,
    MIN_DISTANCE,
    NUM_TRACKED,
    OUTSIDE,
    SAFETY_DELTA_V,
    SAFETY_PERIODS,
    TRACK_BORESIGHT,
    TRACK_FORCE,
    TRACK_LEFT,
    TRACK_SPENT,
    TRACK_TURN_RATE,
    Beyond,
    Guard,
    Law,
    State,
    Workspace,
    World,
)
from pipeline.flight.state.errors import ModelErrors
from pipeline.flight.state.log import FlightLog
from pipeline.flight.state.signals import SETTING, URGENCY


@compiled(error_model="numpy")
def start_lanes(world: World, state: State, cases: Any, counted: Bytes, first: int, num_lanes: int) -> None:
    """Put flights at their starts; lanes without one repeat the last, so that their numbers stay finite.

    `cases` and `counted` are as in `fly_many`.
    """
    lanes, truth = state.lanes, state.truth
    width = width_of(lanes)
    state.unseen[:] = 0.0
    state.num_centres[:] = 0
    state.clustered[:] = 0.0
    for lane in range(width):
        row = first + min(lane, num_lanes - 1)
        case = cases[row]
        write_lane(truth.position, 0, lane, three_of(case.position))
        write_lane(truth.velocity, 0, lane, three_of(case.velocity))
        lanes.sun_at_start[0, lane], lanes.sun_at_start[1, lane] = cos(case.sun_angle), sin(case.sun_angle)
        lanes.height_at_start[0, lane], lanes.height_at_start[1, lane] = (
            cos(case.sun_elevation),
            sin(case.sun_elevation),
        )
        counts, num_counted = counted[row if len(counted) > 1 else 0], 0
        for j in range(world.num_points):
            state.unseen[lane, j] = counts[j]
            num_counted += counts[j]
        lanes.num_counted[lane], lanes.num_unseen[lane] = num_counted, num_counted
    for component in range(4):
        store(truth.attitude, component, splat(world.attitude_at_start[component], width))
    for component in range(3):
        store(truth.rate, component, splat(world.rate_at_start[component], width))
    nothing = splat(0.0, width)
    store_three(lanes.y_before, 0, Three(nothing, splat(1.0, width), nothing))
    store_three(lanes.change, 0, same(0.0, width))
    store(lanes.nearest, 0, splat(np.inf, width))
    for total in (
        lanes.coasts,
        lanes.spent,
        lanes.travelled,
        lanes.farthest,
        lanes.beyond,
        lanes.num_acted,
        lanes.corrected,
        lanes.limit,
    ):
        store(total, 0, nothing)


@compiled(error_model="numpy")
def write_outcomes(world: World, state: State, num_lanes: int, flight: int, outcomes: Floats) -> None:
    """Write the outcomes of flights, from row `flight` on; delta-v is NaN where the attitude is.

    A NaN force is clipped to a finite one, whereas an attitude stays NaN.
    """
    lanes = state.lanes
    for lane in range(num_lanes):
        row = outcomes[flight + lane]
        row[DELTA_V] = lanes.spent[lane]
        for component in range(4):
            if not np.isfinite(state.truth.attitude[component, lane]):
                row[DELTA_V] = np.nan
        row[INSPECTED] = lanes.num_counted[lane] - lanes.num_unseen[lane]
        row[MEAN_DISTANCE] = lanes.travelled[lane] / (world.num_controls + 1)
        row[MIN_DISTANCE] = lanes.nearest[lane]
        row[MAX_DISTANCE] = lanes.farthest[lane]
        row[OUTSIDE] = lanes.beyond[lane]
        row[SAFETY_PERIODS] = lanes.num_acted[lane]
        row[SAFETY_DELTA_V] = lanes.corrected[lane]


@compiled(error_model="numpy", inline="always")
def write_track(world: World, state: State, lane: int, row: NDArray[np.float32]) -> None:
    """Write the position of a lane and, if the row has room, everything else known before the next force."""
    lanes, truth = state.lanes, state.truth
    for component in range(3):
        row[component] = truth.position[component, lane]
    if len(row) == NUM_TRACKED:
        for component in range(3):
            row[3 + component] = truth.velocity[component, lane]
            row[TRACK_FORCE + component] = 0.0
            row[TRACK_BORESIGHT + component] = truth.boresight[component, lane]
        row[TRACK_SPENT] = lanes.spent[lane]
        row[TRACK_LEFT] = world.num_points - lanes.num_counted[lane] + lanes.num_unseen[lane]
        row[TRACK_TURN_RATE] = 0.0 if world.is_attitude_ideal else turn_rate(world, state, lane)


@compiled(error_model="numpy")
def turn_rate(world: World, state: State, lane: int) -> float:
    """Return a lane's angular rate relative to Hill, rad/s: its inertial rate less the orbit's."""
    rate = lane_of(state.truth.rate, 0, lane)
    wx, wy, wz = relative_rate(attitude_of(state.truth.attitude, lane), rate, world.mean_motion)
    return sqrt(wx * wx + wy * wy + wz * wz)


@compiled(error_model="numpy", inline="always")
def write_fired(state: State, lane: int, row: NDArray[np.float32]) -> None:
    """Write what a lane fires, if the row has room."""
    if len(row) == NUM_TRACKED:
        for component in range(3):
            row[TRACK_FORCE + component] = state.lanes.force[component, lane]


@compiled(error_model="numpy")
def open_with(world: World, state: State, openings: Floats, first: int, num_lanes: int) -> None:
    """Command forces given for each start instead of the inferred ones."""
    lanes, limit = state.lanes, world.max_force
    for lane in range(num_lanes):
        for axis in range(3):
            force = openings[first + lane, axis]
            lanes.asked[axis, lane] = force
            lanes.commanded[axis, lane] = min(max(force, -limit), limit)


# Inlined: as a function of its own it would be optimised twice, alone and within `fly_many`.
@compiled(error_model="numpy", inline="always")
def fly(
    world: World,
    optics: Beyond | None,
    guard: Guard | None,
    clusters: bool | None,
    pushes: bool | None,
    errors: ModelErrors | None,
    law: Law,
    values: Floats,
    rules: Integers,
    cases: Any,
    counted: Bytes,
    openings: Floats,
    first: int,
    num_lanes: int,
    state: State,
    work: Workspace,
    log: FlightLog,
    tracks: NDArray[np.float32],
    flight: int,
    outcomes: Floats,
) -> None:
    """Fly one controller from some starts side by side, and write the outcomes.

    `values` and `rules` are its row, `first` the first start, `num_lanes` how many are flown, and `flight`
    the row of the first in `tracks` and `outcomes`; the rest is as in `fly_many`.
    """
    start_lanes(world, state, cases, counted, first, num_lanes)
    if law.needs & (URGENCY | SETTING):
        note_deadlines(world, optics, state, work, num_lanes)
    counts = counted[first if len(counted) > 1 else 0]
    for k in range(world.num_controls + 1):
        look(world, optics, clusters, errors, law.plans, state, work, first, num_lanes, k)
        for lane in range(num_lanes if len(tracks) > 0 else 0):
            write_track(world, state, lane, tracks[flight + lane, k])
        if is_logged(log):
            write_sample(world, errors, state, work, counts, log, k, cases[first])
        if k == world.num_controls:
            break
        decide(world, optics, pushes, law, values, rules, state, work, first, num_lanes, k)
        is_opened = k == 0 and len(openings) > 0
        if is_opened:
            open_with(world, state, openings, first, num_lanes)
        act(world, guard, errors, law.plans, state, work, first, num_lanes, k)
        for lane in range(num_lanes if len(tracks) > 0 else 0):
            write_fired(state, lane, tracks[flight + lane, k])
        if is_logged(log):
            write_period(world, law, values, state, work, errors, log, k, is_opened)
    write_outcomes(world, state, num_lanes, flight, outcomes)


@compiled(nogil=True, error_model="numpy")
def fly_many(
    world: World,
    optics: Beyond | None,
    guard: Guard | None,
    clusters: bool | None,
    pushes: bool | None,
    errors: ModelErrors | None,
    law: Law,
    values: Floats,
    rules: Integers,
    cases: Any,
    counted: Bytes,
    openings: Floats,
    state: State,
    work: Workspace,
    log: FlightLog,
    tracks: NDArray[np.float32],
    first: int,
    last: int,
    outcomes: Floats,
) -> None:
    """Fly flights `first` to `last - 1` of every controller from every start, starts varying fastest.

    Parameters
    ----------
    world, law
        What is flown.
    optics, guard, clusters, pushes, errors
        See `pipeline.flight.period.steps`.
    values, rules : (n, ...) arrays
        Of n controllers, see `fis_tools.engines.packing.Packed`.
    cases : (m,) array of `CASE`
        The starts.
    counted : (m or 1, P padded)
        1 for the points that a flight counts, 0 for those never lit in it.
    openings : (m, 3)
        Forces of the first control period, N, Hill axes; no rows where the rules decide it.
    state, work
        Of this thread; their content does not matter.
    log : FlightLog
        Its arrays are filled unless they are empty; for one flight alone.
    tracks : (n m, K+1, NUM_PLACED or NUM_TRACKED) float32
        Filled unless it is empty.
    first, last : int
    outcomes : (n m, NUM_OUTCOMES)
        Filled.
    """
    # not those that may be None: they must stay arguments for numba to leave code out
    width = width_of(state.lanes)
    world, law, values, rules, cases, counted = borrowed((world, law, values, rules, cases, counted))
    state, work, log, tracks, outcomes = borrowed((state, work, log, tracks, outcomes))
    num_starts = len(cases)
    flight = first
    while flight < last:
        row, start = flight // num_starts, flight % num_starts
        num_lanes = min(width, num_starts - start, last - flight)
        fly(
            world,
            optics,
            guard,
            clusters,
            pushes,
            errors,
            law,
            values[row],
            rules[row],
            cases,
            counted,
            openings,
            start,
            num_lanes,
            state,
            work,
            log,
            tracks,
            flight,
            outcomes,
        )
        flight += num_lanes
