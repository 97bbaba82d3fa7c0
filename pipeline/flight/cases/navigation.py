"""The deputy's knowledge of its own state: fixes with errors, and a Kalman filter.

docs/explanation/navigation.md describes both; the filter runs in `pipeline.flight.period.look.navigation`.

It is Kalman's (A new approach to linear filtering and prediction problems, Journal of Basic Engineering 82,
1960, 35-45), and considers the errors that a flight keeps (Schmidt, Application of state-space methods to
navigation problems, Advances in Control Systems 3, 1966, 293-340). The covariance of a range and a bearing,
converted to a position, is taken along and across the line of sight that the filter predicts, so that it does
not depend on the fix's own error (Bordonaro, Willett and Bar-Shalom, Decorrelated unbiased converted
measurement Kalman filter, IEEE Transactions on Aerospace and Electronic Systems 50(2), 2014, 1431-1444).
"""

from dataclasses import replace

import numpy as np

from pipeline.array_types import Floats
from pipeline.flight.cases.processes import in_time, varies
from pipeline.flight.state import errors
from pipeline.flight.state.errors import Filter, Fixes, NavigationErrors
from pipeline.flight.state.log import Scenario
from pipeline.flight.world.estimates import process_noise
from pipeline.physics.motion import motion_over
from pipeline.settings.equipment import Actuators, Navigation, PositionFixes, RangeBearingFixes, RealActuators
from pipeline.settings.experiment import Mission
from pipeline.settings.mission import Dynamics, TwoBody

#: part of the spawn key of the random numbers for navigation, after the case
FIXES = 1
#: added to the first part of the spawn key for each draw of a rehearsal; greater than the parts of all stages
REHEARSAL = 1 << 22
#: up to this bias of the attitude, forces are turned to first order
FIRST_ORDER_DEG = 5.0
#: of a deputy that knows its state
NO_ERRORS = NavigationErrors(np.zeros((0, 6)), np.zeros((0, 0, 3)), np.zeros((0, 0, 4)), np.zeros((0, 0, 3)))


def fixes_of(mission: Mission, scenarios: list[Scenario]) -> Fixes:
    """Return the navigation of some flights: exact, or fixes with their drawn errors and a filter."""
    is_on = mission.navigation.mode == "fixes"
    return Fixes(is_on, filter_of(mission), errors_of(mission, scenarios) if is_on else NO_ERRORS)


def filter_of(mission: Mission) -> Filter:
    """Return the filter of a mission."""
    navigation, period = mission.filtered, mission.control_period_s
    control = motion_over(mission.orbit, mission.deputy, (period,)).control[0]
    unit = control @ control.T
    seen = navigation if isinstance(navigation, RangeBearingFixes) else None
    angles = (
        seen.bearing_noise_deg if seen else 0.0,
        navigation.attitude_noise_deg,
        navigation.attitude_bias_deg,
    )
    bearing, tilt, bias = np.square(np.radians(angles))
    variances, unknown = considered(mission), process_noise(mission)
    actuators = mission.actuators
    start = [navigation.initial_position_m] * 3 + [navigation.initial_velocity_m_s] * 3
    return Filter(
        round(navigation.fix_period_s / period),
        round(navigation.delay_s / period),
        np.diag(np.square(start)),
        unit * (unknown.std_m_s2 * mission.deputy.mass_kg) ** 2,
        unknown.nearest_m,
        unknown.farthest_m,
        np.array(unknown.growth),
        unit * (navigation.execution_error**2 + tilt),
        round(actuators.delay_s / period) if isinstance(actuators, RealActuators) else 0,
        np.flatnonzero(variances),
        variances[variances > 0.0],
        navigation.noise_m**2 if isinstance(navigation, PositionFixes) else 0.0,
        np.inf if navigation.gate_sigma is None else navigation.gate_sigma**2,
        seen is not None,
        seen.range_noise_m**2 if seen else 0.0,
        float(bearing + tilt) if seen else 0.0,
        # two of three turns shorten a vector, each by half its square
        float(1.0 - tilt - bias),
        float(1.0 - bearing - tilt - bias) if seen else 1.0,
    )


def considered(mission: Mission) -> Floats:
    """Return the variances of the constant errors that the filter may consider, shape (MOST_CONSTANT,)."""
    navigation, actuators, variances = mission.filtered, mission.actuators, np.zeros(errors.MOST_CONSTANT)
    if isinstance(actuators, RealActuators):
        variances[: errors.OF_ROTATION] = actuators.scale_error**2
        variances[errors.OF_ROTATION : errors.OF_ATTITUDE] = np.radians(actuators.misalignment_deg) ** 2
    tilt = np.radians(navigation.attitude_bias_deg) ** 2
    variances[errors.OF_ATTITUDE : errors.OF_FIXES] = tilt
    variances[errors.OF_FIXES : errors.OF_SQUARES] = navigation.bias_m**2
    # E (|turn|^2/2)^2 of the two turns across the line of sight, and across a force
    square = 2.0 * tilt**2
    variances[errors.OF_SQUARES : errors.OF_SHORTENED] = square * (navigation.measures == "range_bearing")
    variances[errors.OF_SHORTENED :] = square * (navigation.attitude_bias_deg > FIRST_ORDER_DEG)
    return variances


