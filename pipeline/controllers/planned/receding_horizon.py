"""The receding-horizon controller: solves repeatedly for the minimum-fuel path to a place on the ring.

Motion is linear, so is the sum of force magnitudes, and so are the distance limits after replacing them by
tangent planes where a solution would violate them. The problem is a linear program
(`pipeline.optimum.polish`) over the forces of the horizon,

``min sum |f| T/m  +  price of what is missed``, with ``|f| <= f_max``,

with the elements of free motion at the horizon's end within a tolerance of the ring's, and every sample
before inside the limits. The first horizon is long enough for a cheap transfer; later ones have the same end,
unless a shorter horizon would reach further. Only the forces before the next solution are flown. If free
motion alone meets all requirements, the solution is zero force.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.array_types import Floats
from pipeline.controllers.planned.paths import Routes, check_ring, elements_matrix, ring_elements
from pipeline.flight.control.controller import Controller, PlanningController
from pipeline.flight.state.arrays import World
from pipeline.flight.state.log import Scenario
from pipeline.flight.world.chief import predicted_motion
from pipeline.flight.world.pack import pack_world
from pipeline.optimum.polish import least_forces
from pipeline.physics.motion import repeated
from pipeline.physics.transitions import Transitions, follows_course
from pipeline.settings.controllers import RecedingHorizon
from pipeline.settings.experiment import Mission, SettingError

#: tangent planes are set where a solution comes nearer than this to a limit, m
NEAR_REACH, FAR_REACH = 30.0, 40.0
#: most times that planes are set around a solution that leaves the limits
ROUNDS = 3
#: violation of its margin from which a path gets planes, m
ROUGHNESS = 0.5


@dataclass(frozen=True)
class Horizon:
    """Effect of the forces of a horizon of H periods.

    Parameters
    ----------
    periods : (F,) int
        Periods in which a force may be fired.
    free_end : (6, 6)
        From the state now to the elements at the end, by free motion.
    end : (6, 3F)
        From forces to the elements at the end.
    free : (H, 3, 6)
        From the state now to the positions at samples 1 … H.
    path : (H, 3, 3F)
        From forces to these positions.
    """

    periods: NDArray[np.int64]
    free_end: Floats
    end: Floats
    free: Floats
    path: Floats


def horizon_of(world: World, course: Transitions, decision: int, length: int, spacing: int) -> Horizon:
    """Return a horizon of some periods from a decision on, with a force in every `spacing`-th."""
    motion = repeated(world.motion, length)
    periods = np.arange(0, length, spacing)
    free, responses = motion.transition, np.zeros((length, 6, len(periods), 3))
    for sample in range(1, length + 1):
        for column, period in enumerate(periods[periods < sample].tolist()):
            responses[sample - 1, :, column] = motion.control[sample - 1 - period]
    if follows_course(course):
        begun, onward = decision + periods, course.onward[decision + 1 : decision + length + 1]
        kicks = course.back[begun + 1] @ course.pushes[begun]
        free = onward @ course.back[decision]
        responses = np.einsum("sij,pjf->sipf", onward, kicks)
        responses *= (periods < np.arange(1, length + 1)[:, np.newaxis])[:, np.newaxis, :, np.newaxis]
    flat = responses.reshape(length, 6, -1)
    elements = elements_matrix(world.mean_motion)
    return Horizon(
        periods=periods,
        free_end=elements @ free[-1],
        end=elements @ flat[-1],
        free=free[:, :3],
        path=flat[:, :3],
    )


def controller(settings: RecedingHorizon, mission: Mission) -> Controller:
    """Return the controller of this kind for a mission."""
    return PlanningController("receding_horizon", RecedingHorizonPlanner(settings, mission))


class RecedingHorizonPlanner:
    """Solves repeatedly for the forces of a flight."""

    def __init__(self, settings: RecedingHorizon, mission: Mission) -> None:
        if (refusal := mission.refusal_of_plans("linear programs")) is not None:
            raise SettingError(refusal)
        self.settings, self.world, deputy = settings, pack_world(mission), mission.deputy
        self.max_force = deputy.max_force_n
        self.limits = deputy.min_distance_m + settings.margin_m, deputy.max_distance_m - settings.margin_m
        self.turn = self.world.mean_motion * mission.control_period_s
        self.delta_v_per_force = mission.control_period_s / deputy.mass_kg

        def periods(seconds: float) -> int:
            return max(1, round(seconds / mission.control_period_s))

        self.solution_period = periods(settings.solution_period_s)
        first, least = periods(settings.first_horizon_s), periods(settings.horizon_s)
        self.decisions = range(0, self.world.num_controls, self.solution_period)
        self.lengths = {k: max(first - k, least) for k in self.decisions}
        spacing, beyond_s = periods(settings.force_spacing_s), first * mission.control_period_s
        _, course = predicted_motion(mission, beyond_s)
        # on a circle all of a length are the same
        first_of = {length: k for k, length in reversed(self.lengths.items())}
        begins = {k: k if follows_course(course) else first_of[length] for k, length in self.lengths.items()}
        distinct = {
            k: horizon_of(self.world, course, k, self.lengths[k], spacing) for k in set(begins.values())
        }
        self.horizons = {k: distinct[begin] for k, begin in begins.items()}
        of_pairs = settings.centre_tolerance_m, settings.ring_tolerance_m, settings.height_tolerance_m
        self.tolerances = np.repeat(of_pairs, 2)
        self.routes = Routes(mission, first) if settings.follows == "route" else None
        if self.routes is None:
            check_ring(settings, mission)
        self.elements = elements_matrix(self.world.mean_motion)

    def __call__(self, scenario: Scenario, decision: int, state: Floats) -> Floats:
        """Return the forces up to the next solution, shape (rows, 3), N, Hill axes; see `Planner`."""
        length = self.lengths[decision]
        horizon = self.horizons[decision]
        solved = self.solve(horizon, state, self.wanted(scenario, decision + length))
        forces = np.zeros((self.solution_period, 3))
        is_next = horizon.periods < self.solution_period
        forces[horizon.periods[is_next]] = solved[is_next]
        return forces

    def wanted(self, scenario: Scenario, sample: int) -> Floats:
        """Return the elements of ring or route at a sample, shape (6,)."""
        if self.routes is not None:
            return np.asarray(self.elements @ self.routes(scenario).states[sample])
        return np.asarray(ring_elements(self.settings, scenario, np.array([sample * self.turn]))[0])

    def solve(self, horizon: Horizon, state: Floats, target: Floats) -> Floats:
        """Return the forces of a horizon, shape (F, 3), N, Hill axes.

        Parameters
        ----------
        horizon : Horizon
        state : (6,)
            Present state.
        target : (6,)
            Elements at the horizon's end.
        """
        error = target - horizon.free_end @ state
        free = horizon.free @ state
        if np.all(np.abs(error) <= self.tolerances) and self._is_inside(free, 0.0):
            return np.zeros((len(horizon.periods), 3))
        ends = np.concatenate([horizon.end, -horizon.end])
        limits = np.concatenate([error + self.tolerances, self.tolerances - error])
        forces = self._least(ends, limits)
        for _ in range(ROUNDS):
            path = free + horizon.path @ forces
            if self._is_inside(path, ROUGHNESS):
                break
            planes, bounds = self._planes(horizon, path, free)
            forces = self._least(np.concatenate([ends, planes]), np.concatenate([limits, bounds]))
        return forces.reshape(-1, 3)

    def _is_inside(self, path: Floats, roughness: float) -> bool:
        """Return whether a path, (n, 3), keeps the distance limits, give or take a roughness, m."""
        distances = np.linalg.norm(path, axis=1)
        return bool(
            distances.min() >= self.limits[0] - roughness and distances.max() <= self.limits[1] + roughness
        )

    def _planes(self, horizon: Horizon, path: Floats, free: Floats) -> tuple[Floats, Floats]:
        """Return the limits as rows, ``rows forces <= bounds``: tangent planes where a path is close."""
        distances = np.linalg.norm(path, axis=1)
        normals = path / np.maximum(distances, 1e-9)[:, np.newaxis]
        near = distances < self.limits[0] + NEAR_REACH
        far = distances > self.limits[1] - FAR_REACH
        heights = np.sum(normals * free, axis=1)
        rows = np.einsum("ka,kaf->kf", normals, horizon.path)
        return (
            np.concatenate([-rows[near], rows[far]]),
            np.concatenate([heights[near] - self.limits[0], self.limits[1] - heights[far]]),
        )

    def _least(self, rows: Floats, most: Floats) -> Floats:
        """Return the forces of least fuel, flat, with ``rows forces <= most`` as far as possible."""
        return least_forces(rows, most, self.delta_v_per_force, self.max_force, presolves=True).forces
