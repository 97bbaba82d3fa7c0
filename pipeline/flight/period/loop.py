"""Flights, compiled: the closed loop of dynamics, sight, guidance, inference and attitude control.

The plain version, which this is tested against, is `pipeline.flight.reference.loop`. Up
to L flights of one controller run side by side (`pipeline.flight.state.arrays`), so that vector units
work on all of them; a flight's result does not depend on the others.

States move exactly, by `pipeline.physics.motion`, or about the Earth, by `pipeline.physics.two_body`.
Single letters follow the equations: r, v position and velocity (Hill), q attitude, w rate, f force, m torque.
"""

from math import cos, sin, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.vectors import borrowed, splat, store, width_of
from pipeline.flight.period.act.actuators import burn, fire
from pipeline.flight.period.act.aim import aim_at_once, aim_deputies
from pipeline.flight.period.act.attitude import turn_deputies, write_instants
from pipeline.flight.period.act.command import note_command, recover_truth
from pipeline.flight.period.act.safety import assure
from pipeline.flight.period.act.two_body import move_about_earth
from pipeline.flight.period.decide.free_motion import sense_approach, sense_orbit
from pipeline.flight.period.decide.preview import preview
from pipeline.flight.period.decide.see_push import sense_push
from pipeline.flight.period.decide.thrust import (
    command,
    decide_to_coast,
    is_decision,
    may_coast,
    write_thrust,
)
from pipeline.flight.period.decide.tour import sense_tour
from pipeline.flight.period.decide.urgency import note_deadlines, sense_urgency
from pipeline.flight.period.look.navigation import believe, point_beside
from pipeline.flight.period.look.sight import sense, sense_again
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
    Workspace,
    World,
)
from pipeline.flight.state.errors import ModelErrors
from pipeline.flight.state.lanes import one, three, write_three
from pipeline.flight.state.log import REHEARSED, FlightLog
from pipeline.flight.state.signals import (
    ANGLES,
    APPROACH,
    ORBIT,
    PREVIEW,
    SETTING,
    TOUR,
    URGENCY,
    slot,
)
from pipeline.physics.motion import place_after, step_of, velocity_after
from pipeline.physics.quaternion import dcm_b_from_h

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Bytes = NDArray[np.uint8]

LAMBDA_U, ETA_U = slot("lambda_u"), slot("eta_u")


@compiled(error_model="numpy", forceinline=True)
def spend(world: World, work: Workspace) -> None:
    """Add up what all lanes spend in a control period."""
    lanes = work.lanes
    fx, fy, fz = three(lanes.force)
    spent_per_force = world.control_period * world.acceleration_per_force
    store(lanes.spent, 0, one(lanes.spent) + (abs(fx) + abs(fy) + abs(fz)) * spent_per_force)


@compiled(error_model="numpy", forceinline=True)
def move(world: World, work: Workspace) -> None:
    """Move all lanes by a control period."""
    lanes, step = work.lanes, step_of(world.motion, 0)
    rx, ry, rz = three(lanes.position)
    vx, vy, vz = three(lanes.velocity)
    fx, fy, fz = three(lanes.force)
    px, py, pz = place_after(step, rx, ry, rz, vx, vy, vz, fx, fy, fz)
    ux, uy, uz = velocity_after(step, rx, rz, vx, vy, vz, fx, fy, fz)
    write_three(lanes.position, 0, px, py, pz)
    write_three(lanes.velocity, 0, ux, uy, uz)


@compiled(error_model="numpy")
def open_with(
    world: World, work: Workspace, openings: Floats, first: int, num_lanes: int, log: FlightLog
) -> None:
    """Replace the inferred forces at the start by forces given for each start, Hill axes."""
    limit = world.max_force
    for lane in range(num_lanes):
        for axis in range(3):
            force = openings[first + lane, axis]
            work.lanes.asked[axis, lane] = force
            work.lanes.force[axis, lane] = min(max(force, -limit), limit)
    if len(log.position_m) > 0:
        log.is_decided[0] = False
        log.fis_input[0], log.fis_output_n[0] = 0.0, 0.0
        for axis in range(3):
            log.force_asked_n[0, axis] = openings[first, axis]
            log.reason[0, axis] = REHEARSED


