"""Rotation of the deputies of all lanes over a control period.

Between two instants the torque m is held. With w the deputy's *inertial* rate in body axes,
``J w' = m - w x J w``; for a spherical inertia w is linear in time. The rotation over a step h is the
exponential of a fourth-order Magnus expansion, ``theta = h (w0 + 4 wm + w1)/6 + h^2 (w0 x w1)/12``,
``wm = (w0 + w1)/2 + h (w0' - w1')/8`` (Blanes, Casas, Oteo and Ros, "The Magnus expansion and some of its
applications", Physics Reports 470, 2009), while the Hill frame turns by ``n h`` about k:
``q <- exp(-n h k/2) q exp(theta/2)``.
"""

from math import cos, sin, sqrt

import numpy as np
from numpy.typing import NDArray

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.vectors import select, some, store
from pipeline.flight.state.arrays import Workspace, World
from pipeline.flight.state.lanes import clip, four, three, write_four, write_three
from pipeline.flight.state.log import FlightLog
from pipeline.physics.quaternion import dcm_b_from_h

Floats = NDArray[np.float64]

#: longest step of the attitude integrator, s
LONGEST_STEP_S = 1.0
#: a body that turns faster takes half steps, unless its inertia is spherical, rad/s
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
def turn(
    q1: float,
    q2: float,
    q3: float,
    q4: float,
    ax: float,
    ay: float,
    az: float,
    s: float,
    c: float,
    hill_sin: float,
    hill_cos: float,
) -> tuple[float, float, float, float]:
    """Turn an attitude by a rotation vector a in body axes while the Hill frame turns about k.

    s and c are ``sin(|a|/2)/|a|`` and ``cos(|a|/2)``. Written so that the products do not wait for them: this
    is the longest dependency chain of operations in a flight.
    """
    p1 = hill_cos * q1 + hill_sin * q2
    p2 = hill_cos * q2 - hill_sin * q1
    p3 = hill_cos * q3 - hill_sin * q4
    p4 = hill_cos * q4 + hill_sin * q3
    return (
        c * p1 + s * (p4 * ax + (p2 * az - p3 * ay)),
        c * p2 + s * (p4 * ay + (p3 * ax - p1 * az)),
        c * p3 + s * (p4 * az + (p1 * ay - p2 * ax)),
        c * p4 - s * (p1 * ax + (p2 * ay + p3 * az)),
    )


