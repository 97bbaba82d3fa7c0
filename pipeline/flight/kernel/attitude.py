"""How the deputies of all lanes aim and turn over a control period.

Aim
    Positions at the instants of the attitude clock come from the closed form. With azimuth a and elevation e
    of a position, ``q* = (sin a/2 sin e/2, -cos a/2 sin e/2, sin a/2 cos e/2, cos a/2 cos e/2)``, half angles
    from square roots.
Turn
    Between two instants the torque m is held. With w the deputy's *inertial* rate in body axes,
    ``J w' = m - w x J w``; for a spherical inertia w is linear in time. The turn over a step h is the
    exponential of a fourth-order Magnus expansion,
    ``theta = h (w0 + 4 wm + w1)/6 + h^2 (w0 x w1)/12``, ``wm = (w0 + w1)/2 + h (w0' - w1')/8``
    (Blanes, Casas, Oteo and Ros, "The Magnus expansion and some of its applications", Physics Reports 470,
    2009), and the Hill frame turns by ``n h`` about k meanwhile: ``q <- exp(-n h k/2) q exp(theta/2)``.
"""

from math import cos, sin, sqrt

import numpy as np
from numpy.typing import NDArray

from fis_tools.engines.compiled import compiled
from fis_tools.engines.kernel import LANES
from pipeline.flight.kernel.arrays import (
    FX,
    FY,
    FZ,
    POLES,
    Q1,
    Q2,
    Q3,
    Q4,
    RX,
    RY,
    RZ,
    VX,
    VY,
    VZ,
    WX,
    WY,
    WZ,
    Workspace,
    World,
)
from pipeline.flight.log import FlightLog
from pipeline.physics.attitude_control import POLE, blended_y, desired_dcm, desired_y
from pipeline.physics.motion import Motion, place_after, step_of
from pipeline.physics.quaternion import from_dcm
from pipeline.physics.vectors import assign

Floats = NDArray[np.float64]
Indices = NDArray[np.uint64]
Integers = NDArray[np.int64]

#: longest step of the attitude integrator, s
LONGEST_STEP_S = 1.0
#: a body that turns faster takes half steps, unless its inertia is spherical, rad/s
FAST_RATE = 0.25

#: square of the largest turn in one step that the series of half angles is for
LARGEST_SQUARE = 0.25


@compiled(error_model="numpy", fastmath={"contract"})
def aim(aims: Floats, lanes: Floats, instants: Motion, num_instants: int) -> None:
    """Write the desired attitudes of all lanes at all instants of a control period.

    Counts in each lane the instants so near a pole that the position does not define y*.
    """
    for lane in range(LANES):
        lanes[POLES + lane] = 0.0
    for j in range(num_instants):
        step = step_of(instants, j)
        at = 4 * LANES * j
        for lane in range(LANES):
            rx, ry, rz = lanes[RX + lane], lanes[RY + lane], lanes[RZ + lane]
            vx, vy, vz = lanes[VX + lane], lanes[VY + lane], lanes[VZ + lane]
            fx, fy, fz = lanes[FX + lane], lanes[FY + lane], lanes[FZ + lane]
            x, y, z = place_after(step, rx, ry, rz, vx, vy, vz, fx, fy, fz)
            flat2 = x * x + y * y
            square = flat2 + z * z
            flat2 = flat2 if flat2 > 1e-200 else 1e-200
            square = square if square > 1e-200 else 1e-200
            flat, distance = sqrt(flat2), sqrt(square)
            inverse = 1.0 / (flat * distance)
            cos_a, sin_a = x * distance * inverse, y * distance * inverse
            cos_e, sin_e = flat2 * inverse, z * flat * inverse
            larger = sqrt(0.5 + 0.5 * (cos_a if cos_a >= 0.0 else -cos_a))
            half_cos_e = sqrt(0.5 + 0.5 * cos_e)
            inverse = 0.5 / (larger * half_cos_e)
            smaller = sin_a * half_cos_e * inverse
            half_sin_e = sin_e * larger * inverse
            # the larger of |cos a/2| and |sin a/2| by a root, the other by a division: neither cancels
            half_cos_a = larger if cos_a >= 0.0 else smaller
            half_sin_a = smaller if cos_a >= 0.0 else larger
            aims[at + lane] = half_sin_a * half_sin_e
            aims[at + LANES + lane] = -half_cos_a * half_sin_e
            aims[at + 2 * LANES + lane] = half_sin_a * half_cos_e
            aims[at + 3 * LANES + lane] = half_cos_a * half_cos_e
            lanes[POLES + lane] += 1.0 if flat2 < POLE * POLE * square else 0.0


