"""Reaction wheels along the body axes, and how much angular momentum each holds.

Markley and Crassidis, Fundamentals of Spacecraft Attitude Determination and Control, 3.3.3: external torques
alone change the momentum L of body and wheels. Wheels hold ``h = L - J w``, and a torque that they give to
the body changes that along its axes by ``-torque - w x h``.
"""

import numpy as np
from scipy.spatial.transform import Rotation

from pipeline.array_types import Floats
from pipeline.settings.experiment import Mission


def _inertial(hill: Floats, attitude: Rotation, rate: Floats) -> Floats:
    """Return the inertial rate, rad/s, body axes, of a rate relative to Hill axes, which turn at `hill`."""
    return rate + attitude.inv().apply(hill)


def momentum_at_start(mission: Mission, hill: Floats) -> Floats:
    """Return the momentum of the deputy with its wheels at rest, N m s, Hill axes, which turn at `hill`."""
    attitude = Rotation.from_quat(mission.deputy.initial_quaternion)
    rate = _inertial(hill, attitude, np.array(mission.rate_at_start_rad_s))
    return np.asarray(attitude.apply(np.array(mission.deputy.inertia_kg_m2) @ rate))


def momentum_after(
    mission: Mission, hill: Floats, attitude: Rotation, momentum: Floats, external: Floats
) -> Floats:
    """Return it an attitude period later; the torque is held from this attitude on, N m, body axes."""
    period = mission.attitude_period_s
    turn = Rotation.from_rotvec(-hill * period)
    return np.asarray(turn.apply(momentum + period * attitude.apply(external)))


def wheels_turned(
    mission: Mission, hill: Floats, attitude: Rotation, rate: Floats, momentum: Floats, wanted: Floats
) -> tuple[Floats, Floats]:
    """Return the torque that wheels give for one that is wanted, N m, and what they hold before, N m s.

    Both along body axes. Without a limit they give any, and nothing is said of what they hold.
    """
    most = mission.deputy.max_momentum_n_m_s
    if most is None:
        return wanted, np.zeros(3)
    inertial = _inertial(hill, attitude, rate)
    held = attitude.inv().apply(momentum) - np.array(mission.deputy.inertia_kg_m2) @ inertial
    after = held - mission.attitude_period_s * (wanted + np.cross(inertial, held))
    return wanted + (after - np.clip(after, -most, most)) / mission.attitude_period_s, held
