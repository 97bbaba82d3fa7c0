"""Bounds on how far flights deviate from the safety layer's plan, and the margins that allow for it.

With `safety.probability` the errors of state, force and motion are bounded, as far as they follow from the
configuration, and all of a flight's bounds hold together with that probability. docs/explanation/safety.md
has the proof. Vectors are bounded by their lengths, matrices by their spectral norms.
"""

from dataclasses import dataclass, replace
from functools import lru_cache
from math import ceil, cos, hypot, inf, radians, sqrt

import numpy as np

from pipeline.array_types import Floats
from pipeline.flight.period.act.safety import STANDING
from pipeline.flight.state.arrays import Guard
from pipeline.flight.world import thrust_bounds
from pipeline.flight.world.estimates import SQRT_3, EstimateErrors, estimate_errors, unknown_acceleration
from pipeline.physics.motion import joined, motion_over, stop_of, stopped
from pipeline.settings.equipment import RangeBearingFixes, RealActuators
from pipeline.settings.experiment import Mission, SettingError

#: kept besides, beyond the accumulated rounding of a flight
ROUNDING_M = 0.001
#: pushes back to a planned stop that are tried, by the least step back
PUSHES = [1.0 + 0.05 * step for step in range(41)]


@dataclass(frozen=True)
class ErrorBounds:
    """Bounds on a flight's errors; all hold with the probability that is asked for."""

    position_m: float = 0.0  # of the estimate, like the next
    speed_m_s: float = 0.0
    share: float = 0.0  # of a force, by which what is fired differs from it: a linear map that a flight keeps
    force_n: float = 0.0  # by which it differs besides, and the motion as if by such a force
    lighter: float = 0.0  # part of the share by which a force counts for more as propellant is used up
    constant_m: float = 0.0  # of all fixes of a flight
    risk: float = 0.0  # that the noise of one part of the estimate leaves its bound


@dataclass(frozen=True)
class SafetyBounds:
    """Margins that the safety layer keeps for errors of state, thrust and motion; zero where all is exact."""

    errors: ErrorBounds = ErrorBounds()
    keep_out_m: float = 0.0  # least distances to the limits, at samples, of what the layer plans
    keep_in_m: float = 0.0
    planned_force_n: float = inf  # greatest force along each axis that is passed on, and greatest of a stop
    braking_force_n: float = inf
    step_back_n: float = 0.0  # force beyond the stop that leads back from where even the stop is not safe
    astray_m: float = 0.0  # how far samples and stops may be from where deputies kept apart plan them
    does_close: bool = True  # whether thrusters make good for the errors, so that flights stay in the limits
    needed_force_n: float = 0.0  # the greatest along an axis that making good may take
    greatest_force_n: float = 0.0  # greatest length of a force that is passed on
    propellant_kg: float = 0.0  # what a flight may use up


def is_exact(mission: Mission) -> bool:
    """Return whether state, forces and motion are just those that the safety layer computes with."""
    return (
        mission.navigation.mode == "perfect"
        and mission.actuators.kind == "ideal"
        and mission.dynamics.model == "cw"
        and not mission.dispersions
    )


@lru_cache(maxsize=20_000)  # controllers that are compared fly the same cases
def bounds_of(mission: Mission) -> SafetyBounds:
    """Return the bounds under which a mission's safety layer plans."""
    if mission.safety.probability is None or is_exact(mission):
        return SafetyBounds()
    known = estimate_errors(mission)
    bounds = _Recursion(mission, error_bounds(mission, known), known).bounds()
    actuators = mission.actuators
    if not isinstance(actuators, RealActuators) or actuators.specific_impulse_s is None:
        return bounds
    return _with_tank(mission, known, bounds, actuators)


def stops_apart(mission: Mission) -> float:
    """Return how far apart deputies of fleets are kept where they would stop, m; 0: not at all."""
    if not mission.fleet.keep_apart_m > 0.0:
        return 0.0
    return mission.fleet.keep_apart_m + 2.0 * bounds_of(mission.of_each).astray_m


def _with_tank(
    mission: Mission, known: EstimateErrors, constant: SafetyBounds, actuators: RealActuators
) -> SafetyBounds:
    """Return bounds that allow for the mass of the propellant that a flight may use up.

    They are those of a constant mass where the tank does not hold it, or the thrusters cannot make good for
    it. Propellant and errors depend on one another; that they stay below these bounds follows by induction
    over the control periods.
    """
    bounds = constant
    while True:  # the propellant grows by a hundredth at least
        propellant = 1.01 * _propellant(mission, bounds, actuators)
        if propellant > actuators.propellant_kg:
            return replace(constant, propellant_kg=propellant)
        lighter = propellant / (mission.deputy.mass_kg - propellant)
        bounds = _Recursion(mission, error_bounds(mission, known, lighter), known).bounds()
        if not bounds.does_close:
            return replace(constant, propellant_kg=propellant, does_close=False)
        if _propellant(mission, bounds, actuators) <= propellant:
            return replace(bounds, propellant_kg=propellant)


