"""From a commanded force to the force that the thrusters fire; docs/explanation/navigation.md describes it.

A command is delayed, rotated and scaled, rounded to whole impulses, dropped if below the least impulse, and
clipped: in this order, along Hill axes. A layout of thrusters divides it among them by a table. The mean of
the mass before and after a control period is accelerated in it.
"""

from math import ceil

import numpy as np

from pipeline.constants import STANDARD_GRAVITY_M_S2
from pipeline.flight.cases.processes import in_time, varies
from pipeline.flight.state.errors import Firing, ThrustErrors, Thrusters
from pipeline.flight.state.log import Scenario
from pipeline.flight.world.layout import layout_of
from pipeline.settings.equipment import RealActuators
from pipeline.settings.experiment import Mission

#: part of the spawn key of the random numbers for the thrusters, after the case
THRUSTERS = 2
#: of ideal thrusters
NO_FIRING = Firing(
    False,
    Thrusters(0, 0.0, 0.0, np.inf, -1.0, np.zeros((0, 6)), np.zeros((0, 7))),
    ThrustErrors(np.zeros((0, 1, 3, 3)), np.zeros((0, 3))),
)


def firing_of(mission: Mission, scenarios: list[Scenario]) -> Firing:
    """Return the thrusters of some flights with their drawn errors."""
    if not isinstance(mission.actuators, RealActuators):
        return NO_FIRING
    return Firing(True, thrusters_of(mission), thrust_errors(mission, scenarios))


def thrusters_of(mission: Mission) -> Thrusters:
    """Return the thrusters of a mission, with settings converted to forces held over a control period."""
    actuators, period = mission.actuators, mission.control_period_s
    if not isinstance(actuators, RealActuators):
        return NO_FIRING.thrusters
    impulse = actuators.specific_impulse_s
    return Thrusters(
        round(actuators.delay_s / period),
        actuators.impulse_step_n_s / period,
        actuators.least_impulse_n_s / period,
        np.inf if impulse is None else STANDARD_GRAVITY_M_S2 * impulse,
        -1.0 if impulse is None else 1.0 - actuators.propellant_kg / mission.deputy.mass_kg,
        *(layout_of(actuators.thrusters) if actuators.thrusters else (np.zeros((0, 6)), np.zeros((0, 7)))),
        -1 if actuators.failed_thruster is None else actuators.failed_thruster,
        # rounding must not put off a failure at a sample
        ceil(actuators.failure_s / period - 1e-9),
    )


def thrust_errors(mission: Mission, scenarios: list[Scenario]) -> ThrustErrors:
    """Draw the errors of some flights."""
    from scipy.spatial.transform import Rotation  # noqa: PLC0415 - slow to import, used only here

    actuators, keys = mission.actuators, ("actuators.scale_error", "actuators.misalignment_deg")
    if not isinstance(actuators, RealActuators):
        return NO_FIRING.errors
    num_matrices = mission.num_controls if varies(mission, *keys) else 1
    matrices, arms = np.empty((len(scenarios), num_matrices, 3, 3)), np.empty((len(scenarios), 3))
    for case, scenario in enumerate(scenarios):
        generator = scenario.generator(THRUSTERS)
        scale = actuators.scale_error * generator.standard_normal(3)
        turn = np.radians(actuators.misalignment_deg) * generator.standard_normal(3)
        arms[case] = actuators.thrust_arm_m * generator.standard_normal(3)
        scales, turns = (
            in_time(mission, key, scenario, constant)[:num_matrices]
            for key, constant in zip(keys, (scale, turn), strict=True)
        )
        turned = Rotation.from_rotvec(np.array(np.broadcast_to(turns, (num_matrices, 3)))).as_matrix()
        matrices[case] = turned * (1.0 + scales)[:, :, np.newaxis]
    return ThrustErrors(matrices, arms)
