"""A case as linear algebra agrees with the simulator."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from scipy.optimize import linprog

from pipeline.evaluation.after import aftermath
from pipeline.flight.fly.prices import NEVER, PLANS, PRICE_OF_DISTANCE, PRICE_OF_HEIGHT
from pipeline.flight.reference.light import sun_direction
from pipeline.flight.world.coasting import LOOK_AFTER_S, FreeMotion
from pipeline.optimum import bound, polish
from pipeline.optimum.bound import can_cover, delta_v_bound, price_pair, sample_costs, slopes_to, unavoidable
from pipeline.optimum.plan import num_agreeing, solve
from pipeline.optimum.problem import flown, flown_as, margins_along, path_after, path_of, seen_as
from pipeline.optimum.search import priced
from pipeline.scenarios import evaluation_scenarios
from tests.pipeline.optimum.cases import TRANSFER, composed, problem, random_forces


@pytest.mark.parametrize("tumbling", [(), ("chief=tumbling",)])
def test_paths_are_those_of_the_simulator(tumbling):
    case = problem(0, *tumbling)
    forces = random_forces(case.num_controls, 0.1)
    log = flown(case, forces)
    assert np.abs(path_of(case, forces) - log.position_m).max() < 1e-8
    assert np.abs(forces).sum() * case.delta_v_per_force == pytest.approx(log.delta_v_m_s[-1], rel=1e-12)


def test_paths_beside_an_ellipse_are_those_of_the_simulator_and_a_flight_takes_the_rest():
    case = problem(0, *TRANSFER, "light=shadow", "sensor.min_sun_angle_deg=20")
    forces = random_forces(case.num_controls, 0.1)
    log = flown(case, forces)
    assert np.abs(path_of(case, forces) - log.position_m).max() < 0.02
    corrected = flown_as(case, forces, log)
    assert np.abs(path_of(corrected, forces) - log.position_m).max() < 1e-9
    suns = [sun_direction(*angles) for angles in zip(log.sun_angle_rad, log.sun_elevation_rad, strict=True)]
    np.testing.assert_allclose(case.suns, suns, rtol=0.0, atol=1e-9)
    by_circle = problem(0, *TRANSFER, "orbit.course=uniform")
    assert np.abs(path_of(by_circle, forces) - log.position_m).max() > 20.0


@pytest.mark.parametrize("words", [(), ("world=leo",), TRANSFER], ids=["circle", "low orbit", "ellipse"])
def test_what_follows_the_end_is_free_motion_from_there(words):
    case = problem(0, *words, "after_s=6000")
    forces = random_forces(case.num_controls, 0.05)
    log = flown(case, forces)
    motion = FreeMotion(case.mission, 6000.0)
    end = np.r_[log.position_m[-1], log.velocity_m_s[-1]]
    path = motion.path(case.num_controls, end[np.newaxis], 6000.0, LOOK_AFTER_S)[:, :, 0]
    # in the low orbit equations of a circle leave out what drag and oblateness do
    assert np.abs(path_after(case, forces) - path).max() < (100.0 if words == ("world=leo",) else 0.02)
    assert np.abs(path_after(flown_as(case, forces, log), forces) - path).max() < 1e-9


#: three orbits
STAYING = "after_s=18355"


@pytest.mark.slow
def test_a_plan_that_must_stay_does_and_costs_no_less():
    """Followed by what tells of every flight whether it stays."""
    few = ("optimum.restarts=2", "optimum.kicks=0", "sun=random")
    (leaves, stays), after = (planned(*few, *words) for words in ((), (STAYING,))), []
    for plan in (leaves, stays):
        assert plan.flight.is_feasible(plan.needed)
        log = flown(problem(1, *few), plan.flight.forces)
        track = np.concatenate([log.position_m, log.velocity_m_s], axis=1)
        after.append(aftermath(composed(*few).experiment.mission, track[np.newaxis]))
    assert [bool(each.stays_three_orbits[0]) for each in after] == [False, True]
    assert stays.bound == leaves.bound <= leaves.flight.delta_v <= stays.flight.delta_v


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


def planned(*overrides):
    """A plan of the second case."""
    experiment = composed(*overrides).experiment
    (_, scenario) = evaluation_scenarios(experiment)
    return solve(experiment.mission, scenario, experiment.optimum, np.random.SeedSequence(5))


@pytest.mark.slow
@pytest.mark.parametrize(("world", "points"), [(STRICT, 30), (TRANSFER, 60)], ids=["strict", "ellipse"])
def test_a_plan_holds_in_flight(world, points):
    """Its demands are met by tangents, the flight judges by what they are tangents of."""
    few = (f"optimum.points={points}", "optimum.restarts=1", "optimum.kicks=0", "optimum.burns=2")
    plan = planned(*world, *few)
    assert plan.flight.is_feasible(points)
    assert 0.0 <= plan.bound <= plan.flight.delta_v < 0.5


@pytest.mark.slow
def test_easy_cases_end_after_the_least_restarts_and_cost_no_less_than_the_bound(monkeypatch):
    monkeypatch.setattr("pipeline.optimum.plan.LEAST_RESTARTS", 3)
    plan = planned("optimum.points=60", "optimum.kicks=1")
    assert plan.flight.is_feasible(60)
    assert len(plan.restart_delta_v) == 3
    assert np.all(np.diff(plan.restart_delta_v) >= 0)
    assert plan.bound <= plan.flight.delta_v <= plan.restart_delta_v[0] + 1e-3


@pytest.mark.parametrize(
    ("seed", "world", "margin", "least"),
    [
        (0, ["attitude=ideal"], 1e-6, 30),
        (0, ["attitude=flown"], 1e-6, 30),
        (1, ["attitude=flown"], 1e-6, 30),
        (2, ["attitude=ideal", "chief=tumbling"], 1e-6, 30),
        (2, STRICT, 0.0, 10),
        pytest.param(2, [*STRICT, "chief.shape=mesh"], 0.0, 10, marks=pytest.mark.slow),
    ],
)
def test_what_has_a_margin_is_inspected(seed, world, margin, least):
    case = problem(1, "sun=random", *world)
    log = flown(case, random_forces(case.num_controls, 0.05, seed))
    seen = margins_along(seen_as(case, log), log.position_m).max(axis=0) >= margin
    assert seen.sum() > least
    assert np.all(log.is_inspected[-1][seen])
    if margin == 0.0:
        # from so near that the camera does not hold all of the chief a flight may see more
        assert log.is_inspected[-1].sum() <= seen.sum() + 3
        assert case.is_lit.any(axis=0).sum() == log.is_inspectable.sum()


def test_far_away_and_pointing_well_no_other_point_is_inspected():
    case = problem(1, "attitude=ideal")
    log = flown(case, np.zeros((0, 3)))
    assert np.linalg.norm(log.position_m, axis=1).min() > case.sight.max()
    assert np.array_equal(margins_along(case, log.position_m).max(axis=0) >= 0.0, log.is_inspected[-1])


def test_a_camera_that_looks_away_sees_nothing():
    case = problem(0, "attitude=flown")
    assert np.isinf(case.sight[0])
    assert np.isfinite(case.sight[30:]).all()
    assert margins_along(case, case.free)[0].max() == -np.inf


@pytest.mark.parametrize("world", [(), STRICT, (*TRANSFER, "attitude=ideal")])
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
    assert min(short, outside) > 0
    spent = np.abs(burns).sum() * 10.0 / 12.0
    genes = np.array([*burns[0], *burns[1], 40.7])
    # more plans than are priced side by side: some that burn less, and later
    many = np.array([[*(genes[:6] / (1 + i)), 40.7 + 3 * i] for i in range(PLANS + 2)]).T
    costs = priced(case, many, 2, 95, (60.0, 120.0))
    expected = spent + PRICE_OF_HEIGHT * short + PRICE_OF_DISTANCE * outside
    assert costs[0] == pytest.approx(expected, rel=1e-9)
    for column in (1, PLANS - 1, PLANS, PLANS + 1):
        assert costs[column] == priced(case, many[:, [column]], 2, 95, (60.0, 120.0))[0] != costs[0]


@pytest.mark.parametrize("world", [(), TRANSFER])
def test_rows_are_the_slopes_of_what_is_demanded(world):
    case = problem(1, *world)
    forces = random_forces(case.num_controls, 0.1)
    path = path_of(case, forces)
    sample, point, step = 200, 17, 1e-4
    normal, outward = case.normals[sample, :, point], path[sample] / np.linalg.norm(path[sample])
    periods = np.arange(0, case.num_controls, 7)
    rows, _ = polish._rows(case, [(normal, sample, 10.0), (outward, sample, 15.0)], periods)

    quantities = (lambda path: normal @ path[sample], lambda path: np.linalg.norm(path[sample]))
    for index in (0, 5, 20, 28, 29, 40):
        for axis in range(3):
            change = np.zeros_like(forces)
            change[periods[index], axis] = step
            ends = [path_of(case, forces + sign * change) for sign in (1.0, -1.0)]
            for row, quantity in zip(rows, quantities, strict=True):
                slope = (quantity(ends[0]) - quantity(ends[1])) / (2 * step)
                assert row[3 * index + axis] == pytest.approx(slope, rel=1e-5, abs=1e-6)


SHORT = "duration_s=400.0"


def least_by_linear_program(case, demands) -> float:
    """Return what several (point, sample) demands take, m/s, limits aside."""
    rows, missing = [], []
    for point, k in demands:
        normal = case.normals[k, :, point]
        slopes = np.zeros((case.num_controls, 3))
        slopes[:k] = normal @ case.effects_on(k)
        rows.append(np.r_[-slopes.ravel(), slopes.ravel()])
        missing.append(normal @ case.free[k] - case.radius)
    solved = linprog(np.full(len(rows[0]), case.delta_v_per_force), A_ub=np.array(rows), b_ub=missing)
    return solved.fun if solved.status == 0 else np.inf


@pytest.mark.parametrize("world", [(), TRANSFER])
def test_one_point_takes_what_the_linear_program_says_and_those_never_lit_cannot_be_seen(world):
    case = problem(0, SHORT, *world)
    costs = sample_costs(case).min(axis=0)
    ever = case.is_lit.any(axis=0)
    assert np.array_equal(np.isinf(costs), ~ever)
    hardest = int(np.where(ever, costs, -1.0).argmax())
    lit = np.flatnonzero(case.is_lit[1:, hardest]) + 1
    least = min(least_by_linear_program(case, [(hardest, int(k))]) for k in lit)
    assert least > 0
    assert costs[hardest] == pytest.approx(least, rel=1e-7)
    assert np.isfinite(delta_v_bound(case, int(ever.sum())))
    assert np.isinf(delta_v_bound(case, int(ever.sum()) + 1))


@pytest.mark.slow
@pytest.mark.parametrize("world", [(), TRANSFER])
def test_a_pair_takes_no_more_than_the_linear_program_says_and_nearly_as_much(world):
    case = problem(1, "duration_s=160.0", *world)
    costs = sample_costs(case)
    finite = np.where(np.isinf(costs.min(axis=0)), -1.0, costs.min(axis=0))
    first = int(finite.argmax())
    # the other as far round as there is one that is lit and unseen
    second = int(np.where(finite > 0.0, case.normals[0, :, first] @ case.normals[0], 2.0).argmin())
    missing = (case.radius - np.einsum("ka,kaj->kj", case.free, case.normals)) * case.delta_v_per_force
    sightings = (bound.Sighting(slopes_to(case, j), missing[:, j], costs[:, j]) for j in (first, second))
    pair = price_pair(*sightings, np.linspace(0.0, np.pi / 2, 41), np.inf)
    when = [np.flatnonzero(case.is_lit[1:, j]) + 1 for j in (first, second)]
    true = min(least_by_linear_program(case, [(first, k), (second, m)]) for k, m in product(*when))
    assert max(finite[first], finite[second]) <= pair <= true * (1 + 1e-9)
    assert pair >= 0.98 * true


def test_edges_are_covered_by_vertices():
    triangle = [(0, 1), (1, 2), (0, 2)]
    assert not can_cover(triangle, 1)
    assert can_cover(triangle, 2)
    assert can_cover([(3, 3)], 1)
    assert not can_cover([(3, 3), (4, 4)], 1)
    assert can_cover([], 0)


def test_what_is_left_when_the_worst_are_let_go():
    takes = {(0, 0): 1.0, (1, 1): 2.0, (2, 2): 3.0, (0, 1): 5.0, (1, 2): 6.0, (0, 2): 3.0}
    assert [unavoidable(takes, num_let_go) for num_let_go in range(4)] == [6.0, 3.0, 1.0, 0.0]


def test_pairs_raise_the_bound_and_the_ceiling_holds():
    case = problem(1, "sun=random")
    alone = np.sort(sample_costs(case).min(axis=0))[94]
    bound = delta_v_bound(case, 95)
    assert 1.1 * alone < bound < np.inf
    ceiling = 0.5 * (alone + bound)
    assert delta_v_bound(case, 95, ceiling) == pytest.approx(ceiling, rel=1e-8)


FUEL, MAX_FORCE = 0.8, 0.2


@pytest.mark.parametrize("presolves", [True, False])
@pytest.mark.parametrize(("num_rows", "num_forces"), [(1, 1), (5, 12), (40, 9)])
def test_solutions_are_those_of_scipy(num_rows, num_forces, presolves):
    generator = np.random.default_rng(num_rows)
    rows = generator.normal(0.0, 50.0, (num_rows, num_forces))
    rows[generator.random(rows.shape) < 0.3] = 0.0
    most = generator.normal(-10.0, 20.0, num_rows)
    actual = polish.least_forces(rows, most, FUEL, MAX_FORCE, presolves=presolves)
    parts = [(0.0, MAX_FORCE)] * (2 * num_forces)
    expected = linprog(
        np.r_[np.full(2 * num_forces, FUEL), np.full(num_rows, polish.PRICE_OF_SLACK)],
        A_ub=np.hstack([rows, -rows, -np.eye(num_rows)]),
        b_ub=most,
        bounds=[*parts, *[(0.0, None)] * num_rows],
    )
    forces = expected.x[:num_forces] - expected.x[num_forces : 2 * num_forces]
    np.testing.assert_allclose(actual.forces, forces, atol=2 * polish.LEAST_FORCE)
    assert actual.slack == pytest.approx(expected.x[2 * num_forces :].sum(), abs=1e-9)
    np.testing.assert_allclose(actual.prices, -expected.ineqlin.marginals, atol=1e-12)


@pytest.mark.parametrize(
    ("slope", "most", "max_force"),
    [(np.inf, -10.0, 1.0), (1.0, np.nan, 1.0), (1.0, -10.0, -1.0)],
    ids=["infinite slope", "no bound", "no force within its limits"],
)
def test_a_program_without_a_solution_has_no_forces_and_infinite_slack(slope, most, max_force):
    actual = polish.least_forces(np.array([[slope]]), np.array([most]), FUEL, max_force, presolves=False)
    assert (*actual.forces, actual.slack, *actual.prices) == (0.0, np.inf, 0.0)


NEEDED = 70


def polished(case, forces, needed):
    """The eight first steps from a plan."""
    prices = np.zeros(case.num_points)
    for _ in range(8):
        polished_step = polish.step(case, forces, needed, prices, 6)
        forces, prices = polished_step.forces, polished_step.prices
        yield polished_step


def test_from_a_feasible_plan_fuel_never_rises_and_every_step_meets_what_is_asked():
    case = problem(1, "attitude=ideal")
    steps = polished(case, random_forces(case.num_controls, 0.05), NEEDED)
    feasible = [each for each in steps if each.is_feasible]
    spent = np.array([each.delta_v for each in feasible])
    assert len(spent) >= 4
    assert np.all(np.diff(spent) <= 1e-7)
    assert spent[-1] < 0.98 * spent[0]
    for each in feasible:
        path = path_of(case, each.forces)
        distances = np.linalg.norm(path[1:], axis=1)
        assert (margins_along(case, path).max(axis=0) >= 0.0).sum() >= NEEDED
        assert 15.0 + 0.99 * polish.NEAR_MARGIN <= distances.min() <= distances.max() <= 200.0
        assert np.abs(each.forces).max() <= 1.0
        assert np.all(each.forces[np.arange(case.num_controls) % 6 != 0] == 0.0)


def test_a_wall_in_the_way_is_kept_out_of():
    deputy = replace(problem(0).mission.deputy, min_distance_m=60.0)
    case = problem(0, "attitude=ideal")
    case = replace(case, mission=replace(case.mission, deputy=deputy))
    forces = np.zeros((case.num_controls, 3))
    assert np.linalg.norm(path_of(case, forces), axis=1).min() < 60.0
    *_, done = polished(case, forces, 40)
    assert done.is_feasible
    assert np.linalg.norm(path_of(case, done.forces)[1:], axis=1).min() >= 60.0


def test_of_more_points_than_needed_the_costly_go():
    best, prices = np.array([1.0, 0.0, 2.0, 0.5, -1.0]), np.array([0.0, 3.0, 0.0, 1.0, 0.0])
    for needed, kept in ((2, [2, 0]), (3, [2, 0, 3]), (5, [2, 0, 3, 1, 4])):
        assert polish.choose(best, needed, prices).tolist() == kept


def test_restarts_agree_within_a_thousandth():
    assert num_agreeing(np.array([0.2, 0.2009, 0.1999, 0.21])) == 3
    assert num_agreeing(np.array([np.inf, np.inf])) == 0
