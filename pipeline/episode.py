"""One flight, compiled: the closed loop of dynamics, sight, guidance, inference and attitude control.

What is computed is what `pipeline.reference` writes out plainly; the two are tested to agree. How:

translation
    ``s(k+1) = Phi(T) s(k) + Gamma(T) f(k)``, exact (`pipeline.physics.clohessy_wiltshire`); the same in
    closed form for the instants of the attitude clock inside a period, all at once.
attitude
    Between two instants of the attitude clock the torque is held. With w the deputy's *inertial* rate in body
    axes, ``J w' = t - w x J w``; for a spherical inertia w is linear in time. The turn over a step h is the
    exponential of a fourth-order Magnus expansion,
    ``theta = h (w0 + 4 wm + w1)/6 + h^2 (w0 x w1)/12``, ``wm = (w0 + w1)/2 + h (w0' - w1')/8``
    (Blanes, Casas, Oteo and Ros, "The Magnus expansion and some of its applications", Physics Reports 470,
    2009), and the Hill frame turns by ``n h`` about k meanwhile: ``q <- exp(-n h k/2) q exp(theta/2)``.
desired attitude
    With azimuth a and elevation e of the position, ``q* = (sin a/2 sin e/2, -cos a/2 sin e/2,
    sin a/2 cos e/2, cos a/2 cos e/2)``, half angles from square roots.
sight
    All points at once, without branches.
lanes
    Up to `LANES` flights of one controller run side by side, so that vector units work on all of them; every
    flight comes out the same in any company.

Single letters follow the equations: r, v position and velocity (Hill), q attitude, w rate, f force, t torque.
"""

from math import atan2, cos, pi, sin, sqrt
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fis_tools.kernel import LANES, infer
from pipeline.guidance import MIN_PROJECTION_M, cluster_centres, nearest_centre
from pipeline.physics.attitude_control import POLE, blended_y, desired_dcm, desired_y
from pipeline.physics.quaternion import dcm_b_from_h, from_dcm

Floats = NDArray[np.float64]
Indices = NDArray[np.uint64]
Integers = NDArray[np.int64]

#: positions of the signals that a controller may sense, see `pipeline.controllers.SIGNALS`
DISTANCE, VELOCITY_BODY, LAMBDA_U, ETA_U, POSITION_HILL, VELOCITY_HILL, NUM_SIGNALS = 0, 1, 4, 5, 6, 9, 12

#: columns of a row of outcomes
DELTA_V, INSPECTED, MEAN_DISTANCE, MIN_DISTANCE, MAX_DISTANCE, OUTSIDE, NUM_OUTCOMES = 0, 1, 2, 3, 4, 5, 6

#: longest step of the attitude integrator, s
LONGEST_STEP_S = 1.0
#: a body that turns faster takes half steps, unless its inertia is spherical, rad/s
FAST_RATE = 0.25

#: square of the largest turn in one step that the series of half angles is for
LARGEST_SQUARE = 0.25

HILL, BODY = 0, 1


class World(NamedTuple):
    """What all flights of a mission share, as numbers and arrays in SI."""

    num_controls: int
    num_attitude_steps: int
    mean_motion: float
    control_period: float
    attitude_period: float
    acceleration_per_force: float
    transition: Floats  # (6, 6) over a control period
    control: Floats  # (6, 3)
    instant_transition: Floats  # (6, 6, S): over 0, 1, … attitude periods
    instant_control: Floats  # (6, 3, S)
    points: Floats  # (K+1 or 1, 3, P padded), Hill axes
    num_points: int
    sun_threshold: float  # a point is lit where p . s exceeds it, m
    horizon: float  # a point is above the horizon where p . r reaches it, m^2
    cos_half_angle_squared: float
    boresight: Floats  # (3,) body axes
    is_spherical: bool
    inertia: Floats  # (3, 3)
    inverse_inertia: Floats  # (3, 3)
    proportional_gain: Floats  # (3, 3) N m
    derivative_gain: Floats  # (3, 3) N m s
    max_torque: float
    max_force: float
    min_distance: float
    max_distance: float
    is_attitude_ideal: bool
    has_pole_blending: bool
    has_clusters: bool
    coasts_when_complete: bool