@compiled(error_model="numpy")
def write_sample(
    world: World, work: Workspace, counts: Bytes, log: FlightLog, k: int, sun_angle: float
) -> None:
    """Log lane 0 at a sample, before its force is known."""
    lanes, n = work.lanes, world.mean_motion
    for component in range(3):
        log.position_m[k, component] = lanes.position[component, 0]
        log.velocity_m_s[k, component] = lanes.velocity[component, 0]
        log.target_m[k, component] = lanes.target[component, 0]
    for component in range(4):
        log.quaternion_b_from_h[k, component] = lanes.attitude[component, 0]
        log.sensed_quaternion_b_from_h[k, component] = lanes.attitude[component, 0]
    if not world.is_attitude_ideal:
        dcm = dcm_b_from_h(log.quaternion_b_from_h[k])
        for component in range(3):
            log.angular_velocity_b_rad_s[k, component] = lanes.rate[component, 0] - n * dcm[component, 2]
    log.num_candidates[k] = int(lanes.num_candidates[0])
    log.sun_angle_rad[k] = sun_angle - n * world.control_period * k
    for j in range(world.num_points):
        log.is_inspected[k, j] = work.unseen[0, j] == 0.0 and counts[j] > 0
    log.delta_v_m_s[k] = lanes.spent[0]


@compiled(error_model="numpy")
def start_lanes(
    world: World, work: Workspace, cases: Any, counted: Bytes, first: int, num_lanes: int
) -> None:
    """Put flights at their starts; lanes without one repeat the last, so that their numbers stay finite."""
    width = width_of(work.lanes)
    lanes, nothing = work.lanes, splat(0.0, width)
    work.unseen[:] = 0.0
    work.num_centres[:] = 0
    work.clustered[:] = 0.0
    for lane in range(width):
        row = first + min(lane, num_lanes - 1)
        case = cases[row]
        for component in range(3):
            lanes.position[component, lane] = case.position[component]
            lanes.velocity[component, lane] = case.velocity[component]
        lanes.sun_at_start[0, lane], lanes.sun_at_start[1, lane] = cos(case.sun_angle), sin(case.sun_angle)
        lanes.sun_height[0, lane], lanes.sun_height[1, lane] = (
            cos(case.sun_elevation),
            sin(case.sun_elevation),
        )
        counts, num_counted = counted[row if len(counted) > 1 else 0], 0
        for j in range(world.num_points):
            work.unseen[lane, j] = counts[j]
            num_counted += counts[j]
        lanes.num_counted[lane], lanes.num_unseen[lane] = num_counted, num_counted
    for component in range(4):
        store(lanes.attitude, component, splat(world.attitude_at_start[component], width))
    for component in range(3):
        store(lanes.rate, component, splat(world.rate_at_start[component], width))
    write_three(lanes.force, 0, nothing, nothing, nothing)
    write_three(lanes.y_before, 0, nothing, splat(1.0, width), nothing)
    store(lanes.nearest, 0, splat(np.inf, width))
    for total in (
        lanes.coasts,
        lanes.spent,
        lanes.travelled,
        lanes.farthest,
        lanes.beyond,
        lanes.num_acted,
        lanes.corrected,
    ):
        store(total, 0, nothing)


@compiled(error_model="numpy")
def write_outcomes(world: World, work: Workspace, num_lanes: int, flight: int, outcomes: Floats) -> None:
    """Write the outcomes of flights, from row `flight` on; delta-v is NaN where the attitude is.

    A NaN force is clipped to a finite one, whereas an attitude stays NaN.
    """
    lanes = work.lanes
    for lane in range(num_lanes):
        row = outcomes[flight + lane]
        row[DELTA_V] = lanes.spent[lane]
        for component in range(4):
            if not np.isfinite(lanes.attitude[component, lane]):
                row[DELTA_V] = np.nan
        row[INSPECTED] = lanes.num_counted[lane] - lanes.num_unseen[lane]
        row[MEAN_DISTANCE] = lanes.travelled[lane] / (world.num_controls + 1)
        row[MIN_DISTANCE] = lanes.nearest[lane]
        row[MAX_DISTANCE] = lanes.farthest[lane]
        row[OUTSIDE] = lanes.beyond[lane]
        row[SAFETY_PERIODS] = lanes.num_acted[lane]
        row[SAFETY_DELTA_V] = lanes.corrected[lane]


