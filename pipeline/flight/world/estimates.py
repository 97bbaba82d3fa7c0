"""What a filter allows for, and how far its estimates may be off.

The accelerations that the deputy's equations of motion neglect, as a bound and as white noise; and the
covariances of errors of estimates over a flight.
"""

from dataclasses import dataclass
from math import radians, sqrt

import numpy as np

from pipeline.array_types import Floats
from pipeline.constants import EARTH_RADIUS_M
from pipeline.flight.world.chief import elements_of, greatest_drag
from pipeline.physics.motion import motion_over
from pipeline.settings.equipment import FilteredNavigation, PositionFixes, RangeBearingFixes, RealActuators
from pipeline.settings.experiment import Mission
from pipeline.settings.mission import TwoBody

SQRT_3 = sqrt(3.0)
#: what the neglected acceleration amounts to as white noise, as a share of its bound: with it, errors are
#: as large as the filter says (python -m benchmarks consistency)
SHARE_OF_UNKNOWN = 0.06
#: by how many times that share the noise has grown at the greatest distance, where no errors of thrusters
#: widen what the filter allows for: if they are ideal, or have a tank, which may be empty
MORE_ALONE = 1.4


@dataclass(frozen=True)
class ProcessNoise:
    """Standard deviation of the accelerations that the filter allows for, by the distance from the chief.

    Attributes
    ----------
    std_m_s2 : float
        To be multiplied by a polynomial of the distance.
    nearest_m : float
        Distances below it count as this one.
    farthest_m : float
        The greatest distance allowed.
    growth : tuple of three float
        The polynomial's coefficients, of 1, x and x^2, with x the distance over the greatest.
    """

    std_m_s2: float
    nearest_m: float
    farthest_m: float
    growth: tuple[float, float, float] = (0.0, 0.0, 1.0)

    def at(self, distance_m: float) -> float:
        """Return it at a distance, m/s^2."""
        share = max(self.nearest_m, distance_m) / self.farthest_m
        return self.std_m_s2 * sum(part * share**power for power, part in enumerate(self.growth))


@dataclass(frozen=True)
class EstimateErrors:
    """How far estimates may be off at each sample of a flight, under the greatest planned force."""

    noise: Floats  # covariances of what is random, (K+1, 6, 6)
    response: Floats  # to a constant error of the fixes, (K+1, 6, 3)

    def bound(self, rows: Floats, constant_m: float, risk: float) -> float:
        """Return a bound on ``|A e|`` over a flight that holds with probability 1 - risk.

        A are the rows, (n, 6), e is the error of the estimate. The risk is the sum over all samples; an error
        along any direction is taken for the greatest one.
        """
        from scipy.optimize import brentq  # noqa: PLC0415 - slow to import, used only here
        from scipy.special import chdtrc, chdtri  # noqa: PLC0415 - as above

        constant = constant_m * float(np.linalg.norm(rows @ self.response, 2, axis=(1, 2)).max())
        spreads = np.sqrt(np.linalg.eigvalsh(rows @ self.noise @ rows.T)[:, -1])
        if not spreads.any():
            return constant
        least, most = (
            spreads.max() * sqrt(chdtri(3, probability))
            for probability in (2.0 * risk, 0.5 * risk / len(spreads))
        )
        return constant + float(brentq(lambda far: chdtrc(3, (far / spreads) ** 2).sum() - risk, least, most))


def unpredicted_acceleration(mission: Mission) -> float:
    """Return a bound on the acceleration that the deputy's own prediction neglects, m/s^2.

    On a true course that is the second order of attraction at the perigee, drag and sunlight.
    """
    dynamics, elements = mission.dynamics, mission.orbit.elements
    if not isinstance(dynamics, TwoBody) or not mission.has_true_course:
        return unknown_acceleration(mission)
    share = mission.deputy.max_distance_m / (elements.semi_major_axis_m * (1.0 - elements.eccentricity))
    square = mission.orbit.mean_motion_rad_s**2 / (1.0 - elements.eccentricity) ** 3
    second = 6.0 * square * share * mission.deputy.max_distance_m
    return second + greatest_drag(mission, dynamics) + abs(dynamics.radiation_m_s2)


def unknown_acceleration(mission: Mission) -> float:
    """Return a bound on the acceleration that Clohessy and Wiltshire's equations neglect, m/s^2.

    The second order of a point mass' attraction, the gradient of its oblateness, and what an orbit's
    eccentricity changes in rate and attraction; distance and speed at their greatest.
    """
    dynamics, n = mission.dynamics, mission.orbit.mean_motion_rad_s
    if not isinstance(dynamics, TwoBody):
        return 0.0
    elements, distance = mission.orbit.elements, mission.deputy.max_distance_m
    radius, eccentricity = elements.semi_major_axis_m, elements.eccentricity
    speed = SQRT_3 * mission.deputy.max_force_n * mission.control_period_s / mission.deputy.mass_kg
    rate_excess: float = (1.0 + eccentricity) ** 2 / (1.0 - eccentricity**2) ** 1.5 - 1.0
    oblateness = elements_of(mission).j2 * (EARTH_RADIUS_M / radius) ** 2
    share_of_gradient = 6.0 * distance / radius + 40.0 * oblateness + 8.0 * rate_excess * (2.0 + rate_excess)
    attraction = n**2 * distance * share_of_gradient + 2.0 * n * speed * (rate_excess + 10.0 * oblateness)
    return attraction + greatest_drag(mission, dynamics) + abs(dynamics.radiation_m_s2)


