"""How bodies turn: the deputy under torques, and a chief that tumbles freely. Euler's equation, by SciPy."""

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from pipeline.array_types import Floats
from pipeline.settings.experiment import Mission

TOLERANCES: dict[str, Any] = {"method": "DOP853", "rtol": 1e-11, "atol": 1e-13}


def _euler(inertia: Floats, torque: Floats) -> Callable[[float, Floats], Floats]:
    """Return the rates of change of an inertial attitude, four numbers, and of the rate in body axes."""
    inverse = np.linalg.inv(inertia)

    def rates(_time: float, s: Floats) -> Floats:
        p, q, r = rate = s[4:]
        turn = np.array([[0.0, r, -q, p], [-r, 0.0, p, q], [q, -p, 0.0, r], [-p, -q, -r, 0.0]])
        # its first three rows and columns make a vector a of a x w
        return np.concatenate((0.5 * turn @ s[:4], inverse @ (torque + turn[:3, :3] @ (inertia @ rate))))

    return rates


def turned(
    mission: Mission, hill: Floats, attitude: Rotation, rate: Floats, torque: Floats, duration: float
) -> tuple[Rotation, Floats]:
    """Return the deputy's attitude and rate, relative to Hill, after a torque held along its axes, N m.

    Hill axes turn at the rate `hill`, (3,), rad/s.
    """
    euler = _euler(np.array(mission.deputy.inertia_kg_m2), torque)
    start = np.concatenate((attitude.as_quat(), rate + attitude.inv().apply(hill)))
    end = solve_ivp(euler, (0.0, duration), start, first_step=duration, **TOLERANCES).y[:, -1]
    attitude = Rotation.from_rotvec(-hill * duration) * Rotation.from_quat(end[:4])
    return attitude, end[4:] - attitude.inv().apply(hill)


def gradient_torque(mission: Mission, rate: float, attitude: Rotation) -> Floats:
    """Return the torque of gravity's gradient on the deputy, N m, body axes; zero unless it is asked for.

    Schaub and Junkins, Analytical Mechanics of Space Systems, 4.2: ``3 n^2 i x J i`` with the unit vector i
    away from the Earth, and the rate n of a circular orbit at the chief's distance. It is held over an
    attitude period.
    """
    if not mission.attitude.gravity_gradient:
        return np.zeros(3)
    inertia, upward = np.array(mission.deputy.inertia_kg_m2), attitude.inv().apply([1.0, 0.0, 0.0])
    return 3.0 * rate**2 * np.cross(upward, inertia @ upward)


def chief_attitudes(mission: Mission, hill_axes: list[Floats]) -> list[Rotation]:
    """Return the chief's attitude at each sample, from its axes to Hill's.

    `hill_axes` are rows i, j, k at each sample, in axes that do not turn; empty where they turn uniformly.
    """
    times = mission.control_period_s * np.arange(mission.num_controls + 1)
    rate, n = mission.chief.initial_angular_velocity_rad_s, mission.orbit.mean_motion_rad_s
    if rate is None:
        return [Rotation.identity()] * len(times)
    euler = _euler(np.array(mission.chief.inertia_kg_m2), np.zeros(3))
    path = solve_ivp(euler, (0.0, times[-1]), [0.0, 0.0, 0.0, 1.0, *rate], t_eval=times, **TOLERANCES).y
    hill = [Rotation.from_matrix(rows) for rows in hill_axes]
    hill = hill or [Rotation.from_rotvec([0.0, 0.0, -n * time]) for time in times]
    return [turn * Rotation.from_quat(row[:4]) for turn, row in zip(hill, path.T, strict=True)]
