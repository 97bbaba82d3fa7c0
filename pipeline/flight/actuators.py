"""What becomes of a commanded force in the thrusters.

A command is delayed, turned and scaled by the errors of its flight, rounded to whole impulses, not fired
where it is less than the least impulse, and clipped to the thrust limit: in this order, along Hill axes, in
which forces are fired. The safety layer acts on commands, before all this. Delta-v counts what is fired.

What is fired acts beside the centre of mass and so turns the deputy, by ``arm x force`` in body axes; that
torque comes on top of that of attitude control, and follows the attitude while the force stays along Hill
axes. By Tsiolkovsky's equation it uses up ``(|f_x| + |f_y| + |f_z|) T/(g I)`` of the mass in a control period,
in which the mean of the mass before and after is accelerated; the deputy itself computes with the mass of the
start.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipeline.flight.log import Scenario
from pipeline.settings.experiment import Actuators, Mission
from pipeline.settings.mission import STANDARD_GRAVITY_M_S2

Floats = NDArray[np.float64]

#: place in the spawn key of what is drawn for the thrusters, after the case
THRUSTERS = 2


class Thrusters(NamedTuple):
    """What all flights of a mission share.

    Attributes
    ----------
    delay : int
        Control periods from a command to its force.
    step : float
        Forces are multiples of this, N; 0 for any.
    least : float
        Least force along an axis, N.
    exhaust_speed : float
        Of propellant, m/s; infinite where the mass stays.
    dry : float
        Share of the mass at the start that nothing is fired with; -1 where the mass stays.
    """

    delay: int
    step: float
    least: float
    exhaust_speed: float
    dry: float


class ThrustErrors(NamedTuple):
    """What the thrusters are off by in some flights.

    Attributes
    ----------
    matrices : (m, 3, 3)
        That turn a command into what is fired, but for impulses and limits.
    arms : (m, 3)
        Where the thrust acts, from the centre of mass, m, body axes.
    """

    matrices: Floats
    arms: Floats


def thrusters_of(mission: Mission) -> Thrusters:
    """Turn settings into forces held over a control period."""
    actuators, period = mission.actuators, mission.control_period_s
    impulse = actuators.specific_impulse_s
    return Thrusters(
        round(actuators.delay_s / period),
        actuators.impulse_step_n_s / period,
        actuators.least_impulse_n_s / period,
        np.inf if impulse is None else STANDARD_GRAVITY_M_S2 * impulse,
        -1.0 if impulse is None else 1.0 - actuators.propellant_kg / mission.deputy.mass_kg,
    )


def has_arm(mission: Mission) -> bool:
    """Tell whether thrust acts beside the centre of mass."""
    return mission.actuators.kind == "real" and mission.actuators.thrust_arm_m > 0.0


def thrust_errors(actuators: Actuators, scenarios: list[Scenario]) -> ThrustErrors:
    """Draw the errors of some flights; the turn of a matrix is linear in the angle, which is small."""
    matrices, arms = np.empty((len(scenarios), 3, 3)), np.empty((len(scenarios), 3))
    for case, scenario in enumerate(scenarios):
        generator = scenario.generator(THRUSTERS)
        scale = 1.0 + actuators.scale_error * generator.standard_normal(3)
        a, b, c = np.radians(actuators.misalignment_deg) * generator.standard_normal(3)
        matrices[case] = np.array([[1.0, -c, b], [c, 1.0, -a], [-b, a, 1.0]]) * scale[:, np.newaxis]
        arms[case] = actuators.thrust_arm_m * generator.standard_normal(3)
    return ThrustErrors(matrices, arms)
