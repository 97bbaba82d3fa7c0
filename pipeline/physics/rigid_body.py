"""Rotation of rigid bodies: the deputy relative to a rotating reference, and a chief that tumbles freely.

The relative equation is that of Choi, Kim and Leeghim, AAS 25-727 (after Li and others, 2018)::

    J w' - A w - h = tau
    A = -J [(C w_c)x] - [(C w_c)x] J + [J (w + C w_c)]x
    h = -[(C w_c)x] J C w_c - J C w_c'

with w the rate of the deputy relative to the reference in body axes, w_c the reference's inertial rate in its
own axes, w_c' the derivative of those components, and C the matrix from reference to body axes.
"""

import numpy as np

from fis_tools.compiled.decorator import compiled
from pipeline.array_types import Floats
from pipeline.physics.quaternion import dcm_b_from_h, derivative, normalised
from pipeline.physics.vectors import cross, cross_matrix, times

#: tolerance for the attitude of a tumbling chief at the end of a flight, applied to two errors, rad
TUMBLING_TOLERANCE_RAD = 1e-4


@compiled
def relative_coefficients(
    inertia: Floats,
    dcm: Floats,
    angular_velocity_b: Floats,
    reference_rate: Floats,
    reference_acceleration: Floats,
) -> tuple[Floats, Floats]:
    """Return A and h of the relative equation as in the paper.

    Parameters
    ----------
    inertia : array, shape (3, 3)
        Of the deputy, kg m^2, body axes.
    dcm : array, shape (3, 3)
        From reference to body axes, C.
    angular_velocity_b : array, shape (3,)
        Of the deputy relative to the reference, rad/s, body axes.
    reference_rate, reference_acceleration : array, shape (3,)
        Inertial rate of the reference (rad/s) and its derivative (rad/s^2), reference axes.

    Returns
    -------
    A : array, shape (3, 3)
        In N m s.
    h : array, shape (3,)
        In N m.
    """
    carried = times(dcm, reference_rate)
    spin = cross_matrix(carried)
    momentum = times(inertia, angular_velocity_b + carried)
    a = -inertia @ spin - spin @ inertia + cross_matrix(momentum)
    h = -cross(carried, times(inertia, carried)) - times(inertia, times(dcm, reference_acceleration))
    return a, h


@compiled
def relative_angular_acceleration(
    inertia: Floats,
    inverse_inertia: Floats,
    dcm: Floats,
    angular_velocity_b: Floats,
    reference_rate: Floats,
    reference_acceleration: Floats,
    torque_b: Floats,
) -> Floats:
    """Return ``J^-1 (A w + h + tau)``, with the products of A and h expanded.

    Parameters
    ----------
    inertia, inverse_inertia : array, shape (3, 3)
        Of the deputy, kg m^2 and its inverse, body axes.
    dcm : array, shape (3, 3)
        From reference to body axes, C.
    angular_velocity_b : array, shape (3,)
        Of the deputy relative to the reference, rad/s, body axes.
    reference_rate, reference_acceleration : array, shape (3,)
        Inertial rate of the reference (rad/s) and its derivative (rad/s^2), reference axes.
    torque_b : array, shape (3,)
        N m, body axes.

    Returns
    -------
    array, shape (3,)
        Derivative of the components of `angular_velocity_b`, rad/s^2.
    """
    carried = times(dcm, reference_rate)
    inertial = angular_velocity_b + carried
    gyroscopic = cross(inertial, times(inertia, inertial))
    transport = cross(angular_velocity_b, carried) - times(dcm, reference_acceleration)
    return times(inverse_inertia, torque_b - gyroscopic) + transport


@compiled
def euler_angular_acceleration(
    inertia: Floats, inverse_inertia: Floats, inertial_rate: Floats, torque: Floats
) -> Floats:
    """Return ``J^-1 (tau - w x J w)``, Euler's equation.

    Parameters
    ----------
    inertia, inverse_inertia : array, shape (3, 3)
        kg m^2 and its inverse, body axes.
    inertial_rate : array, shape (3,)
        rad/s, body axes.
    torque : array, shape (3,)
        N m, body axes.

    Returns
    -------
    array, shape (3,)
        rad/s^2.
    """
    return times(inverse_inertia, torque - cross(inertial_rate, times(inertia, inertial_rate)))


def longest_tumbling_step(
    inertia: Floats, inertial_rate_c: Floats, mean_motion: float, duration: float
) -> float:
    """Return the longest step that keeps a torque-free chief accurate over a flight.

    The fourth-order Runge-Kutta method turns a harmonic motion of rate w by ``w (w h)^4 / 120`` too slowly,
    and damps it by ``w (w h)^5 / 144`` (its stability function on the imaginary axis; Hairer, Norsett and
    Wanner, Solving Ordinary Differential Equations I, II.1), which changes its angle with the square of time.
    Each of the two angles stays below `TUMBLING_TOLERANCE_RAD`, with w the fastest possible rate of the chief
    at its energy.

    Parameters
    ----------
    inertia : array, shape (3, 3)
        Of the chief, kg m^2, chief axes.
    inertial_rate_c : array, shape (3,)
        At the start, rad/s, chief axes.
    mean_motion : float
        rad/s.
    duration : float
        Of the flight, s.

    Returns
    -------
    float
        In s.
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
    """Turn a torque-free chief by one step of the classical fourth-order Runge-Kutta method.

    Parameters
    ----------
    quaternion_c_from_h : array, shape (4,)
        From Hill to chief axes.
    inertial_rate_c : array, shape (3,)
        Inertial rate of the chief, rad/s, chief axes.
    inertia, inverse_inertia : array, shape (3, 3)
        Of the chief, kg m^2 and its inverse, chief axes.
    mean_motion : float
        Rate of the Hill frame about k, rad/s.
    duration : float
        Length of the step, s.

    Returns
    -------
    quaternion_c_from_h : array, shape (4,)
        Normalised.
    inertial_rate_c : array, shape (3,)
    """
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
    """Turn a torque-free chief for a time, in a number of steps, see `tumbling_step`."""
    for _ in range(num_steps):
        quaternion_c_from_h, inertial_rate_c = tumbling_step(
            quaternion_c_from_h, inertial_rate_c, inertia, inverse_inertia, mean_motion, duration / num_steps
        )
    return quaternion_c_from_h, inertial_rate_c
