"""Many flights, compiled: every controller of a population from every start, to the end."""

from math import cos, sin
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.three import (
    Three,
    lane_of,
    length,
    load_three,
    same,
    store_three,
    three_of,
    times,
    write_lane,
    write_three,
)
from fis_tools.compiled.vectors import borrowed, most, splat, store, width_of
from pipeline.array_types import Bytes, Floats, Integers
from pipeline.flight.fly.logged import write_period, write_sample
from pipeline.flight.period.act.attitude import relative_rate
from pipeline.flight.period.decide.urgency import note_deadlines
from pipeline.flight.period.look.navigation import update_covariance
from pipeline.flight.period.steps import act, decide, look
from pipeline.flight.state import arrays
from pipeline.flight.state.arrays import Control, FlightState, FullOptics, Law, Moment, Workspace, World
from pipeline.flight.state.errors import ModelErrors
from pipeline.flight.state.lanes import attitude_of, flight_of, load_quaternion, load_row, write_row
from pipeline.flight.state.log import NO_LOG, FlightLog
from pipeline.flight.state.signals import SETTING, URGENCY
from pipeline.physics.quaternion import to_hill
from pipeline.physics.transitions import times_six


class FlightBatch(NamedTuple):
    """Flights of every controller of a population from every start, starts varying fastest."""

    world: World
    law: Law
    values: Floats  # (n, S, ...) rows of n controllers in S stretches of a flight, of `Packed`
    rules: Integers  # (n, ...) likewise, the same in all stretches
    changes: Integers  # (S-1,) samples at which the next stretch begins
    cases: Any  # (m,) starts, of `CASE`
    counted: Bytes  # (m or 1, P padded) 1 for the points that a flight counts, 0 for those it leaves out
    # (m, n, 4) of the first n control periods: a force, N, Hill axes, and 1 where it is given, 0 where the
    # rules decide it
    openings: Floats


NO_TRACKS = np.empty((0, 0, 3), dtype=np.float32)
NOTHING_KNOWN = np.empty((0, 6))


class Results(NamedTuple):
    """Arrays into which flights write their results."""

    outcomes: Floats  # (n m, NUM_OUTCOMES)
    log: FlightLog = NO_LOG  # of one flight alone
    tracks: NDArray[np.float32] = NO_TRACKS  # (n m, K+1, NUM_PLACED or NUM_TRACKED)
    known: Floats = NOTHING_KNOWN  # (n m, 6+P) what the deputies know at the end, see `write_known`


@compiled(error_model="numpy")
def start_lanes(now: Moment, cases: Any, counted: Bytes) -> None:
    """Put flights at their starts; lanes without one repeat the last, so that their numbers stay finite.

    `cases` and `counted` are as in `FlightBatch`.
    """
    world, state, lanes, truth = now.world, now.state, now.state.lanes, now.state.truth
    width = width_of(lanes)
    state.unseen[:] = 0.0
    state.num_centres[:] = 0
    state.clustered[:] = 0.0
    for lane in range(width):
        row = flight_of(now, lane)
        case = cases[row]
        write_lane(truth.position, 0, lane, three_of(case.position))
        write_lane(truth.velocity, 0, lane, three_of(case.velocity))
        lanes.sun_at_start[0, lane], lanes.sun_at_start[1, lane] = cos(case.sun_angle), sin(case.sun_angle)
        lanes.height_at_start[0, lane] = cos(case.sun_elevation)
        lanes.height_at_start[1, lane] = sin(case.sun_elevation)
        counts, num_counted = counted[row if len(counted) > 1 else 0], 0
        for j in range(world.num_points):
            state.unseen[lane, j] = counts[j]
            num_counted += counts[j]
        lanes.num_counted[lane], lanes.num_unseen[lane] = num_counted, num_counted
    for component in range(4):
        store(truth.attitude, component, splat(world.attitude_at_start[component], width))
    for component in range(3):
        store(truth.rate, component, splat(world.rate_at_start[component], width))
    spun = to_hill(load_quaternion(truth.attitude), times(world.inertia, load_three(truth.rate, 0)))
    store_three(lanes.momentum, 0, spun)  # the wheels are at rest
    zeros = splat(0.0, width)
    store_three(lanes.y_before, 0, Three(zeros, splat(1.0, width), zeros))
    store_three(lanes.change, 0, same(0.0, width))
    store(lanes.nearest, 0, splat(np.inf, width))
    for total in (lanes.spent, lanes.travelled, lanes.farthest, lanes.beyond):
        store(total, 0, zeros)
    for total in (lanes.coasts, lanes.parks, lanes.num_acted, lanes.corrected, lanes.limit, lanes.num_full):
        store(total, 0, zeros)


