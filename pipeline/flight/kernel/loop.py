"""Flights, compiled: the closed loop of dynamics, sight, guidance, inference and attitude control.

What is computed is what `pipeline.flight.reference.loop` writes out plainly; the two are tested to agree. Up
to `LANES` flights of one controller run side by side (`pipeline.flight.kernel.arrays`), so that vector units
work on all of them; every flight comes out the same in any company.

A state moves exactly, by `pipeline.physics.motion`.
Single letters follow the equations: r, v position and velocity (Hill), q attitude, w rate, f force, m torque.
"""

from math import cos, sin

import numpy as np
from numpy.typing import NDArray

from fis_tools.engines.compiled import compiled
from fis_tools.engines.kernel import LANES, infer
from pipeline.flight.kernel.arrays import (
    ACTED,
    BEYOND,
    COASTS,
    CORRECTED,
    DELTA_V,
    FARTHEST,
    FX,
    FY,
    FZ,
    GX,
    GY,
    GZ,
    INSPECTED,
    LEFT,
    MAX_DISTANCE,
    MEAN_DISTANCE,
    MIN_DISTANCE,
    NEAREST,
    OUTSIDE,
    Q1,
    Q2,
    Q3,
    Q4,
    RX,
    RY,
    RZ,
    SAFETY_DELTA_V,
    SAFETY_PERIODS,
    SPENT,
    SUN_COS,
    SUN_SIN,
    TRAVELLED,
    VX,
    VY,
    VZ,
    WX,
    WY,
    WZ,
    Guard,
    Law,
    Workspace,
    World,
)
from pipeline.flight.kernel.attitude import aim_plainly, clip, turn_deputies
from pipeline.flight.kernel.free_motion import sense_approach, sense_orbit
from pipeline.flight.kernel.preview import preview
from pipeline.flight.kernel.safety import assure
from pipeline.flight.kernel.see_push import sense_push
from pipeline.flight.kernel.sight import sense
from pipeline.flight.kernel.urgency import note_deadlines, sense_urgency
from pipeline.flight.log import FlightLog
from pipeline.flight.signals import (
    ANGLES,
    APPROACH,
    BODY,
    DEAD_BAND,
    HILL,
    ORBIT,
    PREVIEW,
    SETTING,
    URGENCY,
    constant,
    slot,
)
from pipeline.physics.motion import place_after, step_of, velocity_after
from pipeline.physics.quaternion import dcm_b_from_h

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

LAMBDA_U, ETA_U, MISSED = slot("lambda_u"), slot("eta_u"), slot("missed")
COASTING_NEAREST, COASTING_FARTHEST = slot("coasting_nearest"), slot("coasting_farthest")
COAST_BELOW, COAST_MARGIN = constant("coast_below_points"), constant("coast_margin_m")


@compiled(error_model="numpy", forceinline=True, fastmath={"contract"})
def move(world: World, lanes: Floats) -> None:
    """Move all lanes by a control period and add up what they spend."""
    step = step_of(world.motion, 0)
    spent_per_force = world.control_period * world.acceleration_per_force
    for i in range(LANES):
        rx, ry, rz = lanes[RX + i], lanes[RY + i], lanes[RZ + i]
        vx, vy, vz = lanes[VX + i], lanes[VY + i], lanes[VZ + i]
        fx, fy, fz = lanes[FX + i], lanes[FY + i], lanes[FZ + i]
        lanes[SPENT + i] += (abs(fx) + abs(fy) + abs(fz)) * spent_per_force
        px, py, pz = place_after(step, rx, ry, rz, vx, vy, vz, fx, fy, fz)
        ux, uy, uz = velocity_after(step, rx, rz, vx, vy, vz, fx, fy, fz)
        lanes[RX + i], lanes[RY + i], lanes[RZ + i] = px, py, pz
        lanes[VX + i], lanes[VY + i], lanes[VZ + i] = ux, uy, uz


@compiled(error_model="numpy")
def may_coast(law: Law, values: Floats) -> bool:
    """Tell whether a controller coasts where that shows enough."""
    return law.constants >= 0 and values[law.constants + COAST_BELOW] > 0.0


@compiled(error_model="numpy")
def is_decision(law: Law, k: int) -> bool:
    """Tell whether a force is decided on at a sample; between two such samples nothing is fired."""
    return k % law.decision_stride == 0