class Law(NamedTuple):
    """What one controller commands, for a controller with fuzzy systems or with a plan of forces."""

    axes: Integers  # (F,) which component each system drives
    signals: Integers  # (F, 3) which signals it senses
    num_inputs: Integers  # (F,)
    layout: Indices  # of `fis_tools.kernel.Packed`, flat
    force_axes: int
    has_plan: bool
    plan: Floats  # (K, 3) forces in Hill axes, N; empty without a plan


class Workspace(NamedTuple):
    """Arrays that flights work in; any content is right."""

    lanes: Floats  # (NUM_ROWS * LANES,) rows of what each lane carries
    aims: Floats  # (S * 4 * LANES,) desired attitudes at the instants of a control period
    unseen: Floats  # (LANES, P padded) 1 where a point is not inspected
    candidate: Floats  # (P padded,) 1 where it is lit and not inspected
    signals: Floats  # (NUM_SIGNALS * LANES,)
    inputs: Floats  # (3 * LANES,)
    outputs: Floats  # (LANES,)
    scratch: Floats
    y_before: Floats  # (LANES, 3)
    is_general: NDArray[np.bool_]  # (LANES,) whether a lane's attitude is integrated the general way
    turned: Floats  # (LANES, 7) their attitudes and rates
    candidates: Floats  # (3, P) those of this sample, packed
    centres: Floats  # (LANES, C, 3)
    num_centres: Integers  # (LANES,)
    labels: Integers  # (2, P)
    distances: Floats  # (P,)
    sums: Floats  # (C, 4)


# Rows of `Workspace.lanes`, as offsets: position, velocity, attitude, inertial rate, force as commanded,
# force as applied, what has been spent and seen so far.
RX, RY, RZ, VX, VY, VZ, Q1, Q2, Q3, Q4, WX, WY, WZ = (LANES * row for row in range(13))
GX, GY, GZ, FX, FY, FZ = (LANES * row for row in range(13, 19))
SPENT, TRAVELLED, NEAREST, FARTHEST, LEFT, POLES, BEYOND = (LANES * row for row in range(19, 26))
NUM_ROWS = 26


class Log(NamedTuple):
    """The arrays of `pipeline.flight.FlightLog`, in its order; all empty where nothing is logged."""

    position: Floats
    velocity: Floats
    quaternion: Floats
    angular_velocity: Floats
    attitude_quaternion: Floats
    attitude_rate: Floats
    torque: Floats
    force_body: Floats
    force_hill: Floats
    num_candidates: Integers
    target: Floats
    lambda_u: Floats
    eta_u: Floats
    fis_input: Floats
    fis_output: Floats
    is_decided: NDArray[np.bool_]
    sun_angle: Floats
    is_inspected: NDArray[np.bool_]
    delta_v: Floats


# Sums over points may be taken in any order: that is what lets them run on vector units.
@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def look(
    points: Floats,
    sample: int,
    unseen: Floats,
    lane: int,
    candidate: Floats,
    rx: float,
    ry: float,
    rz: float,
    bx: float,
    by: float,
    bz: float,
    sx: float,
    sy: float,
    sun_threshold: float,
    horizon: float,
    cos2: float,
) -> tuple[float, float, float, float, float]:
    """Inspect what is lit and in view, then sum up what is lit and still to be seen.

    Returns the number of points not inspected yet, of candidates, and the sum of the candidates' positions.
    """
    unseen_count, count, cx, cy, cz = 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(len(candidate)):
        px, py, pz = points[sample, 0, j], points[sample, 1, j], points[sample, 2, j]
        dx, dy, dz = px - rx, py - ry, pz - rz
        towards = dx * bx + dy * by + dz * bz
        squared = dx * dx + dy * dy + dz * dz
        lit = unseen[lane, j] if px * sx + py * sy > sun_threshold else 0.0
        seen = lit if px * rx + py * ry + pz * rz >= horizon else 0.0
        seen = seen if towards > 0.0 else 0.0
        seen = seen if towards * towards >= cos2 * squared else 0.0
        unseen[lane, j] -= seen
        left = lit - seen
        candidate[j] = left
        unseen_count += unseen[lane, j]
        count += left
        cx += left * px
        cy += left * py
        cz += left * pz
    return unseen_count, count, cx, cy, cz


