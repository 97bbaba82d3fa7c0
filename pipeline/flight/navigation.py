"""What the deputy knows of its own state: fixes with errors, and the filter that makes the most of them.

The filter is Kalman's (A new approach to linear filtering and prediction problems, Journal of Basic
Engineering 82, 1960, 35-45) over the six numbers of position and velocity, moving by Clohessy and Wiltshire's
equations under the forces that are commanded. Its process noise is a constant acceleration in each control
period, and a share of each commanded force. It knows the impulses that thrusters can fire, and their delay.
It runs in `pipeline.flight.kernel.navigation` and, plainly, in `pipeline.flight.reference.navigation`.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipeline.flight.log import Scenario
from pipeline.physics.motion import Motion, motion_over
from pipeline.settings.experiment import Mission, Navigation
from pipeline.settings.mission import IDEAL, LINEAR, PERFECT

Floats = NDArray[np.float64]

#: place in the spawn key of what is drawn for navigation, after the case
FIXES = 1


#: by which a fix that is not believed widens the covariance: after a few in a row the filter, not the fix, is
#: taken to be wrong, and fixes are believed again
WIDER = 4.0


class Filter(NamedTuple):
    """What the filter assumes.

    Attributes
    ----------
    stride : int
        Control periods from one fix to the next.
    delay : int
        Control periods from a fix to its use.
    at_start : (6, 6)
        Covariance of the first estimate, m and m/s.
    process : (6, 6)
        What each control period adds to the covariance.
    process_per_force : (6, 6)
        What it adds besides for each square newton commanded.
    fix : float
        Variance of a fix along each axis, m^2.
    gate : float
        Square of the standard deviations beyond which a fix is not believed.
    """

    stride: int
    delay: int
    at_start: Floats
    process: Floats
    process_per_force: Floats
    fix: float
    gate: float


def filter_of(mission: Mission) -> Filter:
    """Return the filter of a mission whose deputy navigates by fixes."""
    navigation, period = mission.navigation, mission.control_period_s
    motion: Motion = motion_over(mission.orbit, mission.deputy, (period,))
    control = motion.control[0]
    unit = control @ control.T
    start = [navigation.initial_position_m] * 3 + [navigation.initial_velocity_m_s] * 3
    return Filter(
        round(navigation.fix_period_s / period),
        round(navigation.delay_s / period),
        np.diag(np.square(start)),
        unit * (navigation.process_noise_m_s2 * mission.deputy.mass_kg) ** 2,
        unit * navigation.execution_error**2,
        navigation.noise_m**2 + navigation.bias_m**2,
        np.inf if navigation.gate_sigma is None else navigation.gate_sigma**2,
    )


class Errors(NamedTuple):
    """What navigation is off by in some flights.

    Attributes
    ----------
    at_start : (m, 6)
        The first estimate less the truth, m and m/s.
    of_fixes : (m, F, 3)
        Fixes less the truth, m, Hill axes.
    """

    at_start: Floats
    of_fixes: Floats


def errors_of(navigation: Navigation, scenarios: list[Scenario], num_fixes: int) -> Errors:
    """Draw the errors of some flights, each from the noise seed of its start."""
    found = Errors(np.empty((len(scenarios), 6)), np.empty((len(scenarios), num_fixes, 3)))
    for case, scenario in enumerate(scenarios):
        generator = scenario.generator(FIXES)
        found.at_start[case, :3] = navigation.initial_position_m * generator.standard_normal(3)
        found.at_start[case, 3:] = navigation.initial_velocity_m_s * generator.standard_normal(3)
        bias = navigation.bias_m * generator.standard_normal(3)
        noise = navigation.noise_m * generator.standard_normal((num_fixes, 3))
        is_outlier = generator.uniform(size=(num_fixes, 1)) < navigation.outlier_share
        outliers = navigation.outlier_m * generator.standard_normal((num_fixes, 3))
        found.of_fixes[case] = bias + noise + is_outlier * outliers
    return found


def as_believed(mission: Mission, scenarios: list[Scenario]) -> tuple[Mission, list[Scenario]]:
    """Return the mission and the starts as the deputies take them to be when they start.

    Motion is linear and thrusters fire what they are told. A deputy that navigates by fixes is where it first
    estimates itself to be, and will know its place; errors to come are drawn, but nobody knows them yet.
    """
    known = replace(mission, navigation=PERFECT, actuators=IDEAL, dynamics=LINEAR)
    if mission.navigation.mode == "perfect":
        return known, scenarios
    first = errors_of(mission.navigation, scenarios, 0).at_start
    return known, [
        replace(
            scenario, position_m=scenario.position_m + off[:3], velocity_m_s=scenario.velocity_m_s + off[3:]
        )
        for scenario, off in zip(scenarios, first, strict=True)
    ]
