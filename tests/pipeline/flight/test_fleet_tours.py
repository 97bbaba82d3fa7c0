"""Tours of fleets: chosen by answers in turn, each deputy's by flights ahead, and flown as the reference."""

from itertools import product

import numpy as np
import pytest

from pipeline.command_line.config import compose_experiment
from pipeline.controllers.source import load, named
from pipeline.flight.control.controller import ControllerError, RuleController
from pipeline.flight.control.law import rehearsed_pushes
from pipeline.flight.fly.answers import answers_in_turn
from pipeline.flight.fly.fleet_controllers import check_controller
from pipeline.flight.fly.fleet_logs import fly_logged_fleet
from pipeline.flight.fly.fleets import OF_DEPUTIES, Chosen, fly_chosen
from pipeline.flight.fly.fleets_ahead import fly_all_fleets, looked_ahead
from pipeline.flight.fly.reference import reference_of
from pipeline.flight.fly.rehearsals import rehearsed_costs
from pipeline.flight.fly.replanning import foresees
from pipeline.flight.fly.tours import tour_images, tour_names
from pipeline.flight.reference import fleet as reference
from pipeline.flight.state.arrays import NUM_TRACKED, TRACK_FORCE
from pipeline.flight.state.signals import constant
from pipeline.recording.events import events
from pipeline.recording.fleets import fleet_events
from pipeline.scenarios import evaluation_scenarios
from pipeline.settings.places import conf_folder
from tests.pipeline.flight.independence import assert_fleets_are_independent

FLEET = ("+experiment=evaluate_fleet", "world=leo", "controller=champion_leo", "attitude=ideal")
#: where deputies fly what they believe
EXACT = ("navigation=perfect", "actuators=ideal", "dynamics=cw")


def composed(*words: str):
    experiment = compose_experiment([*FLEET, "monte_carlo.num_cases=3", *words]).experiment
    mission = experiment.mission
    return mission, load(experiment.controller, mission), evaluation_scenarios(experiment)


@pytest.mark.parametrize(("deputies", "num_tours"), [(1, 3), (2, 4), (3, 3), (4, 2)])
def test_answers_end_where_no_deputy_alone_has_a_better_tour(deputies, num_tours):
    """By tables of costs, some with equal ones, enumerated."""
    generator = np.random.default_rng(deputies)
    tables = np.round(generator.uniform(size=(40, *[num_tours] * deputies)), 1)
    flown = []

    def fly(fleets, tours):
        flown.extend(map(tuple, np.column_stack([fleets, tours]).tolist()))
        return tables[(fleets, *tours.T)]

    answers = answers_in_turn(len(tables), deputies, num_tours, fly)
    assert len(flown) == len(set(flown))
    for table, costs, followed in zip(tables, answers.costs, answers.followed, strict=True):
        end = table[tuple(followed)]
        assert end <= min(table[(tour,) * deputies] for tour in range(num_tours))
        for deputy, tour in product(range(deputies), range(num_tours)):
            tried = [*followed[:deputy], tour, *followed[deputy + 1 :]]
            assert costs[deputy, tour] == table[tuple(tried)]
        np.testing.assert_array_equal(costs.argmin(axis=1), followed)
        np.testing.assert_array_equal(costs.min(axis=1), end)


def test_tours_that_do_not_touch_one_another_are_each_the_cheapest():
    parts = np.random.default_rng(5).uniform(size=(20, 3, 6))

    def fly(fleets, tours):
        return np.take_along_axis(parts[fleets], tours[:, :, np.newaxis], axis=2).sum(axis=(1, 2))

    np.testing.assert_array_equal(answers_in_turn(20, 3, 6, fly).followed, parts.argmin(axis=2))


KEPT_APART = ("safety=filter", "fleet.keep_apart_m=10", "fleet.delay_periods=2")


@pytest.mark.slow
@pytest.mark.parametrize("words", [(), KEPT_APART])
def test_where_all_is_exact_fleets_cost_what_they_cost_ahead(words):
    mission, controller, scenarios = composed(*EXACT, *words)
    chosen = looked_ahead(mission, controller, scenarios, 1)
    flown = fly_all_fleets(mission, controller, scenarios, 1)
    costs = np.broadcast_to(rehearsed_costs(controller, flown)[:, np.newaxis], chosen.followed.shape)
    np.testing.assert_array_equal(chosen.tour_costs.min(axis=2), costs)
    for deputy, tour in product(range(mission.fleet.deputies), range(len(chosen.controllers))):
        followed = chosen.followed.copy()
        followed[:, deputy] = tour
        otherwise = fly_chosen(mission, Chosen(chosen.controllers, followed), scenarios, 1)
        otherwise_costs = rehearsed_costs(controller, otherwise)
        np.testing.assert_array_equal(chosen.tour_costs[:, deputy, tour], otherwise_costs)
        assert np.all(otherwise_costs >= costs[:, 0])
    assert (chosen.followed != chosen.followed[:, :1]).any()  # not all deputies follow the same


