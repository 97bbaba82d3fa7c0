"""Requirements on fleets: quantities by SciPy's matrix exponential, each deputy judged, pairs proved."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.stats import binomtest

from pipeline.command_line.config import compose_experiment
from pipeline.controllers.source import load
from pipeline.evaluation.assurance.campaign import Campaign, evaluate_each, evaluate_formulas, search
from pipeline.evaluation.assurance.case_space import case_space
from pipeline.evaluation.assurance.conditions import start_bounds
from pipeline.evaluation.assurance.formula import parse
from pipeline.evaluation.assurance.proofs import safety_proof
from pipeline.evaluation.assurance.quantities import UNITS, of_tracks
from pipeline.evaluation.assurance.rare import RARE, NotMet
from pipeline.evaluation.assurance.requirements import (
    OF_ONE_DEPUTY,
    RequirementError,
    check_formulas,
    check_starts,
    load_requirements,
)
from pipeline.evaluation.monte_carlo import fly_tracked
from pipeline.evaluation.splitting import rare_share
from pipeline.flight.fly.fleet_logs import fly_logged_fleet
from pipeline.flight.world.bounds import bounds_of, spheres_of
from pipeline.run.engine import HERE
from pipeline.scenarios import DrawnCases
from pipeline.settings.experiment import Mission

NUM_CASES = 12
APART = "nearest_pair >= 11 m -> always (nearest_pair >= 10 m)"


def composed(*words: str):
    """The experiment of a fleet's evidence, its controller and first cases."""
    experiment = compose_experiment(
        ["+experiment=assure_fleet", "controller=champion_27", "sun=random", *words]
    ).experiment
    controller = load(experiment.controller, experiment.mission)
    return experiment, controller, list(DrawnCases(experiment, range(NUM_CASES)))


@pytest.fixture(scope="module")
def flown():
    """Of fleets of three: experiment, cases, tracks and what these do not hold."""
    experiment, controller, scenarios = composed("fleet.deputies=3")
    tracks, facts = Campaign(experiment.mission, controller, 1).tracks(scenarios)
    return experiment, scenarios, tracks, facts


def margins(formula, tracks, facts):
    return evaluate_formulas(tracks, facts, {"R": parse(formula, UNITS)}, 10.0)["R"].margins


def test_pairs_are_as_near_as_their_tracks(flown):
    *_, tracks, facts = flown
    positions = tracks[..., :3].astype(np.float64)
    away = [np.linalg.norm(positions[:, i] - positions[:, j], axis=2) for i, j in combinations(range(3), 2)]
    quantities = of_tracks(tracks, facts, ["nearest_pair", "fleet_delta_v", "distance"])
    assert {values.shape for values in quantities.values()} == {(3 * NUM_CASES, tracks.shape[2])}
    np.testing.assert_allclose(quantities["nearest_pair"][::3], np.min(away, axis=0), rtol=1e-12)
    spent = tracks[..., 6].astype(np.float64).sum(axis=1)
    np.testing.assert_allclose(quantities["fleet_delta_v"][2::3], spent, rtol=1e-12)
    np.testing.assert_allclose(
        quantities["distance"].reshape(NUM_CASES, 3, -1), np.linalg.norm(positions, axis=3), rtol=1e-12
    )


def test_pairs_coast_as_linear_motion_leads_them(flown):
    """Each second of an orbit, by SciPy's matrix exponential; between looks they are little nearer."""
    experiment, _, tracks, facts = flown
    n = experiment.mission.orbit.mean_motion_rad_s
    rates = np.zeros((6, 6))
    rates[:3, 3:] = np.eye(3)
    rates[3, 0], rates[3, 4], rates[4, 3], rates[5, 2] = 3.0 * n**2, 2.0 * n, -2.0 * n, -(n**2)
    orbit, second = 2.0 * np.pi / n, expm(rates)
    for name, duration in (("coasting_pair", orbit), ("coasting_pair[600]", 600.0)):
        quantity = of_tracks(tracks[:2], facts._replace(inspectable=facts.inspectable[:2]), [name])[name]
        for case, k in ((0, 0), (0, 200), (1, 77), (1, 360)):
            states, least = tracks[case, :, k, :6].astype(np.float64), np.inf
            for _ in range(int(duration) + 1):
                for i, j in combinations(range(3), 2):
                    least = min(least, float(np.linalg.norm(states[i, :3] - states[j, :3])))
                states = states @ second.T
            assert quantity[3 * case, k] == pytest.approx(least, abs=0.05)