@compiled(error_model="numpy")
def note_after(now: Moment) -> None:
    """Count where coasting on from the flights' end leads outside the limits as the flights themselves."""
    world, lanes, truth = now.world, now.state.lanes, now.state.truth
    position, velocity = load_three(truth.position, 0), load_three(truth.velocity, 0)
    for j in range(len(world.after)):
        rows = world.after[j]
        moved = times_six(rows, 0, position, velocity)
        distance = length(Three(moved.x + rows[0, 6], moved.y + rows[1, 6], moved.z + rows[2, 6]))
        beyond = most(world.min_distance - distance, distance - world.max_distance)
        store(lanes.beyond, 0, most(beyond, load_row(lanes.beyond)))


@compiled(error_model="numpy")
def write_outcomes(now: Moment, flight: int, outcomes: Floats) -> None:
    """Write the outcomes of flights, from row `flight` on; delta-v is NaN where the attitude is.

    A NaN force is clipped to a finite one, whereas an attitude stays NaN.
    """
    world, state, lanes = now.world, now.state, now.state.lanes
    for lane in range(now.num_lanes):
        row = outcomes[flight + lane]
        row[arrays.DELTA_V] = lanes.spent[lane]
        for component in range(4):
            if not np.isfinite(state.truth.attitude[component, lane]):
                row[arrays.DELTA_V] = np.nan
        row[arrays.INSPECTED] = lanes.num_counted[lane] - lanes.num_unseen[lane]
        row[arrays.MEAN_DISTANCE] = lanes.travelled[lane] / (world.last - world.first + 1)
        row[arrays.MIN_DISTANCE] = lanes.nearest[lane]
        row[arrays.MAX_DISTANCE] = lanes.farthest[lane]
        row[arrays.OUTSIDE] = lanes.beyond[lane]
        row[arrays.SAFETY_PERIODS] = lanes.num_acted[lane]
        row[arrays.SAFETY_DELTA_V] = lanes.corrected[lane]
        row[arrays.FULL_WHEELS] = lanes.num_full[lane] * world.attitude_period


@compiled(error_model="numpy")
def write_known(now: Moment, lane: int, errors: ModelErrors | None, row: Floats) -> None:
    """Write a deputy's estimate, position (m) and velocity (m/s), and 1 for each point left to inspect.

    If the row has room, the estimate's covariance follows, row by row.
    """
    belief, end = now.state.belief, 6 + now.world.num_points
    write_row(row[:3], belief.position, lane)
    write_row(row[3:6], belief.velocity, lane)
    for j in range(now.world.num_points):
        row[6 + j] = now.state.unseen[lane, j]
    if errors is not None and len(row) > end:
        update_covariance(now, errors.fixes.law)
        for i in range(6):
            write_row(row[end + 6 * i : end + 6 * i + 6], now.state.estimate.now[i], lane)


@compiled(error_model="numpy", inline="always")
def write_track(now: Moment, lane: int, row: NDArray[np.float32]) -> None:
    """Write the position of a lane and, if the row has room, everything else known before the next force."""
    world, lanes, truth = now.world, now.state.lanes, now.state.truth
    write_row(row[:3], truth.position, lane)
    if len(row) == arrays.NUM_TRACKED:
        write_row(row[3:6], truth.velocity, lane)
        write_three(row[arrays.TRACK_FORCE :], Three(0.0, 0.0, 0.0))
        write_row(row[arrays.TRACK_BORESIGHT : arrays.TRACK_BORESIGHT + 3], truth.boresight, lane)
        row[arrays.TRACK_SPENT] = lanes.spent[lane]
        row[arrays.TRACK_LEFT] = world.num_points - lanes.num_counted[lane] + lanes.num_unseen[lane]
        row[arrays.TRACK_TURN_RATE] = 0.0
        if not world.is_attitude_ideal:
            attitude, rate = attitude_of(truth.attitude, lane), lane_of(truth.rate, 0, lane)
            row[arrays.TRACK_TURN_RATE] = length(relative_rate(world, now.k, attitude, rate))


