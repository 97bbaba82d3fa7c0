"""The linear programs: least fuel where it is known, arrival on the ring, and the limits on the way."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.controllers.planned.paths import elements_matrix
from pipeline.controllers.source import load
from pipeline.flight.control.controller import PlanningController
from pipeline.flight.fly.simulation import fly_all, fly_logged
from pipeline.flight.state.log import Scenario
from pipeline.stages.compare import remembering
from tests.pipeline.controllers.planned import cases
from tests.pipeline.controllers.planned.cases import MEAN_MOTION, flown

MISSION, STARTS = cases.starts("receding_horizon", "sun=random")


@pytest.fixture(scope="module")
def plans():
    plan_for = cases.planner("receding_horizon", "sun=random")
    return plan_for, [cases.planned_ahead(plan_for, start) for start in STARTS]


def ring_of(settings, start, k):
    """The elements of the ring at a sample: centre, phase to the Sun, height."""
    return elements_matrix(MEAN_MOTION) @ cases.ring(settings, start, k)


@pytest.mark.slow
def test_a_single_burn_is_found_where_it_is_the_least(plans):
    # to change the swing along k, a burn of size d at one time gives d/n in one direction; no sum of
    # several, that point in other directions, gives as much for less
    plan_for = cases.planner("receding_horizon", height_tolerance_m=1e-6, centre_tolerance_m=1e-3)
    length, horizon = plan_for.lengths[0], plan_for.horizons[0]
    state = np.array([80.0, 0.0, 5.0, 0.0, -2.0 * MEAN_MOTION * 80.0, 0.0])
    for index, force in ((0, 0.05), (len(horizon.periods) // 2, -0.08)):
        forces = np.zeros((length, 3))
        forces[horizon.periods[index], 2] = force
        start = Scenario(state[:3], state[3:], 0.0)
        end = flown(start, forces, length + 1)[-1]
        solved = plan_for.solve(horizon, state, elements_matrix(MEAN_MOTION) @ end)
        expected = np.zeros_like(solved)
        expected[index, 2] = force
        np.testing.assert_allclose(solved, expected, atol=1e-6)


def test_no_force_where_free_motion_is_enough(plans):
    plan_for, _ = plans
    start = STARTS[0]
    settings = replace(plan_for.settings, max_height_m=0.0)
    state = cases.ring(settings, start, 0)
    on_ring = replace(start, position_m=state[:3], velocity_m_s=state[3:])
    assert not cases.planned_ahead(plan_for, on_ring).any()


def test_a_solution_ends_on_the_ring_unless_the_limits_forbid(plans):
    plan_for, _ = plans
    num_there = 0
    settings, horizon = plan_for.settings, plan_for.horizons[0]
    length = len(horizon.path)
    for start in STARTS:
        wanted = ring_of(settings, start, length)
        forces = np.zeros((length, 3))
        forces[horizon.periods] = plan_for.solve(horizon, np.r_[start.position_m, 0.0, 0.0, 0.0], wanted)
        states = flown(start, forces, length + 1)
        off = np.abs(elements_matrix(MEAN_MOTION) @ states[-1] - wanted)
        distances = np.linalg.norm(states[1:, :3], axis=1)
        if (off <= plan_for.tolerances + 1e-6).all():
            num_there += 1
            # of least fuel: nothing is spent on the middle of the tolerances
            assert np.isclose(off, plan_for.tolerances, atol=1e-5).sum() >= 3
        else:
            assert distances.min() < plan_for.limits[0] + 1.0 or distances.max() > 190.0
    assert num_there >= 6


def test_it_comes_to_the_ring_and_stays(plans):
    plan_for, made = plans
    settings = plan_for.settings
    for start, plan in zip(STARTS, made, strict=True):
        assert np.abs(plan).max() <= 1.0
        elements = flown(start, plan) @ elements_matrix(MEAN_MOTION).T
        for k in (200, 300, 360):
            off = np.abs(elements[k] - ring_of(settings, start, k))
            assert off.max() < 25.0


@pytest.mark.slow
def test_it_keeps_the_limits_where_the_way_leads_past_them():
    plan_for = cases.planner("receding_horizon", "sun=random", "monte_carlo.num_cases=30")
    _, many = cases.starts("receding_horizon", "sun=random", "monte_carlo.num_cases=30")
    crossing = [
        s for s in many if np.cos(np.arctan2(s.position_m[1] / 2, s.position_m[0]) - s.sun_angle_rad) < -0.5
    ]
    assert len(crossing) > 4
    nearest = []
    for start in crossing:
        distances = np.linalg.norm(flown(start, cases.planned_ahead(plan_for, start))[:, :3], axis=1)
        nearest.append(distances.min())
        assert 15.0 <= distances.min() < distances.max() <= 200.0
    assert min(nearest) < 30.0


def test_it_burns_less_than_the_regulator(plans):
    regulator = load(cases.composed("lqr", "sun=random").experiment.controller, MISSION)
    regulated = fly_all(MISSION, regulator, STARTS, 1).delta_v_m_s
    spent = np.array([np.abs(plan).sum() * cases.PERIOD / cases.MASS for plan in plans[1]])
    assert spent.mean() < 0.9 * regulated.mean()
    assert max(spent.max(), regulated.max()) < 2.0


@pytest.mark.slow
def test_under_several_layers_what_is_known_alike_is_planned_once() -> None:
    experiment = cases.composed("receding_horizon", "sun=random").experiment
    alone = load(experiment.controller, experiment.mission)
    assert isinstance(alone, PlanningController)
    requests = []

    class Counting:
        decisions = alone.planner.decisions[:4]

        def __call__(self, scenario, decision, state):
            requests.append((decision, tuple(state)))
            return alone.planner(scenario, decision, state)

    both = remembering(replace(alone, planner=Counting()))
    guard = replace(experiment.mission.safety, kind="filter")
    guarded = replace(experiment.mission, safety=guard)
    flown_twice = [fly_all(mission, both, STARTS[:2], 1) for mission in (experiment.mission, guarded)]
    assert len(requests) == len(set(requests))
    assert 2 * len(Counting.decisions) <= len(requests) < 4 * len(Counting.decisions)
    again = replace(alone, planner=Counting())
    for mission, flights in zip((experiment.mission, guarded), flown_twice, strict=True):
        expected = fly_all(mission, again, STARTS[:2], 1)
        np.testing.assert_array_equal(flights.delta_v_m_s, expected.delta_v_m_s)
        np.testing.assert_array_equal(flights.inspected_count, expected.inspected_count)


def test_what_is_planned_from_is_where_the_safety_layer_has_led() -> None:
    """In vectors with room for more flights than are flown, too: copies there are not guarded."""
    experiment = cases.composed("receding_horizon", "sun=random").experiment
    planned_from = {}

    class Diving:
        decisions = (0, 12, 24)

        def __call__(self, scenario, decision, state):
            planned_from[decision] = state
            return -0.5 * np.tile(state[:3] / np.linalg.norm(state[:3]), (12, 1))

    guard = replace(experiment.mission.safety, kind="filter")
    guarded = replace(experiment.mission, safety=guard, duration_s=600.0)
    diving = replace(load(experiment.controller, experiment.mission), planner=Diving())
    log = fly_logged(guarded, diving, STARTS[0])
    assert np.any(log.safety_force_hill_n[12:24])
    for decision, state in planned_from.items():
        np.testing.assert_array_equal(
            state, np.hstack((log.position_m[decision], log.velocity_m_s[decision]))
        )


def test_where_no_solution_is_found_nothing_is_fired(plans):
    plan_for, _ = plans
    assert plan_for._least(np.ones((2, 3)), np.array([-1.0, np.nan])).tolist() == [0.0, 0.0, 0.0]