def test_points_count_for_whoever_saw_them():
    """Also where nobody tells anybody: then no deputy alone knows of all."""
    experiment, controller, scenarios = composed("fleet.sharing=nothing")
    tracks, facts = Campaign(experiment.mission, controller, 1).tracks(scenarios[:4])
    outcomes, alone = fly_tracked(experiment.mission, controller, scenarios[:4], 1)
    inspected = of_tracks(tracks, facts, ["inspected"])["inspected"]
    np.testing.assert_array_equal(inspected[::2, -1], outcomes.inspected_count)
    assert np.any(99 - alone[:, :, -1, 7] < outcomes.inspected_count[:, np.newaxis])
    logs = fly_logged_fleet(experiment.mission, controller, scenarios[0])
    seen = np.any([log.flight.is_inspected for log in logs], axis=0).sum(axis=1)
    np.testing.assert_array_equal(inspected[0], seen)


def test_a_fleet_meets_what_each_deputy_meets(flown):
    *_, tracks, facts = flown
    distances = np.linalg.norm(tracks[..., :3].astype(np.float64), axis=3)
    np.testing.assert_allclose(
        margins("always distance >= 40 m", tracks, facts), distances.min(axis=(1, 2)) - 40.0, rtol=1e-9
    )
    formula = parse("always distance >= 40 m", UNITS)
    result = evaluate_formulas(tracks, facts, {"R": formula}, 10.0)["R"]
    np.testing.assert_array_equal(result.is_met, np.all(distances >= 40.0, axis=(1, 2)))
    assert 0 < np.count_nonzero(result.is_met) < NUM_CASES
    each = evaluate_each(tracks, facts, {"R": formula}, 10.0)["R"]
    np.testing.assert_allclose(each.margins, distances.min(axis=2).ravel() - 40.0, rtol=1e-9)
    premise = parse("distance < 40 m -> speed <= 9 m/s", UNITS)
    result = evaluate_formulas(tracks, facts, {"R": premise}, 10.0)["R"]
    (occurred,) = result.premises.values()
    np.testing.assert_array_equal(occurred, np.any(distances[:, :, 0] < 40.0, axis=1))


def test_pairs_are_proved_apart_where_they_start_so(flown):
    experiment, scenarios, tracks, facts = flown
    mission = experiment.mission
    proof = safety_proof(mission, scenarios, start_bounds(experiment))
    assert (proof.num_starts, proof.num_safe, proof.keep_apart_m) == (36, 36, 10.0)
    assert proof.start_apart_m == pytest.approx(10.0)  # who holds still at rest stops there
    assert proof.proves(parse(APART, UNITS))
    assert proof.proves(parse("always distance >= 15 m", UNITS))
    assert margins(APART, tracks, facts).min() >= 0.0
    for unproved in (
        "always nearest_pair >= 10 m",
        "nearest_pair >= 9.9 m -> always (nearest_pair >= 10 m)",
        "nearest_pair >= 11 m -> always (nearest_pair >= 10.1 m)",
        "nearest_pair >= 11 m -> eventually (nearest_pair >= 10 m)",
        "distance >= 11 m -> always (nearest_pair >= 10 m)",
        "nearest_pair <= 11 m -> always (nearest_pair >= 10 m)",
        "nearest_pair >= 11 m -> always (coasting_pair >= 10 m)",
        "nearest_pair >= 11 m -> always (nearest_pair <= 10 m)",
    ):
        assert not proof.proves(parse(unproved, UNITS))
    of_none = replace(mission, fleet=replace(mission.fleet, keep_apart_m=0.0))
    loose = safety_proof(of_none, scenarios, start_bounds(experiment))
    assert not loose.proves(parse(APART, UNITS))
    assert loose.proves(parse("always distance >= 15 m", UNITS))


def test_pairs_are_proved_apart_where_nothing_is_exact():
    """Errors of all deputies are within their bounds at once, and plans begin with estimates."""
    experiment, _, scenarios = composed("safety=robust", "world=leo", "fleet.deputies=3")
    mission, shell = experiment.mission, start_bounds(experiment)
    proof, bounds = safety_proof(mission, scenarios, shell), bounds_of(mission)
    assert proof.failing == ()
    assert proof.probability == pytest.approx(1.0 - 3.0 * 0.001)
    least = proof.start_apart_m
    assert least > 10.0 + 2.0 * bounds.astray_m + 2.0 * bounds.errors.position_m
    formula = parse(f"nearest_pair >= {least + 0.1:.1f} m -> always (nearest_pair >= 10 m)", UNITS)
    assert proof.proves(formula)
    assert not proof.proves(parse(APART, UNITS))
    assert not proof.is_continuous(formula)
    assert proof.is_continuous(parse("always distance >= 15 m", UNITS))
    # starts that only an exact deputy knows to be safe
    near = spheres_of(mission, bounds)[0] + 1.0
    assert not safety_proof(mission, scenarios, (near, *shell[1:])).are_all_safe