@compiled(error_model="numpy")
def aim_plainly(world: World, work: Workspace, lane: int, first: int, last: int, is_start: bool) -> None:
    """Write one lane's desired attitudes of instants `first` to `last - 1` in turn, by the rules for poles.

    Slower than `aim`, for where that does not hold; `y_before` is carried along.
    """
    lanes = work.lanes
    rx, ry, rz = lanes[RX + lane], lanes[RY + lane], lanes[RZ + lane]
    vx, vy, vz = lanes[VX + lane], lanes[VY + lane], lanes[VZ + lane]
    fx, fy, fz = lanes[FX + lane], lanes[FY + lane], lanes[FZ + lane]
    for j in range(first, last):
        r = np.array(place_after(step_of(world.instants, j), rx, ry, rz, vx, vy, vz, fx, fy, fz))
        if world.has_pole_blending and not is_start:
            y = blended_y(r, work.y_before[lane], world.attitude_period)
        else:
            y = desired_y(r, work.y_before[lane])
        is_start = False
        assign(work.y_before[lane], y)
        quaternion = from_dcm(desired_dcm(r, y))
        for i in range(4):
            work.aims[(4 * j + i) * LANES + lane] = quaternion[i]


@compiled(error_model="numpy", forceinline=True, fastmath={"contract"})
def half_angle_series(square: float) -> tuple[float, float]:
    """Return ``sin(x/2)/x`` and ``cos(x/2)`` to rounding, for a square of x up to `LARGEST_SQUARE`."""
    fourth = square * square
    s = (0.5 - square * (1 / 48)) + fourth * ((1 / 3840 - square * (1 / 645120)) + fourth * (1 / 185794560))
    c = (1.0 - square * (1 / 8)) + fourth * (
        (1 / 384 - square * (1 / 46080)) + fourth * (1 / 10321920 - square * (1 / 3715891200))
    )
    return s, c


@compiled(error_model="numpy", forceinline=True, fastmath={"contract"})
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
    is the longest chain of operations that depend on one another in a flight.
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


