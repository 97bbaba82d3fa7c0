"""Foresight divided among deputies: priced together, flown as planned, cheaper than alone."""

import numpy as np
import pytest

from pipeline.command_line.config import compose_experiment
from pipeline.controllers.source import load
from pipeline.flight.control.controller import ControllerError
from pipeline.flight.fly.divided import Team, divided_openings
from pipeline.flight.fly.fleet_logs import fly_logged_fleet
from pipeline.flight.fly.fleets_ahead import fly_all_fleets
from pipeline.flight.fly.outlooks import at_start, finishing
from pipeline.flight.fly.simulation import fly_all
from pipeline.flight.reference.motion import pushed
from pipeline.scenarios import evaluation_scenarios

WORDS = ("+experiment=evaluate_fleet", "controller=champion_27_rehearsed", "sun=random", "attitude=ideal")
PARKED = "monte_carlo.parked=true"


def composed(*words: str):
    experiment = compose_experiment([*WORDS, *words]).experiment
    mission = experiment.mission
    return mission, load(experiment.controller, mission), evaluation_scenarios(experiment)


@pytest.fixture(scope="module")
def planned():
    """Of a few fleets of two: mission, controller, starts, teams and their plans."""
    mission, controller, scenarios = composed(PARKED, "monte_carlo.num_cases=6")
    teams = []
    for scenario in scenarios:
        deputies = at_start(mission.of_each, mission.of_each, controller, list(scenario.fleet), 0, 8)
        teams.append(Team(deputies, deputies.outlooks()))
    return mission, controller, scenarios, teams, [team.divided() for team in teams]


def test_enough_seen_inside_the_limits_costs_what_is_fired(planned):
    """What plans show, by positions that SciPy's matrix exponential leads to, and points as they stand."""
    mission, _, scenarios, teams, plans = planned
    num_exact = 0
    for scenario, team, genes in zip(scenarios, teams, plans, strict=True):
        shown, fired, is_inside = np.zeros(99, np.bool_), 0.0, True
        for start, plan, (outlook, _) in zip(scenario.fleet, genes, team.outlooks, strict=True):
            forces = np.where(np.abs(plan[:6]) >= outlook.least_force, plan[:6], 0.0).reshape(2, 3)
            state, period = np.r_[start.position_m, start.velocity_m_s], mission.control_period_s
            begins = {0: forces[0]}
            later = outlook.step * int(plan[6])
            begins[later] = begins.get(later, np.zeros(3)) + forces[1]
            fired += np.abs(forces).sum() * outlook.delta_v_per_force
            for k in range(outlook.step * (len(outlook.free) - 1) + 1):
                sample, rest = divmod(k, outlook.step)
                distance = np.linalg.norm(state[:3])
                if rest == 0:  # the cheapest plans end at limits, up to rounding
                    is_inside &= bool(outlook.nearest - 1e-8 <= distance <= outlook.farthest + 1e-8)
                    is_above = state[:3] @ outlook.normals[sample] >= outlook.heights - 1e-8
                    shown |= outlook.is_lit[sample] & is_above & (distance >= outlook.sight[sample] - 1e-8)
                state = pushed(mission, state, begins.get(k, np.zeros(3)), period)
        if shown.sum() >= team.outlooks[0][1] and is_inside:
            num_exact += 1
            assert team.price(genes) == pytest.approx(fired, abs=1e-6)
        else:
            assert team.price(genes) > fired
    assert num_exact >= 4


def test_no_deputy_alone_does_better_than_the_team_is_priced(planned):
    """Doing nothing, for both and for each, costs at least as much as the plans."""
    *_, teams, plans = planned
    for team, genes in zip(teams, plans, strict=True):
        price = team.price(genes)
        for kept in ([False, False], [True, False], [False, True]):
            assert team.price(np.where(np.array(kept)[:, np.newaxis], genes, 0.0)) >= price - 1e-12


def test_fleets_fly_the_cheapest_of_plans_and_rules(planned):
    mission, controller, scenarios, *_ = planned
    flown = fly_all_fleets(mission, controller, scenarios, 1)
    rules = fly_all_fleets(mission, finishing(controller), scenarios, 1)
    assert np.all(flown.is_success(95.0) & ~flown.is_violated)
    assert np.all(flown.delta_v_m_s <= rules.delta_v_m_s + 0.15 * (99 - rules.inspected_count))
    # two parked deputies that divide their plans need less than one alone
    alone = fly_all(mission.of_each, controller, [scenario.fleet[0] for scenario in scenarios], 1)
    assert flown.delta_v_m_s.mean() < 0.75 * alone.delta_v_m_s.mean()
    assert np.all(flown.ahead_delta_v_m_s <= flown.delta_v_m_s + 1e-12)
    again = fly_all_fleets(mission, controller, scenarios[2:3], 2)
    assert again.delta_v_m_s[0] == flown.delta_v_m_s[2]


def test_planned_forces_are_logged(planned):
    mission, controller, scenarios, *_ = planned
    flown = fly_all_fleets(mission, controller, scenarios[:1], 1)
    logs = fly_logged_fleet(mission, controller, scenarios[0])
    spent = [log.flight.delta_v_m_s[-1] for log in logs]
    np.testing.assert_array_equal(spent, flown.of_deputies[0, :, 0])
    openings = divided_openings(mission, controller, scenarios[:1])
    assert openings.shape == (2, mission.num_controls, 4)


@pytest.mark.parametrize("words", [("navigation=fixes",), ("actuators=real",), ("dynamics=two_body",)])
def test_plans_are_divided_where_all_is_exact(words):
    mission, controller, scenarios = composed("monte_carlo.num_cases=1", *words)
    with pytest.raises(ControllerError, match=r"divides its plans among deputies, once, where all is exact"):
        fly_all_fleets(mission, controller, scenarios, 1)
