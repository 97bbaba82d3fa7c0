"""The safety layer: the least change of a force that keeps the limits (docs/explanation/safety.md)."""

from collections.abc import Sequence
from math import ceil

import numpy as np

from pipeline.array_types import Floats
from pipeline.flight.reference.course import PredictedCourse
from pipeline.flight.reference.motion import transition
from pipeline.settings.experiment import Mission

#: checked positions whose limits are never given up: at the next sample, and stopped from there
STANDING = 2
#: margins of corrections, m, to limits and to those that act early, and tolerance for rounding, m
SLACK, EARLY_SLACK, TOLERANCE = 1e-4, 0.1, 1e-6
#: share of the depth in the Sun's cone that may be left after a period
STAYING = 0.98
#: most cuts, most sweeps of the projection, the change that ends them, N, and bisections towards the stop
MOST_CUTS, MOST_SWEEPS, LEAST_CHANGE, HALVINGS = 12, 200, 1e-12, 30

#: a half-space ``g . f >= level`` of forces
Cut = tuple[Floats, float]


class SafetyLayer:
    """A mission's safety layer, with its own margins unless others are given, see `DrawnErrors`.

    It looks ahead of sample k along a predicted course, and by the mean motion where none is given.
    """

    def __init__(
        self,
        mission: Mission,
        margins: tuple[float, float, float, float, float] | None = None,
        course: PredictedCourse | None = None,
        k: int = 0,
    ) -> None:
        self.law, self.limit = mission.safety, mission.deputy.max_force_n
        self.period = mission.control_period_s
        out = mission.deputy.min_distance_m + self.law.keep_out_margin_m
        far = mission.deputy.max_distance_m - self.law.keep_in_margin_m
        given = self.law.braking_force_n
        from_settings = (out, far, self.limit, 0.8 * self.limit if given is None else given, 0.0)
        self.out, self.far, self.planned, self.braking, self.step_back = margins or from_settings
        n, self.mass = mission.orbit.mean_motion_rad_s, mission.deputy.mass_kg
        self.phi, self.gamma = transition(n, self.period, self.mass)
        self.stop = -np.linalg.solve(self.gamma[3:], self.phi[3:])
        #: so that a force counts as the metres that it moves the deputy in a period
        self.metres_per_newton = self.gamma[2, 2]
        horizons = self.law.passive_horizon_s, self.law.keep_in_horizon_s
        num_out, num_in = (ceil(horizon / self.period - 1e-9) for horizon in horizons)
        count = max(num_out, num_in)
        drifts = [transition(n, j * self.period)[0][:3] for j in range(1, count + 1)]
        #: the positions that are checked: of the next state, stopped from there, and after free drift
        self.checks = np.array([np.eye(3, 6), self.phi[:3] + self.gamma[:3] @ self.stop, *drifts])
        if course is not None:  # stops stay those of the mean motion
            self.phi, self.gamma = course.step(k)
            self.checks[STANDING:] = [course.between(k + 1, k + 2 + j)[:3] for j in range(count)]
        order = np.arange(len(self.checks))
        self.least = np.where(order < STANDING + num_out, self.out, -np.inf)
        self.greatest = np.where(order < STANDING + num_in, self.far, np.inf)

    def excesses(self, ahead: Floats, num_checks: int) -> Floats:
        """Return by how many metres a state exceeds each limit, minus infinity for those that are off.

        There are two for each check, then the speed, braking along three axes, and the speed along each.
        """
        distances = np.linalg.norm(self.checks[:num_checks] @ ahead, axis=1)
        spheres = self.least[:num_checks] - distances, distances - self.greatest[:num_checks]
        law = self.law
        farther = np.linalg.norm(ahead[:3]) - law.speed_distance_m
        fastest = law.speed_limit_m_s + law.speed_slope_per_s * farther
        speed = self.period * (np.linalg.norm(ahead[3:]) - fastest)
        braking = self.metres_per_newton * (np.abs(self.stop @ ahead) - self.braking)
        along_axes = np.full(3, -np.inf)
        if (most := law.axis_speed_limit_m_s) > 0.0:
            along_axes = self.metres_per_newton * self.braking * (np.abs(ahead[3:]) / most - 1.0)
        return np.concatenate((np.column_stack(spheres).ravel(), [speed], braking, along_axes))

    def half_space(self, ahead: Floats, index: int, num_checks: int) -> tuple[Floats, float]:
        """Return the half-space ``row . s' >= level`` of next states for a limit, an index of `excesses`.

        They list the nearest and farthest distance at each check by turns, then the speed, then the stop
        along each axis, then the speed along each. A limit is linearised at `ahead`, the next state, (6,), m
        and m/s, Hill axes.
        """
        past_checks = index - 2 * num_checks
        if past_checks > 3:
            row = -np.sign(ahead[past_checks - 1]) * np.eye(6)[past_checks - 1]
            spare = SLACK / (self.metres_per_newton * self.braking)
            level = (spare - 1.0) * self.law.axis_speed_limit_m_s
        elif past_checks > 0:
            row = -np.sign(self.stop[past_checks - 1] @ ahead) * self.stop[past_checks - 1]
            level = SLACK / self.metres_per_newton - self.braking
        elif past_checks == 0:
            outward, forward = (part / np.linalg.norm(part) for part in (ahead[:3], ahead[3:]))
            row = np.concatenate((self.law.speed_slope_per_s * outward, -forward))
            level = self.law.speed_slope_per_s * self.law.speed_distance_m - self.law.speed_limit_m_s
            level += SLACK / self.period
        else:
            check, is_far = divmod(index, 2)
            towards = self.checks[check] @ ahead
            towards = (-1.0 if is_far else 1.0) * towards / max(float(np.linalg.norm(towards)), TOLERANCE)
            row = towards @ self.checks[check]
            level = (-self.far if is_far else self.out) + (SLACK if check < STANDING else EARLY_SLACK)
        return row, level

    def depth_in_cone(self, position: Floats, sun: Floats | None) -> float:
        """Return how far inside the cone a position lies, m, in which a camera looks into the Sun.

        It is minus infinity where there is no cone, or no Sun is given.
        """
        if sun is None or self.law.min_sun_angle_deg == 0.0:
            return -np.inf
        distance, half = np.linalg.norm(position), np.radians(self.law.min_sun_angle_deg)
        off_axis = np.arctan2(np.linalg.norm(np.cross(position, sun)), -position @ sun)
        return float(distance * np.sin(half - off_axis))

    def out_of_cone(self, position: Floats, sun: Floats) -> Floats:
        """Return the normal of the cone at its line that is nearest to a position inside, (3,)."""
        half = np.radians(self.law.min_sun_angle_deg)
        across = position - (position @ sun) * sun
        if np.linalg.norm(across) < TOLERANCE:
            across = np.cross([0.0, 0.0, 1.0] if abs(sun[2]) < 0.9 else [1.0, 0.0, 0.0], sun)
        return np.asarray(np.cos(half) * across / np.linalg.norm(across) + np.sin(half) * sun)

    def nearest_safe_force(
        self,
        free: Floats,
        requested: Floats,
        num_checks: int,
        sun: Floats | None = None,
        most_deep: float = 0.0,
    ) -> Floats:
        """Return the force nearest to a requested one that keeps the limits of the first checks, by cuts.

        Nor does it lead deeper into the cone about a Sun that is given, m. `free` is the next state without a
        force.
        """
        cuts: list[Cut] = []
        force = np.clip(requested, -self.planned, self.planned)
        for _ in range(MOST_CUTS):
            ahead = free + self.gamma @ force
            excesses = self.excesses(ahead, num_checks)
            depth = self.depth_in_cone(ahead[:3], sun) - most_deep
            if max(excesses.max(), depth) <= 0.0:
                break
            if sun is not None and depth > excesses.max():
                row = np.concatenate((self.out_of_cone(ahead[:3], sun), np.zeros(3)))
                level = EARLY_SLACK - most_deep
            else:
                row, level = self.half_space(ahead, int(np.argmax(excesses)), num_checks)
            cuts.append((row @ self.gamma, level - float(row @ free)))
            force = projected(requested, cuts, self.planned)
        return force

    def is_safe(self, free: Floats, force: Floats, tolerance: float = TOLERANCE) -> bool:
        """Return whether a force keeps the limits that are never given up, apart from rounding."""
        return bool(self.excesses(free + self.gamma @ force, STANDING).max() <= tolerance)

    def assured(
        self, state: Floats, requested: Floats, suns: tuple[Floats, Floats] | None = None
    ) -> tuple[Floats, str | None]:
        """Return the force to apply, N, and the limit it was changed for; None where it is safe.

        `suns` are the directions of the Sun now and at the next sample, whose cone is given up first.
        """
        now, sun = suns or (None, None)
        free = self.phi @ state
        ahead = free + self.gamma @ requested
        name = self.exceeded(ahead) or ("speed" if np.abs(requested).max() > self.planned else None)
        most_deep = STAYING * max(0.0, self.depth_in_cone(state[:3], now))
        if name is None and self.depth_in_cone(ahead[:3], sun) <= most_deep:
            return requested, None
        if sun is not None and self.law.min_sun_angle_deg > 0.0:
            force = self.nearest_safe_force(free, requested, len(self.checks), sun, most_deep)
            reached = free + self.gamma @ force
            excess = self.excesses(reached, len(self.checks)).max()
            if max(self.depth_in_cone(reached[:3], sun) - most_deep, excess) <= TOLERANCE:
                return force, name or "sun"
        if name is None:
            return requested, None
        for num_checks in (len(self.checks), STANDING):
            force = self.nearest_safe_force(free, requested, num_checks)
            if self.is_safe(free, force):
                return force, name
        stop = np.clip(self.stop @ state, -self.limit, self.limit)
        if not self.is_safe(free, stop, 2.0 * TOLERANCE):
            return (self._step_back(state, stop) if self.step_back > 0.0 else force), name
        low, high = 0.0, 1.0
        for _ in range(HALVINGS):
            share = 0.5 * (low + high)
            if self.is_safe(free, stop + share * (force - stop)):
                low = share
            else:
                high = share
        return stop + low * (force - stop), name

    def _step_back(self, state: Floats, stop: Floats) -> Floats:
        """Return the stopping force with a push added, away from the nearer limit."""
        stopped_position = self.checks[1] @ state
        distance = np.linalg.norm(stopped_position)
        is_far = distance > 0.5 * (self.out + self.far)
        push_back = (-self.step_back if is_far else self.step_back) * stopped_position / distance
        return np.clip(stop + push_back, -self.limit, self.limit)

    def exceeded(self, ahead: Floats) -> str | None:
        """Return the most exceeded limit of a state, first of those never given up; None for none."""
        for num_checks in (STANDING, len(self.checks)):
            excesses = self.excesses(ahead, num_checks)
            worst = int(np.argmax(excesses))
            if excesses[worst] > 0.0:
                if worst >= 2 * num_checks:
                    return "axis_speed" if worst > 2 * num_checks + 3 else "speed"
                if worst % 2:
                    return "keep_in"
                return "keep_out" if worst < 2 * STANDING else "passive_safety"
        return None


def projected(requested: Floats, cuts: Sequence[Cut], limit: float) -> Floats:
    """Return the force in all half-spaces and the thruster's box nearest to a requested one.

    Each set is projected onto in turn, after undoing its last correction: Boyle and Dykstra, 1986.
    """
    force, corrections = requested, np.zeros((len(cuts) + 1, 3))
    for _ in range(MOST_SWEEPS):
        before = force
        for i, (g, level) in enumerate(cuts):
            wished = force + corrections[i]
            force = wished + max(0.0, level - g @ wished) / max(g @ g, 1e-30) * g
            corrections[i] = wished - force
        wished = force + corrections[-1]
        force = np.clip(wished, -limit, limit)
        corrections[-1] = wished - force
        if np.abs(force - before).max() < LEAST_CHANGE:
            break
    return force
