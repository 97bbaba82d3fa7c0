"""Plans of several deputies together: their price in plain NumPy, how near two come, what a search finds."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import minimize_scalar

from pipeline.command_line.config import compose_experiment
from pipeline.controllers.source import load
from pipeline.flight.fly.divided import APART_MARGIN_M, team_of
from pipeline.flight.fly.joint import joint_outlook, price_together, search_together, too_near
from pipeline.flight.fly.outlooks import at_start
from pipeline.flight.fly.prices import price_pushes
from pipeline.flight.fly.pushes import Effort, search_pushes
from pipeline.scenarios import evaluation_scenarios

APART = "safety=filter", "fleet.keep_apart_m=10"
REACH_M_S = 0.2
PAIRS = ((0, 1), (0, 2), (1, 2))


def teams_of(*words: str, controller="champion_27_rehearsed", deputies=3, count=1):
    """The mission, and some teams as they plan."""
    experiment = compose_experiment(
        [
            *("+experiment=evaluate_fleet", f"controller={controller}", f"fleet.deputies={deputies}"),
            *("sun=random", "attitude=ideal", f"monte_carlo.num_cases={count}", *words),
        ]
    ).experiment
    mission = experiment.mission
    rules, alone = load(experiment.controller, mission), mission.of_each
    fleets = [scenario.fleet for scenario in evaluation_scenarios(experiment)]
    return mission, [team_of(mission, at_start(alone, alone, rules, list(each), 0, 8)) for each in fleets]


def drawn(team, generator, count=1, size_m_s=0.02):
    """Some plans of all deputies, at random."""
    outlook, num_pushes = team.outlooks[0][0], team.num_pushes
    forces = generator.normal(0.0, size_m_s, (count, len(team.outlooks), 3 * num_pushes))
    times = generator.uniform(0.0, 0.8 * len(outlook.free), (count, len(team.outlooks), num_pushes - 1))
    return np.concatenate([forces / outlook.delta_v_per_force, times], axis=2)


def positions(mission, outlook, start, genes):
    """Where a plan leads at each sample, (S, 3), m, by SciPy's matrix exponential."""
    n, mass, period = mission.orbit.mean_motion_rad_s, mission.deputy.mass_kg, mission.control_period_s
    rates = np.zeros((9, 9))
    rates[:3, 3:6] = np.eye(3)
    rates[3, 0], rates[3, 4], rates[4, 3], rates[5, 2] = 3.0 * n**2, 2.0 * n, -2.0 * n, -(n**2)
    rates[3:6, 6:] = np.eye(3) / mass
    step, num_pushes = expm(rates * period), (len(genes) + 1) // 4
    fired = np.zeros((outlook.step * len(outlook.free), 3))
    forces = np.where(np.abs(genes) >= outlook.least_force, genes, 0.0)[: 3 * num_pushes].reshape(-1, 3)
    for force, sample in zip(forces, np.r_[0, genes[3 * num_pushes :].astype(int)], strict=True):
        fired[outlook.step * sample] += force
    state, path = np.r_[start.position_m, start.velocity_m_s], []
    for force in fired:
        path.append(state[:3])
        state = (step @ np.r_[state, force])[:6]
    return np.array(path[:: outlook.step])


def nearest(path, other):
    """How near two come on straight ways between samples, m: where a quadratic along each way is least."""
    before, after = (path - other)[:-1], (path - other)[1:]
    step = after - before
    share = np.clip(-np.sum(before * step, axis=1) / np.sum(step * step, axis=1), 0.0, 1.0)
    return np.linalg.norm(before + share[:, np.newaxis] * step, axis=1).min()