def _propellant(mission: Mission, bounds: SafetyBounds, actuators: RealActuators) -> float:
    """Return the propellant of a flight, kg, that fires the greatest force in each control period."""
    return thrust_bounds.propellant(
        actuators,
        bounds.errors.share,
        bounds.greatest_force_n,
        mission.control_period_s,
        mission.num_controls,
    )


def spheres_of(mission: Mission, bounds: SafetyBounds) -> tuple[float, float]:
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
            "it, safety.planned_force_n or safety.planned_braking_n, or move the limits apart"
        )
    return keep_out, keep_in


def guard_of(mission: Mission) -> Guard:
    """Turn the safety settings of a mission into the numbers that `assure` reads."""
    safety, period = mission.safety, mission.control_period_s
    motion = motion_over(mission.orbit, mission.deputy, (period,))
    stop = stop_of(motion)
    if safety.kind == "none":
        return Guard(False, 0.0, np.inf, np.inf, 0.0, np.inf, np.inf, 0.0, stop, motion, 0, 0, None)
    bounds = bounds_of(mission)
    keep_out, keep_in = spheres_of(mission, bounds)
    num_drifts = [ceil(time / period - 1e-9) for time in (safety.passive_horizon_s, safety.keep_in_horizon_s)]
    now = motion_over(mission.orbit, mission.deputy, (0.0,))
    drifts = [(j + 1) * period for j in range(max(num_drifts))]
    braking = min(bounds.braking_force_n, mission.braking_force_n)
    checks = joined(now, stopped(motion, stop), motion_over(mission.orbit, mission.deputy, drifts))
    fastest, angle = safety.axis_speed_limit_m_s, safety.min_sun_angle_deg
    if fastest > 0.0 or angle > 0.0:
        stop = np.vstack((stop, (braking / fastest if fastest > 0.0 else 0.0) * np.eye(3, 6, 3)))
    if angle > 0.0:
        stop = np.vstack((stop, cos(radians(angle)) * np.eye(1, 6)))
    return Guard(
        is_on=True,
        keep_out=keep_out,
        keep_in=keep_in,
        speed_at_chief=safety.speed_limit_m_s - safety.speed_slope_per_s * safety.speed_distance_m,
        speed_slope=safety.speed_slope_per_s,
        braking_force=braking,
        planned_force=min(bounds.planned_force_n, mission.deputy.max_force_n),
        step_back=bounds.step_back_n,
        stop=stop,
        checks=checks,
        num_kept_out=STANDING + num_drifts[0],
        num_kept_in=STANDING + num_drifts[1],
        way_out=(safety.delta_v_limit_m_s or inf) if safety.keep_way_out else None,
    )


def error_bounds(mission: Mission, known: EstimateErrors, lighter: float = 0.0) -> ErrorBounds:
    """Return bounds on a flight's errors from the settings of navigation, thrusters and motion.

    `lighter` is the share by which a force may count for more in the end, for the propellant used up.
    Of the probability that one of them fails, the noise of all samples together has five parts, thrusters
    have four, and constant errors of sensors have one, as far as there are such errors.
    """
    from scipy.special import chdtri  # noqa: PLC0415 - slow to import, used only here

    navigation, actuators = mission.filtered, mission.actuators
    is_fixed, is_real = mission.navigation.mode == "fixes", actuators.kind == "real"
    is_biased = is_fixed and (navigation.bias_m > 0.0 or navigation.attitude_bias_deg > 0.0)
    parts = 5.0 * is_fixed + 4.0 * is_real + 1.0 * is_biased
    part = (1.0 - (mission.safety.probability or 0.0)) / max(1.0, parts)
    period, mass = mission.control_period_s, mission.deputy.mass_kg
    share, force = 0.0, mass * unknown_acceleration(mission)
    if isinstance(actuators, RealActuators):
        share, missed = thrust_bounds.of_fired(actuators, period, 1.0 - 4.0 * part, lighter)
        force += missed
    if not is_fixed:
        return ErrorBounds(share=share, force_n=force, lighter=lighter)
    # the stop's force and position, both now and after a period, and the attitude
    part_risk = 5.0 * part / (4 + (navigation.attitude_noise_deg > 0.0))
    constant, noise = sqrt(chdtri(3, 0.5 * part)), sqrt(chdtri(3, part_risk / (mission.num_controls + 1)))
    tilt = radians(constant * navigation.attitude_bias_deg)
    off = constant * navigation.bias_m
    off += tilt * mission.deputy.max_distance_m if isinstance(navigation, RangeBearingFixes) else 0.0
    position, speed = (known.bound(rows, off, part_risk) for rows in np.split(np.eye(6), 2))
    turn = tilt + radians(noise * navigation.attitude_noise_deg)  # it changes as the body turns
    force += (1.0 + share) * turn * SQRT_3 * mission.deputy.max_force_n
    return ErrorBounds(position, speed, share, force, lighter, off, part_risk)


