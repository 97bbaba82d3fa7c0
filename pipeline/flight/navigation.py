"""What the deputy knows of its own state: fixes with errors, and the filter that makes the most of them.

The filter is Kalman's (A new approach to linear filtering and prediction problems, Journal of Basic
Engineering 82, 1960, 35-45) over the six numbers of position and velocity, moving by Clohessy and Wiltshire's
equations under the forces that are commanded. Fixes come at times known beforehand, so its covariances and
gains are the same for all flights of a mission and are computed once, here; the estimates are
`pipeline.flight.kernel.navigation`'s and `pipeline.flight.reference.navigation`'s.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipeline.flight.log import Scenario
from pipeline.physics.motion import motion_over
from pipeline.settings.experiment import Mission, Navigation

Floats = NDArray[np.float64]

#: place in the spawn key of what is drawn for navigation, after the case
FIXES = 1


class Filter(NamedTuple):
    """Gains and covariances of the filter, at the samples 0 … K of a flight.

    Attributes
    ----------
    stride : int
        Control periods from one fix to the next.
    delay : int
        Control periods from a fix to its use.
    gains : (F, 6, 3)
        Of the fix of sample ``stride * f``.
    weights : (F, 3, 3)
        Inverse covariances of the differences between fix and prediction, 1/m^2.
    gate : float
        Square of the standard deviations beyond which a fix is not believed.
    deviations : (K+1, 6)
        Standard deviations of what is known at each sample, m and m/s.
    """

    stride: int
    delay: int
    gains: Floats
    weights: Floats
    gate: float
    deviations: Floats


def filter_of(mission: Mission) -> Filter:
    """Compute the filter of a mission whose deputy navigates by fixes."""
    navigation, period, samples = mission.navigation, mission.control_period_s, mission.num_controls + 1
    motion = motion_over(mission.orbit, mission.deputy, (period,))
    transition = motion.transition[0]
    # an acceleration that is constant over a period
    pushed = motion.control[0] * mission.deputy.mass_kg * navigation.process_noise_m_s2
    stride, delay = round(navigation.fix_period_s / period), round(navigation.delay_s / period)
    start = [navigation.initial_position_m] * 3 + [navigation.initial_velocity_m_s] * 3
    covariance = np.diag(np.square(start))
    fixed = (navigation.noise_m**2 + navigation.bias_m**2) * np.eye(3)
    seen = np.eye(3, 6)
    gains, weights, filtered = [], [], []
    for k in range(samples):
        if k > 0:
            covariance = transition @ covariance @ transition.T + pushed @ pushed.T
        if k % stride == 0:
            weight = np.linalg.inv(seen @ covariance @ seen.T + fixed)
            gain = covariance @ seen.T @ weight
            kept = np.eye(6) - gain @ seen  # Joseph's form keeps the covariance positive
            covariance = kept @ covariance @ kept.T + gain @ fixed @ gain.T
            gains.append(gain)
            weights.append(weight)
        filtered.append(covariance)
    known = [np.diag(np.square(start))] * delay + filtered[: samples - delay]
    for k in range(samples):
        for _ in range(min(k, delay)):
            known[k] = transition @ known[k] @ transition.T + pushed @ pushed.T
    return Filter(
        stride,
        delay,
        np.array(gains),
        np.array(weights),
        np.inf if navigation.gate_sigma is None else navigation.gate_sigma**2,
        np.sqrt(np.array([np.diag(one) for one in known])),
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