def plain_price(mission, team, genes, kept_m):
    """What plans cost together, m/s, by the definition."""
    spent = outside = 0.0
    best, paths = np.full(99, -1e3), []
    for start, plan, (outlook, _) in zip(team.deputies.believed, genes, team.outlooks, strict=True):
        forces = plan[: 3 * team.num_pushes]
        spent += np.abs(forces[np.abs(forces) >= outlook.least_force]).sum() * outlook.delta_v_per_force
        path = positions(mission, outlook, start, plan)
        distance = np.linalg.norm(path, axis=1)
        beyond = np.maximum(outlook.nearest - distance, distance - outlook.farthest)
        ways = np.abs(np.diff(path, axis=0)).max(initial=0.0) - outlook.longest_way
        outside += max(0.0, beyond[1:].max(), 5.0 * ways)
        for path_before in paths:
            kept = min(kept_m, np.linalg.norm(path[0] - path_before[0]))
            outside += max(0.0, kept - nearest(path, path_before))
        paths.append(path)
        height = np.einsum("sap,sa->sp", outlook.normals, path) - outlook.heights
        seen = np.minimum(height, (distance - outlook.sight)[:, np.newaxis])
        best = np.maximum(best, np.where(outlook.is_lit, seen, -1e3).max(axis=0))
    outlook, needed = team.outlooks[0]
    short = np.cumsum(np.r_[0.0, np.sort(np.maximum(0.0, -best))])
    return spent + 0.01 * short[needed] + 0.03 * short[outlook.required] + 0.05 * outside, outside


@pytest.mark.parametrize(
    ("words", "deputies"),
    [
        ((), 2),
        (APART, 3),
        (("safety=filter", "fleet.keep_apart_m=90", "monte_carlo.parked=true"), 3),
        (("chief.initial_angular_velocity_rad_s=[0.01,0.004,-0.006]",), 2),
    ],
)
def test_the_price_of_plans_together_is_that_of_the_definition(words, deputies):
    mission, teams = teams_of(*words, deputies=deputies, count=3)
    kept_m = mission.fleet.keep_apart_m + APART_MARGIN_M if mission.fleet.keep_apart_m else 0.0
    generator, outside = np.random.default_rng(3), []
    for team in teams:
        for genes in drawn(team, generator, 4):
            expected, beyond = plain_price(mission, team, genes, kept_m)
            assert team.price(genes) == pytest.approx(expected, rel=1e-7, abs=1e-8)
            outside.append(beyond)
    assert max(outside) > 0.0


@pytest.mark.parametrize("controller", ["champion_27_rehearsed", "champion_27_parked"])
def test_plans_that_need_see_nothing_cost_what_each_costs_alone(controller):
    """Also what follows pushes and the end counts, of each."""
    _, (team,) = teams_of(controller=controller)
    reach = REACH_M_S / team.outlooks[0][0].delta_v_per_force
    outlooks = [outlook for outlook, _ in team.outlooks]
    others, apart = np.zeros((0, *outlooks[0].free.shape)), np.zeros((3, 3))
    joint, num_lit = joint_outlook(outlooks, team.num_pushes, reach, others, apart)
    for genes in drawn(team, np.random.default_rng(5), 4, 0.05):
        costs = np.empty((3, 1))
        for outlook, plan, cost in zip(outlooks, genes, costs, strict=True):
            price_pushes(np.ascontiguousarray(plan[:, np.newaxis]), team.num_pushes, 0, outlook, cost)
        price = price_together(genes.ravel(), team.num_pushes, num_lit, 0, joint, np.inf)
        assert price == pytest.approx(costs.sum(), rel=1e-12)


def test_a_price_is_left_out_only_above_its_limit():
    _, (team,) = teams_of(*APART)
    generator, outlooks = np.random.default_rng(7), [outlook for outlook, _ in team.outlooks]
    others = np.zeros((0, *outlooks[0].free.shape))
    reach, needed = REACH_M_S / outlooks[0].delta_v_per_force, team.outlooks[0][1]
    joint, num_lit = joint_outlook(outlooks, team.num_pushes, reach, others, team.apart)
    num_left_out = 0
    for genes in drawn(team, generator, 60):
        price, limit = team.price(genes), team.price(genes) * generator.uniform(0.5, 1.5)
        limited = price_together(genes.ravel(), team.num_pushes, num_lit, needed, joint, limit)
        assert limited == price if price <= limit else limited in {price, np.inf}
        num_left_out += np.isinf(limited)
    assert num_left_out > 20


