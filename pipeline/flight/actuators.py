"""What becomes of a commanded force in the thrusters.

A command is delayed, turned and scaled by the errors of its flight, rounded to whole impulses, not fired
where it is less than the least impulse, and clipped to the thrust limit: in this order, along Hill axes, in
which forces are fired. The safety layer acts on commands, before all this. Delta-v counts what is fired.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipeline.flight.log import Scenario
from pipeline.settings.experiment import Actuators, Mission

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
    """

    delay: int
    step: float
    least: float


def thrusters_of(mission: Mission) -> Thrusters:
    """Turn settings into forces held over a control period."""
    actuators, period = mission.actuators, mission.control_period_s
    return Thrusters(
        round(actuators.delay_s / period),
        actuators.impulse_step_n_s / period,
        actuators.least_impulse_n_s / period,
    )


def thrust_errors(actuators: Actuators, scenarios: list[Scenario]) -> Floats:
    """Draw for each flight the matrix that turns a command into what is fired, shape (m, 3, 3).

    Its turn is linear in the angle, which is small.
    """
    matrices = np.empty((len(scenarios), 3, 3))
    for case, scenario in enumerate(scenarios):
        generator = scenario.generator(THRUSTERS)
        scale = 1.0 + actuators.scale_error * generator.standard_normal(3)
        a, b, c = np.radians(actuators.misalignment_deg) * generator.standard_normal(3)
        matrices[case] = np.array([[1.0, -c, b], [c, 1.0, -a], [-b, a, 1.0]]) * scale[:, np.newaxis]
    return matrices