@njit(cache=True, error_model="numpy", forceinline=True, fastmath={"contract"})
def relative_angle(target_a: float, target_b: float, position_a: float, position_b: float) -> float:
    """Return the angle from the position's to the target's projection, in (-pi, pi]; 0 where one vanishes."""
    least = MIN_PROJECTION_M * MIN_PROJECTION_M
    if (
        target_a * target_a + target_b * target_b < least
        or position_a * position_a + position_b * position_b < least
    ):
        return 0.0
    angle = atan2(
        position_a * target_b - position_b * target_a, position_a * target_a + position_b * target_b
    )
    return pi if angle == -pi else angle


@njit(cache=True, error_model="numpy", fastmath={"contract"})
def aim(aims: Floats, lanes: Floats, phi: Floats, gamma: Floats, num_instants: int) -> None:
    """Write the desired attitudes of all lanes at all instants of a control period.

    Counts in each lane the instants so near a pole that the position does not define y*.
    """
    for lane in range(LANES):
        lanes[POLES + lane] = 0.0
    for j in range(num_instants):
        xx, xu, xv, xf, xg = phi[0, 0, j], phi[0, 3, j], phi[0, 4, j], gamma[0, 0, j], gamma[0, 1, j]
        yx, yu, yv, yf, yg = phi[1, 0, j], phi[1, 3, j], phi[1, 4, j], gamma[1, 0, j], gamma[1, 1, j]
        zz, zw, zf = phi[2, 2, j], phi[2, 5, j], gamma[2, 2, j]
        at = 4 * LANES * j
        for lane in range(LANES):
            rx, vx, vy = lanes[RX + lane], lanes[VX + lane], lanes[VY + lane]
            fx, fy = lanes[FX + lane], lanes[FY + lane]
            x = xx * rx + xu * vx + xv * vy + xf * fx + xg * fy
            y = yx * rx + lanes[RY + lane] + yu * vx + yv * vy + yf * fx + yg * fy
            z = zz * lanes[RZ + lane] + zw * lanes[VZ + lane] + zf * lanes[FZ + lane]
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


@njit(cache=True, error_model="numpy")
def aim_plainly(world: World, work: Workspace, lane: int, first: int, last: int, is_start: bool) -> None:
    """Write one lane's desired attitudes of instants `first` to `last - 1` in turn, by the rules for poles.

    Slower than `aim`, for where that does not hold; `y_before` is carried along.
    """
    for j in range(first, last):
        r = np.zeros(3)
        for i in range(3):
            for k in range(6):
                r[i] += world.instant_transition[i, k, j] * work.lanes[RX + LANES * k + lane]
            for k in range(3):
                r[i] += world.instant_control[i, k, j] * work.lanes[FX + LANES * k + lane]
        if world.has_pole_blending and not is_start:
            y = blended_y(r, work.y_before[lane], world.attitude_period)
        else:
            y = desired_y(r, work.y_before[lane])
        is_start = False
        work.y_before[lane] = y
        quaternion = from_dcm(desired_dcm(r, y))
        for i in range(4):
            work.aims[(4 * j + i) * LANES + lane] = quaternion[i]


@njit(cache=True, error_model="numpy", forceinline=True, fastmath={"contract"})
def half_angle_series(square: float) -> tuple[float, float]:
    """Return ``sin(x/2)/x`` and ``cos(x/2)`` to rounding, for a square of x up to `LARGEST_SQUARE`."""
    fourth = square * square
    s = (0.5 - square * (1 / 48)) + fourth * ((1 / 3840 - square * (1 / 645120)) + fourth * (1 / 185794560))
    c = (1.0 - square * (1 / 8)) + fourth * (
        (1 / 384 - square * (1 / 46080)) + fourth * (1 / 10321920 - square * (1 / 3715891200))
    )
    return s, c


@njit(cache=True, error_model="numpy", forceinline=True, fastmath={"contract"})
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


