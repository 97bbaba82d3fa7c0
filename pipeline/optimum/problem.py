"""One case as linear algebra: where forces move the deputy, and what it must see from there.

The Clohessy-Wiltshire motion is linear: the position at sample k is ``free_k + sum_i gain_(k-i) force_i``.
The paper's first condition of view, ``p . r >= d_c |p|``, is linear in the position r as well: a point is
seen from beyond its tangent plane. Its second one, the cone of the camera, holds for every point above the
horizon once the deputy is at least ``d_s/sin(beta - e)`` away, where e is by how much the camera misses the
chief. The Sun moves by itself, so what is lit when is known.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pipeline.flight.controller import open_loop
from pipeline.flight.log import FlightLog, Scenario
from pipeline.flight.simulation import fly_logged
from pipeline.flight.world import pack_world
from pipeline.physics.illumination import sun_angle
from pipeline.physics.motion import free_path, repeated
from pipeline.physics.quaternion import dcm_b_from_h
from pipeline.physics.sight import is_lit
from pipeline.settings.experiment import Mission

Floats = NDArray[np.float64]

#: of the camera's error, that a slightly different flight may add to it
ERROR_SHARE = 0.2


@dataclass(frozen=True)
class Problem:
    """A case: K control periods, P points.

    Parameters
    ----------
    mission, scenario
        What it was made of.
    free : (K+1, 3)
        Positions without force, m, Hill axes.
    gain : (K+1, 3, 3)
        What 1 N held over a period adds to the position m samples after the period began, m/N.
    normals : (K+1, 3, P)
        Unit vectors to the points, Hill axes.
    radius : float
        Of the sphere of points, m.
    is_lit : (K+1, P) bool
    sight : (K+1,)
        Distance from which on the camera holds all that is above the horizon, m; infinite where it looks
        away.
    delta_v_per_force : float
        m/s for 1 N held over a period.
    """

    mission: Mission
    scenario: Scenario
    free: Floats
    gain: Floats
    normals: Floats
    radius: float
    is_lit: NDArray[np.bool_]
    sight: Floats
    delta_v_per_force: float

    @property
    def num_controls(self) -> int:
        """Control periods, K."""
        return len(self.free) - 1

    @property
    def num_points(self) -> int:
        """Points on the chief, P."""
        return int(self.normals.shape[2])


def problem_of(mission: Mission, scenario: Scenario) -> Problem:
    """Set up a case; the camera is supposed to point as it does in a flight without force."""
    world = pack_world(mission)
    num_controls, radius = world.num_controls, mission.chief.inspection_radius_m
    start = np.r_[scenario.position_m, scenario.velocity_m_s]
    free = free_path(world.motion, start, num_controls + 1)[:, :3].copy()
    gain = np.zeros((num_controls + 1, 3, 3))
    gain[1:] = repeated(world.motion, num_controls).control[:, :3]
    times = np.arange(num_controls + 1) * world.control_period
    angles = np.array([sun_angle(scenario.sun_angle_rad, world.mean_motion, time) for time in times])
    points = np.broadcast_to(world.points[:, :, : world.num_points], (num_controls + 1, 3, world.num_points))
    sun_x, sun_y = np.cos(angles)[:, np.newaxis], np.sin(angles)[:, np.newaxis]
    problem = Problem(
        mission=mission,
        scenario=scenario,
        free=free,
        gain=gain,
        normals=np.ascontiguousarray(points) / radius,
        radius=radius,
        is_lit=np.ascontiguousarray(is_lit(world.sight, points[:, 0], points[:, 1], sun_x, sun_y)),
        sight=np.zeros(num_controls + 1),
        delta_v_per_force=world.control_period * world.acceleration_per_force,
    )
    return seen_as(problem, flown(problem, np.zeros((0, 3))))


def path_of(problem: Problem, forces: Floats) -> Floats:
    """Return the positions that forces of shape (K, 3), N, lead through, shape (K+1, 3), m."""
    path = problem.free.copy()
    for i in np.flatnonzero(np.any(forces != 0.0, axis=1)):
        path[i + 1 :] += problem.gain[1 : len(path) - i] @ forces[i]
    return path


def flown(problem: Problem, forces: Floats) -> FlightLog:
    """Fly forces by the simulator, with the mission's attitude."""
    return fly_logged(problem.mission, open_loop("plan", forces), problem.scenario)


def seen_as(problem: Problem, log: FlightLog) -> Problem:
    """Return the problem with the camera pointing as it did in a flight."""
    boresight = np.array(problem.mission.sensor.boresight, dtype=np.float64)
    axes = np.array([dcm_b_from_h(quaternion).T @ boresight for quaternion in log.quaternion_b_from_h])
    inward = -log.position_m / np.linalg.norm(log.position_m, axis=1)[:, np.newaxis]
    error = np.arctan2(np.linalg.norm(np.cross(axes, inward), axis=1), np.sum(axes * inward, axis=1))
    left = np.radians(problem.mission.sensor.half_angle_deg) - (1.0 + ERROR_SHARE) * error
    # a camera that has less than a tenth of a degree left sees nothing to count on
    is_useful = left > np.radians(0.1)
    sight = np.where(is_useful, problem.radius / np.sin(np.where(is_useful, left, 1.0)), np.inf)
    return replace(problem, sight=sight)


def margins_along(problem: Problem, path: Floats) -> Floats:
    """Return by how much each point is seen at each sample, m: below zero it is not, -inf in the dark.

    It is the lesser of the height over the point's tangent plane and the distance beyond `sight`.

    Returns
    -------
    (K+1, P) array
    """
    height = np.einsum("ka,kaj->kj", path, problem.normals) - problem.radius
    beyond = np.linalg.norm(path, axis=1) - problem.sight
    margins: Floats = np.where(problem.is_lit, np.minimum(height, beyond[:, np.newaxis]), -np.inf)
    return margins
