"""Rotation of the deputies of all lanes over a control period.

Between two instants the torque m is held. With w the deputy's *inertial* rate in body axes,
``J w' = m - w x J w``; for a spherical inertia w is linear in time. The rotation over a step h is the
exponential of a fourth-order Magnus expansion, ``theta = h (w0 + 4 wm + w1)/6 + h^2 (w0 x w1)/12``,
``wm = (w0 + w1)/2 + h (w0' - w1')/8`` (Blanes, Casas, Oteo and Ros, "The Magnus expansion and some of its
applications", Physics Reports 470, 2009), while the Hill frame turns by ``n h`` about k:
``q <- exp(-n h k/2) q exp(theta/2)``. On a true course it turns at the mean rate of each control
period, and so exactly from sample to sample.
"""

from math import cos, sin, sqrt
from typing import Any

import numpy as np

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.three import (
    Three,
    cross,
    dot,
    lane_of,
    load_three,
    store_three,
    three_of,
    times,
    write_lane,
    write_three,
)
from fis_tools.compiled.vectors import Vector, select, some, store
from pipeline.flight.period.act.wheels import momentum_after, torque_of_wheels, wheel_momentum
from pipeline.flight.period.look.hill import hill_rate, hill_turn, is_true
from pipeline.flight.state.arrays import Moment, Plans, World
from pipeline.flight.state.lanes import (
    attitude_of,
    clip_three,
    load_quaternion,
    store_quaternion,
    write_attitude,
    write_row,
)
from pipeline.flight.state.log import FULL, FlightLog
from pipeline.physics.attitude import euler
from pipeline.physics.quaternion import Quaternion, axes_of, to_body

#: longest step of the attitude integrator, s
LONGEST_STEP_S = 1.0
#: a body that turns faster takes half steps, and shorter ones the faster it turns, rad/s
FAST_RATE = 0.25

#: square of the largest rotation per step for which the series of half angles is accurate
LARGEST_SQUARE = 0.25


@compiled(error_model="numpy", forceinline=True)
def half_angle_series(square: float) -> tuple[float, float]:
    """Return ``sin(x/2)/x`` and ``cos(x/2)`` to rounding, for a square of x up to `LARGEST_SQUARE`."""
    fourth = square * square
    s = (0.5 - square * (1 / 48)) + fourth * ((1 / 3840 - square * (1 / 645120)) + fourth * (1 / 185794560))
    c = (1.0 - square * (1 / 8)) + fourth * (
        (1 / 384 - square * (1 / 46080)) + fourth * (1 / 10321920 - square * (1 / 3715891200))
    )
    return s, c


@compiled(error_model="numpy", forceinline=True)
def turn(q: Quaternion, a: Three, s: Vector, c: Vector, hill: Quaternion, is_level: bool) -> Quaternion:
    """Turn an attitude by a rotation vector a in body axes while the Hill frame turns, level about k alone.

    s and c are ``sin(|a|/2)/|a|`` and ``cos(|a|/2)``. Written so that the products do not wait for them: this
    is the longest dependency chain of operations in a flight.
    """
    q1, q2, q3, q4 = q
    x, y, z, w = hill
    p1 = w * q1 + z * q2
    p2 = w * q2 - z * q1
    p3 = w * q3 - z * q4
    p4 = w * q4 + z * q3
    if not is_level:
        p1 = p1 - (x * q4 + y * q3)
        p2 = p2 + (x * q3 - y * q4)
        p3 = p3 + (y * q1 - x * q2)
        p4 = p4 + (x * q1 + y * q2)
    return (
        c * p1 + s * (p4 * a.x + (p2 * a.z - p3 * a.y)),
        c * p2 + s * (p4 * a.y + (p3 * a.x - p1 * a.z)),
        c * p3 + s * (p4 * a.z + (p1 * a.y - p2 * a.x)),
        c * p4 - s * (p1 * a.x + (p2 * a.y + p3 * a.z)),
    )


