"""The desired attitude, which looks at the chief, and the law that turns the deputy to it."""

import numpy as np
from scipy.spatial.transform import Rotation

from tests.readable_flight.motion import pushed
from tests.readable_flight.turning import turned

#: |k x r|/|r| below which y* is not defined by the position, or, with pole blending, is carried along
POLE, BLENDED_POLE = 1e-3, 0.2
#: rate at which pole blending lets y* return, rad/s
RETURN_RATE = 0.005


def next_y(mission, position, before):
    """The desired second body axis at an attitude instant from the one before; None before the first."""
    x = position / np.linalg.norm(position)
    across = np.cross([0.0, 0.0, 1.0], x)
    flat = np.linalg.norm(across)
    if before is None or not mission.attitude.pole_blending:
        return _carried(x, [0.0, 1.0, 0.0] if before is None else before) if flat < POLE else across / flat
    carried = _carried(x, before)
    if flat < BLENDED_POLE:
        return carried
    goal, sideways = across / flat, np.cross(x, carried)
    angle, most = np.arctan2(goal @ sideways, goal @ carried), RETURN_RATE * mission.attitude_period_s
    if abs(angle) <= most:
        return goal
    return Rotation.from_rotvec(np.sign(angle) * most * x).apply(carried)


def _carried(x, y):
    """An axis made orthogonal to x*; any other where it lies along x*."""
    y = y - (x @ np.asarray(y)) * x
    if np.linalg.norm(y) < 1e-9:
        y = np.cross(x, [1.0, 0.0, 0.0] if abs(x[0]) < 0.9 else [0.0, 1.0, 0.0])
    return y / np.linalg.norm(y)


def looking(position, y):
    """The desired attitude: x* away from the chief, so that a camera along -x looks at it."""
    x = position / np.linalg.norm(position)
    return Rotation.from_matrix(np.column_stack((x, y, np.cross(x, y))))


def control_torque(mission, attitude, desired, rate):
    """``-Kp q_e - Kd w`` with gains scaled by the inertia, each axis clipped, N m."""
    law, inertia = mission.attitude, np.array(mission.deputy.inertia_kg_m2)
    error = (desired.inv() * attitude).as_quat(canonical=True)[:3]
    torque = -inertia @ (law.proportional_gain * error + law.derivative_gain * rate)
    return np.clip(torque, -mission.deputy.max_torque_n_m, mission.deputy.max_torque_n_m)


def turn_through_period(flight, k, state, known, y, thrust):
    """Turn the deputy through a control period, steered at every attitude instant.

    Parameters
    ----------
    known : (6,)
        The state as the deputy knows it, whose path under its own command it follows in its aim.
    thrust : Thrust

    Returns
    -------
    attitude, rate, y, instants
        The last is a list of attitude, rate and torque at each instant.
    """
    mission, attitude, rate, instants = flight.mission, state.attitude, state.rate, []
    played, torques = flight.played(k)
    for tick in range(mission.num_attitude_steps):
        if tick:
            known = pushed(mission, known, thrust.commanded, mission.attitude_period_s)
            y = next_y(mission, known[:3], y)
        desired = looking(known[:3], y) if played is None else played
        desired = desired * flight.tilt(k).inv()
        if mission.attitude.mode == "ideal":
            instants.append((desired, np.zeros(3), np.zeros(3)))
            continue
        torque = control_torque(mission, attitude, desired, rate) if torques is None else torques
        instants.append((attitude, rate, torque))
        turning = torque + np.cross(thrust.arm, attitude.inv().apply(thrust.fired)) + thrust.twist
        attitude, rate = turned(mission, attitude, rate, turning, mission.attitude_period_s)
    return attitude, rate, y, instants
