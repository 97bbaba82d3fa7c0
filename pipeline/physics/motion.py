"""Motion of the deputy: one implementation for flights, previews, the safety layer, planners and plans.

While a force f is held, a state ``s = [x, y, z, u, v, w]`` (position in m, then velocity in m/s, Hill axes)
moves by ``s(t) = Phi(t) s + Gamma(t) f``. This is the closed form of the Clohessy-Wiltshire equations (i
radial, j along-track, k orbit normal; Choi, Kim and Leeghim, AAS 25-727; Schaub and Junkins, Analytical
Mechanics of Space Systems, section 14.4)::

    x'' - 3 n^2 x - 2 n y' = f_x / m
    y'' + 2 n x'           = f_y / m
    z'' + n^2 z            = f_z / m

`motion_over` computes the matrices. Forces that the deputy does not know, where flights have any, are those
of `pipeline.physics.orbit`.

Compiled code takes a state as a position and a velocity, m and m/s, and reads the elements of Phi and Gamma
that are not 0 or 1 from a `Propagator`. A law that stops a deputy is a gain, shape (3, 6): ``f = K s``,
``K = -Gamma_v^-1 Phi_v``, N/m and N s/m.
"""

from collections.abc import Collection
from functools import lru_cache
from math import cos, pi, sin
from typing import NamedTuple, Protocol

import numpy as np

from fis_tools.compiled.decorator import compiled, plainly
from fis_tools.compiled.three import Three
from pipeline.array_types import Floats


@compiled
def _angle_minus_sine(angle: float) -> float:
    """Return ``angle - sin(angle)`` without cancellation for small angles."""
    if abs(angle) > 0.5:
        return angle - sin(angle)
    square = angle * angle
    term = angle * square / 6.0
    total = term
    for k in range(4, 20, 2):
        term *= -square / (k * (k + 1))
        total += term
    return total


@compiled
def state_transition(mean_motion: float, duration: float) -> Floats:
    """Return Phi, shape (6, 6), for a mean motion above zero, rad/s, and a duration, s."""
    n = mean_motion
    angle = n * duration
    s = sin(angle)
    c = cos(angle)
    one_minus_c = 2.0 * sin(0.5 * angle) * sin(0.5 * angle)
    late = _angle_minus_sine(angle)
    phi = np.zeros((6, 6))  # element by element: numba makes lists of rows
    phi[0, 0], phi[0, 3], phi[0, 4] = 1.0 + 3.0 * one_minus_c, s / n, 2.0 * one_minus_c / n
    phi[1, 0], phi[1, 1], phi[1, 3] = -6.0 * late, 1.0, -2.0 * one_minus_c / n
    phi[1, 4] = duration - 4.0 * late / n
    phi[2, 2], phi[2, 5] = c, s / n
    phi[3, 0], phi[3, 3], phi[3, 4] = 3.0 * n * s, c, 2.0 * s
    phi[4, 0], phi[4, 3], phi[4, 4] = -6.0 * n * one_minus_c, -2.0 * s, 1.0 - 4.0 * one_minus_c
    phi[5, 2], phi[5, 5] = -n * s, c
    return phi


def input_matrix(mean_motion: float, duration: float, mass: float) -> Floats:
    """Return Gamma, shape (6, 3), for a mean motion above zero, rad/s, a duration, s, and a mass, kg."""
    n = mean_motion
    angle = n * duration
    one_minus_c = 2.0 * sin(0.5 * angle) * sin(0.5 * angle)
    late = _angle_minus_sine(angle)
    along_track = 4.0 * one_minus_c / (n * n) - 1.5 * duration * duration
    position = np.array(
        [
            [one_minus_c / (n * n), 2.0 * late / (n * n), 0.0],
            [-2.0 * late / (n * n), along_track, 0.0],
            [0.0, 0.0, one_minus_c / (n * n)],
        ]
    )
    # a steady acceleration changes the velocity as a velocity changes the position
    return np.vstack((position, state_transition(n, duration)[:3, 3:])) / mass


#: parts into which `closest_approach` divides an orbit
ORBIT_PARTS = 36


class HasMeanMotion(Protocol):
    """The properties of the chief's orbit that motion depends on."""

    @property
    def mean_motion_rad_s(self) -> float:
        """Mean motion, rad/s, above zero."""


class HasMass(Protocol):
    """The properties of the deputy that motion depends on."""

    @property
    def mass_kg(self) -> float:
        """Mass, kg."""


