"""A deputy that turns as it moves: Hill's equations and Euler's, joined by forces along body axes."""

from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.three import Three, three_of, times
from pipeline.array_types import Floats
from pipeline.physics.attitude import euler
from pipeline.physics.quaternion import dcm_b_from_h, derivative

#: where a state has its parts: position (m) and velocity (m/s), Hill axes; attitude; inertial rate (rad/s)
PLACE, VELOCITY, ATTITUDE, RATE = slice(0, 3), slice(3, 6), slice(6, 10), slice(10, 13)


@compiled
def slopes(
    _time: float,
    state: Floats,
    push: Floats,
    torque: Floats,
    inertia: Floats,
    inverse_inertia: Floats,
    most_rate: float,
    mean_motion: float,
) -> Floats:
    """Return the time derivative of a state, shape (13,), as `PLACE` and the others divide it.

    The push is an acceleration by thrust, m/s^2, the torque in N m, inertia and its inverse in kg m^2, all in
    body axes. No component of the inertial rate grows beyond the greatest, rad/s. The system's part is
    rounded to single precision, as in AFRL's safe-autonomy-simulation (2.2.1), and so are Hill's equations,
    which `pipeline.physics.motion` has in closed form: that form would not follow their rounding.
    """
    x, z, u, v = state[0], state[2], state[3], state[4]
    rate = three_of(state[10:])
    attitude, hill_rate = state[6:10], Three(0.0, 0.0, mean_motion)
    dcm = dcm_b_from_h(attitude)
    # of stages that are not of unit length AFRL's matrix differs from ours by this on its diagonal
    surplus = 1.0 - np.sum(attitude * attitude)
    relative = rate - times(dcm, hill_rate) - surplus * hill_rate
    change = euler(inertia, inverse_inertia, rate, three_of(torque))
    thrust = times(dcm.T, three_of(push))
    slope = np.empty(13)
    slope[0:3] = state[3:6]
    slope[3] = 3.0 * mean_motion * mean_motion * x + 2.0 * mean_motion * v
    slope[4] = -2.0 * mean_motion * u
    slope[5] = -mean_motion * mean_motion * z
    slope[6:10] = derivative(attitude, relative)
    for i in range(10):
        slope[i] = np.float32(slope[i])
    for i in range(3):
        slope[3 + i] += thrust[i]
        if rate[i] >= most_rate:
            slope[10 + i] = min(change[i], 0.0)
        elif rate[i] <= -most_rate:
            slope[10 + i] = max(change[i], 0.0)
        else:
            slope[10 + i] = change[i]
    return slope


def moved(
    state: Floats,
    push: Floats,
    torque: Floats,
    inertia: Floats,
    most_rate: float,
    mean_motion: float,
    duration: float,
) -> Floats:
    """Return the state after a duration (s), shape (13,), by SciPy's RK45, with its tolerances, as AFRL's.

    Parameters are those of `slopes`.
    """
    settings = push, torque, inertia, np.linalg.inv(inertia), most_rate, mean_motion
    rates: Any = slopes  # its stubs ask for the number of dimensions
    after = solve_ivp(rates, (0.0, duration), state, args=settings).y[:, -1]
    after[RATE] = np.clip(after[RATE], -most_rate, most_rate)
    return np.asarray(after)