def norm(matrix: Floats) -> float:
    """Return the spectral norm."""
    return float(np.linalg.norm(matrix, 2))


def dip(radius: float, length: float) -> float:
    """Return how far the middle of a chord of a length lies inside a sphere through its ends."""
    return radius - sqrt(max(0.0, radius**2 - 0.25 * length**2))


class _Recursion:
    """The recursion over samples of the position and force of a stop under bounded errors."""

    def __init__(self, mission: Mission, errors: ErrorBounds, known: EstimateErrors) -> None:
        motion = motion_over(mission.orbit, mission.deputy, (mission.control_period_s,))
        self.mission, self.errors, self.motion, self.known = mission, errors, motion, known
        self.stop = stop_of(motion)
        self.position = stopped(motion, self.stop).transition[0, :3]
        phi, gamma = motion.transition[0], motion.control[0]
        self.braking = min(mission.braking_force_n, mission.safety.planned_braking_n)
        #: by which a newton moves the place of the next stop, m, and changes its force
        self.pushed = self.position @ gamma
        self.shifted = norm(self.pushed)
        self.turned = norm(self.stop @ gamma)
        #: errors of the stop's force and place as estimated, and of its place after a period
        self.force_off = max(self._off(self.stop), self._off(self.stop @ phi))
        self.position_off, self.later_off = self._off(self.position), self._off(self.position @ phi)

    def _off(self, rows: Floats) -> float:
        """Return a bound on ``|A e|`` for the errors of estimates, see `EstimateErrors.bound`."""
        return self.known.bound(rows, self.errors.constant_m, self.errors.risk)

    def bounds(self) -> SafetyBounds:
        """Return the bounds; of deputies kept apart those with the push that strays least from plans."""
        mission = self.mission
        # symbols of docs/explanation/safety.md at the right: |h|
        standing = 3.0 * mission.deputy.mass_kg * mission.orbit.mean_motion_rad_s**2 * mission.keep_in_m
        left = max(1e-3, 1.0 - self.turned * self.errors.share)  # 1 - c e
        back = self._step_back(self.shifted * self.errors.share / left, left, standing)  # |g|
        if not mission.fleet.keep_apart_m > 0.0:
            return self._bounds(back, left, standing)
        tried = [self._bounds(more * back, left, standing) for more in PUSHES]
        return min(
            (each for each in tried if each.does_close), key=lambda each: each.astray_m, default=tried[0]
        )

    def _bounds(self, back: float, left: float, standing: float) -> SafetyBounds:
        """Return the bounds with a push back, step by step as docs/explanation/safety.md proves them."""
        mission, errors, safety = self.mission, self.errors, self.mission.safety
        share, most = errors.share, mission.deputy.max_force_n  # e
        weight = self.shifted * share / left  # w
        does_close, stepping = back <= most, back
        back = back if does_close else 0.0
        pushed = (1.0 + share) * (back + self.force_off) + errors.force_n  # of y, all but D k
        led, stop, missed = self._after_forces(weight, standing, (standing + self.turned * pushed) / left)
        stepped = standing + self.turned * (share * stop + pushed)  # |k| after a step back
        axis = max(led, stepped) + self.force_off + back
        needed = max(stepping, axis + share * (stop + self.force_off + back))
        does_close = does_close and needed <= most
        strayed = self.later_off + missed + weight * stepped  # how far p lies inside R1
        # how far a sample may lie from halfway between the positions of two stops
        off = share * stop + pushed  # |y|
        halfway = norm(self.motion.control[0, :3] - 0.5 * self.pushed) * off
        is_apart, astray = mission.fleet.keep_apart_m > 0.0, 0.0
        if is_apart:
            around = self._around_plan(back, weight, left, (standing, stop), self.later_off + missed)  # rho
            does_close = does_close and around < inf
            strayed = max(strayed, around + weight * stepped if does_close else 0.0)
        # in steps back the share grows by this, at most, as propellant is used up
        strayed += self.shifted * (1.0 + share) * errors.lighter * stepped / left**2
        if is_apart:
            astray = max(strayed + halfway, self._sample_off())
        fired = max(SQRT_3 * safety.planned_force_n, stop + self.force_off + back)
        bent, length = self._between(fired * (1.0 + share) + errors.force_n, stop)
        keep_in, near = strayed + halfway + bent, mission.deputy.min_distance_m + bent
        keep_out = keep_in + dip(near, length + 2.0 * bent)
        keep_out += dip(near, self.shifted * off)
        planned = safety.planned_force_n, self.braking, back
        return SafetyBounds(errors, keep_out, keep_in, *planned, astray, does_close, needed, fired)

    def _around_plan(
        self, back: float, weight: float, left: float, forces: tuple[float, float], after_force: float
    ) -> float:
        """Return how far from a planned stop V stays while a deputy of a fleet is led back to it, m.

        docs/explanation/fleets.md has the proof. Given are the push, w, 1 - c e, bounds on |h| and |k|, and
        on how far V is from the plan after a planned force; infinite where the push does not suffice.
        """
        standing, stop = forces
        length, least = norm(self.pushed), 1.0 / norm(np.linalg.inv(self.pushed))
        askew = self.errors.share * norm(self.stop @ self.motion.control[0] + np.eye(3)) / left
        step = least * back  # zeta
        known = self.position_off + weight * max(stop, SQRT_3 * self.braking)  # beta
        lost = length / least * askew * step + length * ((1.0 + askew) * self.force_off)
        lost += length * self.errors.force_n / left + weight * standing  # omega

        def outward(along: float) -> float:
            """Return how far a step may lead out of the ball whose squared radius is along^2 + beta^2."""
            inside = max(0.5 * step, abs(along - step))
            return hypot(known, inside) + lost - hypot(known, along)

        farthest = 1e3 * (known + lost + step)
        if outward(farthest) > 0.0:
            return inf
        from scipy.optimize import brentq  # noqa: PLC0415 - slow to import, used only here

        nearest = hypot(known, float(brentq(outward, 0.0, farthest)))
        return max(nearest, known, after_force)

    def _sample_off(self) -> float:
        """Return how far a sample may lie from where a planned force is to lead, m."""
        force = self.errors.share * SQRT_3 * self.mission.safety.planned_force_n + self.errors.force_n
        return self.position_off + norm(self.motion.control[0, :3]) * (self.force_off + force)

    def _step_back(self, weight: float, left: float, standing: float) -> float:
        """Return the least force beyond the stop with which a step back does not lead towards the limit."""
        mission, errors, most = self.mission, self.errors, self.mission.deputy.max_force_n
        askew = errors.share * norm(self.stop @ self.motion.control[0] + np.eye(3)) / left
        off = self.position_off + weight * SQRT_3 * most
        towards = sqrt(max(0.0, 1.0 - (off / mission.deputy.min_distance_m) ** 2)) - 1.0
        towards -= 0.5 * self.shifted * most / mission.keep_in_m
        gained = self.shifted * (1.0 + towards - askew) - norm(self.pushed - self.shifted * np.eye(3))
        lost = self.shifted * ((1.0 + askew) * self.force_off + errors.force_n / left) + weight * standing
        return lost / gained if gained > 0.0 else inf

    def _after_forces(self, weight: float, standing: float, stepped: float) -> tuple[float, float, float]:
        """Return bounds after any force that was found safe.

        Along an axis and in length, N, on the force of the next stop; in metres, on what was not fired and
        what true thrusters add to the place of that stop. The force is within the planned box, or on the way
        from the stop to such a force.
        """
        planned, braking = SQRT_3 * self.mission.safety.planned_force_n, SQRT_3 * self.braking
        stop, axis, missed = stepped, 0.0, 0.0
        for _ in range(100):  # the bound grows to a fixed point
            known, longest, axis, missed = stop + self.force_off, 0.0, 0.0, 0.0
            reach = self.turned * (planned + known)
            for way in (0.0, min(1.0, max(0.0, braking - standing) / reach), 1.0):
                off = self.errors.share * ((1.0 - way) * known + way * planned) + self.errors.force_n
                more, led = self.force_off + self.turned * off, standing + way * reach
                length = min(braking, led) + more
                longest, axis = max(longest, length), max(axis, min(self.braking, led) + more)
                missed = max(missed, self.shifted * off + weight * length)
            stop = max(longest, stepped)
        return axis, stop, missed

    def _between(self, fired: float, stop: float) -> tuple[float, float]:
        """Return how far a path bends off its chord in a period, and how long that is, m."""
        mission, period, phi = self.mission, self.mission.control_period_s, self.motion.transition[0]
        n, far = mission.orbit.mean_motion_rad_s, mission.deputy.max_distance_m
        speed = norm(self.motion.control[0, 3:]) * stop + norm(phi[3:, :3]) * far
        speed *= norm(np.linalg.inv(phi[3:, 3:]))
        fastest = speed + 0.5 * period * fired / mission.deputy.mass_kg
        bent = 0.125 * period**2 * (fired / mission.deputy.mass_kg + n * (3.0 * n * far + 2.0 * fastest))
        return bent, period * speed