@compiled(error_model="numpy", forceinline=True, fastmath={"contract"})
def decide_to_coast(world: World, law: Law, values: Floats, work: Workspace) -> None:
    """Tell which lanes fire nothing: all is seen, or coasting will show enough inside the limits."""
    lanes, signals = work.lanes, work.signals
    for i in range(LANES):
        lanes[COASTS + i] = 1.0 if world.coasts_when_complete and lanes[LEFT + i] == 0.0 else 0.0
    if may_coast(law, values):
        most = values[law.constants + COAST_BELOW]
        nearest = world.min_distance + values[law.constants + COAST_MARGIN]
        farthest = world.max_distance - values[law.constants + COAST_MARGIN]
        for i in range(LANES):
            if (
                signals[LANES * MISSED + i] < most
                and signals[LANES * COASTING_NEAREST + i] >= nearest
                and signals[LANES * COASTING_FARTHEST + i] <= farthest
            ):
                lanes[COASTS + i] = 1.0


@compiled(error_model="numpy", forceinline=True, fastmath={"contract"})
def command(  # noqa: PLR0912 - one for each kind of law, and one for the log
    world: World,
    law: Law,
    values: Floats,
    rules: Integers,
    work: Workspace,
    num_lanes: int,
    log: FlightLog,
    k: int,
) -> None:
    """Infer the forces of all lanes, where one is decided on, and turn them to Hill axes, clipped."""
    lanes, signals, inputs, outputs = work.lanes, work.signals, work.inputs, work.outputs
    is_logged = len(log.position_m) > 0
    for i in range(3 * LANES):
        lanes[GX + i] = 0.0
    if law.has_plan:
        for axis in range(3):
            for i in range(LANES):
                lanes[GX + LANES * axis + i] = law.plan[k, axis]
    elif is_decision(law, k):
        for system in range(len(law.axes)):
            for place in range(3):
                signal = LANES * law.signals[system, place]
                for i in range(LANES):
                    inputs[LANES * place + i] = signals[signal + i]
            infer(values, rules, law.layout, system, inputs, work.scratch, outputs)
            force = GX + LANES * law.axes[system]
            dead_band = values[law.constants + DEAD_BAND + law.axes[system]] if law.constants >= 0 else 0.0
            for i in range(num_lanes):
                is_still = lanes[COASTS + i] > 0.0 or abs(outputs[i]) < dead_band
                lanes[force + i] += 0.0 if is_still else outputs[i]
            if is_logged and not (world.coasts_when_complete and lanes[LEFT] == 0.0):
                log.is_decided[k] = True
                log.fis_output_n[k, system] = outputs[0]
                for place in range(law.num_inputs[system]):
                    log.fis_input[k, system, place] = inputs[LANES * place]
    for i in range(LANES):
        gx, gy, gz = lanes[GX + i], lanes[GY + i], lanes[GZ + i]
        q1, q2, q3, q4 = lanes[Q1 + i], lanes[Q2 + i], lanes[Q3 + i], lanes[Q4 + i]
        fx, fy, fz = gx, gy, gz
        if law.force_axes == BODY:
            fx = (q1 * q1 - q2 * q2 - q3 * q3 + q4 * q4) * gx
            fx += 2 * (q1 * q2 - q3 * q4) * gy + 2 * (q1 * q3 + q2 * q4) * gz
            fy = 2 * (q1 * q2 + q3 * q4) * gx + (-q1 * q1 + q2 * q2 - q3 * q3 + q4 * q4) * gy
            fy += 2 * (q2 * q3 - q1 * q4) * gz
            fz = 2 * (q1 * q3 - q2 * q4) * gx + 2 * (q2 * q3 + q1 * q4) * gy
            fz += (-q1 * q1 - q2 * q2 + q3 * q3 + q4 * q4) * gz
        lanes[FX + i] = clip(fx, world.max_force)
        lanes[FY + i] = clip(fy, world.max_force)
        lanes[FZ + i] = clip(fz, world.max_force)


@compiled(error_model="numpy", fastmath={"contract"})
def open_with(
    world: World, work: Workspace, openings: Floats, first: int, num_lanes: int, log: FlightLog
) -> None:
    """Replace what was inferred at the start by forces given for each start, Hill axes."""
    for lane in range(num_lanes):
        for axis in range(3):
            force = openings[first + lane, axis]
            work.lanes[GX + LANES * axis + lane] = force
            work.lanes[FX + LANES * axis + lane] = clip(force, world.max_force)
    if len(log.position_m) > 0:
        log.is_decided[0] = False


