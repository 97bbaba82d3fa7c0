"""The search for pushes, plan by plan and up to a limit, against all plans priced side by side to the end."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.flight.fly.outlooks import at_start
from pipeline.flight.fly.prices import price_pushes, price_up_to, pricing_of
from pipeline.flight.fly.pushes import (
    CROSSOVER,
    LEAST_WEIGHT,
    MOST_WEIGHT,
    NUM_DRAWS,
    Effort,
    num_best,
    search_pushes,
)
from pipeline.flight.world.pack import pack_world
from pipeline.settings.mission import TwoBody
from pipeline.settings.orbit import OrbitSettings
from tests.pipeline.flight.cases import SEEING, mission, random_starts, with_attributes

pytestmark = pytest.mark.slow

ELLIPSE = {
    "orbit": OrbitSettings(
        kind="elements", semi_major_axis_m=9.6e6, eccentricity=0.3, true_anomaly_deg=290.0
    ),
    "dynamics": TwoBody(j2=1.08e-3),
}
NOISY = {"navigation": {"mode": "fixes"}, "actuators": {"kind": "real"}}
#: what changes of the mission, and of the controller's constants
KINDS = {
    "paper": ({}, {}),
    "cone, range and shadow": (
        {"sensor": {"max_incidence_deg": 70.0, "max_range_m": 90.0}, "light": {"shadow": "conical"}},
        {"foresight_points": "3"},
    ),
    "range alone": ({"sensor": {"max_range_m": 60.0}}, {}),
    "tumbling": ({"chief": {"initial_angular_velocity_rad_s": (0.01, 0.004, -0.006)}}, {}),
    "weak thrusters": ({"deputy": {"max_force_n": 0.03}}, {}),
    "safety layer": ({"safety": {"kind": "filter"}}, {}),
    "parked": ({}, {"foresight_after_s": "9000", "foresight_passive_s": "3000"}),
    "parked, with errors": (NOISY, {"foresight_after_s": "9000", "foresight_passive_s": "3000"}),
    "ellipse": (ELLIPSE, {}),
    "ellipse, weak thrusters": ({**ELLIPSE, "deputy": {"max_force_n": 0.03}}, {}),
}


def outlooks(kind, num_pushes):
    """What plans are priced by in some flights: from the start, and from a later sample on."""
    changes, constants = KINDS[kind]
    flown = mission(attitude={"mode": "ideal"}, **changes)
    constants = {"foresight_pushes": str(num_pushes), "rehearsal_reach_m_s": "0.1", **constants}
    controller = with_attributes(SEEING, coast_margin_m="4.0", coast_below_points="6", **constants)
    starts = [replace(start, sun_elevation_rad=0.2) for start in random_starts(2, seed=8)]
    deputies, generator = at_start(flown, flown, controller, starts, 0, 8), np.random.default_rng(4)
    yield from deputies.outlooks()
    errors = generator.normal(0.0, [1.0] * 3 + [0.002] * 3, (2, 9, 6))
    left = generator.random((2, pack_world(flown).points.shape[2])) < 0.7
    covariances = errors.transpose(0, 2, 1) @ errors * (flown.navigation.mode == "fixes")
    later = replace(deputies, sample=60, left=left.astype(np.uint8), covariances=covariances)
    yield from later.outlooks()


def evolved(outlook, num_pushes, needed, bounds, first, draws):
    """All plans of a search, and their prices: each generation priced side by side to the end."""
    below, above = (bound[:, np.newaxis] for bound in bounds)
    plans = first.copy()
    prices = np.empty(plans.shape[1])
    price_pushes(plans, num_pushes, needed, outlook, prices)
    every, costs = [plans.copy()], [prices.copy()]
    num_genes, num_plans = plans.shape
    for drawn in draws:
        top = np.argsort(prices, kind="stable")[(drawn[:, 0] * num_best(num_plans)).astype(int)]
        plus, minus = (drawn[:, 1:3] * num_plans).astype(int).T
        towards, along = LEAST_WEIGHT + (MOST_WEIGHT - LEAST_WEIGHT) * drawn[:, 3:5].T
        mutants = plans + towards * (plans[:, top] - plans)
        mutants = mutants + along * (plans[:, plus] - plans[:, minus])
        mutants = np.where(mutants < below, 0.5 * (below + plans), mutants)
        mutants = np.where(mutants > above, 0.5 * (above + plans), mutants)
        changes = drawn[:, NUM_DRAWS:].T < CROSSOVER
        changes |= np.arange(num_genes)[:, np.newaxis] == (drawn[:, 5] * num_genes).astype(int)
        mutants = np.ascontiguousarray(np.where(changes, mutants, plans))
        tried = np.empty(num_plans)
        price_pushes(mutants, num_pushes, needed, outlook, tried)
        is_kept = tried <= prices
        plans, prices = np.where(is_kept, mutants, plans), np.where(is_kept, tried, prices)
        every.append(mutants)
        costs.append(tried)
    return np.array(every), np.array(costs)


@pytest.mark.parametrize("num_pushes", [2, 3])
@pytest.mark.parametrize("kind", KINDS)
def test_a_search_finds_bit_by_bit_what_all_prices_lead_to(kind, num_pushes):
    num_rejected = 0
    for number, (outlook, needed) in enumerate(outlooks(kind, num_pushes)):
        assert 0 < needed <= outlook.is_lit.any(axis=0).sum()
        effort, reach = Effort(24, 12), 0.2
        searches = [
            search_pushes(outlook, num_pushes, needed, reach, effort, np.random.default_rng(number), **how)
            for how in ({}, {"is_exact": True})
        ]
        generator = np.random.default_rng(number)
        generator.random(searches[0].genes[0].shape)
        draws = generator.random((12, 24, NUM_DRAWS + 4 * num_pushes - 1))
        force = reach / outlook.delta_v_per_force
        latest = (0.99 if outlook.tail.num_after else 0.85) * (len(outlook.free) - 1)
        lowest = np.repeat([-force, 0.0], [3 * num_pushes, num_pushes - 1])
        highest = np.repeat([force, latest], [3 * num_pushes, num_pushes - 1])
        first = searches[0].genes[0]
        assert np.all((first >= lowest[:, np.newaxis]) & (first <= highest[:, np.newaxis]))
        genes, costs = evolved(outlook, num_pushes, needed, (lowest, highest), first, draws)
        np.testing.assert_array_equal(searches[1].genes, genes)
        np.testing.assert_array_equal(searches[1].costs, costs)
        is_rejected = np.isinf(searches[0].costs)
        np.testing.assert_array_equal(searches[0].genes, genes)
        np.testing.assert_array_equal(searches[0].costs[~is_rejected], costs[~is_rejected])
        np.testing.assert_array_equal(searches[0].best, searches[1].best)
        assert searches[0].cost == searches[1].cost == costs.min()
        num_rejected += np.count_nonzero(is_rejected)
    assert num_rejected > 100


@pytest.mark.parametrize("kind", KINDS)
def test_a_price_is_told_unless_it_exceeds_the_limit(kind):
    generator, num_pushes = np.random.default_rng(6), 3
    for outlook, needed in outlooks(kind, num_pushes):
        reach, num_samples = 0.15 / outlook.delta_v_per_force, len(outlook.free)
        genes, costs = np.zeros((11, 40)), np.empty(40)
        genes[:9] = generator.uniform(-reach, reach, (9, 40)) * (generator.random((9, 40)) < 0.7)
        genes[9:] = generator.uniform(0.0, num_samples - 1, (2, 40))
        price_pushes(genes, num_pushes, needed, outlook, costs)
        pricing, num_lit = pricing_of(outlook, num_pushes, reach)
        for plan, cost in zip(genes.T.copy(), costs.tolist(), strict=True):
            for limit in (np.inf, cost, np.nextafter(cost, 0.0), 0.9 * cost, 0.0):
                priced = price_up_to(plan, num_pushes, num_lit, needed, outlook, pricing, limit)
                assert priced == cost or (priced == np.inf and cost > limit)
        assert costs.min() < costs.max()


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind.startswith("parked")])
def test_of_thrusters_without_errors_no_deviation_is_followed_and_no_price_changes(kind):
    generator, num_pushes, has_errors = np.random.default_rng(2), 3, KINDS[kind][0] == NOISY
    for outlook, needed in outlooks(kind, num_pushes):
        reach, num_samples = 0.15 / outlook.delta_v_per_force, len(outlook.free)
        pricing, num_lit = pricing_of(outlook, num_pushes, reach)
        assert pricing.doubts.shape == (6, 3 * num_pushes if has_errors else 0)
        followed = pricing._replace(doubts=np.empty((6, 3 * num_pushes)), points=pricing.points.copy())
        for _ in range(40):
            plan = generator.uniform(-reach, reach, 4 * num_pushes - 1)
            plan[3 * num_pushes :] = generator.uniform(0.0, num_samples - 1, num_pushes - 1)
            priced, expected = (
                price_up_to(plan, num_pushes, num_lit, needed, outlook, each, np.inf)
                for each in (pricing, followed)
            )
            assert priced == expected < np.inf