@compiled(error_model="numpy")
def spin(world: World, w: Three, torque: Three, h: float) -> tuple[Three, Three]:
    """Integrate Euler's equation over one step by the classical Runge-Kutta method.

    Returns the new rate and the rotation vector of the step.
    """
    inertia, inverse = world.inertia, world.inverse_inertia
    a = euler(inertia, inverse, w, torque)
    b = euler(inertia, inverse, w + 0.5 * h * a, torque)
    c = euler(inertia, inverse, w + 0.5 * h * b, torque)
    d = euler(inertia, inverse, w + h * c, torque)
    u = w + (h / 6.0) * (a + 2.0 * (b + c) + d)
    e = euler(inertia, inverse, u, torque)
    # Simpson's rule with the midpoint by Hermite's formula, then the commutator of the Magnus expansion
    half, twelfth = 0.5 * h, h * h / 12.0
    theta = Three(
        half * (w.x + u.x) + twelfth * (a.x - e.x + w.y * u.z - w.z * u.y),
        half * (w.y + u.y) + twelfth * (a.y - e.y + w.z * u.x - w.x * u.z),
        half * (w.z + u.z) + twelfth * (a.z - e.z + w.x * u.y - w.y * u.x),
    )
    return u, theta


@compiled(error_model="numpy")
def turn_body(world: World, k: int, q: Quaternion, rate: Three, torque: Three) -> tuple[Quaternion, Three]:
    """Turn a body of any inertia under a held torque for one attitude period of control period k."""
    steps = int(np.ceil(world.attitude_period / LONGEST_STEP_S - 1e-9))
    speed = sqrt(dot(rate, rate))
    if speed > FAST_RATE:
        steps *= 2 * int(np.ceil(speed / FAST_RATE - 1.0))
    h = world.attitude_period / steps
    hill, is_level = hill_turn(world, k, h), not is_true(world)
    for _ in range(steps):
        rate, a = spin(world, rate, torque, h)
        square = dot(a, a)
        sine, cosine = half_angle_series(square)
        if square > LARGEST_SQUARE:
            angle = sqrt(square)
            sine, cosine = sin(0.5 * angle) / angle, cos(0.5 * angle)
        q = turn(q, a, sine, cosine, hill, is_level)
    return q, rate


@compiled(error_model="numpy", forceinline=True)
def error_of(q: Quaternion, aim: Quaternion) -> Three:
    """Return the error of an attitude from the desired one, body axes."""
    q1, q2, q3, q4 = q
    a1, a2, a3, a4 = aim
    sign = a4 * q4 + (a1 * q1 + a2 * q2 + a3 * q3)
    sign = select(sign >= 0.0, 1.0, -1.0)
    return Three(
        sign * (a4 * q1 - q4 * a1 - (a2 * q3 - a3 * q2)),
        sign * (a4 * q2 - q4 * a2 - (a3 * q1 - a1 * q3)),
        sign * (a4 * q3 - q4 * a3 - (a1 * q2 - a2 * q1)),
    )


@compiled(error_model="numpy", forceinline=True)
def relative_rate(world: World, k: int, q: Quaternion, rate: Three) -> Three:
    """Return the rate relative to Hill of a body with an inertial rate at sample k, rad/s, body axes."""
    return rate_beside(hill_rate(world, k), not is_true(world), q, rate)


@compiled(error_model="numpy", forceinline=True)
def rate_beside(hill: Three, is_level: bool, q: Quaternion, rate: Three) -> Three:
    """Return the rate relative to Hill axes that turn at a rate in their own axes, level about k alone."""
    x, y, z = axes_of(q)
    relative = rate - hill.z * Three(x.z, y.z, z.z)
    if not is_level:
        relative = relative - hill.x * Three(x.x, y.x, z.x) - hill.y * Three(x.y, y.y, z.y)
    return relative


@compiled(error_model="numpy", forceinline=True)
def turn_spherical(now: Moment, aims: Any, passed: Any) -> None:
    """Turn all lanes over a control period, for spherical inertias and slow rotation."""
    # compiled twice, so that the loop over instants does not branch: a step takes 2 to 5 % less
    if is_true(now.world):
        turn_spheres(now, aims, passed, is_level=False)
    else:
        turn_spheres(now, aims, passed, is_level=True)