@pytest.mark.slow
def test_fleets_know_their_estimates_and_not_their_errors():
    """Tours are those of a fleet that starts at the first estimates, where all is exact and arrives."""
    mission, controller, scenarios = composed("fleet.lost_percent=40")
    chosen = looked_ahead(mission, controller, scenarios, 1)
    exact, _, starts = composed(*EXACT)
    for case, (scenario, start) in enumerate(zip(scenarios, starts, strict=True)):
        logs = fly_logged_fleet(mission, controller, scenario)
        believed = [log.flight.estimate[0] for log in logs]
        assert all(
            np.abs(known[:3] - deputy.position_m).max() > 0.01
            for known, deputy in zip(believed, start.fleet, strict=True)
        )
        fleet = [
            deputy.__class__(known[:3], known[3:], deputy.sun_angle_rad, deputy.sun_elevation_rad)
            for known, deputy in zip(believed, start.fleet, strict=True)
        ]
        first = fleet[0].__class__(**(vars(fleet[0]) | {"others": tuple(fleet[1:])}))
        ahead = looked_ahead(exact, controller, [first], 1)
        np.testing.assert_allclose(ahead.tour_costs[0], chosen.tour_costs[case], atol=1e-6)


@pytest.mark.slow
def test_a_tour_of_all_is_flown_as_by_a_controller_that_follows_it():
    mission, controller, scenarios = composed(*EXACT)
    images = tour_images(controller)
    for tour, image in enumerate(images):
        followed = np.full((len(scenarios), mission.fleet.deputies), tour)
        flown = fly_chosen(mission, Chosen(images, followed), scenarios, 1)
        expected = fly_all_fleets(mission, image, scenarios, 1)
        for name, values in vars(expected).items():
            np.testing.assert_array_equal(getattr(flown, name), values, err_msg=f"{tour} {name}")


@pytest.mark.slow
def test_results_depend_on_neither_workers_nor_neighbours():
    mission, controller, scenarios = composed("fleet.deputies=3")
    assert_fleets_are_independent(mission, controller, scenarios)


@pytest.mark.slow
def test_deputies_with_tours_of_their_own_fly_as_the_reference():
    mission, controller, scenarios = composed("duration_s=900", "monte_carlo.num_cases=2", "fleet.deputies=3")
    images = tour_images(controller)
    chosen = Chosen(images, np.array([[0, 1, 2], [3, 2, 0]]))
    shape = len(scenarios), 3, mission.num_controls + 1, NUM_TRACKED
    tracks, case = np.full(shape, np.nan, np.float32), 1
    fly_chosen(mission, chosen, scenarios, 1, tracks=tracks)
    flights = [
        reference_of(mission.of_each, images[tour], start)
        for tour, start in zip(chosen.followed[case], scenarios[case].fleet, strict=True)
    ]
    fleet = reference.start(flights)
    for k in range(mission.num_controls + 1):
        truths = [state.truth.copy() for state in fleet.deputies]
        _, acts = reference.fleet_period(flights, k, fleet, mission.fleet, None)
        np.testing.assert_allclose(tracks[case, :, k, :6], truths, rtol=1e-5, atol=1e-4, err_msg=f"{k}")
        if acts:
            fired = [act.thrust.fired for act in acts]
            np.testing.assert_allclose(tracks[case, :, k, TRACK_FORCE : TRACK_FORCE + 3], fired, atol=1e-5)


@pytest.mark.slow
def test_each_log_says_which_tour_its_deputy_follows():
    mission, controller, scenarios = composed()
    flown = fly_all_fleets(mission, controller, scenarios, 1)
    chosen, names = looked_ahead(mission, controller, scenarios, 1), tour_names(controller)
    for case, scenario in enumerate(scenarios):
        logs = fly_logged_fleet(mission, controller, scenario)
        spent = [log.flight.delta_v_m_s[-1] for log in logs]
        np.testing.assert_array_equal(spent, flown.of_deputies[case, :, OF_DEPUTIES.index("delta_v_m_s")])
        for log, tour in zip(logs, chosen.followed[case], strict=True):
            words = [event.text for event in events(mission.of_each, log.flight, 10.0, controller)]
            assert any(text.endswith(f"one ends cheapest: {names[tour]}") for text in words)
            words = [event.text for event in fleet_events(mission, log, mission.fleet.deputies)]
            assert any(text.startswith("this tour is the cheapest for all 2 deputies") for text in words)


def shipped():
    """The shipped controllers that need no file, by name."""
    mission = compose_experiment(["+experiment=evaluate_fleet", "world=leo"]).experiment.mission
    for path in sorted((conf_folder() / "controller").glob("champion_*.yaml")):
        controller = named(path.stem, mission)
        if isinstance(controller, RuleController):
            yield controller


def test_shipped_controllers_that_rehearse_more_than_tours_at_the_start_are_refused():
    """Those that plan, in any mission, and those that rehearse tours once are not."""
    mission = compose_experiment(["+experiment=evaluate_fleet", "world=leo"]).experiment.mission
    touring, again, planning = [], [], []
    for controller in shipped():
        constants = {
            name: controller.constants[constant(name)] for name in ("rehearsal_period_s", "rehearsal_draws")
        }
        if foresees(controller):
            planning.append(controller.name)
            check_controller(mission, controller)
        elif len(rehearsed_pushes(controller)):
            with pytest.raises(ControllerError, match=r"plans for one deputy"):
                check_controller(mission, controller)
        elif tour_images(controller) and any(constants.values()):
            again.append(controller.name)
            with pytest.raises(
                ControllerError, match=r"rehearses tours later again, by rehearsal_period_s=1200"
            ):
                check_controller(mission, controller)
        else:
            touring += [controller.name] * bool(tour_images(controller))
            check_controller(mission, controller)
    assert touring
    assert again
    assert planning


def test_tours_with_drawn_errors_are_refused():
    mission, controller, _ = composed("+controller.attributes.rehearsal_draws=16")
    with pytest.raises(
        ControllerError, match=r"rehearses tours with drawn errors, by rehearsal_draws=16, and f"
    ):
        check_controller(mission, controller)