@compiled(error_model="numpy", fastmath={"contract"})
def write_sample(
    world: World, work: Workspace, log: FlightLog, k: int, sun_angle: float, count: int, target: Floats
) -> None:
    """Log what is known at a sample before the force is, of lane 0."""
    lanes, n = work.lanes, world.mean_motion
    for component in range(3):
        log.position_m[k, component] = lanes[RX + LANES * component]
        log.velocity_m_s[k, component] = lanes[VX + LANES * component]
    for component in range(4):
        log.quaternion_b_from_h[k, component] = lanes[Q1 + LANES * component]
    if not world.is_attitude_ideal:
        q1, q2, q3, q4 = lanes[Q1], lanes[Q2], lanes[Q3], lanes[Q4]
        log.angular_velocity_b_rad_s[k, 0] = lanes[WX] - n * 2 * (q1 * q3 - q2 * q4)
        log.angular_velocity_b_rad_s[k, 1] = lanes[WY] - n * 2 * (q2 * q3 + q1 * q4)
        log.angular_velocity_b_rad_s[k, 2] = lanes[WZ] - n * (-q1 * q1 - q2 * q2 + q3 * q3 + q4 * q4)
    log.num_candidates[k] = count
    for component in range(3 if count > 0 else 0):
        log.target_m[k, component] = target[component]
    log.lambda_u_rad[k], log.eta_u_rad[k] = work.signals[LANES * LAMBDA_U], work.signals[LANES * ETA_U]
    log.sun_angle_rad[k] = sun_angle - n * world.control_period * k
    for j in range(world.num_points):
        log.is_inspected[k, j] = work.unseen[0, j] == 0.0
    log.delta_v_m_s[k] = lanes[SPENT]


@compiled(error_model="numpy", fastmath={"contract"})
def write_force(work: Workspace, law: Law, log: FlightLog, k: int, dcm: Floats) -> None:
    """Log the force of lane 0: as asked for in body axes, and as applied."""
    for row in range(3):
        log.force_hill_n[k, row] = work.lanes[FX + LANES * row]
        asked = work.lanes[GX + LANES * row]
        if law.force_axes == HILL:
            asked = 0.0
            for column in range(3):
                asked += dcm[row, column] * work.lanes[GX + LANES * column]
        log.force_body_n[k, row] = asked


@compiled(error_model="numpy")
def start_lanes(
    world: World, work: Workspace, starts: Floats, sun_angles: Floats, first: int, num_lanes: int
) -> None:
    """Put flights at their starts; lanes without one repeat the last, so that their numbers stay finite."""
    lanes = work.lanes
    lanes[:] = 0.0
    work.unseen[:] = 0.0
    work.num_centres[:] = 0
    work.clustered[:] = 0.0
    for lane in range(LANES):
        start = starts[first + min(lane, num_lanes - 1)]
        for component in range(6):
            lanes[RX + LANES * component + lane] = start[component]
        sun_angle = sun_angles[first + min(lane, num_lanes - 1)]
        lanes[SUN_COS + lane], lanes[SUN_SIN + lane] = cos(sun_angle), sin(sun_angle)
        lanes[Q4 + lane] = 1.0
        lanes[WZ + lane] = 2.0 * world.mean_motion  # inertial: n relative to Hill, and Hill's own
        lanes[NEAREST + lane] = np.inf
        work.unseen[lane, : world.num_points] = 1.0
        work.y_before[lane, 0], work.y_before[lane, 1], work.y_before[lane, 2] = 0.0, 1.0, 0.0