@njit(cache=True, error_model="numpy", forceinline=True, fastmath={"contract"})
def times3(m: Floats, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Return a 3x3 matrix times a vector."""
    return (
        m[0, 0] * x + m[0, 1] * y + m[0, 2] * z,
        m[1, 0] * x + m[1, 1] * y + m[1, 2] * z,
        m[2, 0] * x + m[2, 1] * y + m[2, 2] * z,
    )


@njit(cache=True, error_model="numpy", forceinline=True, fastmath={"contract"})
def euler(
    inertia: Floats, inverse: Floats, wx: float, wy: float, wz: float, tx: float, ty: float, tz: float
) -> tuple[float, float, float]:
    """Return the rate of change of an inertial rate in body axes (Euler's equation)."""
    hx, hy, hz = times3(inertia, wx, wy, wz)
    return times3(inverse, tx - (wy * hz - wz * hy), ty - (wz * hx - wx * hz), tz - (wx * hy - wy * hx))


@njit(cache=True, error_model="numpy", fastmath={"contract"})
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


@njit(cache=True, error_model="numpy", forceinline=True, fastmath={"contract"})
def clip(x: float, limit: float) -> float:
    """Return x, brought within ± the limit."""
    x = x if x < limit else limit
    return x if x > -limit else -limit


@njit(cache=True, error_model="numpy", fastmath={"contract"})
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


@njit(cache=True, error_model="numpy", forceinline=True, fastmath={"contract"})
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


@njit(cache=True, error_model="numpy", forceinline=True, fastmath={"contract"})
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


@njit(cache=True, error_model="numpy", forceinline=True, fastmath={"contract"})
def torque(
    e1: float, e2: float, e3: float, ux: float, uy: float, uz: float, kp: Floats, kd: Floats, limit: float
) -> tuple[float, float, float]:
    """Return ``-Kp e - Kd u``, each axis clipped."""
    px, py, pz = times3(kp, e1, e2, e3)
    dx, dy, dz = times3(kd, ux, uy, uz)
    return clip(-px - dx, limit), clip(-py - dy, limit), clip(-pz - dz, limit)


@njit(cache=True, error_model="numpy", fastmath={"contract"})
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


@njit(cache=True, error_model="numpy", fastmath={"contract"})
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


@njit(cache=True, error_model="numpy", fastmath={"contract"})
def write_instant(lanes: Floats, aims: Floats, instant: int, world: World, log: Log, k: int) -> None:
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
    log.attitude_rate[k, instant, 0], log.attitude_rate[k, instant, 1] = ux, uy
    log.attitude_rate[k, instant, 2] = uz
    log.torque[k, instant, 0], log.torque[k, instant, 1], log.torque[k, instant, 2] = mx, my, mz


@njit(cache=True, error_model="numpy", forceinline=True, fastmath={"contract"})
def turn_deputies(  # noqa: PLR0912 - most branches part the fast way from the general one
    world: World, work: Workspace, num_lanes: int, log: Log, k: int
) -> None:
    """Aim and turn over the control period that follows sample k."""
    lanes, last = work.lanes, world.num_attitude_steps - 1
    aim(work.aims, lanes, world.instant_transition, world.instant_control, world.num_attitude_steps)
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
    is_logged = len(log.position) > 0
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


@njit(cache=True, error_model="numpy", forceinline=True, fastmath={"contract"})
def move(world: World, lanes: Floats) -> None:
    """Move all lanes by a control period and add up what they spend."""
    phi, gamma = world.transition, world.control
    spent_per_force = world.control_period * world.acceleration_per_force
    for i in range(LANES):
        rx, ry, rz = lanes[RX + i], lanes[RY + i], lanes[RZ + i]
        vx, vy, vz = lanes[VX + i], lanes[VY + i], lanes[VZ + i]
        fx, fy, fz = lanes[FX + i], lanes[FY + i], lanes[FZ + i]
        lanes[SPENT + i] += (abs(fx) + abs(fy) + abs(fz)) * spent_per_force
        lanes[RX + i] = phi[0, 0] * rx + phi[0, 3] * vx + phi[0, 4] * vy + gamma[0, 0] * fx + gamma[0, 1] * fy
        lanes[RY + i] = (
            phi[1, 0] * rx + ry + phi[1, 3] * vx + phi[1, 4] * vy + gamma[1, 0] * fx + gamma[1, 1] * fy
        )
        lanes[RZ + i] = phi[2, 2] * rz + phi[2, 5] * vz + gamma[2, 2] * fz
        lanes[VX + i] = phi[3, 0] * rx + phi[3, 3] * vx + phi[3, 4] * vy + gamma[3, 0] * fx + gamma[3, 1] * fy
        lanes[VY + i] = phi[4, 0] * rx + phi[4, 3] * vx + phi[4, 4] * vy + gamma[4, 0] * fx + gamma[4, 1] * fy
        lanes[VZ + i] = phi[5, 2] * rz + phi[5, 5] * vz + gamma[5, 2] * fz


@njit(cache=True, error_model="numpy")
def choose_cluster(
    points: Floats,
    sample: int,
    candidate: Floats,
    count: int,
    r: Floats,
    candidates: Floats,
    centres: Floats,
    num_centres: int,
    labels: Integers,
    distances: Floats,
    sums: Floats,
) -> int:
    """Cluster the candidates of a sample, seen from `r`, where the chosen centre is left.

    Returns the number of centres.
    """
    filled = 0
    for j in range(len(candidate)):
        if candidate[j] != 0.0:
            for axis in range(3):
                candidates[axis, filled] = points[sample, axis, j]
            filled += 1
    num_centres = cluster_centres(candidates, count, r, centres, num_centres, labels, distances, sums)
    chosen = nearest_centre(centres, num_centres, r)
    for axis in range(3):
        r[axis] = centres[chosen, axis]
    return num_centres


@njit(cache=True, error_model="numpy", forceinline=True, fastmath={"contract"})
def sense(
    world: World,
    work: Workspace,
    sun_angles: Floats,
    first: int,
    num_lanes: int,
    k: int,
    needs_angles: bool,
    target: Floats,
) -> int:
    """Inspect, choose the target and write the signals of every lane.

    Leaves the last lane's target in `target` where there are candidates, and returns how many it has.
    """
    lanes = work.lanes
    turned = world.mean_motion * world.control_period * k
    count = 0.0
    for lane in range(num_lanes):
        angle = sun_angles[first + lane] - turned
        rx, ry, rz = lanes[RX + lane], lanes[RY + lane], lanes[RZ + lane]
        vx, vy, vz = lanes[VX + lane], lanes[VY + lane], lanes[VZ + lane]
        q1, q2, q3, q4 = lanes[Q1 + lane], lanes[Q2 + lane], lanes[Q3 + lane], lanes[Q4 + lane]
        distance = sqrt(rx * rx + ry * ry + rz * rz)
        lanes[TRAVELLED + lane] += distance
        lanes[NEAREST + lane] = min(lanes[NEAREST + lane], distance)
        lanes[FARTHEST + lane] = max(lanes[FARTHEST + lane], distance)
        if k > 0:
            beyond = max(world.min_distance - distance, distance - world.max_distance)
            lanes[BEYOND + lane] = max(lanes[BEYOND + lane], beyond)

        c11, c12, c13 = (
            q1 * q1 - q2 * q2 - q3 * q3 + q4 * q4,
            2 * (q1 * q2 + q3 * q4),
            2 * (q1 * q3 - q2 * q4),
        )
        c21, c22, c23 = (
            2 * (q1 * q2 - q3 * q4),
            -q1 * q1 + q2 * q2 - q3 * q3 + q4 * q4,
            2 * (q2 * q3 + q1 * q4),
        )
        c31, c32, c33 = (
            2 * (q1 * q3 + q2 * q4),
            2 * (q2 * q3 - q1 * q4),
            -q1 * q1 - q2 * q2 + q3 * q3 + q4 * q4,
        )
        sample = k if len(world.points) > 1 else 0
        b = world.boresight
        unseen_count, count, tx, ty, tz = look(
            world.points,
            sample,
            work.unseen,
            lane,
            work.candidate,
            rx,
            ry,
            rz,
            c11 * b[0] + c21 * b[1] + c31 * b[2],
            c12 * b[0] + c22 * b[1] + c32 * b[2],
            c13 * b[0] + c23 * b[1] + c33 * b[2],
            cos(angle),
            sin(angle),
            world.sun_threshold,
            world.horizon,
            world.cos_half_angle_squared,
        )
        lanes[LEFT + lane] = unseen_count

        lambda_u, eta_u = 0.0, 0.0
        if count > 0.0:
            target[0], target[1], target[2] = tx / count, ty / count, tz / count
            if world.has_clusters:
                target[0], target[1], target[2] = rx, ry, rz
                num_centres = choose_cluster(
                    world.points,
                    sample,
                    work.candidate,
                    int(count),
                    target,
                    work.candidates,
                    work.centres[lane],
                    work.num_centres[lane],
                    work.labels,
                    work.distances,
                    work.sums,
                )
                work.num_centres[lane] = num_centres
            if needs_angles:
                lambda_u = relative_angle(target[0], target[1], rx, ry)
                eta_u = relative_angle(target[0], target[2], rx, rz)
        else:
            work.num_centres[lane] = 0

        signals = work.signals
        signals[LANES * DISTANCE + lane] = distance
        signals[LANES * VELOCITY_BODY + lane] = c11 * vx + c12 * vy + c13 * vz
        signals[LANES * (VELOCITY_BODY + 1) + lane] = c21 * vx + c22 * vy + c23 * vz
        signals[LANES * (VELOCITY_BODY + 2) + lane] = c31 * vx + c32 * vy + c33 * vz
        signals[LANES * LAMBDA_U + lane] = lambda_u
        signals[LANES * ETA_U + lane] = eta_u
        for component in range(6):  # position, then velocity
            signals[LANES * (POSITION_HILL + component) + lane] = lanes[RX + LANES * component + lane]
    return int(count)


@njit(cache=True, error_model="numpy", forceinline=True, fastmath={"contract"})
def command(  # noqa: PLR0912 - one for each kind of law, and one for the log
    world: World, law: Law, values: Floats, rules: Indices, work: Workspace, num_lanes: int, log: Log, k: int
) -> None:
    """Infer the forces of all lanes and turn them to Hill axes, clipped; flights that are complete coast."""
    lanes, signals, inputs, outputs = work.lanes, work.signals, work.inputs, work.outputs
    is_logged = len(log.position) > 0
    for i in range(3 * LANES):
        lanes[GX + i] = 0.0
    if law.has_plan:
        for axis in range(3):
            for i in range(LANES):
                lanes[GX + LANES * axis + i] = law.plan[k, axis]
    else:
        for system in range(len(law.axes)):
            for place in range(3):
                signal = LANES * law.signals[system, place]
                for i in range(LANES):
                    inputs[LANES * place + i] = signals[signal + i]
            infer(
                values,
                rules,
                law.layout,
                np.uint64(system),
                inputs,
                work.scratch,
                np.uint64(num_lanes),
                outputs,
            )
            force = GX + LANES * law.axes[system]
            for i in range(num_lanes):
                coasts = world.coasts_when_complete and lanes[LEFT + i] == 0.0
                lanes[force + i] += 0.0 if coasts else outputs[i]
            if is_logged and not (world.coasts_when_complete and lanes[LEFT] == 0.0):
                log.is_decided[k] = True
                log.fis_output[k, system] = outputs[0]
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


@njit(cache=True, error_model="numpy", fastmath={"contract"})
def write_sample(
    world: World, work: Workspace, log: Log, k: int, sun_angle: float, count: int, target: Floats
) -> None:
    """Log what is known at a sample before the force is, of lane 0."""
    lanes, n = work.lanes, world.mean_motion
    for component in range(3):
        log.position[k, component] = lanes[RX + LANES * component]
        log.velocity[k, component] = lanes[VX + LANES * component]
    for component in range(4):
        log.quaternion[k, component] = lanes[Q1 + LANES * component]
    if not world.is_attitude_ideal:
        q1, q2, q3, q4 = lanes[Q1], lanes[Q2], lanes[Q3], lanes[Q4]
        log.angular_velocity[k, 0] = lanes[WX] - n * 2 * (q1 * q3 - q2 * q4)
        log.angular_velocity[k, 1] = lanes[WY] - n * 2 * (q2 * q3 + q1 * q4)
        log.angular_velocity[k, 2] = lanes[WZ] - n * (-q1 * q1 - q2 * q2 + q3 * q3 + q4 * q4)
    log.num_candidates[k] = count
    for component in range(3 if count > 0 else 0):
        log.target[k, component] = target[component]
    log.lambda_u[k], log.eta_u[k] = work.signals[LANES * LAMBDA_U], work.signals[LANES * ETA_U]
    log.sun_angle[k] = sun_angle - n * world.control_period * k
    for j in range(world.num_points):
        log.is_inspected[k, j] = work.unseen[0, j] == 0.0
    log.delta_v[k] = lanes[SPENT]


@njit(cache=True, error_model="numpy", fastmath={"contract"})
def write_force(work: Workspace, law: Law, log: Log, k: int, dcm: Floats) -> None:
    """Log the force of lane 0: as asked for in body axes, and as applied."""
    for row in range(3):
        log.force_hill[k, row] = work.lanes[FX + LANES * row]
        asked = work.lanes[GX + LANES * row]
        if law.force_axes == HILL:
            asked = 0.0
            for column in range(3):
                asked += dcm[row, column] * work.lanes[GX + LANES * column]
        log.force_body[k, row] = asked


@njit(cache=True, error_model="numpy")
def start_lanes(world: World, work: Workspace, starts: Floats, first: int, num_lanes: int) -> None:
    """Put flights at their starts; lanes without one repeat the last, so that their numbers stay finite."""
    lanes = work.lanes
    lanes[:] = 0.0
    work.unseen[:] = 0.0
    work.num_centres[:] = 0
    for lane in range(LANES):
        start = starts[first + min(lane, num_lanes - 1)]
        for component in range(6):
            lanes[RX + LANES * component + lane] = start[component]
        lanes[Q4 + lane] = 1.0
        lanes[WZ + lane] = 2.0 * world.mean_motion  # inertial: n relative to Hill, and Hill's own
        lanes[NEAREST + lane] = np.inf
        work.unseen[lane, : world.num_points] = 1.0
        work.y_before[lane, 0], work.y_before[lane, 1], work.y_before[lane, 2] = 0.0, 1.0, 0.0


@njit(cache=True, error_model="numpy", fastmath={"contract"})
def fly(
    world: World,
    law: Law,
    values: Floats,
    rules: Indices,
    starts: Floats,
    sun_angles: Floats,
    first: int,
    num_lanes: int,
    work: Workspace,
    log: Log,
    tracks: NDArray[np.float32],
    flight: int,
    outcomes: Floats,
) -> None:
    """Fly one controller from some starts side by side, and write the outcomes.

    Parameters
    ----------
    world, law : what is flown
    values, rules : rows of `fis_tools.kernel.Packed`
    starts : (m, 6) position (m) and velocity (m/s), Hill axes
    sun_angles : (m,) rad, at k = 0
    first, num_lanes : which starts, at most `LANES`
    work : Workspace
    log : Log, whose arrays are filled unless they are empty; for one flight alone
    tracks : (n, K+1, 3) float32, filled with positions from row `flight` on, unless it is empty
    flight : row of the first flight
    outcomes : (n, NUM_OUTCOMES), filled from row `flight` on
    """
    is_logged = len(log.position) > 0
    needs_angles = is_logged
    for system in range(len(law.axes)):
        for place in range(3):
            needs_angles |= law.signals[system, place] == LAMBDA_U or law.signals[system, place] == ETA_U
    start_lanes(world, work, starts, first, num_lanes)
    lanes = work.lanes
    target, count = np.zeros(3), 0
    for k in range(world.num_controls + 1):
        for lane in range(num_lanes if world.is_attitude_ideal else 0):
            for component in range(3):
                lanes[FX + LANES * component + lane] = 0.0
            aim_plainly(world, work, lane, 0, 1, k == 0)
            for component in range(4):
                lanes[Q1 + LANES * component + lane] = work.aims[component * LANES + lane]
        count = sense(world, work, sun_angles, first, num_lanes, k, needs_angles, target)
        for lane in range(num_lanes if len(tracks) > 0 else 0):
            for component in range(3):
                tracks[flight + lane, k, component] = lanes[RX + LANES * component + lane]
        if is_logged:
            write_sample(world, work, log, k, sun_angles[first], count, target)
        if k == world.num_controls:
            break
        command(world, law, values, rules, work, num_lanes, log, k)
        if is_logged:
            write_force(work, law, log, k, dcm_b_from_h(log.quaternion[k]))
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


@njit(cache=True, nogil=True, error_model="numpy")
def fly_many(
    world: World,
    law: Law,
    values: Floats,
    rules: Indices,
    starts: Floats,
    sun_angles: Floats,
    work: Workspace,
    log: Log,
    tracks: NDArray[np.float32],
    first: int,
    last: int,
    outcomes: Floats,
) -> None:
    """Fly flights `first` to `last - 1` of every controller from every start, starts fastest."""
    num_starts = len(starts)
    flight = first
    while flight < last:
        row, start = flight // num_starts, flight % num_starts
        num_lanes = min(LANES, num_starts - start, last - flight)
        fly(
            world,
            law,
            values[row],
            rules[row],
            starts,
            sun_angles,
            start,
            num_lanes,
            work,
            log,
            tracks,
            flight,
            outcomes,
        )
        flight += num_lanes