class Motion(NamedTuple):
    """Motion over each of n durations."""

    transition: Floats  # (n, 6, 6) Phi: state transition without force
    control: Floats  # (n, 6, 3) Gamma: effect of 1 N held for the duration


#: the effect of a held force (f, g, h): of f and g along i, of f and g along j, of h along k
HeldEffect = tuple[float, float, float, float, float]


class PositionRows(NamedTuple):
    """The rows of Phi that give the position after free motion, as far as they are not 0 or 1.

    It is ``xx x + xu u + xv v``, ``yx x + y + yu u + yv v``, ``zz z + zw w``.
    """

    xx: float
    xu: float
    xv: float
    yx: float
    yu: float
    yv: float
    zz: float
    zw: float


class Propagator(NamedTuple):
    """Motion over one duration: the elements of Phi and Gamma that are not 0 or 1."""

    position: PositionRows
    u: Three  # from x, u, v
    v: Three  # from x, u, v
    w: tuple[float, float]  # from z, w
    pushed_position: HeldEffect
    pushed_velocity: HeldEffect


def motion_over(orbit: HasMeanMotion, deputy: HasMass, durations: Collection[float]) -> Motion:
    """Return the motion of a deputy over some durations, s."""
    return _motion_over(orbit.mean_motion_rad_s, deputy.mass_kg, tuple(durations))


@lru_cache(maxsize=32)  # rehearsals pack the same world for every call
def _motion_over(n: float, mass: float, durations: tuple[float, ...]) -> Motion:
    """Compute the motion over durations, s, by the mean motion, rad/s, and the mass, kg."""
    with plainly("pipeline"):  # compiling takes longer than all calls in a run
        return Motion(
            transition=np.array([state_transition(n, duration) for duration in durations]).reshape(-1, 6, 6),
            control=np.array([input_matrix(n, duration, mass) for duration in durations]).reshape(-1, 6, 3),
        )


def stop_of(motion: Motion) -> Floats:
    """Return the gain of the law that stops a deputy within the first duration of a motion."""
    gain = -np.linalg.solve(motion.control[0, 3:], motion.transition[0, 3:])
    return np.asarray(gain, dtype=np.float64)


def stopped(motion: Motion, stop: Floats) -> Motion:
    """Return motion over the first duration under the force that stops it: no speed is left."""
    transition = np.zeros((1, 6, 6))
    transition[0, :3] = motion.transition[0, :3] + motion.control[0, :3] @ stop
    return Motion(transition, np.zeros((1, 6, 3)))


def joined(*motions: Motion) -> Motion:
    """Return the motions over all durations of several."""
    return Motion(*(np.concatenate(arrays) for arrays in zip(*motions, strict=True)))


def free_path(motion: Motion, state: Floats, num_samples: int) -> Floats:
    """Return the states of free motion after each first duration, `state` first, (num_samples, 6)."""
    path = np.empty((num_samples, 6))
    path[0] = state
    for k in range(1, num_samples):
        path[k] = motion.transition[0] @ path[k - 1]
    return path


def repeated(motion: Motion, num_periods: int) -> Motion:
    """Return motion over 1, 2, … of the first duration, with a force only in the first."""
    powers = [motion.transition[0]]
    for _ in range(num_periods - 1):
        powers.append(motion.transition[0] @ powers[-1])
    responses = [motion.control[0], *(power @ motion.control[0] for power in powers[:-1])]
    return Motion(np.array(powers), np.array(responses))


@compiled(inline="always")
def position_rows(phi: Floats) -> PositionRows:
    """Return the rows of Phi that give the position after free motion."""
    return PositionRows(
        phi[0, 0], phi[0, 3], phi[0, 4], phi[1, 0], phi[1, 3], phi[1, 4], phi[2, 2], phi[2, 5]
    )


@compiled(inline="always")
def position_rows_of(motion: Motion, index: int) -> PositionRows:
    """Return the rows of Phi that give the position, over one of the durations of a motion."""
    return position_rows(motion.transition[index])


@compiled
def position_rows_over(mean_motion: float, duration: float) -> PositionRows:
    """Return the rows of Phi that give the position, over any duration, s."""
    return position_rows(state_transition(mean_motion, duration))