def process_noise(mission: Mission) -> ProcessNoise:
    """Return what the filter allows for as white noise.

    Within the limits it is the same everywhere, and beyond them it grows as the second order of attraction
    does. Where no errors of thrusters hide what it lacks far from the chief, it grows with the distance, as
    the gradient of oblateness does, and by its second order.
    """
    given, farthest = mission.filtered.process_noise_m_s2, mission.deputy.max_distance_m
    actuators, n = mission.actuators, mission.orbit.mean_motion_rad_s
    if given is not None:
        return ProcessNoise(given, farthest, farthest)
    unknown, dynamics = unpredicted_acceleration(mission), mission.dynamics
    is_alone = not isinstance(actuators, RealActuators) or actuators.specific_impulse_s is not None
    if not is_alone or not isinstance(dynamics, TwoBody):
        return ProcessNoise(SHARE_OF_UNKNOWN * unknown, farthest, farthest)
    second = 6.0 * (n * farthest) ** 2 / mission.orbit.elements.semi_major_axis_m
    if mission.has_true_course:
        second /= SHARE_OF_UNKNOWN  # it lasts, and what is unknown besides no longer covers it
    return ProcessNoise(SHARE_OF_UNKNOWN * unknown, 0.0, farthest, (1.0, MORE_ALONE, second / unknown))


def estimate_errors(mission: Mission) -> EstimateErrors:
    """Return covariances of the errors of estimates; zero where navigation is perfect.

    Fixes are taken from the farthest position; smaller forces and nearer positions give smaller covariances.
    """
    from scipy.linalg import block_diag  # noqa: PLC0415 - slow to import, used only here

    navigation, safety, period = mission.navigation, mission.safety, mission.control_period_s
    actuators = mission.actuators
    if not isinstance(navigation, FilteredNavigation):
        return EstimateErrors(np.zeros((1, 6, 6)), np.zeros((1, 6, 3)))
    motion = motion_over(mission.orbit, mission.deputy, (period,))
    phi, gamma = motion.transition[0], motion.control[0]
    tilts = np.radians((navigation.attitude_bias_deg, navigation.attitude_noise_deg))
    per_force = navigation.execution_error**2 + float(tilts @ tilts)
    if isinstance(actuators, RealActuators):
        per_force += max(actuators.scale_error, radians(actuators.misalignment_deg)) ** 2
    square = 3.0 * safety.planned_force_n**2 * per_force
    unknown = process_noise(mission).at(mission.deputy.max_distance_m)
    process = gamma @ gamma.T * (square + (unknown * mission.deputy.mass_kg) ** 2)
    noise, constant = 0.0, navigation.bias_m**2
    if isinstance(navigation, PositionFixes):
        noise = navigation.noise_m**2
    elif isinstance(navigation, RangeBearingFixes):
        far = mission.deputy.max_distance_m
        across = far * sqrt(radians(navigation.bearing_noise_deg) ** 2 + float(tilts[1]) ** 2)
        noise = max(navigation.range_noise_m, across) ** 2
        constant += (far * float(tilts[0])) ** 2
    stride, delay = round(navigation.fix_period_s / period), round(navigation.delay_s / period)
    start = [navigation.initial_position_m] * 3 + [navigation.initial_velocity_m_s] * 3
    # position, velocity and a constant error of the fixes, which the filter considers: as it has them, and by
    # noise alone
    phi, more = block_diag(phi, np.eye(3)), block_diag(process, np.zeros((3, 3)))
    seen = np.hstack([np.eye(3, 6), np.eye(3)])
    noisy = np.diag(np.r_[np.square(start), np.zeros(3)])
    believed = noisy + np.diag(np.r_[np.zeros(6), np.full(3, constant)])
    response = np.eye(9)[:, 6:]
    noises, responses = [noisy], [response]
    for _ in range(delay):  # until the first fix comes into use
        noises.append(phi @ noises[-1] @ phi.T + more)
        responses.append(phi @ responses[-1])
    for k in range(mission.num_controls + 1):
        if k % stride == 0:
            gain = believed @ seen.T @ np.linalg.inv(seen @ believed @ seen.T + noise * np.eye(3))
            gain[6:] = 0.0
            kept = np.eye(9) - gain @ seen
            believed, noisy = (
                kept @ covariance @ kept.T + noise * gain @ gain.T for covariance in (believed, noisy)
            )
            response = kept @ response
        now, later = noisy, response
        for _ in range(delay):
            now, later = phi @ now @ phi.T + more, phi @ later
        noises.append(now)
        responses.append(later)
        believed, noisy = (phi @ covariance @ phi.T + more for covariance in (believed, noisy))
        response = phi @ response
    return EstimateErrors(np.asarray(noises)[:, :6, :6], np.asarray(responses)[:, :6])