def test_faster_starts_must_be_farther_apart():
    """A stop lies ahead by half of the way in a control period, for both."""
    experiment, _, scenarios = composed("monte_carlo.max_speed_m_s=0.2")
    proof = safety_proof(experiment.mission, scenarios, start_bounds(experiment))
    assert proof.start_apart_m == pytest.approx(10.0 + 2.0 * 0.5 * 0.2 * 10.0, abs=0.05)
    assert not proof.implies(parse(APART, UNITS))
    assert proof.implies(parse("nearest_pair >= 12.1 m -> always (nearest_pair >= 10 m)", UNITS))


def test_parked_starts_are_proved_by_how_fast_they_may_be():
    """Cases that are drawn stay within the bounds, and the fastest of them comes near."""
    experiment, _, scenarios = composed("monte_carlo.parked=true", "fleet.deputies=6")
    near, far, speed = start_bounds(experiment)
    starts = [start for scenario in scenarios for start in scenario.fleet]
    speeds = np.array([np.linalg.norm(start.velocity_m_s) for start in starts])
    distances = np.array([np.linalg.norm(start.position_m) for start in starts])
    assert near <= distances.min()
    assert distances.max() <= far
    assert 0.8 * speed < speeds.max() <= speed
    proof = safety_proof(experiment.mission, scenarios, (near, far, speed))
    assert proof.proves(parse("nearest_pair >= 12.3 m -> always (nearest_pair >= 10 m)", UNITS))
    requirements = load_requirements("inspection_fleet", experiment.mission)
    check_starts(requirements, experiment.monte_carlo)
    enclosed = replace(requirements[0], verified_by=("tube",))
    with pytest.raises(RequirementError, match=r"R1: monte_carlo\.parked is true, and verified_by has tube"):
        check_starts([enclosed], experiment.monte_carlo)


def test_requirements_fit_the_number_of_deputies():
    fleet, single = composed()[0].mission, Mission()
    with pytest.raises(RequirementError, match=r"R4: fleet_delta_v is of several deputies, and fleet\.dep"):
        check_formulas(load_requirements("inspection_fleet", single), single)
    requirements = load_requirements("inspection_fleet", fleet)
    check_formulas(requirements, fleet)
    for method in OF_ONE_DEPUTY:
        unaware = replace(requirements[0], verified_by=("cases", method))
        with pytest.raises(RequirementError, match=rf"verified_by has {method}, which encloses the starts"):
            check_formulas([unaware], fleet)


def test_a_search_finds_deputies_nearer_to_one_another_than_as_many_random_cases():
    """It varies the starts of all; the margin of its worst case is that of its logged flights."""
    words = "safety=none", "fleet.keep_apart_m=0", "duration_s=600", "assurance.search_generations=8"
    experiment, controller, _ = composed(*words)
    pair = load_requirements("inspection_fleet", experiment.mission)[4]
    formula = parse("always (nearest_pair >= 10 m)", UNITS)
    requirement, space = replace(pair, formula=formula, verified_by=("search",)), case_space(experiment)
    campaign = Campaign(experiment.mission, controller, 1)
    result = search(requirement, campaign, space, experiment, 0)
    random = campaign.judge(DrawnCases(experiment, range(len(result.scenarios))), [requirement])["R5"]
    worst = result.scenarios[result.worst]
    assert result.outcome.worst[0] < min(random.worst[0], 0.0)
    first, second = (log.flight.position_m for log in fly_logged_fleet(experiment.mission, controller, worst))
    nearest = np.linalg.norm(first - second, axis=1).min()
    assert result.outcome.worst[0] == pytest.approx(nearest - 10.0, abs=1e-4)
    for number in range(2):
        starts = np.array([scenario.fleet[number].position_m for scenario in result.scenarios])
        distances = np.linalg.norm(starts, axis=1)
        assert np.all((distances > 49.999) & (distances < 100.001))
        assert len(np.unique(starts, axis=0)) > 0.9 * len(starts)


def test_the_share_of_fleets_that_come_near_is_that_of_random_cases():
    """By splitting; the intervals of both hold the same shares."""
    words = "safety=none", "fleet.keep_apart_m=0", "duration_s=600", "assurance.num_cases=2000"
    experiment, controller, _ = composed(*words)
    pair = load_requirements("inspection_fleet", experiment.mission)[4]
    requirement = replace(pair, formula=parse("always (nearest_pair >= 10 m)", UNITS))
    campaign = Campaign(experiment.mission, controller, 1)
    law = NotMet(case_space(experiment, is_exact=True), experiment.seed, campaign, requirement)
    rare = rare_share(law, 4000, 95.0, (experiment.seed, RARE, 1), HERE, lambda _: None)
    flown = campaign.judge(DrawnCases(experiment, range(2000)), [requirement])["R5"]
    interval = binomtest(int(np.count_nonzero(~flown.is_met)), 2000).proportion_ci(0.95)
    assert 0.0 < rare.low < interval.high
    assert interval.low < rare.high < 0.1
