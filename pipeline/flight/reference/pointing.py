"""The desired attitude, which looks at the chief, and the law that turns the deputy to it."""

import numpy as np
from scipy.spatial.transform import Rotation

from pipeline.array_types import Floats
from pipeline.flight.reference.actuators import Thrust
from pipeline.flight.reference.flight import ReferenceFlight
from pipeline.flight.reference.motion import pushed
from pipeline.flight.reference.state import ReferenceState
from pipeline.flight.reference.turning import gradient_torque, turned
from pipeline.flight.reference.wheels import momentum_after, wheels_turned
from pipeline.settings.experiment import Mission

#: |k x r|/|r| below which y* is not defined by the position, or, with pole blending, is carried along
POLE, BLENDED_POLE = 1e-3, 0.2
#: rate at which pole blending lets y* return, rad/s
RETURN_RATE = 0.005
#: attitude, rate, torque and momentum of the wheels at an instant of the attitude clock
Instant = tuple[Rotation, Floats, Floats, Floats]


def next_y(mission: Mission, position: Floats, before: Floats | None) -> Floats:
    """Return the desired second body axis at an attitude instant from that before; None before the first."""
    x = position / np.linalg.norm(position)
    across = np.cross([0.0, 0.0, 1.0], x)
    flat = float(np.linalg.norm(across))
    if before is None or not mission.attitude.pole_blending:
        start = np.array([0.0, 1.0, 0.0]) if before is None else before
        return _carried(x, start) if flat < POLE else across / flat
    carried = _carried(x, before)
    if flat < BLENDED_POLE:
        return carried
    goal, sideways = across / flat, np.cross(x, carried)
    angle, most = np.arctan2(goal @ sideways, goal @ carried), RETURN_RATE * mission.attitude_period_s
    if abs(angle) <= most:
        return goal
    return Rotation.from_rotvec(np.sign(angle) * most * x).apply(carried)


def _carried(x: Floats, y: Floats) -> Floats:
    """Return an axis made orthogonal to x*; any other where it lies along x*."""
    y = y - (x @ y) * x
    if np.linalg.norm(y) < 1e-9:
        y = np.cross(x, [1.0, 0.0, 0.0] if abs(x[0]) < 0.9 else [0.0, 1.0, 0.0])
    return np.asarray(y / np.linalg.norm(y))


def looking(position: Floats, y: Floats) -> Rotation:
    """Return the desired attitude: x* away from the chief, so that a camera along -x looks at it."""
    x = position / np.linalg.norm(position)
    return Rotation.from_matrix(np.column_stack((x, y, np.cross(x, y))))


def control_torque(mission: Mission, attitude: Rotation, desired: Rotation, rate: Floats) -> Floats:
    """Return ``-Kp q_e - Kd w`` with gains scaled by the inertia, each axis clipped, N m."""
    law, inertia = mission.attitude, np.array(mission.deputy.inertia_kg_m2)
    error = (desired.inv() * attitude).as_quat(canonical=True)[:3]
    torque = -inertia @ (law.proportional_gain * error + law.derivative_gain * rate)
    return np.clip(torque, -mission.deputy.max_torque_n_m, mission.deputy.max_torque_n_m)


def turn_through_period(
    flight: ReferenceFlight, k: int, state: ReferenceState, known: Floats, y: Floats, thrust: Thrust
) -> tuple[Floats, list[Instant]]:
    """Turn the deputy of `state` through a control period, steered at every attitude instant.

    Parameters
    ----------
    known : (6,)
        The state as the deputy knows it, whose path under its own command it follows in its aim.
    y : (3,)
        The desired second body axis there.

    Returns
    -------
    y
        At the end.
    instants : list of Instant
    """
    mission, attitude, rate = flight.mission, state.attitude, state.rate
    instants: list[Instant] = []
    hill = flight.hill_rates[k]
    played, torques = flight.played(k)
    for tick in range(mission.num_attitude_steps):
        if tick:
            known = pushed(mission, known, thrust.commanded, mission.attitude_period_s)
            y = next_y(mission, known[:3], y)
        desired = looking(known[:3], y) if played is None else played
        desired = desired * flight.tilt(k).inv()
        if mission.attitude.mode == "ideal":
            instants.append((desired, np.zeros(3), np.zeros(3), np.zeros(3)))
            continue
        wanted = control_torque(mission, attitude, desired, rate) if torques is None else torques
        torque, held = wheels_turned(mission, hill, attitude, rate, state.momentum, wanted)
        instants.append((attitude, rate, torque, held))
        external = np.cross(thrust.arm, attitude.inv().apply(thrust.fired)) + thrust.twist
        external = external + gradient_torque(mission, flight.circular_rates[k], attitude)
        state.momentum = momentum_after(mission, hill, attitude, state.momentum, external)
        attitude, rate = turned(mission, hill, attitude, rate, torque + external, mission.attitude_period_s)
    # relative to Hill axes as they turn from here on
    rate = rate + attitude.inv().apply(hill - flight.hill_rates[k + 1])
    state.attitude, state.rate = attitude, rate
    return y, instants
