"""One flight, compiled: the closed loop of dynamics, sight, guidance, inference and attitude control.

What is computed is what `pipeline.reference` writes out plainly; the two are tested to agree. How:

translation
    ``s(k+1) = Phi(T) s(k) + Gamma(T) f(k)``, exact (`pipeline.physics.clohessy_wiltshire`); the same in closed form
    for the instants of the attitude clock inside a period, all at once.
attitude
    Between two instants of the attitude clock the torque is held. With w the deputy's *inertial* rate in body
    axes, ``J w' = t - w x J w``; for a spherical inertia w is linear in time. The turn over a step h is the
    exponential of a fourth-order Magnus expansion,
    ``theta = h (w0 + 4 wm + w1)/6 + h^2 (w0 x w1)/12``, ``wm = (w0 + w1)/2 + h (w0' - w1')/8``
    (Blanes, Casas, Oteo and Ros, "The Magnus expansion and some of its applications", Physics Reports 470, 2009),
    and the Hill frame turns by ``n h`` about k meanwhile:
    ``q <- exp(-n h k/2) q exp(theta/2)``.
desired attitude
    With azimuth a and elevation e of the position, ``q* = (sin a/2 sin e/2, -cos a/2 sin e/2,
    sin a/2 cos e/2, cos a/2 cos e/2)``, half angles from square roots.
sight
    All points at once, without branches.

Single letters follow the equations: r, v position and velocity (Hill), q attitude, w rate, f force, t torque.
"""

from math import atan2, cos, pi, sin, sqrt
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fis_tools.kernel import infer
from pipeline.guidance import MIN_PROJECTION_M, cluster_centres, nearest_centre
from pipeline.physics.attitude_control import POLE, blended_y, desired_dcm, desired_y
from pipeline.physics.quaternion import from_dcm

Floats = NDArray[np.float64]
Indices = NDArray[np.uint64]
Integers = NDArray[np.int64]

#: positions of the signals that a controller may sense, see `pipeline.controllers.SIGNALS`
DISTANCE, VELOCITY_BODY, LAMBDA_U, ETA_U, POSITION_HILL, VELOCITY_HILL, NUM_SIGNALS = 0, 1, 4, 5, 6, 9, 12

#: columns of a row of outcomes
DELTA_V, INSPECTED, MEAN_DISTANCE, MIN_DISTANCE, MAX_DISTANCE, OUTSIDE, NUM_OUTCOMES = 0, 1, 2, 3, 4, 5, 6

#: instants of the attitude clock that are computed side by side: a constant, so that the compiler does so
LANES = 16

