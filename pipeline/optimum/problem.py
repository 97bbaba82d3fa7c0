"""One case as linear algebra: the effect of forces on the position, and the visibility of points.

The Clohessy-Wiltshire motion is linear: the position at sample k is ``free_k + sum_i gain_(k-i) force_i``. On
a true course it is ``free_k + rows_k sum_i (sums_(i+1) - sums_i) force_i``, which leaves out the second order
of the distance, drag and sunlight: polishing takes what they do from its last flight (`flown_as`).

The paper's first condition of view, ``p . r >= d_c |p|``, is linear in the position r as well: a point is
seen from beyond its tangent plane. Its second one, the camera's cone, holds for every point above the horizon
once the deputy is at least ``d_s/sin(beta - e)`` away, where e is the camera's pointing error from the chief.
The Sun's motion is known, and so is what is lit when. A limit on incidence or range bends the tangent plane
into a cone or a sphere, of which each step takes the tangent; occlusion by a mesh, and blinding of the camera
by the Sun, are evaluated along a path.

Where a mission counts what follows its flights (`after_s`), free motion from their end is linear in the
forces, too: its positions are samples beyond the last, at which nothing is seen and both limits hold.
"""

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.three import lane_of, three_of, times
from pipeline.array_types import Floats
from pipeline.flight.cases.starts import starts_of
from pipeline.flight.control.controller import open_loop
from pipeline.flight.fly.foresight import geometry_of, lit_at_samples, sight_along
from pipeline.flight.fly.simulation import fly_logged
from pipeline.flight.state.arrays import World
from pipeline.flight.state.log import FlightLog, Scenario
from pipeline.flight.world.coasting import rows_after
from pipeline.flight.world.pack import pack_world
from pipeline.physics.illumination import sun_angle, sun_direction_h
from pipeline.physics.motion import free_path, repeated
from pipeline.physics.quaternion import seen_from_hill
from pipeline.physics.sight import Occlusion, cell_of
from pipeline.settings.experiment import Mission, SettingError


@compiled(nogil=True, error_model="numpy")
def note_free_along(
    occlusion: Occlusion, axes: Floats, path: Floats, points: Floats, is_granted: NDArray[np.bool_]
) -> None:
    """Clear `is_granted`, (K+1, P), for points that the body hides from the positions of a path.

    The path has the shape (K+1, 3), points (K+1, 3, P), m, and axes (K+1 or 1, 3, 3), from the path's to the
    body's.
    """
    for k in range(len(path)):
        turn = axes[k if len(axes) > 1 else 0]
        for j in range(points.shape[2]):
            if is_granted[k, j]:
                to_path = three_of(path[k]) - lane_of(points[k], 0, j)
                cell = cell_of(occlusion.edge, times(turn, to_path))
                is_granted[k, j] = occlusion.is_free[cell, j] > 0


@dataclass(frozen=True)
class PlanningProblem:
    """A case: K control periods, P points.

    Parameters
    ----------
    mission, scenario
        The source of the data.
    free : (K+1, 3)
        Positions without force, m, Hill axes.
    gain : (K+1, 3, 3)
        Effect of 1 N held over a period on the position m samples after its start, m/N.
    points, normals : (K+1, 3, P)
        m, and unit vectors out of the surface there, Hill axes.
    heights : (P,)
        Of the points' tangent planes over the chief's centre, m.
    radius : float
        Of the sphere that contains all points, m.
    cos_incidence, max_range : float
        Of the incidence limit; the range limit, m, infinite for none.
    most_sunward : float
        Cosine between boresight and Sun beyond which the camera is blinded.
    suns : (K+1, 3)
        Unit vectors towards the Sun, Hill axes.
    occlusion, chief_axes : Occlusion, (K+1, 3, 3)
        Occlusion by parts of the chief, and its axes.
    is_lit : (K+1, P) bool
    sight : (K+1,)
        Distance from which the camera covers everything above the horizon, m; infinite if it points
        away.
    delta_v_per_force : float
        m/s for 1 N held over a period.
    rows, sums : (K+1, 3, 6), (K+1, 6, 3)
        On a true course in place of the gain, as of an `Outlook`; elsewhere empty.
    free_after, gain_after : (J, 3), (J, 3, K, 3)
        Positions after the end without force, m, and the effect of 1 N held over each period on them, m/N;
        empty unless the mission counts what follows its flights.
    """

    mission: Mission
    scenario: Scenario
    free: Floats
    gain: Floats
    points: Floats
    normals: Floats
    heights: Floats
    radius: float
    cos_incidence: float
    max_range: float
    most_sunward: float
    suns: Floats
    occlusion: Occlusion
    chief_axes: Floats
    is_lit: NDArray[np.bool_]
    sight: Floats
    delta_v_per_force: float
    rows: Floats = field(default_factory=lambda: np.zeros((0, 3, 6)))
    sums: Floats = field(default_factory=lambda: np.zeros((0, 6, 3)))
    free_after: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    gain_after: Floats = field(default_factory=lambda: np.zeros((0, 3, 0, 3)))

    @property
    def num_controls(self) -> int:
        """Number of control periods, K."""
        return len(self.free) - 1

    @property
    def num_points(self) -> int:
        """Number of points on the chief, P."""
        return int(self.normals.shape[2])

    @property
    def is_flat(self) -> bool:
        """Whether a point is seen from everywhere beyond a plane, with no limit on incidence or range."""
        return self.cos_incidence == 0.0 and self.max_range == np.inf

    @property
    def is_on_course(self) -> bool:
        """Whether motion follows the chief's true course."""
        return len(self.rows) > 0

    @cached_property
    def kicks(self) -> Floats:
        """On a true course, what 1 N held over each period adds to the constants of motion, (K, 6, 3)."""
        return np.asarray(np.diff(self.sums, axis=0))

    def effects_on(self, k: int) -> Floats:
        """Return the effect of 1 N held over each period before sample k on the position then, (k, 3, 3)."""
        return np.asarray(self.rows[k] @ self.kicks[:k] if self.is_on_course else self.gain[k:0:-1])


