"""From which starts a flight may succeed, however it pushes: a bound, known before any controller flies.

A point is seen from beyond its tangent plane, while it is lit, by a camera that has turned to the chief.
By Clohessy and Wiltshire's equations, or along the chief's true course, forces of up to F along each axis
lead by sample k at most ``F sum_i |gain_i' n|_1`` beyond where free motion leads along a normal n: full
thrust that way all the time. Where too few points come within reach like this, each by itself, no flight sees
enough of them.
"""

import math
from dataclasses import replace
from typing import Final

import numpy as np

from pipeline.array_types import Booleans, Floats
from pipeline.evaluation.statistics import Fraction, fraction
from pipeline.flight.cases.starts import starts_of
from pipeline.flight.control.controller import coast
from pipeline.flight.fly.foresight import Geometry, geometry_of, lit_at_samples
from pipeline.flight.fly.simulation import fly_logged
from pipeline.flight.fly.workspace import make_workspace
from pipeline.flight.state.log import Scenario, points_needed
from pipeline.flight.world.pack import pack_world
from pipeline.physics.quaternion import seen_from_hill
from pipeline.settings.equipment import RealActuators
from pipeline.settings.experiment import Mission
from pipeline.training.similarity import Limitation

#: control periods after which a camera has turned to the chief, at the latest
TURNED: Final = 30


def may_succeed(mission: Mission, scenarios: list[Scenario]) -> Booleans:
    """Return from which of n starts enough points come within reach of some flight, (n,).

    What navigation and thrusters err by is left out, and the camera turns as in a flight without force.
    """
    world = pack_world(mission)
    geometry, work = geometry_of(mission, world), make_workspace(world)
    reach, is_true = _most_reach(mission, geometry), len(geometry.rows) > 0
    drift = geometry.rows @ geometry.back[0] if is_true else geometry.drift
    answers = np.zeros(len(scenarios), dtype=np.bool_)
    for index, start in enumerate(scenarios):
        free = drift @ np.r_[start.position_m, start.velocity_m_s]
        is_lit = lit_at_samples(world, starts_of([start]), work)
        heights = np.einsum("ka,kaj->kj", free, geometry.normals) + reach
        is_reached = is_lit & (heights >= geometry.heights)
        needed = points_needed(int(is_lit.any(axis=0).sum()), mission.inspection_threshold_percent)
        if is_reached[TURNED:].any(axis=0).sum() < needed:  # the camera may matter
            is_reached[: _first_sight(mission, start, geometry.radius)] = False
        answers[index] = is_reached.any(axis=0).sum() >= needed
    return answers


def most_success(
    mission: Mission, scenarios: list[Scenario], goal_percent: float, confidence_percent: float
) -> tuple[Fraction, Limitation]:
    """Return the share of starts from which a flight may succeed, and whether it suffices for a goal.

    The goal is a lower bound of success, for as many flights as there are starts.
    """
    share, count = fraction(may_succeed(mission, scenarios), confidence_percent), len(scenarios)
    lows = [fraction(np.arange(count) < least, confidence_percent).low for least in range(count + 1)]
    enough = next((least for least, low in enumerate(lows) if 100.0 * low >= goal_percent), count)
    limitation = Limitation(
        "share of starts from which full thrust brings enough points into view before they go dark",
        "",
        share.fraction,
        *(enough / count, True, f"no controller can reach the goal of {goal_percent:g} %"),
    )
    return share, limitation


def _most_reach(mission: Mission, geometry: Geometry) -> Floats:
    """Return how far full thrust leads along each point's normal by each sample, (K+1, P), m."""
    deputy, normals, thrusters = mission.deputy, geometry.normals, mission.actuators
    if isinstance(thrusters, RealActuators) and thrusters.thrusters:  # along body axes, which lie anyhow
        forces = np.array(thrusters.thrusters)[:, 3:]
        along = forces[:, :3] / np.linalg.norm(forces[:, :3], axis=1, keepdims=True) * forces[:, 3:]
        greatest = np.linalg.norm(np.maximum(along.clip(0.0).sum(axis=0), (-along).clip(0.0).sum(axis=0)))
        if len(geometry.rows) > 0:
            kicks = np.diff(geometry.sums, axis=0)
            effects = [rows @ kicks[:k] for k, rows in enumerate(geometry.rows)]
            reach = greatest * np.array([np.linalg.norm(each, ord=2, axis=(1, 2)).sum() for each in effects])
        else:
            reach = greatest * np.cumsum(np.linalg.norm(geometry.gain, ord=2, axis=(1, 2)))
        return np.asarray(np.broadcast_to(reach[:, np.newaxis], (len(reach), normals.shape[2])))
    if len(geometry.rows) > 0:
        pushes = np.diff(geometry.sums, axis=0).transpose(0, 2, 1).reshape(-1, 6)
        reach = np.empty((len(normals), normals.shape[2]))
        for k, normal in enumerate(normals):
            reach[k] = np.abs(pushes[: 3 * k] @ (geometry.rows[k].T @ normal)).sum(axis=0)
        return deputy.max_force_n * reach
    if np.all(normals == normals[0]):
        pushed = np.abs(np.einsum("kba,bj->kaj", geometry.gain, normals[0])).sum(axis=1)
        return np.asarray(deputy.max_force_n * np.cumsum(pushed, axis=0))
    gains = geometry.gain.transpose(0, 2, 1).reshape(-1, 3)
    reach = np.empty((len(normals), normals.shape[2]))
    for k, normal in enumerate(normals):
        reach[k] = deputy.max_force_n * np.abs(gains[: 3 * (k + 1)] @ normal).sum(axis=0)
    return reach


def _first_sight(mission: Mission, start: Scenario, radius: float) -> int:
    """Return the first sample at which the chief is partly in the camera's view, in free motion."""
    if mission.attitude.mode == "ideal":
        return 0
    sensor = mission.sensor
    halves = sensor.rectangle_deg or (sensor.half_angle_deg,)
    widest = min(180.0, sum(halves))  # a corner is nearer than both half angles together
    periods = min(TURNED, mission.num_controls)
    log = fly_logged(replace(mission, duration_s=periods * mission.control_period_s), coast(), start)
    distance = np.linalg.norm(log.position_m, axis=1)
    boresights = seen_from_hill(log.quaternion_b_from_h, np.array(sensor.boresight))
    inward = -np.sum(boresights * log.position_m, axis=1) / distance
    apart = np.arccos(np.clip(inward, -1.0, 1.0))
    is_in_view = apart <= math.radians(widest) + np.arcsin(np.minimum(1.0, radius / distance))
    return int(is_in_view.argmax()) if is_in_view.any() else periods
