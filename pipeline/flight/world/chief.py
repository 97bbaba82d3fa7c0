"""How the chief turns: its attitude at every sample, and the integration of one that tumbles."""

import math

import numpy as np

from pipeline.array_types import Floats
from pipeline.physics.rigid_body import longest_tumbling_step, tumble
from pipeline.settings.experiment import Mission, SettingError

#: longest step of the chief's integrator, s
LONGEST_STEP_S = 1.0
#: most steps in a flight; they take seconds
MOST_STEPS = 5_000_000


def num_chief_steps(mission: Mission) -> int:
    """Return the steps per control period that keep a tumbling chief accurate over a whole flight.

    Zero for a chief that is aligned with Hill axes.

    Raises
    ------
    SettingError
        If it turns so fast that a flight would need too many.
    """
    rate, longest = mission.chief.initial_angular_velocity_rad_s, LONGEST_STEP_S
    if rate is None:
        return 0
    inertia = np.array(mission.chief.inertia_kg_m2, dtype=np.float64)
    mean_motion = mission.orbit.mean_motion_rad_s
    longest = min(longest, longest_tumbling_step(inertia, np.array(rate), mean_motion, mission.duration_s))
    steps = math.ceil(mission.control_period_s / longest)
    in_flight = steps * mission.num_controls
    if in_flight > MOST_STEPS:
        raise SettingError(
            f"chief.initial_angular_velocity_rad_s is {list(rate)} and duration_s {mission.duration_s:g}; to "
            f"turn the chief truly for so long takes {in_flight:.2g} steps, and there may be at most "
            f"{MOST_STEPS:,}: lower one of them"
        )
    return steps


def chief_attitudes(mission: Mission) -> Floats:
    """Return the chief's attitude at every sample, Hill to chief, scalar last, shape (K+1, 4)."""
    attitudes = np.zeros((mission.num_controls + 1, 4))
    attitudes[:, 3] = 1.0
    rate = mission.chief.initial_angular_velocity_rad_s
    if rate is None:
        return attitudes
    inertia = np.array(mission.chief.inertia_kg_m2, dtype=np.float64)
    inverse = np.linalg.inv(inertia).astype(np.float64)
    quaternion, rate_c = attitudes[0].copy(), np.array(rate, dtype=np.float64)
    steps, n = num_chief_steps(mission), mission.orbit.mean_motion_rad_s
    for k in range(1, len(attitudes)):
        quaternion, rate_c = tumble(quaternion, rate_c, inertia, inverse, n, mission.control_period_s, steps)
        attitudes[k] = quaternion
    return attitudes