def check_light(mission: Mission) -> None:
    """Raise SettingError for a mission with light, a camera or limits that plans do not know.

    Raises
    ------
    SettingError
    """
    if mission.light.reflection != "none":
        raise SettingError(
            f"light.reflection is {mission.light.reflection}, which plans of least fuel do not know of; set "
            "light.reflection=none for them"
        )
    if (refusal := mission.refusal_of_plans("plans of least fuel")) is not None:
        raise SettingError(refusal)


def problem_of(mission: Mission, scenario: Scenario) -> PlanningProblem:
    """Build the planning problem of a case; the camera points as it does in a flight without force.

    Raises
    ------
    SettingError
        See `check_light`.
    """
    check_light(mission)
    world = pack_world(mission)
    num_controls, geometry = world.num_controls, geometry_of(mission, world)
    start = np.r_[scenario.position_m, scenario.velocity_m_s]
    if len(geometry.rows) > 0:
        free = geometry.rows @ (geometry.back[0] @ start)
        sun = sun_direction_h(scenario.sun_angle_rad, scenario.sun_elevation_rad)
        suns = world.transitions.suns[: num_controls + 1] @ sun
    else:
        free = free_path(world.motion, start, num_controls + 1)[:, :3].copy()
        times = np.arange(num_controls + 1) * world.control_period
        angles = [sun_angle(scenario.sun_angle_rad, world.mean_motion, time) for time in times.tolist()]
        suns = np.array([sun_direction_h(angle, scenario.sun_elevation_rad) for angle in angles])
    problem = PlanningProblem(
        mission=mission,
        scenario=scenario,
        free=free,
        gain=geometry.gain,
        points=geometry.points,
        normals=geometry.normals,
        heights=geometry.heights,
        radius=geometry.radius,
        cos_incidence=geometry.cos_incidence,
        max_range=geometry.max_range,
        most_sunward=world.optics.most_sunward,
        suns=suns,
        occlusion=world.occlusion,
        chief_axes=world.chief_axes,
        is_lit=lit_at_samples(world, starts_of([scenario])),
        sight=np.zeros(num_controls + 1),
        delta_v_per_force=world.delta_v_per_force,
        rows=np.ascontiguousarray(geometry.rows),  # as code for it comes compiled
        sums=geometry.sums,
    )
    if mission.after_s > 0.0:
        problem = followed(problem, world)
    return seen_as(problem, flown(problem, np.zeros((0, 3))))


def followed(problem: PlanningProblem, world: World) -> PlanningProblem:
    """Return the problem with what follows the end, at the instants at which a flight looks at it."""
    mission, scenario, num_controls = problem.mission, problem.scenario, problem.num_controls
    rows = rows_after(mission, mission.after_s)
    start = np.r_[scenario.position_m, scenario.velocity_m_s]
    if problem.is_on_course:
        onward, back = world.transitions.onward[num_controls], world.transitions.back[0]
        end, effects = onward @ back @ start, np.einsum("qr,kra->qka", onward, problem.kicks)
    else:
        motion = repeated(world.motion, num_controls)
        end, effects = motion.transition[-1] @ start, motion.control[::-1].transpose(1, 0, 2)
    return replace(
        problem,
        free_after=rows[:, :, :6] @ end + rows[:, :, 6],
        gain_after=np.einsum("jaq,qkb->jakb", rows[:, :, :6], effects),
    )