@compiled(error_model="numpy", forceinline=True)
def turn_spheres(now: Moment, aims: Any, passed: Any, is_level: bool) -> None:
    """Turn all lanes while Hill axes turn, level about k alone."""
    world, state = now.world, now.state
    h = world.attitude_period
    hill, turning = hill_turn(world, now.k, h), hill_rate(world, now.k)
    kp, kd, step = world.proportional_gain[0, 0], world.derivative_gain[0, 0], h * world.inverse_inertia[0, 0]
    half, twelfth = 0.5 * h * step, h * h * step / 12.0
    q, rate = load_quaternion(state.truth.attitude), load_three(state.truth.rate, 0)
    for j in range(world.num_attitude_steps):
        store_quaternion(passed[j].attitude, q)
        store_three(passed[j].rate, 0, rate)
        e, u = error_of(q, load_quaternion(aims[j].attitude)), rate_beside(turning, is_level, q, rate)
        torque = clip_three(-kp * e - kd * u, world.max_torque)
        # one small step, in which the rate is linear in time
        a = h * rate + half * torque + twelfth * cross(rate, torque)
        sine, cosine = half_angle_series(dot(a, a))
        q, rate = turn(q, a, sine, cosine, hill, is_level), rate + step * torque
    store_quaternion(state.truth.attitude, q)
    store_three(state.truth.rate, 0, rate)


@compiled(error_model="numpy")
def turn_general(now: Moment, aims: Any, passed: Any, plans: Plans, lane: int) -> None:
    """Turn one lane over a control period, for any inertia and rate, from its first row of `passed`."""
    world, state, lanes = now.world, now.state, now.state.lanes
    q, rate = attitude_of(passed[0].attitude, lane), lane_of(passed[0].rate, 0, lane)
    has_wheels, total = world.max_momentum < np.inf, lane_of(lanes.momentum, 0, lane)
    for j in range(world.num_attitude_steps):
        write_attitude(passed[j].attitude, lane, q)
        write_lane(passed[j].rate, 0, lane, rate)
        torque = torque_at(now, aims, passed, plans, lane, j)
        if has_wheels:
            held = wheel_momentum(world, q, rate, total)
            torque = torque_of_wheels(world, rate, held, torque)
            if max(abs(held.x), abs(held.y), abs(held.z)) >= FULL * world.max_momentum:
                lanes.num_full[lane] += 1.0
            write_lane(passed[j].torque, 0, lane, torque)
            write_lane(passed[j].held, 0, lane, held)
        given = torque
        if world.turns_by_thrust:
            # of the thrust: arm x C f, and the twist
            force = to_body(q, lane_of(lanes.force, 0, lane))
            thrust = cross(lane_of(lanes.arm, 0, lane), force) + lane_of(lanes.twist, 0, lane)
            torque += thrust
        if world.gravity_gradient[0] > 0.0 and not world.is_spherical:
            torque += gradient_torque(world, now.k, q)
        if has_wheels:
            total = momentum_after(world, now.k, q, total, torque - given)
        q, rate = turn_body(world, now.k, q, rate, torque)
    write_attitude(state.truth.attitude, lane, q)
    write_lane(state.truth.rate, 0, lane, rate)
    write_lane(lanes.momentum, 0, lane, total)


@compiled(error_model="numpy")
def gradient_torque(world: World, k: int, q: Quaternion) -> Three:
    """Return the torque of gravity's gradient at sample k, N m, body axes: ``3 mu/R^3 i x J i``."""
    upward = to_body(q, Three(1.0, 0.0, 0.0))
    gradient = world.gravity_gradient[k if len(world.gravity_gradient) > 1 else 0]
    return gradient * cross(upward, times(world.inertia, upward))


