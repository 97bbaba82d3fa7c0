"""A case as linear algebra agrees with the simulator."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.flight.cases.starts import evaluation_scenarios
from pipeline.optimum.plan import solve
from pipeline.optimum.polish import _rows
from pipeline.optimum.problem import flown, margins_along, path_of, seen_as
from pipeline.optimum.search import NEVER, PLANS, PRICE_OF_DISTANCE, PRICE_OF_HEIGHT, price_burns
from tests.pipeline.optimum.cases import composed, problem, random_forces


@pytest.mark.parametrize("tumbling", [(), ("chief=tumbling",)])
def test_paths_are_those_of_the_simulator(tumbling):
    case = problem(0, *tumbling)
    forces = random_forces(case.num_controls, 0.1)
    log = flown(case, forces)
    assert np.abs(path_of(case, forces) - log.position_m).max() < 1e-8
    assert np.abs(forces).sum() * case.delta_v_per_force == pytest.approx(log.delta_v_m_s[-1], rel=1e-12)


#: a Sun out of the plane, the Earth's shadow, a camera of little sight
STRICT = (
    "attitude=ideal",
    "sun=random",
    "sun.elevation_range_deg=[-40,40]",
    "light=shadow",
    "sensor.max_incidence_deg=70",
    "sensor.max_range_m=100",
    "sensor.min_sun_angle_deg=20",
)


@pytest.mark.parametrize("chief", ["sphere", pytest.param("mesh", marks=pytest.mark.slow)])
def test_margins_are_the_sight_of_a_flight_in_a_strict_world(chief):
    case = problem(1, *STRICT, f"chief.shape={chief}")
    log = flown(case, random_forces(case.num_controls, 0.05, 2))
    seen = margins_along(seen_as(case, log), log.position_m).max(axis=0) >= 0.0
    assert seen.sum() > 10
    # from so near that the camera does not hold all of the chief a flight may see more
    assert np.all(log.is_inspected[-1][seen])
    assert log.is_inspected[-1].sum() <= seen.sum() + 3
    assert case.is_lit.any(axis=0).sum() == log.is_inspectable.sum()


@pytest.mark.slow
def test_a_plan_for_a_strict_world_holds_in_flight():
    """Its demands are met by tangents, the flight judges by what they are tangents of."""
    run = composed(*STRICT, "optimum.points=30", "optimum.restarts=2", "optimum.kicks=0", "optimum.burns=2")
    experiment = run.experiment
    (_, scenario) = evaluation_scenarios(experiment.monte_carlo, experiment.sun, experiment.seed)
    plan = solve(experiment.mission, scenario, experiment.optimum, np.random.SeedSequence(5))
    assert plan.flight.is_feasible(30)
    assert 0.0 <= plan.bound <= plan.flight.delta_v < 0.5


@pytest.mark.parametrize("attitude", ["ideal", "flown"])
@pytest.mark.parametrize("seed", range(3))
def test_what_has_a_margin_is_inspected(attitude, seed):
    case = problem(1, f"attitude={attitude}", "sun=random")
    log = flown(case, random_forces(case.num_controls, 0.05, seed))
    seen = margins_along(seen_as(case, log), log.position_m).max(axis=0) >= 1e-6
    assert seen.sum() > 30
    assert np.all(log.is_inspected[-1][seen])


def test_far_away_and_pointing_well_no_other_point_is_inspected():
    case = problem(1, "attitude=ideal")
    log = flown(case, np.zeros((0, 3)))
    assert np.linalg.norm(log.position_m, axis=1).min() > case.sight.max()
    seen = margins_along(case, log.position_m).max(axis=0) >= 0.0
    assert np.array_equal(seen, log.is_inspected[-1])


def test_a_tumbling_chief_turns_its_points():
    case = problem(0, "attitude=ideal", "chief=tumbling")
    log = flown(case, np.zeros((0, 3)))
    seen = margins_along(case, log.position_m).max(axis=0) >= 0.0
    assert 0 < seen.sum() <= log.is_inspected[-1].sum()
    assert np.all(log.is_inspected[-1][seen])


def test_a_camera_that_looks_away_sees_nothing():
    case = problem(0, "attitude=flown")
    assert np.isinf(case.sight[0])
    assert np.isfinite(case.sight[30:]).all()
    assert margins_along(case, case.free)[0].max() == -np.inf


def priced(case, genes):
    """The costs of plans of two burns, one a column, with 95 points to be seen and limits of 60 and 120 m."""
    costs = np.empty(genes.shape[1])
    price_burns(
        genes,
        2,
        95,
        case.free,
        case.gain,
        case.normals,
        case.is_lit,
        case.sight,
        case.heights,
        case.points,
        case.cos_incidence,
        case.max_range,
        (60.0, 120.0),
        case.delta_v_per_force,
        costs,
    )
    return costs


@pytest.mark.parametrize("world", [(), STRICT])
def test_the_search_pays_for_what_is_spent_short_and_outside(world):
    # what blinds the camera is left to the polishing
    case = replace(problem(0, *world), most_sunward=np.inf)
    burns = np.array([[0.2, -0.1, 0.05], [0.0, 0.3, -0.2]])
    forces = np.zeros((case.num_controls, 3))
    forces[0], forces[40] = burns
    path = path_of(case, forces)
    best = np.maximum(margins_along(case, path).max(axis=0), NEVER)
    distances = np.linalg.norm(path[1:], axis=1)
    short = np.sort(np.maximum(0.0, -best))[:95].sum()
    outside = max(0.0, distances.max() - 120.0, 60.0 - distances.min())
    assert short > 0
    assert outside > 0
    spent = np.abs(burns).sum() * 10.0 / 12.0
    genes = np.array([*burns[0], *burns[1], 40.7])
    # more plans than are priced side by side: some that burn less, and later
    many = np.array([[*(genes[:6] / (1 + i)), 40.7 + 3 * i] for i in range(PLANS + 2)]).T.copy()
    costs = priced(case, many)
    expected = spent + PRICE_OF_HEIGHT * short + PRICE_OF_DISTANCE * outside
    assert costs[0] == pytest.approx(expected, rel=1e-9)
    for place in (1, PLANS - 1, PLANS, PLANS + 1):
        assert costs[place] == priced(case, many[:, place : place + 1].copy())[0] != costs[0]


def test_rows_are_the_slopes_of_what_is_demanded():
    case = problem(1)
    forces = random_forces(case.num_controls, 0.1)
    path = path_of(case, forces)
    sample, point, step = 200, 17, 1e-4
    normal, outward = case.normals[sample, :, point], path[sample] / np.linalg.norm(path[sample])
    periods = np.arange(0, case.num_controls, 7)
    rows, _ = _rows(case, [(normal, sample, 10.0), (outward, sample, 15.0)], periods)

    def height(changed):
        return case.normals[sample, :, point] @ path_of(case, changed)[sample]

    def distance(changed):
        return np.linalg.norm(path_of(case, changed)[sample])

    for place in (0, 5, 20, 28, 29, 40):
        for axis in range(3):
            change = np.zeros_like(forces)
            change[periods[place], axis] = step
            for row, quantity in zip(rows, (height, distance), strict=True):
                slope = (quantity(forces + change) - quantity(forces - change)) / (2 * step)
                assert row[3 * place + axis] == pytest.approx(slope, rel=1e-5, abs=1e-6)