@compiled(error_model="numpy", forceinline=True, fastmath={"contract"})
def times3(m: Floats, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Return a 3x3 matrix times a vector."""
    return (
        m[0, 0] * x + m[0, 1] * y + m[0, 2] * z,
        m[1, 0] * x + m[1, 1] * y + m[1, 2] * z,
        m[2, 0] * x + m[2, 1] * y + m[2, 2] * z,
    )


@compiled(error_model="numpy", forceinline=True, fastmath={"contract"})
def euler(
    inertia: Floats, inverse: Floats, wx: float, wy: float, wz: float, tx: float, ty: float, tz: float
) -> tuple[float, float, float]:
    """Return the rate of change of an inertial rate in body axes (Euler's equation)."""
    hx, hy, hz = times3(inertia, wx, wy, wz)
    return times3(inverse, tx - (wy * hz - wz * hy), ty - (wz * hx - wx * hz), tz - (wx * hy - wy * hx))


@compiled(error_model="numpy", fastmath={"contract"})
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


@compiled(error_model="numpy", forceinline=True, fastmath={"contract"})
def clip(x: float, limit: float) -> float:
    """Return x, brought within ± the limit."""
    x = x if x < limit else limit
    return x if x > -limit else -limit


@compiled(error_model="numpy", fastmath={"contract"})
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


@compiled(error_model="numpy", forceinline=True, fastmath={"contract"})
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


@compiled(error_model="numpy", forceinline=True, fastmath={"contract"})
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
    sign = 1.0 if sign >= 0.0 else -1.0
    e1 = sign * (a4 * q1 - q4 * a1 - (a2 * q3 - a3 * q2))
    e2 = sign * (a4 * q2 - q4 * a2 - (a3 * q1 - a1 * q3))
    e3 = sign * (a4 * q3 - q4 * a3 - (a1 * q2 - a2 * q1))
    ux = wx - n * 2 * (q1 * q3 - q2 * q4)
    uy = wy - n * 2 * (q2 * q3 + q1 * q4)
    uz = wz - n * (-q1 * q1 - q2 * q2 + q3 * q3 + q4 * q4)
    return e1, e2, e3, ux, uy, uz


@compiled(error_model="numpy", forceinline=True, fastmath={"contract"})
def torque(
    e1: float, e2: float, e3: float, ux: float, uy: float, uz: float, kp: Floats, kd: Floats, limit: float
) -> tuple[float, float, float]:
    """Return ``-Kp e - Kd u``, each axis clipped."""
    px, py, pz = times3(kp, e1, e2, e3)
    dx, dy, dz = times3(kd, ux, uy, uz)
    return clip(-px - dx, limit), clip(-py - dy, limit), clip(-pz - dz, limit)


@compiled(error_model="numpy", fastmath={"contract"})
def turn_lanes(
    lanes: Floats,
    aims: Floats,
    instant: int,
    n: float,
    h: float,
    kp: Floats,
    kd: Floats,
    limit: float,
    inverse_inertia: float,
    hill_sin: float,
    hill_cos: float,
) -> None:
    """Fly the attitude of all lanes for one period of the attitude clock, for a body of spherical inertia."""
    at = 4 * LANES * instant
    for i in range(LANES):
        q1, q2, q3, q4 = lanes[Q1 + i], lanes[Q2 + i], lanes[Q3 + i], lanes[Q4 + i]
        wx, wy, wz = lanes[WX + i], lanes[WY + i], lanes[WZ + i]
        a1, a2, a3, a4 = (
            aims[at + i],
            aims[at + LANES + i],
            aims[at + 2 * LANES + i],
            aims[at + 3 * LANES + i],
        )
        e1, e2, e3, ux, uy, uz = error_and_rate(q1, q2, q3, q4, a1, a2, a3, a4, wx, wy, wz, n)
        mx, my, mz = torque(e1, e2, e3, ux, uy, uz, kp, kd, limit)
        q1, q2, q3, q4, wx, wy, wz = turn_ball(
            q1, q2, q3, q4, wx, wy, wz, mx, my, mz, h, inverse_inertia, hill_sin, hill_cos
        )
        lanes[Q1 + i], lanes[Q2 + i], lanes[Q3 + i], lanes[Q4 + i] = q1, q2, q3, q4
        lanes[WX + i], lanes[WY + i], lanes[WZ + i] = wx, wy, wz


@compiled(error_model="numpy", fastmath={"contract"})
def turn_lane(lanes: Floats, aims: Floats, instant: int, i: int, world: World) -> None:
    """Fly the attitude of one lane for one period of the attitude clock, for any inertia."""
    at = 4 * LANES * instant + i
    q1, q2, q3, q4 = lanes[Q1 + i], lanes[Q2 + i], lanes[Q3 + i], lanes[Q4 + i]
    wx, wy, wz = lanes[WX + i], lanes[WY + i], lanes[WZ + i]
    a1, a2, a3, a4 = aims[at], aims[at + LANES], aims[at + 2 * LANES], aims[at + 3 * LANES]
    e1, e2, e3, ux, uy, uz = error_and_rate(q1, q2, q3, q4, a1, a2, a3, a4, wx, wy, wz, world.mean_motion)
    mx, my, mz = torque(
        e1, e2, e3, ux, uy, uz, world.proportional_gain, world.derivative_gain, world.max_torque
    )
    q1, q2, q3, q4, wx, wy, wz = turn_body(world, q1, q2, q3, q4, wx, wy, wz, mx, my, mz)
    lanes[Q1 + i], lanes[Q2 + i], lanes[Q3 + i], lanes[Q4 + i] = q1, q2, q3, q4
    lanes[WX + i], lanes[WY + i], lanes[WZ + i] = wx, wy, wz


@compiled(error_model="numpy", fastmath={"contract"})
def write_instant(lanes: Floats, aims: Floats, instant: int, world: World, log: FlightLog, k: int) -> None:
    """Log attitude, rate and torque of lane 0 at an instant of the attitude clock."""
    at = 4 * LANES * instant
    q1, q2, q3, q4 = lanes[Q1], lanes[Q2], lanes[Q3], lanes[Q4]
    wx, wy, wz = lanes[WX], lanes[WY], lanes[WZ]
    a1, a2, a3, a4 = aims[at], aims[at + LANES], aims[at + 2 * LANES], aims[at + 3 * LANES]
    e1, e2, e3, ux, uy, uz = error_and_rate(q1, q2, q3, q4, a1, a2, a3, a4, wx, wy, wz, world.mean_motion)
    mx, my, mz = torque(
        e1, e2, e3, ux, uy, uz, world.proportional_gain, world.derivative_gain, world.max_torque
    )
    log.attitude_quaternion[k, instant, 0], log.attitude_quaternion[k, instant, 1] = q1, q2
    log.attitude_quaternion[k, instant, 2], log.attitude_quaternion[k, instant, 3] = q3, q4
    log.attitude_rate_b_rad_s[k, instant, 0], log.attitude_rate_b_rad_s[k, instant, 1] = ux, uy
    log.attitude_rate_b_rad_s[k, instant, 2] = uz
    log.torque_b_n_m[k, instant, 0], log.torque_b_n_m[k, instant, 1] = mx, my
    log.torque_b_n_m[k, instant, 2] = mz


@compiled(error_model="numpy", forceinline=True, fastmath={"contract"})
def turn_deputies(  # noqa: PLR0912 - most branches part the fast way from the general one
    world: World, work: Workspace, num_lanes: int, log: FlightLog, k: int
) -> None:
    """Aim and turn over the control period that follows sample k."""
    lanes, last = work.lanes, world.num_attitude_steps - 1
    aim(work.aims, lanes, world.instants, world.num_attitude_steps)
    for i in range(num_lanes):
        if lanes[POLES + i] > 0.0 or world.has_pole_blending:
            done = 1 if world.is_attitude_ideal else 0
            aim_plainly(world, work, i, done, last + 1, k + done == 0)
            if world.is_attitude_ideal:
                for component in range(4):
                    work.aims[component * LANES + i] = lanes[Q1 + LANES * component + i]
        else:
            at = 4 * LANES * last + i
            a1, a2 = work.aims[at], work.aims[at + LANES]
            a3, a4 = work.aims[at + 2 * LANES], work.aims[at + 3 * LANES]
            work.y_before[i, 0] = 2 * (a1 * a2 - a3 * a4)
            work.y_before[i, 1] = -a1 * a1 + a2 * a2 - a3 * a3 + a4 * a4
            work.y_before[i, 2] = 0.0
    is_logged = len(log.position_m) > 0
    if world.is_attitude_ideal:
        for j in range(world.num_attitude_steps if is_logged else 0):
            for component in range(4):
                log.attitude_quaternion[k, j, component] = work.aims[(4 * j + component) * LANES]
        return
    n, h = world.mean_motion, world.attitude_period
    hill_sin, hill_cos = sin(0.5 * n * h), cos(0.5 * n * h)
    is_one_step_of_a_ball = world.is_spherical and h <= LONGEST_STEP_S * (1.0 + 1e-9)
    # a lane that might turn too far for the series within this period goes the general way
    gained = world.control_period * sqrt(3.0) * world.max_torque * world.inverse_inertia[0, 0]
    num_general = 0
    for i in range(num_lanes):
        wx, wy, wz = lanes[WX + i], lanes[WY + i], lanes[WZ + i]
        is_slow = h * (sqrt(wx * wx + wy * wy + wz * wz) + gained) < sqrt(LARGEST_SQUARE)
        work.is_general[i] = not (is_one_step_of_a_ball and is_slow)
        if work.is_general[i]:
            num_general += 1
            for j in range(world.num_attitude_steps):
                if is_logged:
                    write_instant(lanes, work.aims, j, world, log, k)
                turn_lane(lanes, work.aims, j, i, world)
            for component in range(7):
                work.turned[i, component] = lanes[Q1 + LANES * component + i]
    if num_general < num_lanes:
        for j in range(world.num_attitude_steps):
            if is_logged:
                write_instant(lanes, work.aims, j, world, log, k)
            turn_lanes(
                lanes,
                work.aims,
                j,
                n,
                h,
                world.proportional_gain,
                world.derivative_gain,
                world.max_torque,
                world.inverse_inertia[0, 0],
                hill_sin,
                hill_cos,
            )
    for i in range(num_lanes if num_general > 0 else 0):
        if work.is_general[i]:
            for component in range(7):
                lanes[Q1 + LANES * component + i] = work.turned[i, component]
    for i in range(LANES):  # exponentials keep the norm but for rounding
        q1, q2, q3, q4 = lanes[Q1 + i], lanes[Q2 + i], lanes[Q3 + i], lanes[Q4 + i]
        scale = 1.5 - 0.5 * (q1 * q1 + q2 * q2 + q3 * q3 + q4 * q4)
        lanes[Q1 + i], lanes[Q2 + i], lanes[Q3 + i], lanes[Q4 + i] = (
            q1 * scale,
            q2 * scale,
            q3 * scale,
            q4 * scale,
        )