@compiled(error_model="numpy", forceinline=True)
def control_torque(world: World, k: int, q: Quaternion, aim: Quaternion, rate: Three) -> Three:
    """Return the torque of the attitude law, N m, body axes: ``-Kp q_e - Kd w``, each axis clipped."""
    u = relative_rate(world, k, q, rate)
    p, d = times(world.proportional_gain, error_of(q, aim)), times(world.derivative_gain, u)
    return clip_three(-1.0 * p - d, world.max_torque)


@compiled(error_model="numpy")
def torque_at(now: Moment, aims: Any, passed: Any, plans: Plans, lane: int, instant: int) -> Three:
    """Return one lane's torque at an instant already passed of the control period, N m.

    That of the attitude law, or the one that is played; none is after the last of those.
    """
    if len(plans.turns.torques) > 0:
        played = Three(0.0, 0.0, 0.0)
        if now.k < len(plans.turns.torques):
            played = clip_three(three_of(plans.turns.torques[now.k]), now.world.max_torque)
        return played
    aim, attitude = attitude_of(aims[instant].attitude, lane), attitude_of(passed[instant].attitude, lane)
    return control_torque(now.world, now.k, attitude, aim, lane_of(passed[instant].rate, 0, lane))


@compiled(error_model="numpy")
def write_instants(now: Moment, aims: Any, passed: Any, plans: Plans, log: FlightLog) -> None:
    """Log attitudes, rates and torques of lane 0 at the instants of the attitude clock."""
    world, k = now.world, now.k
    for j in range(world.num_attitude_steps):
        attitude = aims[j].attitude if world.is_attitude_ideal else passed[j].attitude
        write_row(log.attitude_quaternion[k, j], attitude, 0)
        if not world.is_attitude_ideal:
            rate = relative_rate(world, k, attitude_of(attitude, 0), lane_of(passed[j].rate, 0, 0))
            if world.max_momentum < np.inf:
                write_row(log.torque_b_n_m[k, j], passed[j].torque, 0)
                write_row(log.wheel_momentum_b_n_m_s[k, j], passed[j].held, 0)
            else:
                write_three(log.torque_b_n_m[k, j], torque_at(now, aims, passed, plans, 0, j))
            write_three(log.attitude_rate_b_rad_s[k, j], rate)


@compiled(error_model="numpy", forceinline=True)
def turn_deputies(now: Moment, aims: Any, passed: Any, plans: Plans) -> None:
    """Turn all lanes over the control period that they are aimed for.

    `aims` and `passed` are as in `Workspace`; the second is written.
    """
    world, lanes, truth, h = now.world, now.state.lanes, now.state.truth, now.world.attitude_period
    rate = load_three(truth.rate, 0)
    # lanes that might turn too far for the series within this period take the general method
    gained = world.control_period * sqrt(3.0) * world.max_torque * world.inverse_inertia[0, 0]
    is_by_law = not (world.turns_by_thrust or len(plans.turns.torques) > 0 or world.max_momentum < np.inf)
    is_simple = is_by_law and world.is_spherical and h <= LONGEST_STEP_S * (1.0 + 1e-9)  # in one step
    slow = max(0.0, sqrt(LARGEST_SQUARE) / h - gained) if is_simple else 0.0
    is_fast = dot(rate, rate) >= slow * slow
    store(lanes.turns_fast, 0, select(is_fast, 1.0, 0.0))
    if slow > 0.0:
        turn_spherical(now, aims, passed)
    else:
        store_quaternion(passed[0].attitude, load_quaternion(truth.attitude))
        store_three(passed[0].rate, 0, rate)
    if some(is_fast):
        for lane in range(now.num_lanes):
            if lanes.turns_fast[lane] > 0.0:
                turn_general(now, aims, passed, plans, lane)
    # exponentials keep the norm except for rounding
    q1, q2, q3, q4 = load_quaternion(truth.attitude)
    scale = 1.5 - 0.5 * (q1 * q1 + q2 * q2 + q3 * q3 + q4 * q4)
    store_quaternion(truth.attitude, (q1 * scale, q2 * scale, q3 * scale, q4 * scale))