@compiled(error_model="numpy", inline="always")
def write_fired(state: FlightState, lane: int, row: NDArray[np.float32]) -> None:
    """Write what a lane fires, if the row has room."""
    if len(row) == arrays.NUM_TRACKED:
        write_row(row[arrays.TRACK_FORCE : arrays.TRACK_FORCE + 3], state.lanes.force, lane)


@compiled(error_model="numpy")
def is_given(now: Moment, openings: Floats) -> bool:
    """Return whether the force of every lane is given in this control period."""
    given = now.k < openings.shape[1]
    for lane in range(width_of(now.state.lanes) if given else 0):
        given &= openings[flight_of(now, lane), now.k, 3] > 0.0
    return given


@compiled(error_model="numpy")
def open_with(now: Moment, openings: Floats) -> None:
    """Command the forces that are given for each start instead of the inferred ones."""
    lanes, limit = now.state.lanes, now.world.max_force
    for lane in range(width_of(lanes) if now.k < openings.shape[1] else 0):
        row = openings[flight_of(now, lane), now.k]
        for axis in range(3 if row[3] > 0.0 else 0):
            lanes.requested[axis, lane] = row[axis]
            lanes.commanded[axis, lane] = min(limit, max(-limit, row[axis]))


@compiled(nogil=True, error_model="numpy")
def fly_many(
    optics: FullOptics | None,
    clusters: bool | None,
    errors: ModelErrors | None,
    flights: FlightBatch,
    state: FlightState,
    work: Workspace,
    results: Results,
    first: int,
    last: int,
) -> None:
    """Fly flights `first` to `last - 1`, side by side those of one controller.

    See `pipeline.flight.period.steps` for the first three. The content of state and workspace, those of this
    thread, does not matter.
    """
    # not those that may be None: they must stay arguments for numba to leave code out
    width = width_of(state.lanes)
    flights, state, work, results = borrowed((flights, state, work, results))
    world, law, log, tracks = flights.world, flights.law, results.log, results.tracks
    num_starts, flight, is_logged = len(flights.cases), first, len(log.position_m) > 0
    while flight < last:
        row, start = flight // num_starts, flight % num_starts
        num_lanes = min(width, num_starts - start, last - flight)
        stretch = 0
        start_lanes(Moment(world, state, start, num_lanes, 0), flights.cases, flights.counted)
        if law.needs & (URGENCY | SETTING):
            note_deadlines(Moment(world, state, start, num_lanes, 0), optics, work.deadlines, work.lit)
        for k in range(world.first, world.last + 1):
            now = Moment(world, state, start, num_lanes, k)
            look(now, work, optics, clusters, errors, law.plans)
            for lane in range(num_lanes if len(tracks) > 0 else 0):
                write_track(now, lane, tracks[flight + lane, k])
            if is_logged:
                counts = flights.counted[start if len(flights.counted) > 1 else 0]
                write_sample(now, work.signals, errors, counts, log, flights.cases[start])
            if k == world.last:
                if k == world.num_controls:
                    note_after(now)
                write_outcomes(now, flight, results.outcomes)
                for lane in range(num_lanes if len(results.known) > 0 else 0):
                    write_known(now, lane, errors, results.known[flight + lane])
                break
            if stretch < len(flights.changes) and k == flights.changes[stretch]:
                stretch += 1
            control = Control(law, flights.values[row, stretch], flights.rules[row])
            is_opened = is_given(now, flights.openings)
            if is_logged or not is_opened:
                decide(now, work, optics, control)
            open_with(now, flights.openings)
            act(now, work, errors, law.plans)
            for lane in range(num_lanes if len(tracks) > 0 else 0):
                write_fired(state, lane, tracks[flight + lane, k])
            if is_logged:
                write_period(now, work, optics, control, errors, log, is_opened)
        flight += num_lanes
