"""Deputies that aim at one another are kept apart, with the least change of force; without it they meet."""

import numpy as np
import pytest
from scipy.optimize import LinearConstraint, minimize

from pipeline.command_line.config import compose_experiment
from pipeline.controllers.source import load
from pipeline.flight.fly.fleets import apart_of
from pipeline.flight.goals.flights import fly_all
from pipeline.flight.world.bounds import bounds_of
from pipeline.scenarios import evaluation_scenarios
from pipeline.settings.experiment import SettingError
from tests.pipeline.flight import attacks as flown
from tests.pipeline.flight.attacks import APART_M, ERRORS, LINKS, WORDS, attacks, drawn, mission_of


@pytest.mark.parametrize("deputies", [2, 3, 5])
@pytest.mark.parametrize("link", LINKS)
def test_deputies_that_aim_at_one_another_never_come_nearer(deputies, link):
    least, unguarded, changed = np.inf, np.inf, 0
    for fleet, alone, num_changed in attacks(deputies, link, 6, 84):
        changed += num_changed
        least, unguarded = min(least, fleet.least()), min(unguarded, alone.least())
        distances = np.linalg.norm(fleet.states[:, :3], axis=1)
        assert fleet.mission.keep_out_m - 1e-5 <= distances.min()
        assert distances.max() <= fleet.mission.keep_in_m + 1e-5
    assert least >= APART_M
    assert unguarded < 0.6 * APART_M
    assert changed > 60


@pytest.mark.parametrize("deputies", [2, 3, 5])
@pytest.mark.parametrize("link", LINKS)
def test_with_errors_they_stay_apart_and_near_what_they_plan(deputies, link):
    """Estimates, thrusters and motion are as far off as their bounds allow."""
    unguarded = np.inf
    for fleet, alone, _ in attacks(deputies, link, 6, 84, *ERRORS):
        assert fleet.least() >= APART_M
        unguarded = min(unguarded, alone.least())
        distances = np.linalg.norm(fleet.states[:, :3], axis=1)
        assert fleet.mission.deputy.min_distance_m <= distances.min()
        assert distances.max() <= fleet.mission.deputy.max_distance_m
        astray = np.linalg.norm(fleet.states @ fleet.stops.T - fleet.plans(), axis=1)
        assert astray.max() <= bounds_of(fleet.mission).astray_m
    assert unguarded < 1.5 * APART_M


@pytest.mark.parametrize("weakened", ["no margin", "not led back"])
def test_an_attack_finds_what_the_bounds_are_for(monkeypatch, weakened):
    def weaker(mission):
        apart = apart_of(mission)
        if weakened == "no margin":
            return apart._replace(distance=APART_M)
        return apart._replace(forces=np.zeros_like(apart.forces))

    monkeypatch.setattr(flown, "apart_of", weaker)
    least, astray = np.inf, 0.0
    for fleet, _, _ in attacks(5, "at once", 24, 84, *ERRORS):
        least = min(least, fleet.least())
        astray = max(astray, np.linalg.norm(fleet.states @ fleet.stops.T - fleet.plans(), axis=1).max())
    if weakened == "no margin":
        assert least < APART_M
    else:
        assert astray > bounds_of(fleet.mission).astray_m


def test_where_motion_alone_is_inexact_hardly_more_is_kept():
    words = "safety=robust", "dynamics=two_body"
    assert 0.0 < bounds_of(mission_of(2, *words)).astray_m < 1e-3
    assert bounds_of(mission_of(2, "safety=robust")).astray_m == 0.0


def test_the_change_of_force_is_the_least():
    """Against SciPy's quadratic programme over the planes as the page writes them."""
    lenient = ("safety.passive_horizon_s=0", "safety.speed_limit_m_s=5")
    mission, random = mission_of(3, *lenient), np.random.default_rng(7)
    compared = 0
    for _ in range(20):
        fleet = drawn(mission, 3, random, spread_m=10.0)
        wanted = 0.6 * fleet.aims()
        forces, stop_places, layer = fleet.corrected(wanted), fleet.states @ fleet.stops.T, fleet.layer
        for deputy in range(3):
            rows, levels = [], []
            for other in {0, 1, 2} - {deputy}:
                between = stop_places[deputy] - stop_places[other]
                u = between / np.linalg.norm(between)
                level = u @ (stop_places[deputy] + stop_places[other]) / 2.0 + APART_M / 2.0
                free = layer.phi @ fleet.states[deputy]
                for check in (np.eye(3, 6), fleet.stops):
                    rows.append(u @ check @ layer.gamma)
                    levels.append(level - u @ check @ free)
            assert np.all(np.array(rows) @ forces[deputy] >= np.array(levels) - 1e-8)
            nearest = minimize(
                lambda f, aim=wanted[deputy]: np.sum((f - aim) ** 2),
                layer.stop @ fleet.states[deputy],
                constraints=LinearConstraint(np.array(rows), np.array(levels)),
                bounds=[(-1.0, 1.0)] * 3,
                method="SLSQP",
                options={"ftol": 1e-14, "maxiter": 500},
            )
            ahead = layer.phi @ fleet.states[deputy] + layer.gamma @ nearest.x
            if not nearest.success or layer.excesses(ahead, len(layer.checks)).max() > 0.0:
                continue  # the spheres, speeds or brakes change it, too
            compared += np.abs(nearest.x - wanted[deputy]).max() > 0.01
            np.testing.assert_allclose(forces[deputy], nearest.x, atol=2e-4)
    assert compared > 10


def test_the_stop_is_always_allowed():
    """The force of the proof: it keeps each deputy on its side of all planes."""
    mission, random = mission_of(5), np.random.default_rng(3)
    for _ in range(10):
        fleet = drawn(mission, 5, random)
        stops = fleet.states @ fleet.layer.stop.T
        np.testing.assert_allclose(fleet.corrected(stops), stops, atol=1e-9)


def test_fleets_of_a_champion_stay_apart():
    words = [
        *WORDS,
        "fleet.deputies=3",
        "monte_carlo.num_cases=100",
        "monte_carlo.parked=true",
        "attitude=ideal",
    ]
    pairs = []
    for kept in ("0", f"{APART_M:g}"):
        experiment = compose_experiment([*words, f"fleet.keep_apart_m={kept}"]).experiment
        mission, scenarios = experiment.mission, evaluation_scenarios(experiment)
        outcomes = fly_all(mission, load(experiment.controller, mission), scenarios, 1)
        pairs.append(outcomes.nearest_pair_m)
    gaps = [
        min(np.linalg.norm(a.position_m - b.position_m) for i, a in enumerate(s.fleet) for b in s.fleet[:i])
        for s in scenarios
    ]
    is_apart = np.array(gaps) >= 2.0 * APART_M
    without, with_planes = pairs
    assert (without[is_apart] < APART_M).sum() > 3
    assert with_planes[is_apart].min() >= APART_M
    assert outcomes.is_success(95.0).mean() > 0.9


@pytest.mark.parametrize(
    "words",
    [
        ("safety=none",),
        ("safety=robust", "dynamics=two_body", "orbit.course=true"),
        ("navigation=fixes",),
        ("actuators=real",),
        ("dynamics=two_body",),
    ],
    ids=" ".join,
)
def test_where_nothing_is_proved_it_is_refused(words):
    with pytest.raises(SettingError, match=r"fleet\.keep_apart_m is 10"):
        mission_of(2, *words)