# Inlined: as a function of its own it would be optimised twice, alone and within `fly_many`.
@compiled(error_model="numpy", inline="always", fastmath={"contract"})
def fly(  # noqa: PLR0912 - one for each thing that may be sensed or logged
    world: World,
    guard: Guard | None,
    clusters: bool | None,
    law: Law,
    values: Floats,
    rules: Integers,
    starts: Floats,
    sun_angles: Floats,
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
    guard, clusters : as in `fly_many`
    values, rules : rows of `fis_tools.engines.packing.Packed`
    starts : (m, 6) position (m) and velocity (m/s), Hill axes
    sun_angles : (m,) rad, at k = 0
    openings : (m, 3) forces of the first control period, N, Hill axes, or (0, 3) where the rules decide it
    first, num_lanes : which starts, at most `LANES`
    work : Workspace
    log : FlightLog, whose arrays are filled unless they are empty; for one flight alone
    tracks : (n, K+1, 3) float32, filled with positions from row `flight` on, unless it is empty
    flight : row of the first flight
    outcomes : (n, NUM_OUTCOMES), filled from row `flight` on
    """
    is_logged = len(log.position_m) > 0
    needs_angles = law.needs & ANGLES != 0 or is_logged
    needs_preview = law.needs & PREVIEW != 0 or may_coast(law, values)
    start_lanes(world, work, starts, sun_angles, first, num_lanes)
    if law.needs & (URGENCY | SETTING):
        note_deadlines(world, work, num_lanes)
    lanes = work.lanes
    target, count = np.zeros(3), 0
    for k in range(world.num_controls + 1):
        decides = is_decision(law, k)
        for lane in range(num_lanes if world.is_attitude_ideal else 0):
            for component in range(3):
                lanes[FX + LANES * component + lane] = 0.0
            aim_plainly(world, work, lane, 0, 1, k == 0)
            for component in range(4):
                lanes[Q1 + LANES * component + lane] = work.aims[component * LANES + lane]
        count = sense(world, clusters, work, num_lanes, k, needs_angles, target)
        if decides and law.needs & ORBIT:
            sense_orbit(world, law, values, work, k)
        if decides and law.needs & APPROACH:
            sense_approach(world, work)
        if decides and needs_preview:
            preview(world, work, num_lanes, k)
        if decides and not law.has_plan:
            decide_to_coast(world, law, values, work)
        if decides and law.needs & URGENCY:
            sense_urgency(world, law, values, work, num_lanes, k, is_logged)
        if decides and law.needs & SETTING:
            sense_push(world, law, values, work, num_lanes, k, is_logged)
        for lane in range(num_lanes if len(tracks) > 0 else 0):
            for component in range(3):
                tracks[flight + lane, k, component] = lanes[RX + LANES * component + lane]
        if is_logged:
            write_sample(world, work, log, k, sun_angles[first], count, target)
        if k == world.num_controls:
            break
        command(world, law, values, rules, work, num_lanes, log, k)
        if k == 0 and len(openings) > 0:
            open_with(world, work, openings, first, num_lanes, log)
        if guard is not None:
            assure(world, work, num_lanes, log, k)
        if is_logged:
            write_force(work, law, log, k, dcm_b_from_h(log.quaternion_b_from_h[k]))
        turn_deputies(world, work, num_lanes, log, k)
        move(world, lanes)

    for lane in range(num_lanes):
        row = outcomes[flight + lane]
        row[DELTA_V] = lanes[SPENT + lane]
        row[INSPECTED] = world.num_points - lanes[LEFT + lane]
        row[MEAN_DISTANCE] = lanes[TRAVELLED + lane] / (world.num_controls + 1)
        row[MIN_DISTANCE] = lanes[NEAREST + lane]
        row[MAX_DISTANCE] = lanes[FARTHEST + lane]
        row[OUTSIDE] = lanes[BEYOND + lane]
        row[SAFETY_PERIODS] = lanes[ACTED + lane]
        row[SAFETY_DELTA_V] = lanes[CORRECTED + lane]


@compiled(nogil=True, error_model="numpy", fastmath={"contract"})
def fly_many(
    world: World,
    guard: Guard | None,
    clusters: bool | None,
    law: Law,
    values: Floats,
    rules: Integers,
    starts: Floats,
    sun_angles: Floats,
    openings: Floats,
    work: Workspace,
    log: FlightLog,
    tracks: NDArray[np.float32],
    first: int,
    last: int,
    outcomes: Floats,
) -> None:
    """Fly flights `first` to `last - 1` of every controller from every start, starts fastest.

    Without the safety layer `guard` is None, without guidance by clusters `clusters`: numba leaves out what
    depends on them, and nobody waits for the compilation of what is not flown.
    """
    num_starts = len(starts)
    flight = first
    while flight < last:
        row, start = flight // num_starts, flight % num_starts
        num_lanes = min(LANES, num_starts - start, last - flight)
        fly(
            world,
            guard,
            clusters,
            law,
            values[row],
            rules[row],
            starts,
            sun_angles,
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
