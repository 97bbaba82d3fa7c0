"""How far flights may stray from what the safety layer plans, and the margins that make good for it.

With `safety.probability` the errors of state, force and motion are bounded, as far as they follow from the
configuration, and all of a flight's bounds hold together with that probability. docs/explanation/safety.md
has the proof. Vectors are bounded by their lengths, matrices by their spectral norms.
"""

from dataclasses import dataclass
from math import inf, radians, sqrt
from typing import TYPE_CHECKING

import numpy as np

from pipeline.array_types import Floats
from pipeline.physics.illumination import EARTH_GRAVITY_M3_S2, EARTH_RADIUS_M
from pipeline.physics.motion import motion_over, stop_of, stopped
from pipeline.settings.checks import SettingError

if TYPE_CHECKING:  # as in `pipeline.flight.period.look.guidance`
    from pipeline.settings.experiment import Mission

SQRT_3 = sqrt(3.0)
#: kept besides, beyond the accumulated rounding of a flight
ROUNDING_M = 0.001


@dataclass(frozen=True)
class Errors:
    """Bounds on a flight's errors; all hold with the probability that is asked for.

    Parameters
    ----------
    place_m, speed_m_s : float
        Of the estimate.
    share : float
        Of a force, by which what is fired differs from it.
    force_n : float
        By which it differs besides, and the motion as if by such a force.
    """

    place_m: float = 0.0
    speed_m_s: float = 0.0
    share: float = 0.0
    force_n: float = 0.0


@dataclass(frozen=True)
class Bounds:
    """What the safety layer keeps to spare where something is inexact; nothing where all is exact.

    Parameters
    ----------
    errors : Errors
    keep_out_m, keep_in_m : float
        Least distances to the limits, at samples, of what the layer plans.
    planned_force_n : float
        Greatest force along each axis that is passed on.
    step_back_n : float
        Force beyond the stop that leads back from where even the stop is not safe.
    does_close : bool
        Whether the thrusters can make good for the errors, so that flights stay within the limits for ever.
    """

    errors: Errors = Errors()
    keep_out_m: float = 0.0
    keep_in_m: float = 0.0
    planned_force_n: float = inf
    step_back_n: float = 0.0
    does_close: bool = True


def is_exact(mission: "Mission") -> bool:
    """Return whether state, forces and motion are just those that the safety layer computes with."""
    return (
        mission.navigation.mode == "perfect"
        and mission.actuators.kind == "ideal"
        and mission.dynamics.model == "cw"
        and not mission.dispersions
    )


def bounds_of(mission: "Mission") -> Bounds:
    """Return the bounds under which a mission's safety layer plans."""
    if mission.safety.probability is None or is_exact(mission):
        return Bounds()
    return _Recursion(mission, errors_of(mission)).bounds()


