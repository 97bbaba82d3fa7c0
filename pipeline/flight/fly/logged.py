"""The log of one flight: the values of lane 0 at each sample and in each control period, with reasons."""

from math import atan2, floor, pi
from typing import Any

import numpy as np

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.three import Three, lane_of, write_three
from fis_tools.model.thrust import SILENT_N
from pipeline.array_types import Booleans, Bytes, Floats, Integers
from pipeline.flight.period.act.actuators import EMPTY, needs_burn
from pipeline.flight.period.act.attitude import relative_rate, write_instants
from pipeline.flight.period.decide.motion import ETA_U, LAMBDA_U, sense_angles
from pipeline.flight.period.decide.preview import FARTHEST, MISSED, NEAREST
from pipeline.flight.period.decide.see_push import COST, SHORT
from pipeline.flight.period.decide.thrust import is_decision, may_coast
from pipeline.flight.period.look.navigation import write_estimate
from pipeline.flight.state import log as logs
from pipeline.flight.state.arrays import Control, FullOptics, Law, Moment, Workspace, World
from pipeline.flight.state.errors import ModelErrors
from pipeline.flight.state.lanes import attitude_of, write_row
from pipeline.flight.state.log import LEAST_CHANGE_N, FlightLog
from pipeline.flight.state.signals import BODY, HILL, SETTING, URGENCY
from pipeline.physics.quaternion import dcms_b_from_h, to_body


@compiled(error_model="numpy")
def write_sample(
    now: Moment, signals: Floats, errors: ModelErrors | None, counts: Bytes, log: FlightLog, case: Any
) -> None:
    """Log the true state and the deputy's estimate at a sample, before the decision.

    `counts`, shape (P padded,), are the points that the flight counts, `case` is the start, of `CASE`.
    """
    world, state, k = now.world, now.state, now.k
    lanes, truth, belief, n = state.lanes, state.truth, state.belief, world.mean_motion
    write_row(log.position_m[k], truth.position, 0)
    write_row(log.velocity_m_s[k], truth.velocity, 0)
    write_row(log.target_m[k], lanes.target, 0)
    write_row(log.quaternion_b_from_h[k], truth.attitude, 0)
    write_row(log.sensed_quaternion_b_from_h[k], belief.attitude, 0)
    if not world.is_attitude_ideal:
        rate = relative_rate(world, k, attitude_of(truth.attitude, 0), lane_of(truth.rate, 0, 0))
        write_three(log.angular_velocity_b_rad_s[k], rate)
    log.num_candidates[k] = int(lanes.num_candidates[0])
    log.sun_angle_rad[k] = case.sun_angle - n * world.control_period * k
    log.sun_elevation_rad[k] = case.sun_elevation
    if world.course.is_on:  # the true angle, continuous with that of the uniform turn
        turned = atan2(lanes.sun[1, 0], lanes.sun[0, 0]) - log.sun_angle_rad[k]
        log.sun_angle_rad[k] += turned - 2.0 * pi * floor(turned / (2.0 * pi) + 0.5)
        log.sun_elevation_rad[k] = atan2(lanes.sun_height[1, 0], lanes.sun_height[0, 0])
    for j in range(world.num_points):
        log.is_inspected[k, j] = state.unseen[0, j] == 0.0 and counts[j] > 0
    log.delta_v_m_s[k] = lanes.spent[0]
    sense_angles(now, signals)
    log.lambda_u_rad[k], log.eta_u_rad[k] = signals[LAMBDA_U, 0], signals[ETA_U, 0]
    if errors is not None and errors.fixes.is_on:
        write_estimate(now, errors.fixes.law, log)


@compiled(error_model="numpy")
def write_period(
    now: Moment,
    work: Workspace,
    optics: FullOptics | None,
    control: Control,
    errors: ModelErrors | None,
    log: FlightLog,
    is_opened: bool,
) -> None:
    """Log what was decided, commanded and fired after sample k; `is_opened` where the force was given."""
    world, state, law, k = now.world, now.state, control.law, now.k
    lanes, signals = state.lanes, work.signals
    is_complete = world.coasts_when_complete and lanes.num_unseen[0] == 0.0
    if not law.has_plan and is_decision(law, k):
        if lanes.coasts[0] == 0.0 and not is_opened:
            write_inference(law, signals, work.outputs, log, k)
            write_points(now, work, law, log)
        if not is_complete and may_coast(control):
            for column, signal in enumerate((MISSED, NEAREST, FARTHEST)):
                log.foreseen[k, column] = signals[signal, 0]
            for j in range(world.num_points):
                point = j if optics is not None else world.order[j]
                log.is_missed[k, point] = work.ahead[j] > 0.0 and state.unseen[0, point] > 0.0
    write_row(log.force_hill_n[k], lanes.force, 0)
    write_row(log.force_commanded_n[k], lanes.commanded, 0)
    write_row(log.safety_force_hill_n[k], lanes.change, 0)
    if law.has_plan or is_opened or lanes.parks[0] > 0.0:
        write_row(log.force_asked_n[k], lanes.requested, 0)
    requested = lane_of(lanes.requested, 0, 0)
    if law.force_axes == HILL:
        a, b, c, d = log.sensed_quaternion_b_from_h[k]
        requested = Three(0.0, 0.0, 0.0) + to_body((a, b, c, d), requested)  # added to zeros, none is -0.0
    write_three(log.force_body_n[k], requested)
    log.safety_limit[k] = int(lanes.limit[0])
    if errors is not None and needs_burn(errors.firing):
        log.mass_kg[k + 1] = state.thrusters.mass[0] / world.acceleration_per_force
    write_instants(now, work.aims, work.passed, law.plans, log)


