"""Foresight divided among deputies: priced together, flown as planned, cheaper than alone."""

import numpy as np
import pytest

from pipeline.command_line.config import compose_experiment
from pipeline.controllers.source import load
from pipeline.flight.cases.navigation import as_believed
from pipeline.flight.cases.starts import cases_of
from pipeline.flight.control.controller import ControllerError
from pipeline.flight.control.law import ahead_stride, law_of
from pipeline.flight.fly.divided import Team, openings_of, team_of
from pipeline.flight.fly.fleet_logs import fly_logged_fleet
from pipeline.flight.fly.fleets import OF_DEPUTIES, Chosen, FlightPart, fly_chosen
from pipeline.flight.fly.fleets_ahead import fly_all_fleets, looked_ahead
from pipeline.flight.fly.lesser_controllers import finishing
from pipeline.flight.fly.outlooks import at_start, by_then, room_for_known
from pipeline.flight.fly.population import fly_population
from pipeline.flight.fly.replanning import COASTING, FINISHING, RULES, left_to_fire
from pipeline.flight.fly.simulation import fly_all
from pipeline.flight.reference.motion import pushed
from pipeline.flight.world.pack import pack_world
from pipeline.recording.events import events
from pipeline.recording.fleets import fleet_events
from pipeline.scenarios import evaluation_scenarios
from tests.pipeline.flight.independence import assert_fleets_are_independent

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
    chosen = looked_ahead(mission, controller, scenarios[:1], 1)
    assert chosen.openings.shape == (2, mission.num_controls, 4)
    # decisions are told, and do not change what is flown
    recorded = looked_ahead(mission, controller, scenarios[:1], 1, records=True)
    np.testing.assert_array_equal(recorded.openings, chosen.openings)
    for log in logs:
        ((sample, _, missed),) = log.flight.foresight_at
        begins, forces = log.flight.foresight_plans[0, 0, :, 0], log.flight.foresight_plans[0, 0, :, 1:]
        assert sample == 0
        assert missed > 0
        fired = np.abs(forces[begins >= 0.0]).sum() * mission.control_period_s / mission.deputy.mass_kg
        assert fired == pytest.approx(log.flight.delta_v_m_s[-1], abs=1e-12)
        (ends,) = log.flight.foresight_ends_m_s
        assert np.nanmin(ends) == pytest.approx(flown.delta_v_m_s[0], abs=1e-12)


def test_what_is_left_of_plans_that_still_see_enough_is_flown_on(planned):
    _, _, _, teams, plans = planned
    num_held = 0
    for team, genes in zip(teams, plans, strict=True):
        again = Team(team.deputies, team.outlooks, last=genes)
        num_held += again.is_held
        if again.is_held:
            assert again.divided() is genes
            assert again.num_priced == 0
        idle = Team(team.deputies, team.outlooks, last=np.zeros_like(genes))
        if not idle.is_held:  # doing nothing sees too little
            assert team.price(idle.divided()) <= team.price(genes) + 0.02
            assert idle.num_priced > 0
    assert num_held >= 4


def test_forces_left_of_a_plan_are_its_genes(planned):
    """What is left of a plan that has just begun is the plan, by when it fires what."""
    _, _, _, teams, plans = planned
    for team, genes in zip(teams, plans, strict=True):
        for each, opening in zip(genes, openings_of(team.deputies, genes), strict=True):
            left = left_to_fire(opening[:, :3], team.num_pushes, team.deputies.step)
            np.testing.assert_array_equal(
                openings_of(team.deputies, np.array([left] * 2))[0], opening, err_msg=str(each)
            )


def test_the_cheapest_of_more_searches_costs_no_more(planned):
    """Each attempt draws anew, and the first is the only one where no more are demanded."""
    mission, _, scenarios, teams, plans = planned
    _, thorough, _ = composed(PARKED, "+controller.attributes.foresight_searches=3")
    num_cheaper = 0
    for scenario, team, genes in zip(scenarios[:3], teams, plans, strict=False):
        deputies = at_start(mission.of_each, mission.of_each, thorough, list(scenario.fleet), 0, 8)
        more, once = Team(deputies, deputies.outlooks()), Team(team.deputies, team.outlooks)
        cheapest = more.divided()
        np.testing.assert_array_equal(once.divided(), genes)
        assert more.price(cheapest) <= team.price(genes)
        num_cheaper += more.price(cheapest) < team.price(genes)
        assert more.num_priced > 2 * once.num_priced
    assert num_cheaper > 0
    # plans that are made again are those of a single attempt
    idle = np.zeros_like(genes)
    again = Team(deputies, more.outlooks, last=idle), Team(team.deputies, team.outlooks, last=idle)
    assert not again[0].is_held
    np.testing.assert_array_equal(*(each.divided() for each in again))


INEXACT = ("navigation=fixes", "actuators=real")
ERRORS = (INEXACT[:1], INEXACT[1:], ("dynamics=two_body",), INEXACT)