def test_paths_of_others_count_as_those_of_deputies():
    """Beside a plan that stands, the price is that of both but for what the other spends and shows."""
    mission, teams = teams_of(
        "safety=filter", "fleet.keep_apart_m=90", "monte_carlo.parked=true", deputies=2, count=8
    )
    distances = []
    for team in teams:
        (genes,) = drawn(team, np.random.default_rng(11))
        outlooks = [outlook for outlook, _ in team.outlooks]
        reach = REACH_M_S / outlooks[0].delta_v_per_force
        planned = zip(outlooks, team.deputies.believed, genes, strict=True)
        paths = [positions(mission, *each) for each in planned]
        prices = []
        for apart in (team.apart[:1], np.zeros((1, 2))):
            joint, num_lit = joint_outlook(outlooks[:1], team.num_pushes, reach, np.array(paths[1:]), apart)
            prices.append(price_together(genes[0], team.num_pushes, num_lit, 0, joint, np.inf))
        distances.append(max(0.0, team.apart[0, 1] - nearest(*paths)))
        assert prices[0] - prices[1] == pytest.approx(0.05 * distances[-1], abs=1e-7)
    assert max(distances) > 1.0


def test_how_near_two_come_between_samples():
    generator = np.random.default_rng(2)
    for number in range(20):
        path, other = generator.normal(0.0, 30.0, (2, 6, 3))
        if number < 3:  # side by side: they stay as far apart as they are
            other = path + np.array([0.0, 12.0, 0.0])
        relative = path - other

        def away(time, relative=relative):
            return np.linalg.norm([np.interp(time, range(6), part) for part in relative.T])

        expected = min(minimize_scalar(away, bounds=(k, k + 1.0), method="bounded").fun for k in range(5))
        expected = min(expected, *map(away, range(6)))
        assert too_near(path.ravel(), other.ravel(), 200.0) == pytest.approx(200.0 - expected, abs=1e-3)
        assert too_near(path.ravel(), other.ravel(), 0.5 * expected) == 0.0


def test_a_single_deputy_is_searched_for_as_without_a_fleet():
    _, (team, *_) = teams_of(count=2)
    nobody, apart = np.zeros((0, *team.outlooks[0][0].free.shape)), np.zeros((1, 1))
    (last,) = drawn(team, np.random.default_rng(1))
    for deputy, (outlook, needed) in enumerate(team.outlooks):
        for known in (last[:0], last[:1]):
            effort, how = Effort(24, 20), (team.num_pushes, needed, REACH_M_S)
            alone = search_pushes(
                outlook, *how, effort, np.random.default_rng(deputy), known[0] if len(known) else None
            )
            beside = search_together(
                [outlook], *how, effort, np.random.default_rng(deputy), known, nobody, apart
            )
            np.testing.assert_array_equal(beside[0], alone.best)


def test_the_search_over_all_begins_with_the_best_answers():
    _, teams = teams_of("monte_carlo.parked=true", deputies=2, count=8)
    prices = np.array(
        [
            [team.price(team.divided()), *(team.price(team.answered(each)) for each in (0, 1))]
            for team in teams
        ]
    )
    assert np.all(prices[:, 0] <= prices[:, 1:].min(axis=1))
    assert np.mean(prices[:, 0] < prices[:, 1:].min(axis=1) - 1e-4) > 0.25


def test_plans_keep_deputies_apart_where_they_can():
    mission, teams = teams_of(*APART, "monte_carlo.parked=true", count=12)
    least, unaware = [], []
    for team in teams:
        for planned, noted in ((team, least), (replace(team, apart_m=0.0), unaware)):
            genes, believed = planned.divided(), team.deputies.believed
            paths = [
                positions(mission, outlook, start, plan)
                for (outlook, _), start, plan in zip(team.outlooks, believed, genes, strict=True)
            ]
            kept = np.minimum(15.0, [np.linalg.norm(paths[i][0] - paths[j][0]) for i, j in PAIRS])
            noted.append(min(np.array([nearest(paths[i], paths[j]) for i, j in PAIRS]) - kept))
    assert min(least) > -0.1
    assert np.mean(np.array(unaware) < -1.0) > 0.1