@compiled(error_model="numpy")
def write_inference(law: Law, signals: Floats, outputs: Floats, log: FlightLog, k: int) -> None:
    """Log what each system sensed and asked for."""
    log.is_decided[k] = True
    for system in range(len(law.axes)):
        log.force_asked_n[k, law.axes[system]] = outputs[system, 0]
        log.fis_output_n[k, system] = outputs[system, 0]
        for column in range(law.num_inputs[system]):
            log.fis_input[k, system, column] = signals[law.signals[system, column], 0]


@compiled(error_model="numpy")
def write_points(now: Moment, work: Workspace, law: Law, log: FlightLog) -> None:
    """Log which points a decision's signals were made of."""
    k = now.k
    for j in range(now.world.num_points):
        log.is_candidate[k, j] = work.candidate_marks[j] > 0.0
        if law.needs & (URGENCY | SETTING):
            log.last_light_s[j] = work.deadlines[0, j]
        if law.needs & SETTING and work.setting[j] > 0.0 and work.looks[COST, j] < np.inf:
            for row in range(4):
                log.looks[k, j, row] = work.looks[SHORT + row, j]


def write_reasons(
    world: World, law: Law, errors: ModelErrors | None, log: FlightLog, num_counted: int, is_given: Booleans
) -> None:
    """Fill in `FlightLog.command_reason` and `FlightLog.reason` from what else was logged.

    The flight counts so many points; `is_given`, (K,), tells where the force was given instead of inferred.
    """
    if not len(log.reason):
        return
    log.command_reason[:] = _of_commands(world, law, log, num_counted, is_given)
    log.reason[:] = log.command_reason
    if errors is not None:
        log.reason[:] = firing_reasons(log, errors.firing.thrusters.delay, errors.firing.thrusters.dry)


def _of_commands(world: World, law: Law, log: FlightLog, num_counted: int, is_given: Booleans) -> Integers:
    """Return why each component was, or was not, commanded; later steps override earlier ones."""
    sensed = log.sensed_quaternion_b_from_h[:-1]
    turns = zip(dcms_b_from_h(sensed), log.force_body_n, strict=True)
    wanted_h = np.array([dcm.T @ body for dcm, body in turns])
    wanted = log.force_body_n if law.force_axes == BODY else wanted_h
    # a dead band leaves all of a component or nothing, but for the rounding of the turn from body axes
    reasons = np.where(np.abs(wanted) < 0.5 * np.abs(log.force_asked_n), logs.DEAD_BAND, logs.FIRED)
    reasons[np.abs(log.force_asked_n) < SILENT_N] = logs.SILENT
    if not law.has_plan:
        k = np.arange(len(reasons))
        is_decision = k % law.decision_stride == 0
        reasons[is_decision & ~log.is_decided] = logs.COASTING
        reasons[~is_decision] = logs.WAITING
        if world.coasts_when_complete:
            reasons[log.is_inspected[:-1].sum(axis=1) == num_counted] = logs.COMPLETE
        reasons[is_decision & ~log.is_decided & (log.force_asked_n != 0.0).any(axis=1)] = logs.PARKED
    reasons[is_given] = logs.REHEARSED
    for is_changed, reason in (
        (np.abs(wanted_h) > world.max_force + LEAST_CHANGE_N, logs.CLIPPED),
        (np.abs(log.safety_force_hill_n) > LEAST_CHANGE_N, logs.SAFETY),
    ):
        # the turn from body axes mixes the components
        is_affected = is_changed.any(axis=1, keepdims=True) if law.force_axes == BODY else is_changed
        reasons = np.where(is_affected, reason, reasons)
    return reasons


def firing_reasons(log: FlightLog, delay: int, dry: float) -> Integers:
    """Return why something was, or was not, fired along each of Hill's axes, (K, 3).

    `delay` is the number of control periods from a command to its force, `dry` the share of the mass at the
    start that is not propellant; -1 where the mass stays.
    """
    is_commanded, is_fired = (np.abs(f) >= SILENT_N for f in (log.force_commanded_n, log.force_hill_n))
    reasons, count = log.command_reason, len(log.reason)
    # from body axes, three components may add up to nothing along one of Hill's
    fired_reasons = np.where(
        np.isin(reasons, (logs.FIRED, logs.CLIPPED)) & ~is_commanded, logs.SILENT, reasons
    )
    delay = min(delay, count)
    is_due, due = np.zeros_like(is_commanded), np.full_like(reasons, logs.FIRED)
    is_due[delay:], due[delay:] = is_commanded[: count - delay], reasons[: count - delay]
    share_left = log.mass_kg[:-1, np.newaxis] / log.mass_kg[0] - dry
    fired_reasons = np.where(is_commanded, logs.DELAYED, fired_reasons)
    fired_reasons = np.where(
        is_due, np.where(share_left > EMPTY, logs.BELOW_LEAST_IMPULSE, logs.EMPTY_TANK), fired_reasons
    )
    as_commanded = np.isin(due, (logs.CLIPPED, logs.SAFETY, logs.REHEARSED, logs.PARKED)) & is_due
    return np.where(is_fired, np.where(as_commanded, due, logs.FIRED), fired_reasons)