def premises(mission: "Mission", bounds: Bounds) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return in words which premises of the proof fail where something is inexact, and which are assumed."""
    actuators, navigation, errors = mission.actuators, mission.navigation, bounds.errors
    is_real, is_fixed = actuators.kind == "real", navigation.mode == "fixes"
    failing = {
        "no bounds are asked for (safety.probability)": mission.safety.probability is None,
        "settings are dispersed": bool(mission.dispersions),
        "commands are late (actuators.delay_s)": is_real and actuators.delay_s > 0.0,
        "thrusters form a layout (actuators.thrusters)": is_real and actuators.thrusters is not None,
        "mass changes (actuators.specific_impulse_s)": is_real and actuators.specific_impulse_s is not None,
        "fixes have outliers (navigation.outlier_share)": is_fixed and navigation.outlier_share > 0.0,
        "the thrusters cannot make good for such errors": not bounds.does_close,
    }
    estimate = (
        f"the filter's estimates stay within {errors.place_m:.3g} m and {errors.speed_m_s:.2g} m/s, which "
        "follows from its covariance and not from the constant errors of thrusters"
    )
    motion = "Clohessy and Wiltshire's equations are off by no more than an estimate of the neglected terms"
    assumed = {estimate: is_fixed, motion: mission.dynamics.model != "cw"}
    return tuple(one for one in failing if failing[one]), tuple(one for one in assumed if assumed[one])


def spheres_of(mission: "Mission", bounds: Bounds) -> tuple[float, float]:
    """Return the radii, m, between which the safety layer plans.

    Raises
    ------
    SettingError
        If the margins leave no room between the limits.
    """
    deputy = mission.deputy
    keep_out = max(mission.keep_out_m, deputy.min_distance_m + bounds.keep_out_m + ROUNDING_M)
    keep_in = min(mission.keep_in_m, deputy.max_distance_m - bounds.keep_in_m - ROUNDING_M)
    if not keep_out < keep_in:
        raise SettingError(
            f"safety.probability={mission.safety.probability:g} takes margins of {bounds.keep_out_m:.3g} and "
            f"{bounds.keep_in_m:.3g} m, which leave no room between deputy.min_distance_m "
            f"({deputy.min_distance_m:g} m) and deputy.max_distance_m ({deputy.max_distance_m:g} m); lower "
            "it, safety.planned_force_n or safety.braking_force_n, or move the limits apart"
        )
    return keep_out, keep_in


def errors_of(mission: "Mission") -> Errors:
    """Return bounds on a flight's errors from the settings of navigation, thrusters and motion.

    Of the probability that one of them fails, eight tenths are for the thrusters, whose bound costs most, and
    a tenth each for constant errors of sensors and for the noise of all samples together.
    """
    from scipy.special import chdtri  # noqa: PLC0415 - slow to import, used only here

    risk = 1.0 - (mission.safety.probability or 0.0)
    per_sample = 0.1 * risk / (3.0 * (mission.num_controls + 1))  # of place, speed and attitude
    constant, noise = sqrt(chdtri(3, 0.05 * risk)), sqrt(chdtri(3, per_sample))
    period, mass, actuators = mission.control_period_s, mission.deputy.mass_kg, mission.actuators
    share, force = 0.0, mass * unknown_acceleration(mission)
    if actuators.kind == "real":
        share = largest_share(actuators.scale_error, radians(actuators.misalignment_deg), 1.0 - 0.8 * risk)
        force += SQRT_3 * (actuators.least_impulse_n_s + 0.5 * actuators.impulse_step_n_s) / period
    navigation = mission.navigation
    if navigation.mode == "perfect":
        return Errors(0.0, 0.0, share, force)
    tilt = radians(constant * navigation.attitude_bias_deg)
    place, speed = deviations(mission)
    off = constant * navigation.bias_m
    off += tilt * mission.deputy.max_distance_m if navigation.measures == "range_bearing" else 0.0
    turn = tilt + radians(noise * navigation.attitude_noise_deg)
    return Errors(off + noise * place, noise * speed, share + (1.0 + share) * turn, force)


def largest_share(scale: float, turn: float, probability: float) -> float:
    """Return what the greatest of three normal scales plus a normal rotation, rad, stays below.

    A force f becomes ``(I + S) R f``, which differs from it by at most ``(max|S| + angle of R) |f|``.
    """
    from scipy.special import chdtr, erf  # noqa: PLC0415 - as above

    angles = turn * np.linspace(0.0, 9.0, 2001)
    weights = np.diff(chdtr(3, (angles / turn) ** 2)) if turn > 0.0 else np.zeros(2000)
    weights = weights if turn > 0.0 else np.r_[weights[1:], 1.0]
    low, high = 0.0, 9.0 * (scale + turn)
    for _ in range(50):
        share = 0.5 * (low + high)
        left = np.maximum(share - angles[1:], 0.0)  # at the far end of each interval: never too hopeful
        below = erf(left / (scale * sqrt(2.0))) ** 3 if scale > 0.0 else (share >= angles[1:]).astype(float)
        low, high = (low, share) if weights @ below >= probability else (share, high)
    return high


def unknown_acceleration(mission: "Mission") -> float:
    """Return a bound on the true relative acceleration less Clohessy and Wiltshire's, m/s^2.

    The second order of a point mass' attraction, the gradient of its oblateness, and what an orbit's
    eccentricity changes in rate and attraction; distance and speed at their greatest.
    """
    dynamics, n = mission.dynamics, mission.orbit.mean_motion_rad_s
    if dynamics.model == "cw":
        return 0.0
    radius: float = (EARTH_GRAVITY_M3_S2 / n**2) ** (1.0 / 3.0)
    distance = mission.deputy.max_distance_m
    speed = SQRT_3 * mission.deputy.max_force_n * mission.control_period_s / mission.deputy.mass_kg
    faster: float = (1.0 + dynamics.eccentricity) ** 2 / (1.0 - dynamics.eccentricity**2) ** 1.5 - 1.0
    oblate = dynamics.j2 * (EARTH_RADIUS_M / radius) ** 2
    gradient = 6.0 * distance / radius + 40.0 * oblate + 8.0 * faster * (2.0 + faster)
    pull = n**2 * distance * gradient + 2.0 * n * speed * (faster + 10.0 * oblate)
    return pull + abs(dynamics.drag_m_s2) + abs(dynamics.radiation_m_s2)


def deviations(mission: "Mission") -> tuple[float, float]:
    """Return the filter's greatest standard deviations along an axis, m and m/s, of place and velocity.

    Those of its covariances in a flight under the greatest planned force, with fixes from the farthest place.
    """
    navigation, safety, period = mission.navigation, mission.safety, mission.control_period_s
    motion = motion_over(mission.orbit, mission.deputy, (period,))
    phi, gamma = motion.transition[0], motion.control[0]
    tilts = np.radians((navigation.attitude_bias_deg, navigation.attitude_noise_deg))
    per_force = navigation.execution_error**2 + float(tilts @ tilts)
    square = 3.0 * safety.planned_force_n**2 * per_force
    process = gamma @ gamma.T * (square + (navigation.process_noise_m_s2 * mission.deputy.mass_kg) ** 2)
    fix = navigation.bias_m**2 + navigation.noise_m**2
    if navigation.measures == "range_bearing":
        across = mission.deputy.max_distance_m * sqrt(
            radians(navigation.bearing_noise_deg) ** 2 + float(tilts @ tilts)
        )
        fix = navigation.bias_m**2 + max(navigation.range_noise_m, across) ** 2
    stride, delay = round(navigation.fix_period_s / period), round(navigation.delay_s / period)
    start = [navigation.initial_position_m] * 3 + [navigation.initial_velocity_m_s] * 3
    covariance, greatest = np.diag(np.square(start)), np.zeros(6)
    for k in range(mission.num_controls + 1):
        if k % stride == 0:
            gain = covariance[:, :3] @ np.linalg.inv(covariance[:3, :3] + fix * np.eye(3))
            covariance = covariance - gain @ covariance[:3]
        now = covariance
        for _ in range(delay):
            now = phi @ now @ phi.T + process
        greatest = np.maximum(greatest, np.diag(now))
        covariance = phi @ covariance @ phi.T + process
    place, speed = np.sqrt([greatest[:3].max(), greatest[3:].max()])
    return float(place), float(speed)


def norm(matrix: Floats) -> float:
    """Return the spectral norm."""
    return float(np.linalg.norm(matrix, 2))


class _Recursion:
    """What becomes, from sample to sample, of a stop's place and force under bounded errors."""

    def __init__(self, mission: "Mission", errors: Errors) -> None:
        motion = motion_over(mission.orbit, mission.deputy, (mission.control_period_s,))
        self.mission, self.errors, self.motion = mission, errors, motion
        self.stop = stop_of(motion)
        self.place = stopped(motion, self.stop).transition[0, :3]
        phi, gamma = motion.transition[0], motion.control[0]
        #: by which a newton moves the next place, and the place of the next stop, m, and changes its force
        self.moved, self.shifted = norm(gamma[:3]), norm(self.place @ gamma)
        self.turned = norm(self.stop @ gamma)
        #: errors of the stop's force and place as estimated, and of its place after a period
        self.force_off = max(self._off(self.stop), self._off(self.stop @ phi))
        self.place_off, self.later_off = self._off(self.place), self._off(self.place @ phi)

    def _off(self, row: Floats) -> float:
        return norm(row[:, :3]) * self.errors.place_m + norm(row[:, 3:]) * self.errors.speed_m_s

    def _fired_off(self, force: float) -> float:
        return self.errors.share * force + self.errors.force_n

    def bounds(self) -> Bounds:
        """Return the bounds; the numbers of the proof in its order."""
        mission, errors, safety = self.mission, self.errors, self.mission.safety
        share, most = errors.share, mission.deputy.max_force_n
        standing = 3.0 * mission.deputy.mass_kg * mission.orbit.mean_motion_rad_s**2 * mission.keep_in_m
        left = max(1e-3, 1.0 - self.turned * share)
        weight = self.shifted * share / left
        towards = sqrt(max(0.0, 1.0 - (self.place_off / mission.keep_out_m) ** 2))
        towards -= 0.5 * self.shifted * most / mission.keep_in_m
        led = float(np.linalg.eigvalsh(self._pushed() + self._pushed().T).min()) / 2.0
        led += self.shifted * (towards - 1.0)
        gained = led - self.shifted * share - weight * self.turned * (1.0 + share)
        lost = (self.shifted + weight * self.turned) * (self.force_off * (1.0 + share) + errors.force_n)
        back = (lost + weight * standing) / gained if gained > 0.0 else inf
        does_close = back <= most
        back = back if does_close else 0.0
        braking, planned = SQRT_3 * safety.braking_force_n, SQRT_3 * safety.planned_force_n
        # of the stop, at any sample: after a step back, and after a force that was found safe
        stepped = self.turned * ((back + self.force_off) * (1.0 + share) + errors.force_n)
        stepped = (standing + stepped) / left
        off = self._fired_off(max(planned, stepped + self.force_off))
        off = max(off, self._fired_off(braking + 2.0 * self.force_off) / left)
        found = self.force_off + self.turned * off
        axis = max(safety.braking_force_n + found, stepped) + self.force_off + back
        does_close = does_close and axis <= most
        strayed = self.later_off + self.shifted * off + weight * (braking + found)
        strayed += self.moved * (self._fired_off(self.force_off + back) + self.force_off)
        fired = max(planned, max(braking + found, stepped) + self.force_off + back)
        bent, dip = self._between(fired * (1.0 + share) + errors.force_n, max(braking + found, stepped))
        return Bounds(errors, strayed + bent + dip, strayed + bent, safety.planned_force_n, back, does_close)

    def _pushed(self) -> Floats:
        """Return by how many metres a newton moves the place of the next stop."""
        return np.asarray(self.place @ self.motion.control[0], dtype=np.float64)

    def _between(self, fired: float, stop: float) -> tuple[float, float]:
        """Return how far a path bends off its chord in a period, and how far a chord dips, m."""
        mission, period, phi = self.mission, self.mission.control_period_s, self.motion.transition[0]
        n, far = mission.orbit.mean_motion_rad_s, mission.deputy.max_distance_m
        speed = norm(self.motion.control[0, 3:]) * stop + norm(phi[3:, :3]) * far
        speed *= norm(np.linalg.inv(phi[3:, 3:]))
        bent = 0.125 * period**2 * (fired / mission.deputy.mass_kg + n * (3.0 * n * far + 2.0 * speed))
        near, half = mission.deputy.min_distance_m + bent, 0.5 * period * speed + bent
        return bent, near - sqrt(max(0.0, near**2 - half**2))
