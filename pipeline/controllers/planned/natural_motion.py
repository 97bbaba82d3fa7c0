"""Natural-motion circumnavigation: one burn at the start, then free motion.

The burn closes the ellipse: its component along j gives the centre zero height, ``x_c = 0``, so that nothing
drifts (Clohessy and Wiltshire, J. Aerospace Sci. 27, 1960). The component along i sets the ellipse's size and
its place along the track, the one along k its cross-track amplitude; both are searched: on a grid, then
around its best burn with decreasing steps. The result is the burn of least delta-v of those after which the
deputy goes around the chief, stays within the limits for a whole revolution, and is predicted to inspect a
number of points; if there is none, the one that inspects most.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.three import three_of
from fis_tools.compiled.vectors import borrowed
from pipeline.array_types import Floats
from pipeline.controllers.planned.paths import CENTRE_RADIAL, check_circle, elements_matrix
from pipeline.flight.cases.starts import starts_of
from pipeline.flight.control.controller import Controller, PlanningController
from pipeline.flight.fly.workspace import make_workspace, optics_in_use
from pipeline.flight.period.look.optics import beam_of_case, strike_out_seen, want_all
from pipeline.flight.state.arrays import FullOptics, Workspace, World
from pipeline.flight.state.log import Scenario
from pipeline.flight.world.pack import pack_world
from pipeline.physics.motion import free_path
from pipeline.settings.controllers import NaturalMotion
from pipeline.settings.experiment import Mission, SettingError

#: on the grid only every third sample is evaluated
STRIDE = 3
#: number of times that the steps around the best burn are halved
HALVINGS = 5


def controller(settings: NaturalMotion, mission: Mission) -> Controller:
    """Return the controller of this kind for a mission."""
    return PlanningController("natural_motion", NaturalMotionPlanner(settings, mission))


class NaturalMotionPlanner:
    """Plans the burn for each start of a mission."""

    decisions = (0,)

    def __init__(self, settings: NaturalMotion, mission: Mission) -> None:
        self.settings = settings
        if (refusal := mission.refusal_of_plans("paths of natural motion")) is not None:
            raise SettingError(refusal)
        check_circle("the path of natural_motion", "choose another controller", mission)
        self.world = pack_world(mission)
        deputy = mission.deputy
        self.limits = deputy.min_distance_m + settings.margin_m, deputy.max_distance_m - settings.margin_m
        self.max_force = deputy.max_force_n
        self.delta_v_per_force = mission.control_period_s / deputy.mass_kg
        revolution = 2.0 * math.pi / (self.world.mean_motion * mission.control_period_s)
        self.num_samples = max(self.world.num_controls, math.ceil(revolution)) + 1
        # a path is linear in the burn: these are the effects of 1 N along i and along k, with the closing
        # burn
        self.directions = np.stack([self._closed_direction(axis) for axis in (0, 2)])
        zero_state = np.zeros(6)
        path_at_rest = self._path(zero_state, zero_state)
        state_changes = self.directions @ self.world.motion.control[0].T
        self.changes = np.stack([self._path(zero_state, state) - path_at_rest for state in state_changes])

    def __call__(self, scenario: Scenario, decision: int, state: Floats) -> Floats:
        """Return the force of the first period, shape (1, 3), N, Hill axes; see `Planner`."""
        coasted = free_path(self.world.motion, state, 2)[1]
        closing_force = self._closing(coasted)
        base = self._path(state, coasted + self.world.motion.control[0] @ closing_force)
        step = self.settings.step_m_s / self.delta_v_per_force
        reach = min(self.settings.reach_m_s / self.delta_v_per_force, self.max_force)
        grid = np.arange(-math.floor(reach / step), math.floor(reach / step) + 1) * step
        candidates = np.array([(along, normal) for along in grid for normal in grid])
        best = self._best(scenario, candidates, closing_force, base, STRIDE)
        neighbours = np.array([(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1)], dtype=np.float64)
        for _ in range(HALVINGS):
            step /= 2.0
            best = self._best(scenario, best + step * neighbours, closing_force, base, 1)
        force = np.clip(closing_force + best @ self.directions, -self.max_force, self.max_force)
        return force.reshape(1, 3)

    def _closing(self, start: Floats) -> Floats:
        """Return the force along j that puts the ellipse's centre at zero radial offset, so it stays."""
        row = elements_matrix(self.world.mean_motion)[CENTRE_RADIAL]
        return np.array([0.0, -(row @ start) / (row @ self.world.motion.control[0, :, 1]), 0.0])

    def _closed_direction(self, axis: int) -> Floats:
        """Return 1 N along an axis, plus the force along j that keeps the ellipse closed."""
        direction = np.zeros(3)
        direction[axis] = 1.0
        row = elements_matrix(self.world.mean_motion)[CENTRE_RADIAL] @ self.world.motion.control[0]
        direction[1] = -row[axis] / row[1]
        return direction

    def _path(self, first: Floats, second: Floats) -> Floats:
        """Return the states of a path, (num_samples, 6): the first, then free motion from the second."""
        rest = free_path(self.world.motion, second, self.num_samples - 1)
        return np.concatenate([first[np.newaxis], rest])

    def _best(
        self, scenario: Scenario, candidates: Floats, closing_force: Floats, base: Floats, stride: int
    ) -> Floats:
        """Return the best of candidate burns, (n, 2), N along i and k, as shape (2,)."""
        forces = closing_force + candidates @ self.directions
        # flat: rows of three numbers take numpy many times as long
        along, normal = (change[::stride, :3].reshape(1, -1) for change in self.changes)
        paths = base[::stride, :3].ravel() + (candidates[:, :1] * along + candidates[:, 1:] * normal)
        paths = paths.reshape(len(candidates), -1, 3)
        after = base[stride] + np.einsum("nb,bs->ns", candidates, self.changes[:, stride])
        outside = self._outside(paths[:, 1:], after)
        outside += 1e3 * np.maximum(0.0, np.abs(forces).max(axis=1) - self.max_force)
        spent = np.abs(forces).sum(axis=1)
        order = np.lexsort((spent, outside))
        order = order[outside[order] <= outside[order[0]]]
        flown = paths[order, : self.world.num_controls // stride + 1]
        counts = np.minimum(count_seen(self.world, scenario, flown, stride), self.settings.points)
        return candidates[order[np.lexsort((spent[order], -counts))[0]]]

    def _outside(self, paths: Floats, states: Floats) -> Floats:
        """Return by how many metres paths leave the limits, or their final ellipses miss the chief, (n,)."""
        squares = paths * paths
        distances = squares[:, :, 0] + squares[:, :, 1] + squares[:, :, 2]
        nearest, farthest = np.sqrt(distances.min(axis=1)), np.sqrt(distances.max(axis=1))
        elements = states @ elements_matrix(self.world.mean_motion).T
        _, centre_along_track, ring_radial, ring_along_track, _, _ = elements.T
        miss = np.abs(centre_along_track) - 2.0 * np.hypot(ring_radial, ring_along_track)
        short = np.maximum(self.limits[0] - nearest, 0.0) + np.maximum(farthest - self.limits[1], 0.0)
        return short + np.maximum(miss, 0.0)


def count_seen(world: World, scenario: Scenario, paths: Floats, stride: int = 1) -> NDArray[np.int64]:
    """Return the number of points that are lit and in view at some sample of each path, without a flight.

    The camera is taken to look at the chief's centre.

    Parameters
    ----------
    world : World
        Of the mission.
    scenario : Scenario
        Gives the Sun's direction.
    paths : (n, samples, 3)
        Positions, m, Hill axes.
    stride : int
        Control periods between two positions.

    Returns
    -------
    (n,) array of int
    """
    starts = starts_of([scenario])
    counts = np.zeros(len(paths), dtype=np.int64)
    optics = optics_in_use(world, starts.sun_elevation)
    workspace = make_workspace(world)
    note_seen_along(world, optics, workspace, starts, np.ascontiguousarray(paths), stride, counts)
    return counts


@compiled(nogil=True, error_model="numpy")
def note_seen_along(
    world: World,
    optics: FullOptics | None,
    work: Workspace,
    cases: Any,
    paths: Floats,
    stride: int,
    counts: NDArray[np.int64],
) -> None:
    """Write the number of points that a camera aimed at the chief inspects along paths, (n, samples, 3), m.

    Places are `stride` control periods apart, from the first case's start on.
    """
    world, work, cases, paths, counts = borrowed((world, work, cases, paths, counts))
    for path in range(len(paths)):
        want_all(world, work.ahead)
        for column in range(paths.shape[1]):
            k = column * stride
            beam = beam_of_case(world, optics, cases[0], k)
            at = three_of(paths[path, column])
            counts[path] += strike_out_seen(
                world, optics, work.ahead, work.lit, work.seen, world.points, beam, at
            )
