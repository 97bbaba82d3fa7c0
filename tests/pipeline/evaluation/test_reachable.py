"""The bound on what any flight can see, against linear programs over integrated motion, and flights."""

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import linprog

from pipeline.command_line.config import compose_experiment
from pipeline.controllers import source
from pipeline.evaluation.fitting import rung_scenarios
from pipeline.evaluation.reachable import _most_reach, may_succeed, most_success
from pipeline.flight.fly.foresight import geometry_of
from pipeline.flight.goals.flights import fly_all
from pipeline.flight.world.pack import pack_world

#: weak thrust, before far sides are dark
SHORT = ("+experiment=fit_mission", "attitude=ideal", "sun=random", "duration_s=1200", "fit.num_cases=24")
SHORT += ("deputy.max_force_n=0.1",)


@pytest.fixture(scope="module")
def short():
    return compose_experiment(SHORT).experiment


@pytest.mark.parametrize("chief", ["paper", "tumbling"])
def test_full_thrust_reaches_as_far_as_a_linear_program_finds(chief):
    mission = compose_experiment([*SHORT, f"chief={chief}"]).experiment.mission
    n, mass, force = mission.orbit.mean_motion_rad_s, mission.deputy.mass_kg, mission.deputy.max_force_n
    matrix = np.zeros((9, 9))
    matrix[:3, 3:6] = np.eye(3)
    matrix[3:6, :6] = np.array(
        [[3 * n**2, 0, 0, 0, 2 * n, 0], [0, 0, 0, -2 * n, 0, 0], [0, 0, -(n**2), 0, 0, 0]]
    )
    matrix[3:6, 6:] = np.eye(3) / mass
    step = expm(matrix * mission.control_period_s)
    effects, response = [], step[:6, 6:]
    for _ in range(20):
        effects.append(response[:3])
        response = step[:6, :6] @ response
    geometry = geometry_of(mission, pack_world(mission))
    reach = _most_reach(mission, geometry)
    for point in (0, 40, 98):
        rows = np.concatenate([effect.T @ geometry.normals[20, :, point] for effect in effects])
        most = -linprog(-rows, bounds=(-force, force)).fun
        assert reach[20, point] == pytest.approx(most, rel=1e-9)


def test_no_flight_succeeds_from_a_start_that_cannot(short):
    starts = rung_scenarios(short, len(short.fit.cases))
    may = may_succeed(short.mission, starts)
    assert 0 < may.sum() < len(starts)
    controller = source.named("champion_81", short.mission)
    flown = fly_all(short.mission, controller, starts, 1)
    is_success = flown.is_success(short.mission.inspection_threshold_percent) & ~flown.is_violated
    assert is_success.any()
    assert not np.any(is_success & ~may)
    share, limit = most_success(short.mission, starts, 50.0, 95.0)
    assert share.count == may.sum()
    # of 24 flights 17 must succeed, for Wilson's interval to begin above a half
    assert limit.limit == 17 / 24
    assert limit.is_kept
    assert not most_success(short.mission, starts, 85.0, 95.0)[
        1
    ].is_kept  # of 24 flights all must, to be sure