@pytest.mark.slow
@pytest.mark.parametrize("words", ERRORS, ids=" ".join)
def test_with_errors_fleets_plan_again(words):
    """They spend a fraction of what their rules do, know only their estimates, and succeed."""
    mission, controller, scenarios = composed(PARKED, "monte_carlo.num_cases=4", *words)
    flown = fly_all_fleets(mission, controller, scenarios, 1)
    rules = fly_all_fleets(mission, finishing(controller), scenarios, 1)
    assert np.all(flown.is_success(95.0) & ~flown.is_violated)
    assert flown.delta_v_m_s.mean() < 0.5 * rules.delta_v_m_s.mean()


@pytest.mark.slow
def test_plans_made_again_depend_on_neither_workers_nor_neighbours():
    words = (*INEXACT, "fleet.deputies=3", "fleet.delay_periods=1", "fleet.lost_percent=20")
    mission, controller, scenarios = composed(PARKED, "monte_carlo.num_cases=3", *words)
    assert_fleets_are_independent(mission, controller, scenarios)


@pytest.mark.slow
@pytest.mark.parametrize("keeps_reserve", [False, True])
@pytest.mark.parametrize("words", [(), ("safety=robust", "fleet.keep_apart_m=10")], ids=" ".join)
def test_each_log_says_what_was_planned_when(words, keeps_reserve):
    reserve = ("+controller.attributes.foresight_points=1.0",) * keeps_reserve
    mission, controller, scenarios = composed("monte_carlo.num_cases=1", *INEXACT, *words, *reserve)
    flown, logs = (
        fly_all_fleets(mission, controller, scenarios, 1),
        fly_logged_fleet(mission, controller, scenarios[0]),
    )
    spent = [log.flight.delta_v_m_s[-1] for log in logs]
    np.testing.assert_array_equal(spent, flown.of_deputies[0, :, OF_DEPUTIES.index("delta_v_m_s")])
    period = ahead_stride(controller, mission, "foresight_period_s")
    for log in logs:
        samples = log.flight.foresight_at[:, 0].tolist()
        assert samples == list(range(0, mission.num_controls, period))
        said = [(event.sample, event.text) for event in events(mission.of_each, log.flight, 10.0, controller)]
        assert [sample for sample, text in said if text.startswith("planned: ")] == samples
        texts = [event.text for event in fleet_events(mission, log, mission.fleet.deputies)]
        assert any(text.startswith("plans are made for all 2 deputies together") for text in texts)
        planned = np.array([each.flight.foresight_plans[:, 0, :, 1:] for each in logs])
        fuels = np.abs(planned).sum(axis=(0, 2, 3)) * mission.control_period_s / mission.deputy.mass_kg
        for decision in range(0 if words else len(samples)):  # where nothing keeps deputies apart
            plan, ends = log.flight.foresight_plans[decision, 0], log.flight.foresight_ends_m_s[decision]
            if log.flight.foresight_at[decision, 1] > 0:  # rules keep no reserve, so that plans come first
                is_enough = ends[COASTING] <= fuels[decision] + 1e-9
                assert np.isnan(ends[[FINISHING, RULES]]).all() == (is_enough and keeps_reserve)
            now = plan[plan[:, 0] == samples[decision], 1:].sum(axis=0)
            if np.nanargmin(ends) == COASTING and np.abs(now).max() < mission.deputy.max_force_n:
                requested = log.flight.force_asked_n[int(samples[decision])]
                np.testing.assert_allclose(requested, now, atol=1e-12)


def test_fleets_know_their_estimates_and_not_their_errors():
    """At the first decision after the start, where each believes to be, and what all have seen together."""
    mission, controller, scenarios = composed("monte_carlo.num_cases=2", "fleet.sharing=nothing", *INEXACT)
    rows, sample = room_for_known(mission.of_each, 4), 30
    coasting = np.tile([0.0, 0.0, 0.0, 1.0], (4, sample, 1))
    chosen = Chosen((finishing(controller),), np.zeros((2, 2), dtype=np.int64), coasting)
    fly_chosen(mission, chosen, scenarios, 1, part=FlightPart(last=sample), known=rows)
    each = [start for scenario in scenarios for start in scenario.fleet]
    single = np.empty_like(rows)
    alone = mission.of_each
    fly_population(
        *(pack_world(alone)._replace(last=sample), law_of(finishing(controller), alone)),
        *(finishing(controller).numbers, cases_of(alone, each), 1),
        openings=coasting,
        known=single,
    )
    np.testing.assert_array_equal(rows, single)
    believed = by_then(
        at_start(alone, as_believed(alone, each)[0], controller, each, 30, 8), each, rows, sample, 30
    )
    team = team_of(mission, believed.only(np.array([0, 1])))
    unseen = rows[:2, 6 : 6 + 99]
    np.testing.assert_array_equal(team.deputies.left[0, :99], unseen.min(axis=0))
    assert np.any(unseen[0] != unseen[1])
    assert team.deputies.spreads_m[0] == believed.spreads_m[:2].max() > 0.0


def test_plans_as_on_board_are_refused_where_they_would_be_made_again():
    for words in ERRORS:
        mission, controller, scenarios = composed(
            "monte_carlo.num_cases=1", "+controller.attributes.foresight_bare=1", *words
        )
        with pytest.raises(ControllerError, match=r"plans as on board, by foresight_bare, and fleets do"):
            fly_all_fleets(mission, controller, scenarios, 1)