@compiled(error_model="numpy", inline="always")
def write_track(world: World, lanes: Any, lane: int, row: NDArray[np.float32]) -> None:
    """Write the position of a lane and, if the row has room, everything else known before the next force."""
    for component in range(3):
        row[component] = lanes.position[component, lane]
    if len(row) == NUM_TRACKED:
        for component in range(3):
            row[3 + component] = lanes.velocity[component, lane]
            row[TRACK_FORCE + component] = 0.0
            row[TRACK_BORESIGHT + component] = lanes.boresight[component, lane]
        row[TRACK_SPENT] = lanes.spent[lane]
        row[TRACK_LEFT] = world.num_points - lanes.num_counted[lane] + lanes.num_unseen[lane]
        row[TRACK_TURN_RATE] = 0.0 if world.is_attitude_ideal else turn_rate(world, lanes, lane)


@compiled(error_model="numpy")
def turn_rate(world: World, lanes: Any, lane: int) -> float:
    """Return a lane's angular rate relative to Hill, rad/s: its inertial rate less the orbit's."""
    q1, q2 = lanes.attitude[0, lane], lanes.attitude[1, lane]
    q3, q4 = lanes.attitude[2, lane], lanes.attitude[3, lane]
    n = world.mean_motion
    wx = lanes.rate[0, lane] - n * 2.0 * (q1 * q3 - q2 * q4)
    wy = lanes.rate[1, lane] - n * 2.0 * (q2 * q3 + q1 * q4)
    wz = lanes.rate[2, lane] - n * (-q1 * q1 - q2 * q2 + q3 * q3 + q4 * q4)
    return sqrt(wx * wx + wy * wy + wz * wz)


@compiled(error_model="numpy", inline="always")
def write_fired(lanes: Any, lane: int, row: NDArray[np.float32]) -> None:
    """Write what a lane fires, if the row has room."""
    if len(row) == NUM_TRACKED:
        for component in range(3):
            row[TRACK_FORCE + component] = lanes.force[component, lane]