#: longest step of the attitude integrator, s
LONGEST_STEP_S = 1.0
#: a body that turns faster takes half steps, unless its inertia is spherical, rad/s
FAST_RATE = 0.25

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
    instant_transition: Floats  # (6, 6, L): over 0, 1, … attitude periods, padded to whole vectors
    instant_control: Floats  # (6, 3, L)
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
    """Arrays that a flight works in; any content is right."""

    unseen: Floats  # (P padded,) 1 where a point is not inspected
    candidate: Floats  # (P padded,) 1 where it is lit and not inspected
    aims: Floats  # (4, L) desired attitudes at the instants of a control period
    signals: Floats  # (NUM_SIGNALS,)
    inputs: Floats  # (3,)
    scratch: Floats
    candidates: Floats  # (3, P) those of this sample, packed
    centres: Floats  # (C, 3)
    labels: Integers  # (2, P)
    distances: Floats  # (P,)
    sums: Floats  # (C, 4)


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
    for j in range(len(unseen)):
        px, py, pz = points[sample, 0, j], points[sample, 1, j], points[sample, 2, j]
        dx, dy, dz = px - rx, py - ry, pz - rz
        towards = dx * bx + dy * by + dz * bz
        squared = dx * dx + dy * dy + dz * dz
        lit = unseen[j] if px * sx + py * sy > sun_threshold else 0.0
        seen = lit if px * rx + py * ry + pz * rz >= horizon else 0.0
        seen = seen if towards > 0.0 else 0.0
        seen = seen if towards * towards >= cos2 * squared else 0.0
        unseen[j] -= seen
        left = lit - seen
        candidate[j] = left
        unseen_count += unseen[j]
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


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def aim(
    aims: Floats,
    phi: Floats,
    gamma: Floats,
    rx: float,
    ry: float,
    rz: float,
    vx: float,
    vy: float,
    vz: float,
    fx: float,
    fy: float,
    fz: float,
) -> float:
    """Write the desired attitudes at all instants of a control period.

    Returns how many of them are so near a pole that the position does not define y*.
    """
    num_poles = 0.0
    for chunk in range(aims.shape[1] // LANES):
        for lane in range(LANES):
            j = LANES * chunk + lane
            x = (
                phi[0, 0, j] * rx
                + phi[0, 3, j] * vx
                + phi[0, 4, j] * vy
                + gamma[0, 0, j] * fx
                + gamma[0, 1, j] * fy
            )
            y = phi[1, 0, j] * rx + ry + phi[1, 3, j] * vx + phi[1, 4, j] * vy
            y += gamma[1, 0, j] * fx + gamma[1, 1, j] * fy
            z = phi[2, 2, j] * rz + phi[2, 5, j] * vz + gamma[2, 2, j] * fz
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
            # the larger of |cos a/2| and |sin a/2| by a root, the other by a division, so that neither cancels
            half_cos_a = larger if cos_a >= 0.0 else smaller
            half_sin_a = smaller if cos_a >= 0.0 else larger
            aims[0, j] = half_sin_a * half_sin_e
            aims[1, j] = -half_cos_a * half_sin_e
            aims[2, j] = half_sin_a * half_cos_e
            aims[3, j] = half_cos_a * half_cos_e
            num_poles += 1.0 if flat2 < POLE * POLE * square else 0.0
    return num_poles


@njit(cache=True, error_model="numpy")
def aim_plainly(
    world: World,
    aims: Floats,
    state: Floats,
    force: Floats,
    y_before: Floats,
    first: int,
    last: int,
    is_start: bool,
) -> None:
    """Write the desired attitudes of instants `first` to `last - 1` one by one, by the rules for poles.

    Slower than `aim`, for where that does not hold; `y_before` is carried along.
    """
    for j in range(first, last):
        r = np.zeros(3)
        for i in range(3):
            for k in range(6):
                r[i] += world.instant_transition[i, k, j] * state[k]
            for k in range(3):
                r[i] += world.instant_control[i, k, j] * force[k]
        if world.has_pole_blending and not is_start:
            y = blended_y(r, y_before, world.attitude_period)
        else:
            y = desired_y(r, y_before)
        is_start = False
        y_before[:] = y
        aims[:, j] = from_dcm(desired_dcm(r, y))


@njit(cache=True, error_model="numpy", forceinline=True, fastmath={"contract"})
def turn(
    q1: float,
    q2: float,
    q3: float,
    q4: float,
    ax: float,
    ay: float,
    az: float,
    hill_sin: float,
    hill_cos: float,
) -> tuple[float, float, float, float]:
    """Turn an attitude by a rotation vector in body axes while the Hill frame turns about k.

    Written so that the two products do not wait for the series: this function is the longest chain of
    operations that depend on one another in a flight.
    """
    square = ax * ax + ay * ay + az * az
    fourth = square * square
    if square < 0.25:  # sin(x/2)/x and cos(x/2), x^2 = square
        s = (0.5 - square * (1 / 48)) + fourth * (
            (1 / 3840 - square * (1 / 645120)) + fourth * (1 / 185794560)
        )
        c = (1.0 - square * (1 / 8)) + fourth * (
            (1 / 384 - square * (1 / 46080)) + fourth * (1 / 10321920 - square * (1 / 3715891200))
        )
    else:
        angle = sqrt(square)
        s, c = sin(0.5 * angle) / angle, cos(0.5 * angle)
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
    tx: float,
    ty: float,
    tz: float,
) -> tuple[float, float, float, float, float, float, float]:
    """Fly the attitude of a body of any inertia over one attitude period; rates are inertial, in body axes."""
    steps = int(np.ceil(world.attitude_period / LONGEST_STEP_S - 1e-9))
    if wx * wx + wy * wy + wz * wz > FAST_RATE * FAST_RATE:
        steps *= 2
    h = world.attitude_period / steps
    hill_sin, hill_cos = sin(0.5 * world.mean_motion * h), cos(0.5 * world.mean_motion * h)
    for _ in range(steps):
        wx, wy, wz, ax, ay, az = spin(world.inertia, world.inverse_inertia, wx, wy, wz, tx, ty, tz, h)
        q1, q2, q3, q4 = turn(q1, q2, q3, q4, ax, ay, az, hill_sin, hill_cos)
    return q1, q2, q3, q4, wx, wy, wz