@compiled(error_model="numpy", forceinline=True)
def times3(m: Floats, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Return a 3x3 matrix times a vector."""
    return (
        m[0, 0] * x + m[0, 1] * y + m[0, 2] * z,
        m[1, 0] * x + m[1, 1] * y + m[1, 2] * z,
        m[2, 0] * x + m[2, 1] * y + m[2, 2] * z,
    )


@compiled(error_model="numpy", forceinline=True)
def euler(
    inertia: Floats, inverse: Floats, wx: float, wy: float, wz: float, tx: float, ty: float, tz: float
) -> tuple[float, float, float]:
    """Return the rate of change of an inertial rate in body axes (Euler's equation)."""
    hx, hy, hz = times3(inertia, wx, wy, wz)
    return times3(inverse, tx - (wy * hz - wz * hy), ty - (wz * hx - wx * hz), tz - (wx * hy - wy * hx))


@compiled(error_model="numpy")
def spin(
    inertia: Floats,
    inverse: Floats,
    wx: float,
    wy: float,
    wz: float,
    tx: float,
    ty: float,
    tz: float,
    h: float,
) -> tuple[float, float, float, float, float, float]:
    """Integrate Euler's equation over one step by the classical Runge-Kutta method.

    Returns the new rate and the rotation vector of the step.
    """
    ax, ay, az = euler(inertia, inverse, wx, wy, wz, tx, ty, tz)
    k = 0.5 * h
    bx, by, bz = euler(inertia, inverse, wx + k * ax, wy + k * ay, wz + k * az, tx, ty, tz)
    cx, cy, cz = euler(inertia, inverse, wx + k * bx, wy + k * by, wz + k * bz, tx, ty, tz)
    dx, dy, dz = euler(inertia, inverse, wx + h * cx, wy + h * cy, wz + h * cz, tx, ty, tz)
    k = h / 6.0
    ux = wx + k * (ax + 2.0 * (bx + cx) + dx)
    uy = wy + k * (ay + 2.0 * (by + cy) + dy)
    uz = wz + k * (az + 2.0 * (bz + cz) + dz)
    ex, ey, ez = euler(inertia, inverse, ux, uy, uz, tx, ty, tz)
    # Simpson's rule with the midpoint by Hermite's formula, then the commutator of the Magnus expansion
    half, twelfth = 0.5 * h, h * h / 12.0
    theta_x = half * (wx + ux) + twelfth * (ax - ex + wy * uz - wz * uy)
    theta_y = half * (wy + uy) + twelfth * (ay - ey + wz * ux - wx * uz)
    theta_z = half * (wz + uz) + twelfth * (az - ez + wx * uy - wy * ux)
    return ux, uy, uz, theta_x, theta_y, theta_z


@compiled(error_model="numpy")
def turn_body(
    world: World,
    q1: float,
    q2: float,
    q3: float,
    q4: float,
    wx: float,
    wy: float,
    wz: float,
    mx: float,
    my: float,
    mz: float,
) -> tuple[float, float, float, float, float, float, float]:
    """Turn a body of any inertia under a held torque for one attitude period."""
    steps = int(np.ceil(world.attitude_period / LONGEST_STEP_S - 1e-9))
    if wx * wx + wy * wy + wz * wz > FAST_RATE * FAST_RATE:
        steps *= 2
    h = world.attitude_period / steps
    hill_sin, hill_cos = sin(0.5 * world.mean_motion * h), cos(0.5 * world.mean_motion * h)
    for _ in range(steps):
        wx, wy, wz, ax, ay, az = spin(world.inertia, world.inverse_inertia, wx, wy, wz, mx, my, mz, h)
        square = ax * ax + ay * ay + az * az
        sine, cosine = half_angle_series(square)
        if square > LARGEST_SQUARE:
            angle = sqrt(square)
            sine, cosine = sin(0.5 * angle) / angle, cos(0.5 * angle)
        q1, q2, q3, q4 = turn(q1, q2, q3, q4, ax, ay, az, sine, cosine, hill_sin, hill_cos)
    return q1, q2, q3, q4, wx, wy, wz


@compiled(error_model="numpy", forceinline=True)
def turn_ball(
    q1: float,
    q2: float,
    q3: float,
    q4: float,
    wx: float,
    wy: float,
    wz: float,
    mx: float,
    my: float,
    mz: float,
    h: float,
    inverse_inertia: float,
    hill_sin: float,
    hill_cos: float,
) -> tuple[float, float, float, float, float, float, float]:
    """Turn a body of spherical inertia under a held torque in one small step: its rate is linear in time."""
    step = h * inverse_inertia
    half, twelfth = 0.5 * h * step, h * h * step / 12.0
    ax = h * wx + half * mx + twelfth * (wy * mz - wz * my)
    ay = h * wy + half * my + twelfth * (wz * mx - wx * mz)
    az = h * wz + half * mz + twelfth * (wx * my - wy * mx)
    sine, cosine = half_angle_series(ax * ax + ay * ay + az * az)
    q1, q2, q3, q4 = turn(q1, q2, q3, q4, ax, ay, az, sine, cosine, hill_sin, hill_cos)
    return q1, q2, q3, q4, wx + step * mx, wy + step * my, wz + step * mz


@compiled(error_model="numpy", forceinline=True)
def error_and_rate(
    q1: float,
    q2: float,
    q3: float,
    q4: float,
    a1: float,
    a2: float,
    a3: float,
    a4: float,
    wx: float,
    wy: float,
    wz: float,
    n: float,
) -> tuple[float, float, float, float, float, float]:
    """Return the attitude's error from the desired one, and the rate relative to Hill, both in body axes."""
    sign = a4 * q4 + (a1 * q1 + a2 * q2 + a3 * q3)
    sign = select(sign >= 0.0, 1.0, -1.0)
    e1 = sign * (a4 * q1 - q4 * a1 - (a2 * q3 - a3 * q2))
    e2 = sign * (a4 * q2 - q4 * a2 - (a3 * q1 - a1 * q3))
    e3 = sign * (a4 * q3 - q4 * a3 - (a1 * q2 - a2 * q1))
    ux = wx - n * 2 * (q1 * q3 - q2 * q4)
    uy = wy - n * 2 * (q2 * q3 + q1 * q4)
    uz = wz - n * (-q1 * q1 - q2 * q2 + q3 * q3 + q4 * q4)
    return e1, e2, e3, ux, uy, uz


@compiled(error_model="numpy", forceinline=True)
def turn_balls(world: World, work: Workspace) -> None:
    """Turn all lanes over a control period, for spherical inertias and slow rotation."""
    lanes, n, h = work.lanes, world.mean_motion, world.attitude_period
    hill_sin, hill_cos = sin(0.5 * n * h), cos(0.5 * n * h)
    kp, kd, inverse_inertia = (
        world.proportional_gain[0, 0],
        world.derivative_gain[0, 0],
        world.inverse_inertia[0, 0],
    )
    q1, q2, q3, q4 = four(lanes.attitude)
    wx, wy, wz = three(lanes.rate)
    for j in range(world.num_attitude_steps):
        write_four(work.passed[j].attitude, q1, q2, q3, q4)
        write_three(work.passed[j].rate, 0, wx, wy, wz)
        a1, a2, a3, a4 = four(work.aims[j].attitude)
        e1, e2, e3, ux, uy, uz = error_and_rate(q1, q2, q3, q4, a1, a2, a3, a4, wx, wy, wz, n)
        mx = clip(-kp * e1 - kd * ux, world.max_torque)
        my = clip(-kp * e2 - kd * uy, world.max_torque)
        mz = clip(-kp * e3 - kd * uz, world.max_torque)
        q1, q2, q3, q4, wx, wy, wz = turn_ball(
            q1, q2, q3, q4, wx, wy, wz, mx, my, mz, h, inverse_inertia, hill_sin, hill_cos
        )
    write_four(lanes.attitude, q1, q2, q3, q4)
    write_three(lanes.rate, 0, wx, wy, wz)


@compiled(error_model="numpy")
def turn_any(world: World, work: Workspace, lane: int) -> None:
    """Turn one lane over a control period, for any inertia and rate, from its first row of `passed`."""
    state, start = np.empty(7), work.passed[0]
    for component in range(4):
        state[component] = start.attitude[component, lane]
    for component in range(3):
        state[4 + component] = start.rate[component, lane]
    for j in range(world.num_attitude_steps):
        for component in range(4):
            work.passed[j].attitude[component, lane] = state[component]
        for component in range(3):
            work.passed[j].rate[component, lane] = state[4 + component]
        mx, my, mz, _, _, _ = torque_at(world, work, lane, j)
        if world.turns_by_thrust:
            ax, ay, az = thrust_torque(work, lane, state)
            mx, my, mz = mx + ax, my + ay, mz + az
        state[0], state[1], state[2], state[3], state[4], state[5], state[6] = turn_body(
            world, state[0], state[1], state[2], state[3], state[4], state[5], state[6], mx, my, mz
        )
    for component in range(4):
        work.lanes.attitude[component, lane] = state[component]
    for component in range(3):
        work.lanes.rate[component, lane] = state[4 + component]


@compiled(error_model="numpy")
def thrust_torque(work: Workspace, lane: int, attitude: Floats) -> tuple[float, float, float]:
    """Return the torque of a lane's thrust at an attitude, N m, body axes: ``arm x C f`` and the twist."""
    arm, twist, force = work.lanes.arm, work.lanes.twist, work.lanes.force
    fx, fy, fz = times3(dcm_b_from_h(attitude[:4]), force[0, lane], force[1, lane], force[2, lane])
    x, y, z = arm[0, lane], arm[1, lane], arm[2, lane]
    return (
        y * fz - z * fy + twist[0, lane],
        z * fx - x * fz + twist[1, lane],
        x * fy - y * fx + twist[2, lane],
    )


@compiled(error_model="numpy")
def torque_at(
    world: World, work: Workspace, lane: int, instant: int
) -> tuple[float, float, float, float, float, float]:
    """Return one lane's torque at an instant already passed, N m, and its rate relative to Hill, rad/s."""
    q, aim, w = work.passed[instant].attitude, work.aims[instant].attitude, work.passed[instant].rate
    e1, e2, e3, ux, uy, uz = error_and_rate(
        q[0, lane],
        q[1, lane],
        q[2, lane],
        q[3, lane],
        aim[0, lane],
        aim[1, lane],
        aim[2, lane],
        aim[3, lane],
        w[0, lane],
        w[1, lane],
        w[2, lane],
        world.mean_motion,
    )
    px, py, pz = times3(world.proportional_gain, e1, e2, e3)
    dx, dy, dz = times3(world.derivative_gain, ux, uy, uz)
    limit = world.max_torque
    return clip(-px - dx, limit), clip(-py - dy, limit), clip(-pz - dz, limit), ux, uy, uz


@compiled(error_model="numpy")
def write_instants(world: World, work: Workspace, log: FlightLog, k: int) -> None:
    """Log attitudes, rates and torques of lane 0 at the instants of the attitude clock."""
    for j in range(world.num_attitude_steps):
        for component in range(4):
            if world.is_attitude_ideal:
                log.attitude_quaternion[k, j, component] = work.aims[j].attitude[component, 0]
            else:
                log.attitude_quaternion[k, j, component] = work.passed[j].attitude[component, 0]
        if not world.is_attitude_ideal:
            torques = torque_at(world, work, 0, j)
            for component in range(3):
                log.torque_b_n_m[k, j, component] = torques[component]
                log.attitude_rate_b_rad_s[k, j, component] = torques[3 + component]


@compiled(error_model="numpy", forceinline=True)
def turn_deputies(world: World, work: Workspace, num_lanes: int) -> None:
    """Turn all lanes over the control period that they are aimed for."""
    lanes, h = work.lanes, world.attitude_period
    wx, wy, wz = three(lanes.rate)
    # lanes that might turn too far for the series within this period take the general method
    gained = world.control_period * sqrt(3.0) * world.max_torque * world.inverse_inertia[0, 0]
    is_one_step_of_a_ball = world.is_spherical and h <= LONGEST_STEP_S * (1.0 + 1e-9)
    is_one_step_of_a_ball = is_one_step_of_a_ball and not world.turns_by_thrust
    slow = max(0.0, sqrt(LARGEST_SQUARE) / h - gained) if is_one_step_of_a_ball else 0.0
    is_fast = wx * wx + wy * wy + wz * wz >= slow * slow
    store(lanes.turns_fast, 0, select(is_fast, 1.0, 0.0))
    if slow > 0.0:
        turn_balls(world, work)
    else:
        q1, q2, q3, q4 = four(lanes.attitude)
        write_four(work.passed[0].attitude, q1, q2, q3, q4)
        write_three(work.passed[0].rate, 0, wx, wy, wz)
    if some(is_fast):
        for lane in range(num_lanes):
            if lanes.turns_fast[lane] > 0.0:
                turn_any(world, work, lane)
    # exponentials keep the norm except for rounding
    q1, q2, q3, q4 = four(lanes.attitude)
    scale = 1.5 - 0.5 * (q1 * q1 + q2 * q2 + q3 * q3 + q4 * q4)
    write_four(lanes.attitude, q1 * scale, q2 * scale, q3 * scale, q4 * scale)