# Inlined: as a function of its own it would be optimised twice, alone and within `fly_many`.
@compiled(error_model="numpy", inline="always")
def fly(  # noqa: PLR0912, PLR0915 - a branch for each signal and each logged quantity
    world: World,
    optics: Beyond | None,
    guard: Guard | None,
    clusters: bool | None,
    pushes: bool | None,
    model_errors: ModelErrors | None,
    law: Law,
    values: Floats,
    rules: Integers,
    cases: Any,
    counted: Bytes,
    openings: Floats,
    first: int,
    num_lanes: int,
    work: Workspace,
    log: FlightLog,
    tracks: NDArray[np.float32],
    flight: int,
    outcomes: Floats,
) -> None:
    """Fly one controller from some starts side by side, and write the outcomes.

    Parameters
    ----------
    world, law : what is flown
    optics, guard, clusters, pushes, model_errors : as in `fly_many`
    values, rules : rows of `fis_tools.engines.packing.Packed`
    cases : (m,) starts, of `CASE`
    counted : (m or 1, P padded) 1 for the points that a flight counts, 0 for those never lit in it
    openings : (m, 3) forces of the first control period, N, Hill axes; no rows where the rules decide it
    first, num_lanes : which starts, at most L
    work : Workspace
    log : FlightLog, whose arrays are filled unless they are empty; for one flight alone
    tracks : (n, K+1, NUM_PLACED or NUM_TRACKED) float32, filled from row `flight` on, unless it is empty
    flight : row of the first flight
    outcomes : (n, NUM_OUTCOMES), filled from row `flight` on
    """
    width = width_of(work.lanes)
    is_logged = len(log.position_m) > 0
    needs_angles = law.needs & ANGLES != 0 or is_logged
    needs_preview = law.needs & PREVIEW != 0 or may_coast(law, values)
    start_lanes(world, work, cases, counted, first, num_lanes)
    if law.needs & (URGENCY | SETTING):
        note_deadlines(world, optics, work, num_lanes)
    lanes = work.lanes
    for k in range(world.num_controls + 1):
        decides = is_decision(law, k)
        if world.is_attitude_ideal:
            write_three(lanes.force, 0, splat(0.0, width), splat(0.0, width), splat(0.0, width))
            aim_at_once(world, work, num_lanes, k)
            if model_errors is not None and model_errors.fixes.is_on:
                point_beside(model_errors.fixes, work, first, num_lanes, k)
        sense(world, optics, clusters, work, num_lanes, k, needs_angles)
        for lane in range(num_lanes if len(tracks) > 0 else 0):
            write_track(world, lanes, lane, tracks[flight + lane, k])
        if is_logged:
            write_sample(
                world, work, counted[first if len(counted) > 1 else 0], log, k, cases[first].sun_angle
            )
        if model_errors is not None and model_errors.fixes.is_on:
            believe(world, model_errors.fixes, work, first, num_lanes, k, log)
            sense_again(work, needs_angles)
        if is_logged:
            log.lambda_u_rad[k], log.eta_u_rad[k] = work.signals[LAMBDA_U, 0], work.signals[ETA_U, 0]
        if decides and law.needs & ORBIT:
            sense_orbit(world, law, values, work)
        if decides and law.needs & APPROACH:
            sense_approach(world, work)
        if decides and needs_preview:
            preview(world, optics, work, num_lanes, k)
        if decides and not law.has_plan:
            decide_to_coast(world, law, values, work)
        if decides and law.needs & URGENCY:
            sense_urgency(world, optics, law, values, work, num_lanes, k, is_logged)
        if pushes is not None and decides and law.needs & SETTING:
            sense_push(world, optics, law, values, work, num_lanes, k, is_logged)
        if decides and law.needs & TOUR:
            sense_tour(world, law, values, work)
        if k == world.num_controls:
            break
        command(world, law, values, rules, work, first, num_lanes, log, k)
        if k == 0 and len(openings) > 0:
            open_with(world, work, openings, first, num_lanes, log)
        if guard is not None and guard.is_on:
            assure(world, work, num_lanes, log, k)
        if is_logged:
            write_thrust(world, law, values, work, log, k, dcm_b_from_h(log.sensed_quaternion_b_from_h[k]))
        aim_deputies(world, work, num_lanes, k)
        if model_errors is not None and model_errors.fixes.is_on:
            note_command(model_errors.fixes, model_errors.firing, work, k, world.num_controls)
            recover_truth(world, model_errors.fixes, work, k, log)
        if model_errors is not None and model_errors.firing.is_on:
            fire(world, model_errors.firing, work, first, num_lanes, k, log)
        for lane in range(num_lanes if len(tracks) > 0 else 0):
            write_fired(lanes, lane, tracks[flight + lane, k])
        if not world.is_attitude_ideal:
            turn_deputies(world, work, num_lanes)
        if is_logged:
            write_instants(world, work, log, k)
        if model_errors is not None and model_errors.firing.is_on:
            burn(world, model_errors.firing, work, k, log)
        spend(world, work)
        if model_errors is not None and model_errors.course.is_on:
            move_about_earth(world, model_errors.course, work, first, num_lanes, k)
        else:
            move(world, work)

    write_outcomes(world, work, num_lanes, flight, outcomes)


@compiled(nogil=True, error_model="numpy")
def fly_many(
    world: World,
    optics: Beyond | None,
    guard: Guard | None,
    clusters: bool | None,
    pushes: bool | None,
    model_errors: ModelErrors | None,
    law: Law,
    values: Floats,
    rules: Integers,
    cases: Any,
    counted: Bytes,
    openings: Floats,
    work: Workspace,
    log: FlightLog,
    tracks: NDArray[np.float32],
    first: int,
    last: int,
    outcomes: Floats,
) -> None:
    """Fly flights `first` to `last - 1` of every controller from every start, starts varying fastest.

    `optics` is None where light and camera are the paper's, `guard` without the safety layer, `clusters`
    without guidance by clusters, `pushes` where no controller senses a push that shows setting points, and
    `model_errors` where the deputy's model is exact: numba leaves out the code that depends on them, which
    saves compiling what is not flown. With `optics` or `model_errors`, `guard` and `pushes` may be present
    but off, so that fewer variants are compiled.
    """
    # not those that may be None: they must stay arguments for numba to leave code out
    width = width_of(work.lanes)
    world, law, values, rules, cases, counted = borrowed((world, law, values, rules, cases, counted))
    work, log, tracks, outcomes = borrowed((work, log, tracks, outcomes))
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
            model_errors,
            law,
            values[row],
            rules[row],
            cases,
            counted,
            openings,
            start,
            num_lanes,
            work,
            log,
            tracks,
            flight,
            outcomes,
        )
        flight += num_lanes