def path_after(problem: PlanningProblem, forces: Floats) -> Floats:
    """Return the positions after the end under forces of shape (n, 3), N, as an array of shape (J, 3), m."""
    if not len(problem.free_after):
        return problem.free_after
    return problem.free_after + np.einsum("jakb,kb->ja", problem.gain_after[:, :, : len(forces)], forces)


def flown_after(problem: PlanningProblem, log: FlightLog) -> Floats:
    """Return where free motion leads from the end of a flight, (J, 3), m, as the flight has it."""
    rows = rows_after(problem.mission, problem.mission.after_s)
    return np.asarray(rows[:, :, :6] @ np.r_[log.position_m[-1], log.velocity_m_s[-1]] + rows[:, :, 6])


def path_of(problem: PlanningProblem, forces: Floats) -> Floats:
    """Return the positions under forces of shape (K, 3), N, as an array of shape (K+1, 3), m."""
    if problem.is_on_course:
        held = np.zeros((problem.num_controls, 3))
        held[: len(forces)] = forces
        added = np.cumsum(np.einsum("kqa,ka->kq", problem.kicks, held), axis=0)
        constants = np.concatenate([np.zeros((1, 6)), added])
        return np.asarray(problem.free + np.einsum("kaq,kq->ka", problem.rows, constants))
    path = problem.free.copy()
    for i in np.flatnonzero(np.any(forces != 0.0, axis=1)):
        path[i + 1 :] += problem.gain[1 : len(path) - i] @ forces[i]
    return path


def flown(problem: PlanningProblem, forces: Floats) -> FlightLog:
    """Fly forces by the simulator, with the mission's attitude."""
    return fly_logged(problem.mission, open_loop("plan", forces), problem.scenario)


def flown_as(problem: PlanningProblem, forces: Floats, log: FlightLog) -> PlanningProblem:
    """Return the problem as a flight of forces, (n, 3), N, had it: pointing, and on a true course the paths.

    What linear motion leaves out then moves the paths without force, so that those of the forces are flown;
    so does what it leaves out of what follows the end, everywhere.
    """
    problem = seen_as(problem, log)
    if len(problem.free_after):
        beside = flown_after(problem, log) - path_after(problem, forces)
        problem = replace(problem, free_after=problem.free_after + beside)
    if not problem.is_on_course:
        return problem
    return replace(problem, free=problem.free + (log.position_m - path_of(problem, forces)))


def seen_as(problem: PlanningProblem, log: FlightLog) -> PlanningProblem:
    """Return the problem with the camera's pointing taken from a flight."""
    axes = seen_from_hill(log.quaternion_b_from_h, np.array(problem.mission.sensor.boresight))
    radius, half_angle = problem.radius, problem.mission.sensor.narrowest_deg
    return replace(problem, sight=sight_along(log.position_m, axes, radius, half_angle))


def margins_along(problem: PlanningProblem, path: Floats) -> Floats:
    """Return the margin by which each point is seen at each sample, m: negative if unseen, -inf in the dark.

    It is the least of the height over the point's tangent plane, or over the cone of the incidence limit,
    of the margin to the range limit, and of the distance beyond `sight`.

    Returns
    -------
    (K+1, P) array
    """
    height = np.einsum("ka,kaj->kj", path, problem.normals) - problem.heights
    distance = np.linalg.norm(path, axis=1)
    least = np.minimum(height, (distance - problem.sight)[:, np.newaxis])
    if not problem.is_flat:
        apart = np.linalg.norm(path[:, :, np.newaxis] - problem.points, axis=1)
        least = np.minimum(least, height - problem.cos_incidence * apart)
        least = np.minimum(least, problem.max_range - apart)
    is_granted = problem.is_lit.copy()
    is_granted &= (-np.sum(path * problem.suns, axis=1) <= problem.most_sunward * distance)[:, np.newaxis]
    if problem.occlusion.edge:
        note_free_along(problem.occlusion, problem.chief_axes, path, problem.points, is_granted)
    return np.where(is_granted, least, -np.inf)


def sight_demands(problem: PlanningProblem, path: Floats, k: int, point: int) -> list[tuple[Floats, float]]:
    """Return the constraints ``d . r >= b`` on a position r for seeing a point, as pairs (d, b).

    First the height, or the tangent of the incidence cone; then that of the range sphere, if there is
    one. Each is tangent from outside.
    """
    normal, at = problem.normals[k, :, point], problem.points[k, :, point]
    if problem.is_flat:
        return [(normal, float(problem.heights[point]))]
    apart = path[k] - at
    towards = apart / np.linalg.norm(apart)
    steep = normal - problem.cos_incidence * towards
    demands = [(steep, float(steep @ at))]
    if problem.max_range < np.inf:
        demands.append((-towards, float(-towards @ at) - problem.max_range))
    return demands
