"""Steps of the convex-concave procedure keep what they have and save fuel; restarts agree."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.flight.cases.starts import evaluation_scenarios
from pipeline.optimum.plan import num_agreeing, solve
from pipeline.optimum.polish import NEAR_MARGIN, choose, step
from pipeline.optimum.problem import margins_along, path_of
from tests.pipeline.optimum.cases import composed, problem, random_forces

NEEDED = 70


@pytest.fixture(scope="module")
def steps():
    case = problem(1, "attitude=ideal")
    prices, forces, found = np.zeros(case.num_points), random_forces(case.num_controls, 0.05), []
    for _ in range(8):
        found.append(step(case, forces, NEEDED, prices, 6))
        forces, prices = found[-1].forces, found[-1].prices
    return case, [each for each in found if each.is_feasible]


def test_from_a_feasible_plan_fuel_never_rises(steps):
    _, feasible = steps
    assert len(feasible) >= 4
    spent = np.array([each.delta_v for each in feasible])
    assert np.all(np.diff(spent) <= 1e-7)
    assert spent[-1] < 0.98 * spent[0]


def test_every_feasible_step_meets_what_is_asked(steps):
    case, feasible = steps
    for each in feasible:
        path = path_of(case, each.forces)
        distances = np.linalg.norm(path[1:], axis=1)
        assert (margins_along(case, path).max(axis=0) >= 0.0).sum() >= NEEDED
        assert distances.min() >= 15.0 + 0.99 * NEAR_MARGIN
        assert distances.max() <= 200.0
        assert np.abs(each.forces).max() <= 1.0
        assert np.all(each.forces[np.arange(case.num_controls) % 6 != 0] == 0.0)


def test_a_wall_in_the_way_is_kept_out_of():
    deputy = replace(problem(0).mission.deputy, min_distance_m=60.0)
    case = problem(0, "attitude=ideal")
    case = replace(case, mission=replace(case.mission, deputy=deputy))
    forces = np.zeros((case.num_controls, 3))
    assert np.linalg.norm(path_of(case, forces), axis=1).min() < 60.0
    prices = np.zeros(case.num_points)
    for _ in range(8):
        done = step(case, forces, 40, prices, 6)
        forces, prices = done.forces, done.prices
    assert done.is_feasible
    assert np.linalg.norm(path_of(case, forces)[1:], axis=1).min() >= 60.0


def test_of_more_points_than_needed_the_costly_go():
    best, prices = np.array([1.0, 0.0, 2.0, 0.5, -1.0]), np.array([0.0, 3.0, 0.0, 1.0, 0.0])
    assert choose(best, 2, prices).tolist() == [2, 0]
    assert choose(best, 3, prices).tolist() == [2, 0, 3]
    assert choose(best, 5, prices).tolist() == [2, 0, 3, 1, 4]


def test_restarts_agree_within_a_thousandth():
    assert num_agreeing(np.array([0.2, 0.2009, 0.1999, 0.21])) == 3
    assert num_agreeing(np.array([np.inf, np.inf])) == 0


@pytest.mark.slow
def test_easy_cases_end_after_the_least_restarts_and_cost_no_less_than_the_bound(monkeypatch):
    monkeypatch.setattr("pipeline.optimum.plan.LEAST_RESTARTS", 3)
    run = composed("optimum.points=60", "optimum.kicks=1")
    experiment = run.experiment
    scenario = evaluation_scenarios(experiment.monte_carlo, experiment.sun, experiment.seed)[1]
    plan = solve(experiment.mission, scenario, experiment.optimum, np.random.SeedSequence(5))
    assert plan.flight.is_feasible(60)
    assert len(plan.restart_delta_v) == 3
    assert np.all(np.diff(plan.restart_delta_v) >= 0)
    assert plan.bound <= plan.flight.delta_v <= plan.restart_delta_v[0] + 1e-3
