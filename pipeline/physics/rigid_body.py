"""Rotation of a chief that tumbles freely.

Arrays are in SI units: attitudes of shape (4,) from Hill to chief axes, scalar last; inertias of shape (3,
3), inertial rates and torques of shape (3,) in body axes.
"""

import numpy as np

from fis_tools.compiled.decorator import compiled
from pipeline.array_types import Floats
from pipeline.physics.quaternion import dcm_b_from_h, derivative, normalised
from pipeline.physics.vectors import cross, times

#: tolerance for the attitude of a tumbling chief at the end of a flight, applied to two errors, rad
TUMBLING_TOLERANCE_RAD = 1e-4


@compiled
def euler_angular_acceleration(
    inertia: Floats, inverse_inertia: Floats, inertial_rate: Floats, torque: Floats
) -> Floats:
    """Return ``J^-1 (tau - w x J w)``, Euler's equation."""
    return times(inverse_inertia, torque - cross(inertial_rate, times(inertia, inertial_rate)))


def longest_tumbling_step(
    inertia: Floats, inertial_rate_c: Floats, mean_motion: float, duration: float
) -> float:
    """Return the longest step that keeps a torque-free chief accurate over a flight.

    The fourth-order Runge-Kutta method turns a harmonic motion of rate w by ``w (w h)^4 / 120`` too slowly,
    and damps it by ``w (w h)^5 / 144`` (its stability function on the imaginary axis; Hairer, Norsett and
    Wanner, Solving Ordinary Differential Equations I, II.1), which changes its angle with the square of time.
    Each of the two angles stays below `TUMBLING_TOLERANCE_RAD`, with w the fastest possible rate of the chief
    at the energy of its rate at the start.
    """
    energy = inertial_rate_c @ inertia @ inertial_rate_c
    rate = float(np.sqrt(energy / np.linalg.eigvalsh(inertia)[0])) + mean_motion
    turned = rate * duration
    slowed = (120.0 * TUMBLING_TOLERANCE_RAD / turned) ** (1.0 / 4.0)
    damped = (288.0 * TUMBLING_TOLERANCE_RAD / turned**2) ** (1.0 / 5.0)
    return float(min(slowed, damped) / rate)


@compiled
def _advance(stage: int, duration: float, start: Floats, rate: Floats, state: Floats, end: Floats) -> None:
    """Apply one stage's rate in the classical Runge-Kutta method, in place.

    `state` becomes the point of the next of the four stages, and `end` accumulates the end of the step.
    """
    weight = duration / 3.0 if 0 < stage < 3 else duration / 6.0
    reach = duration if stage == 2 else 0.5 * duration
    for i in range(len(start)):
        end[i] += weight * rate[i]
        state[i] = start[i] + reach * rate[i]


@compiled
def tumbling_step(
    quaternion_c_from_h: Floats,
    inertial_rate_c: Floats,
    inertia: Floats,
    inverse_inertia: Floats,
    mean_motion: float,
    duration: float,
) -> tuple[Floats, Floats]:
    """Return attitude and rate of a torque-free chief after one step of the classical Runge-Kutta method."""
    hill_rate = np.array([0.0, 0.0, mean_motion])
    free = np.zeros(3)
    q = quaternion_c_from_h.copy()
    w = inertial_rate_c.copy()
    q_next = quaternion_c_from_h.copy()
    w_next = inertial_rate_c.copy()
    for stage in range(4):
        q_rate = derivative(q, w - times(dcm_b_from_h(q), hill_rate))
        w_rate = euler_angular_acceleration(inertia, inverse_inertia, w, free)
        _advance(stage, duration, quaternion_c_from_h, q_rate, q, q_next)
        _advance(stage, duration, inertial_rate_c, w_rate, w, w_next)
    return normalised(q_next), w_next


@compiled
def tumble(
    quaternion_c_from_h: Floats,
    inertial_rate_c: Floats,
    inertia: Floats,
    inverse_inertia: Floats,
    mean_motion: float,
    duration: float,
    num_steps: int,
) -> tuple[Floats, Floats]:
    """Return attitude and rate of a torque-free chief after a time, in a number of steps."""
    for _ in range(num_steps):
        quaternion_c_from_h, inertial_rate_c = tumbling_step(
            quaternion_c_from_h, inertial_rate_c, inertia, inverse_inertia, mean_motion, duration / num_steps
        )
    return quaternion_c_from_h, inertial_rate_c