def errors_of(mission: Mission, scenarios: list[Scenario]) -> NavigationErrors:
    """Draw the errors of some flights, each from the noise seed of its start.

    Settings in degrees are drawn in rad. What a kind of navigation does not use is drawn all the same, so
    that later draws stay as they are.
    """
    navigation, num_samples = mission.filtered, mission.num_controls + 1
    stride = round(navigation.fix_period_s / mission.control_period_s)
    num_fixes = mission.num_controls // stride + 1
    seen = navigation if isinstance(navigation, RangeBearingFixes) else None
    has_tilt = navigation.attitude_bias_deg > 0.0 or navigation.attitude_noise_deg > 0.0
    has_tilt = has_tilt or varies(mission, "navigation.attitude_bias_deg", "navigation.attitude_noise_deg")
    drawn = NavigationErrors(
        np.empty((len(scenarios), 6)),
        np.empty((len(scenarios), num_fixes, 3)),
        np.empty((len(scenarios), num_fixes if seen else 0, 4)),
        np.empty((len(scenarios), num_samples if has_tilt else 0, 3)),
    )
    for case, scenario in enumerate(scenarios):
        generator = scenario.generator(FIXES)

        def series(name: str, constant: Floats | float, of: Scenario = scenario) -> Floats:
            return in_time(mission, f"navigation.{name}", of, constant)

        drawn.at_start[case, :3] = navigation.initial_position_m * generator.standard_normal(3)
        drawn.at_start[case, 3:] = navigation.initial_velocity_m_s * generator.standard_normal(3)
        bias = series("bias_m", navigation.bias_m * generator.standard_normal(3))[::stride]
        noise = generator.standard_normal((num_fixes, 3))
        if isinstance(navigation, PositionFixes):
            noise *= series("noise_m", navigation.noise_m)[::stride]
        else:
            noise *= 0.0
        is_outlier = generator.uniform(size=(num_fixes, 1)) < navigation.outlier_share
        outliers = navigation.outlier_m * generator.standard_normal((num_fixes, 3))
        drawn.of_fixes[case] = bias + noise + is_outlier * outliers
        if seen:
            sight = generator.standard_normal((num_fixes, 4))
            turn = series("bearing_noise_deg", np.radians(seen.bearing_noise_deg))
            sight[:, :1] *= series("range_noise_m", seen.range_noise_m)[::stride]
            sight[:, 1:] *= turn[::stride]
            drawn.of_sight[case] = sight
        if has_tilt:
            bias = np.radians(navigation.attitude_bias_deg) * generator.standard_normal(3)
            shaken = generator.standard_normal((num_samples, 3))
            shaken *= series("attitude_noise_deg", np.radians(navigation.attitude_noise_deg))
            drawn.of_attitude[case] = series("attitude_bias_deg", bias) + shaken
    return drawn


def as_believed(mission: Mission, scenarios: list[Scenario]) -> tuple[Mission, list[Scenario]]:
    """Return the mission and the starts as the deputies believe them to be at the start.

    Motion is linear, or on a true course that of the orbit without drag and sunlight, and thrusters are
    ideal. A deputy that navigates by fixes is at its first estimate, and knows its state from then on; later
    errors are drawn, but not known yet.
    """
    dynamics = mission.dynamics
    if isinstance(dynamics, TwoBody) and mission.has_true_course:
        dynamics = replace(dynamics, drag_m_s2=0.0, radiation_m_s2=0.0)
    else:
        dynamics = Dynamics()
    known = replace(
        mission, navigation=Navigation(), actuators=Actuators(), dynamics=dynamics, dispersions={}
    )
    if mission.navigation.mode == "perfect":
        return known, scenarios
    first = errors_of(mission, scenarios).at_start
    return known, [
        replace(start, position_m=start.position_m + error[:3], velocity_m_s=start.velocity_m_s + error[3:])
        for start, error in zip(scenarios, first, strict=True)
    ]


def as_drawn(mission: Mission, believed: list[Scenario], draws: list[int]) -> list[Scenario]:
    """Return possible true starts behind believed ones: each with the errors of one draw, from 1.

    The errors are drawn by the mission's settings from seeds of their own: they are not those of the flight.
    """
    drawn = [
        replace(start, noise=(start.noise[0], start.noise[1] + draw * REHEARSAL, start.noise[2]))
        for start, draw in zip(believed, draws, strict=True)
    ]
    if mission.navigation.mode == "perfect":
        return drawn
    offsets = errors_of(mission, drawn).at_start
    return [
        replace(start, position_m=start.position_m - error[:3], velocity_m_s=start.velocity_m_s - error[3:])
        for start, error in zip(drawn, offsets, strict=True)
    ]