@compiled(inline="always")
def push_by(p: PositionRows, shift: Three) -> Three:
    """Return the push now, m/s, that moves the position after free motion by a shift, m."""
    scale = 1.0 / (p.xu * p.yv - p.xv * p.yu)
    return Three(
        (p.yv * shift.x - p.xv * shift.y) * scale, (p.xu * shift.y - p.yu * shift.x) * scale, shift.z / p.zw
    )


@compiled(inline="always")
def propagator_of(motion: Motion, index: int) -> Propagator:
    """Return the step of one duration."""
    phi, gamma = motion.transition[index], motion.control[index]
    return Propagator(
        position_rows(phi),
        Three(phi[3, 0], phi[3, 3], phi[3, 4]),
        Three(phi[4, 0], phi[4, 3], phi[4, 4]),
        (phi[5, 2], phi[5, 5]),
        (gamma[0, 0], gamma[0, 1], gamma[1, 0], gamma[1, 1], gamma[2, 2]),
        (gamma[3, 0], gamma[3, 1], gamma[4, 0], gamma[4, 1], gamma[5, 2]),
    )


@compiled(inline="always")
def drifted_position(p: PositionRows, r: Three, v: Three) -> Three:
    """Return the position after free motion, m, from position (m) and velocity (m/s)."""
    return Three(
        p.xx * r.x + p.xu * v.x + p.xv * v.y,
        p.yx * r.x + r.y + p.yu * v.x + p.yv * v.y,
        p.zz * r.z + p.zw * v.z,
    )


@compiled(inline="always")
def drifted_velocity(s: Propagator, r: Three, v: Three) -> Three:
    """Return the velocity after free motion, m/s."""
    return Three(
        s.u.x * r.x + s.u.y * v.x + s.u.z * v.y,
        s.v.x * r.x + s.v.y * v.x + s.v.z * v.y,
        s.w[0] * r.z + s.w[1] * v.z,
    )


@compiled(inline="always")
def pushed(a: Three, held: HeldEffect, f: Three) -> Three:
    """Return a position or a velocity with what a held force adds to it."""
    xf, xg, yf, yg, zh = held
    return Three(a.x + xf * f.x + xg * f.y, a.y + yf * f.x + yg * f.y, a.z + zh * f.z)


@compiled(inline="always")
def position_after(s: Propagator, r: Three, v: Three, f: Three) -> Three:
    """Return the position after a step with a held force, N."""
    return pushed(drifted_position(s.position, r, v), s.pushed_position, f)


@compiled(inline="always")
def velocity_after(s: Propagator, r: Three, v: Three, f: Three) -> Three:
    """Return the velocity after a step with a held force, N."""
    return pushed(drifted_velocity(s, r, v), s.pushed_velocity, f)


@compiled(inline="always")
def effect_along(s: Propagator, p: Three, q: Three) -> Three:
    """Return what each component of a held force adds to ``p . r + q . v`` in a step, per newton."""
    xf, xg, yf, yg, zh = s.pushed_position
    uf, ug, vf, vg, wh = s.pushed_velocity
    return Three(
        xf * p.x + yf * p.y + uf * q.x + vf * q.y,
        xg * p.x + yg * p.y + ug * q.x + vg * q.y,
        zh * p.z + wh * q.z,
    )


@compiled(inline="always")
def position_gradients(p: PositionRows, along: Three) -> tuple[Three, Three]:
    """Return the gradients of the position along a vector after free motion.

    The first is with respect to the position now, the second (s) with respect to the velocity.
    """
    a, b, c = along
    return (
        Three(p.xx * a + p.yx * b, b, p.zz * c),
        Three(p.xu * a + p.yu * b, p.xv * a + p.yv * b, p.zw * c),
    )


@compiled(inline="always")
def stopping_force(k: Floats, r: Three, v: Three) -> Three:
    """Return the force that stops a state, N, by the gain of a law that does."""
    return Three(
        k[0, 0] * r.x + k[0, 3] * v.x + k[0, 4] * v.y,
        k[1, 0] * r.x + k[1, 3] * v.x + k[1, 4] * v.y,
        k[2, 2] * r.z + k[2, 5] * v.z,
    )


def orbit_parts(orbit: HasMeanMotion, deputy: HasMass) -> Motion:
    """Return the motion over 1, 2, … `ORBIT_PARTS` parts of an orbit, for `closest_approach`."""
    part = 2.0 * pi / orbit.mean_motion_rad_s / ORBIT_PARTS
    return motion_over(orbit, deputy, part * np.arange(1, ORBIT_PARTS + 1))