@njit(cache=True, error_model="numpy")
def choose_cluster(world: World, work: Workspace, sample: int, count: int, before: int, r: Floats) -> int:
    """Cluster the candidates of a sample; the chosen centre is left in `r`. Returns the number of centres."""
    filled = 0
    for j in range(world.num_points):
        if work.candidate[j] != 0.0:
            for axis in range(3):
                work.candidates[axis, filled] = world.points[sample, axis, j]
            filled += 1
    number = cluster_centres(
        work.candidates, count, r, work.centres, before, work.labels, work.distances, work.sums
    )
    chosen = nearest_centre(work.centres, number, r)
    for axis in range(3):
        r[axis] = work.centres[chosen, axis]
    return number


@njit(cache=True, error_model="numpy", fastmath={"contract"})
def fly(
    world: World,
    law: Law,
    values: Floats,
    rules: Indices,
    start: Floats,
    sun_angle: float,
    work: Workspace,
    log: Log,
    tracks: NDArray[np.float32],
    flight: int,
    outcomes: Floats,
) -> None:
    """Fly one episode and write its outcome.

    Parameters
    ----------
    world, law : what is flown
    values, rules : rows of `fis_tools.kernel.Packed`
    start : (6,) position (m) and velocity (m/s), Hill axes
    sun_angle : rad, at k = 0
    work : Workspace
    log : Log, whose arrays are filled unless they are empty
    tracks : (n, K+1, 3) float32, row `flight` is filled with positions unless it is empty
    flight : which row
    outcomes : (n, NUM_OUTCOMES), row `flight` is filled
    """
    is_logged = len(log.position) > 0
    is_tracked = len(tracks) > 0
    n = world.mean_motion
    rx, ry, rz, vx, vy, vz = start[0], start[1], start[2], start[3], start[4], start[5]
    q1, q2, q3, q4 = 0.0, 0.0, 0.0, 1.0
    wx, wy, wz = 0.0, 0.0, 2.0 * n  # inertial: n relative to Hill, and Hill's own
    fx, fy, fz = 0.0, 0.0, 0.0
    y_before = np.array([0.0, 1.0, 0.0])
    needs_angles = is_logged
    for system in range(len(law.axes)):
        for place in range(3):
            needs_angles |= law.signals[system, place] == LAMBDA_U or law.signals[system, place] == ETA_U
    work.unseen[:] = 0.0
    work.unseen[: world.num_points] = 1.0
    left = world.num_points
    num_centres, count_before = 0, -1.0
    target = np.zeros(3)
    h = world.attitude_period
    takes_one_step = world.is_spherical and h <= LONGEST_STEP_S * (1.0 + 1e-9)
    hill_sin, hill_cos = sin(0.5 * n * h), cos(0.5 * n * h)
    kp, kd = world.proportional_gain[0, 0], world.derivative_gain[0, 0]
    angular_acceleration = world.inverse_inertia[0, 0]
    delta_v, total_distance, nearest, farthest, outside = 0.0, 0.0, np.inf, 0.0, 0.0
    base_cos, base_sin = cos(sun_angle), sin(sun_angle)
    tick_cos, tick_sin = cos(n * world.control_period), sin(n * world.control_period)

    for k in range(world.num_controls + 1):
        distance = sqrt(rx * rx + ry * ry + rz * rz)
        total_distance += distance
        nearest = distance if distance < nearest else nearest
        farthest = distance if distance > farthest else farthest
        if k > 0:
            outside = max(outside, world.min_distance - distance, distance - world.max_distance)
        if world.is_attitude_ideal:
            state = np.array([rx, ry, rz, vx, vy, vz])
            aim_plainly(world, work.aims, state, np.zeros(3), y_before, 0, 1, k == 0)
            q1, q2, q3, q4 = work.aims[0, 0], work.aims[1, 0], work.aims[2, 0], work.aims[3, 0]

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

        # inspect
        sample = k if len(world.points) > 1 else 0
        b = world.boresight
        sx, sy = base_cos, base_sin
        unseen_count, count, tx, ty, tz = look(
            world.points,
            sample,
            work.unseen,
            work.candidate,
            rx,
            ry,
            rz,
            c11 * b[0] + c21 * b[1] + c31 * b[2],
            c12 * b[0] + c22 * b[1] + c32 * b[2],
            c13 * b[0] + c23 * b[1] + c33 * b[2],
            sx,
            sy,
            world.sun_threshold,
            world.horizon,
            world.cos_half_angle_squared,
        )
        left = int(unseen_count)

        # choose the target
        if count > 0.0:
            tx, ty, tz = tx / count, ty / count, tz / count
        if world.has_clusters:
            if count > 0.0:
                target[0], target[1], target[2] = rx, ry, rz
                num_centres = choose_cluster(world, work, sample, int(count), num_centres, target)
                tx, ty, tz = target[0], target[1], target[2]
            else:
                num_centres = 0
        lambda_u, eta_u = 0.0, 0.0
        if needs_angles and count > 0.0:
            lambda_u = relative_angle(tx, ty, rx, ry)
            eta_u = relative_angle(tx, tz, rx, rz)

        if is_tracked:
            tracks[flight, k, 0], tracks[flight, k, 1], tracks[flight, k, 2] = rx, ry, rz
        if is_logged:
            log.position[k, 0], log.position[k, 1], log.position[k, 2] = rx, ry, rz
            log.velocity[k, 0], log.velocity[k, 1], log.velocity[k, 2] = vx, vy, vz
            log.quaternion[k, 0], log.quaternion[k, 1] = q1, q2
            log.quaternion[k, 2], log.quaternion[k, 3] = q3, q4
            if not world.is_attitude_ideal:
                log.angular_velocity[k, 0] = wx - n * c13
                log.angular_velocity[k, 1] = wy - n * c23
                log.angular_velocity[k, 2] = wz - n * c33
            log.num_candidates[k] = int(count)
            if count > 0.0:
                log.target[k, 0], log.target[k, 1], log.target[k, 2] = tx, ty, tz
            log.lambda_u[k], log.eta_u[k] = lambda_u, eta_u
            log.sun_angle[k] = sun_angle - n * world.control_period * k
            for j in range(world.num_points):
                log.is_inspected[k, j] = work.unseen[j] == 0.0
            log.delta_v[k] = delta_v
        if k == world.num_controls:
            break

        # infer
        gx, gy, gz = 0.0, 0.0, 0.0
        is_decided = False
        if law.has_plan:
            fx, fy, fz = law.plan[k, 0], law.plan[k, 1], law.plan[k, 2]
            gx, gy, gz = fx, fy, fz
        elif len(law.axes) > 0 and (left > 0 or not world.coasts_when_complete):
            is_decided = True
            signals = work.signals
            signals[DISTANCE] = distance
            signals[VELOCITY_BODY] = c11 * vx + c12 * vy + c13 * vz
            signals[VELOCITY_BODY + 1] = c21 * vx + c22 * vy + c23 * vz
            signals[VELOCITY_BODY + 2] = c31 * vx + c32 * vy + c33 * vz
            signals[LAMBDA_U], signals[ETA_U] = lambda_u, eta_u
            signals[POSITION_HILL], signals[POSITION_HILL + 1], signals[POSITION_HILL + 2] = rx, ry, rz
            signals[VELOCITY_HILL], signals[VELOCITY_HILL + 1], signals[VELOCITY_HILL + 2] = vx, vy, vz
            for system in range(len(law.axes)):
                for place in range(3):
                    work.inputs[place] = signals[law.signals[system, place]]
                force = infer(values, rules, law.layout, np.uint64(system), work.inputs, work.scratch)
                if is_logged:
                    log.fis_output[k, system] = force
                    for place in range(law.num_inputs[system]):
                        log.fis_input[k, system, place] = work.inputs[place]
                axis = law.axes[system]
                gx = gx + force if axis == 0 else gx
                gy = gy + force if axis == 1 else gy
                gz = gz + force if axis == 2 else gz
            fx, fy, fz = gx, gy, gz
            if law.force_axes == BODY:
                fx = c11 * gx + c21 * gy + c31 * gz
                fy = c12 * gx + c22 * gy + c32 * gz
                fz = c13 * gx + c23 * gy + c33 * gz
        else:
            fx, fy, fz = 0.0, 0.0, 0.0
        if is_logged:
            log.is_decided[k] = is_decided
            if law.force_axes == BODY and not law.has_plan:
                log.force_body[k, 0], log.force_body[k, 1], log.force_body[k, 2] = gx, gy, gz
            else:
                log.force_body[k, 0] = c11 * fx + c12 * fy + c13 * fz
                log.force_body[k, 1] = c21 * fx + c22 * fy + c23 * fz
                log.force_body[k, 2] = c31 * fx + c32 * fy + c33 * fz
        fx, fy, fz = clip(fx, world.max_force), clip(fy, world.max_force), clip(fz, world.max_force)
        if is_logged:
            log.force_hill[k, 0], log.force_hill[k, 1], log.force_hill[k, 2] = fx, fy, fz
        delta_v += (abs(fx) + abs(fy) + abs(fz)) * world.control_period * world.acceleration_per_force

        # aim
        num_poles = aim(
            work.aims,
            world.instant_transition,
            world.instant_control,
            rx,
            ry,
            rz,
            vx,
            vy,
            vz,
            fx,
            fy,
            fz,
        )
        last = world.num_attitude_steps - 1
        if num_poles > 0.0 or world.has_pole_blending:
            state, force_h = np.array([rx, ry, rz, vx, vy, vz]), np.array([fx, fy, fz])
            done = 1 if world.is_attitude_ideal else 0
            aim_plainly(world, work.aims, state, force_h, y_before, done, last + 1, k + done == 0)
            if world.is_attitude_ideal:
                work.aims[0, 0], work.aims[1, 0], work.aims[2, 0], work.aims[3, 0] = q1, q2, q3, q4
        else:
            a1, a2, a3, a4 = work.aims[0, last], work.aims[1, last], work.aims[2, last], work.aims[3, last]
            y_before[0] = 2 * (a1 * a2 - a3 * a4)
            y_before[1] = -a1 * a1 + a2 * a2 - a3 * a3 + a4 * a4
            y_before[2] = 0.0

        # turn
        if not world.is_attitude_ideal:
            for j in range(world.num_attitude_steps):
                a1, a2, a3, a4 = work.aims[0, j], work.aims[1, j], work.aims[2, j], work.aims[3, j]
                ux = wx - n * 2 * (q1 * q3 - q2 * q4)
                uy = wy - n * 2 * (q2 * q3 + q1 * q4)
                uz = wz - n * (-q1 * q1 - q2 * q2 + q3 * q3 + q4 * q4)
                sign = a4 * q4 + (a1 * q1 + a2 * q2 + a3 * q3)
                e1 = a4 * q1 - q4 * a1 - (a2 * q3 - a3 * q2)
                e2 = a4 * q2 - q4 * a2 - (a3 * q1 - a1 * q3)
                e3 = a4 * q3 - q4 * a3 - (a1 * q2 - a2 * q1)
                e1, e2, e3 = (e1, e2, e3) if sign >= 0.0 else (-e1, -e2, -e3)
                if world.is_spherical:
                    mx, my, mz = -kp * e1 - kd * ux, -kp * e2 - kd * uy, -kp * e3 - kd * uz
                else:
                    px, py, pz = times3(world.proportional_gain, e1, e2, e3)
                    dx, dy, dz = times3(world.derivative_gain, ux, uy, uz)
                    mx, my, mz = -px - dx, -py - dy, -pz - dz
                mx, my, mz = (
                    clip(mx, world.max_torque),
                    clip(my, world.max_torque),
                    clip(mz, world.max_torque),
                )
                if is_logged:
                    log.attitude_quaternion[k, j, 0], log.attitude_quaternion[k, j, 1] = q1, q2
                    log.attitude_quaternion[k, j, 2], log.attitude_quaternion[k, j, 3] = q3, q4
                    log.attitude_rate[k, j, 0], log.attitude_rate[k, j, 1], log.attitude_rate[k, j, 2] = (
                        ux,
                        uy,
                        uz,
                    )
                    log.torque[k, j, 0], log.torque[k, j, 1], log.torque[k, j, 2] = mx, my, mz
                if takes_one_step:
                    # the general step below, for a rate that is linear in time
                    step = h * angular_acceleration
                    half, twelfth = 0.5 * h, h * h * step / 12.0
                    ax = h * wx + half * step * mx + twelfth * (wy * mz - wz * my)
                    ay = h * wy + half * step * my + twelfth * (wz * mx - wx * mz)
                    az = h * wz + half * step * mz + twelfth * (wx * my - wy * mx)
                    wx, wy, wz = wx + step * mx, wy + step * my, wz + step * mz
                    q1, q2, q3, q4 = turn(q1, q2, q3, q4, ax, ay, az, hill_sin, hill_cos)
                else:
                    q1, q2, q3, q4, wx, wy, wz = turn_body(world, q1, q2, q3, q4, wx, wy, wz, mx, my, mz)
            # the exponential keeps the norm but for rounding
            scale = 1.5 - 0.5 * (q1 * q1 + q2 * q2 + q3 * q3 + q4 * q4)
            q1, q2, q3, q4 = q1 * scale, q2 * scale, q3 * scale, q4 * scale
        elif is_logged:
            for j in range(world.num_attitude_steps):
                for component in range(4):
                    log.attitude_quaternion[k, j, component] = work.aims[component, j]

        # move
        phi, gamma = world.transition, world.control
        nx = phi[0, 0] * rx + phi[0, 3] * vx + phi[0, 4] * vy + gamma[0, 0] * fx + gamma[0, 1] * fy
        ny = phi[1, 0] * rx + ry + phi[1, 3] * vx + phi[1, 4] * vy + gamma[1, 0] * fx + gamma[1, 1] * fy
        nz = phi[2, 2] * rz + phi[2, 5] * vz + gamma[2, 2] * fz
        ux = phi[3, 0] * rx + phi[3, 3] * vx + phi[3, 4] * vy + gamma[3, 0] * fx + gamma[3, 1] * fy
        uy = phi[4, 0] * rx + phi[4, 3] * vx + phi[4, 4] * vy + gamma[4, 0] * fx + gamma[4, 1] * fy
        vz = phi[5, 2] * rz + phi[5, 5] * vz + gamma[5, 2] * fz
        rx, ry, rz, vx, vy = nx, ny, nz, ux, uy
        base_cos, base_sin = sx * tick_cos + sy * tick_sin, sy * tick_cos - sx * tick_sin

    outcomes[flight, DELTA_V] = delta_v
    outcomes[flight, INSPECTED] = world.num_points - left
    outcomes[flight, MEAN_DISTANCE] = total_distance / (world.num_controls + 1)
    outcomes[flight, MIN_DISTANCE] = nearest
    outcomes[flight, MAX_DISTANCE] = farthest
    outcomes[flight, OUTSIDE] = outside


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
    """Fly every start with every controller of a population, flights `first` to `last - 1`, starts fastest."""
    num_starts = len(starts)
    for flight in range(first, last):
        row, start = flight // num_starts, flight % num_starts
        fly(
            world,
            law,
            values[row],
            rules[row],
            starts[start],
            sun_angles[start],
            work,
            log,
            tracks,
            flight,
            outcomes,
        )
