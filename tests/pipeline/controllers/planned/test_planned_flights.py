"""Controllers that plan, flown like any other: by any number of threads, from the command line, recorded."""

import json

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

from pipeline.controllers.planned.lqr import gain
from pipeline.controllers.planned.natural_motion import count_seen
from pipeline.controllers.planned.paths import SPARE_POINTS, Route, Routes, elements_matrix, ring_elements
from pipeline.controllers.source import load
from pipeline.flight.control.controller import open_loop
from pipeline.flight.fly.simulation import fly_all, fly_logged
from pipeline.flight.state.log import points_needed
from pipeline.flight.world.pack import pack_world
from pipeline.recording.recorder import controller_text
from pipeline.settings.controllers import planned_settings
from pipeline.settings.experiment import SettingError
from tests.pipeline.controllers.planned.cases import (
    KINDS,
    MEAN_MOTION,
    PERIOD,
    composed,
    discrete,
    flown,
    planned_ahead,
    planner,
    starts,
)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_the_number_of_threads_changes_nothing(kind):
    mission, scenarios = starts(kind, "sun=random")
    controller = load(composed(kind).experiment.controller, mission)
    tracks = [np.empty((8, 361, 3), dtype=np.float32) for _ in range(2)]
    one, two = (
        fly_all(mission, controller, scenarios, n, track) for n, track in zip((1, 2), tracks, strict=True)
    )
    for name, values in vars(one).items():
        np.testing.assert_array_equal(values, vars(two)[name])
    np.testing.assert_array_equal(*tracks)
    last = fly_all(mission, controller, scenarios[-1:], 1)
    assert last.delta_v_m_s[0] == one.delta_v_m_s[-1]


@pytest.mark.parametrize("kind", KINDS)
def test_a_flight_is_its_plan_flown(kind):
    mission, scenarios = starts(kind)
    controller = load(composed(kind).experiment.controller, mission)
    assert controller.name == kind
    log = fly_logged(mission, controller, scenarios[2])
    plan = log.force_hill_n
    assert plan.any()
    if controller.planner is not None:  # in this world nothing comes otherwise than it is known beforehand
        np.testing.assert_allclose(plan, planned_ahead(controller.planner, scenarios[2]), atol=1e-7)
    np.testing.assert_allclose(log.position_m, flown(scenarios[2], plan)[:, :3], atol=1e-6)
    assert log.delta_v_m_s[-1] == pytest.approx(np.abs(plan).sum() * 10.0 / 12.0, rel=1e-12)
    again = fly_logged(mission, open_loop("plan", plan), scenarios[2])
    np.testing.assert_array_equal(log.is_inspected, again.is_inspected)
    assert json.loads(controller_text(controller)) == {"kind": kind, "name": kind}


@pytest.mark.slow
def test_the_reference_flies_the_same_plan():
    overrides = ("guidance=clusters", "guidance.engine=sklearn", "duration_s=600.0", "attitude=ideal")
    mission, scenarios = starts("lqr", *overrides)
    controller = load(composed("lqr", *overrides).experiment.controller, mission)
    outcomes = fly_all(mission, controller, scenarios[:1], 1)
    mission, _ = starts("lqr", "duration_s=600.0", "attitude=ideal")
    spent = np.abs(fly_logged(mission, controller, scenarios[0]).force_hill_n).sum() * 10.0 / 12.0
    assert outcomes.delta_v_m_s[0] == pytest.approx(spent, rel=1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_values_that_cannot_be_are_refused_with_the_configuration(kind):
    key = "points" if kind == "natural_motion" else "ring_size_m"
    with pytest.raises(SettingError, match=rf"controller.{key} is 0(\.0)?; it must be "):
        composed(kind, f"controller.{key}=0")
    with pytest.raises(SettingError, match=f"one of kind {kind} has .*kind"):
        composed(kind, "+controller.colour=red")


def test_under_the_safety_layer_the_law_answers_to_where_it_led():
    overrides = ("sun=random", "safety=filter", "monte_carlo.num_cases=30")
    mission, scenarios = starts("lqr", *overrides)
    controller = load(composed("lqr", *overrides).experiment.controller, mission)
    outcomes = fly_all(mission, controller, scenarios, 1)
    assert not outcomes.is_violated.any()
    case = int(np.argmax(outcomes.safety_periods))
    assert outcomes.safety_periods[case] > 3
    log = fly_logged(mission, controller, scenarios[case])
    settings = planned_settings(composed("lqr").experiment.controller)
    plan_for = planner("lqr", *overrides)
    ring = ring_elements(settings, scenarios[case], MEAN_MOTION * PERIOD * np.arange(361))
    states = np.hstack([log.position_m, log.velocity_m_s])
    error = states - ring @ np.linalg.inv(elements_matrix(MEAN_MOTION)).T
    asked = -(error[:-1] @ plan_for.gain.T)
    asked[np.abs(asked) < settings.dead_band_n] = 0.0
    np.testing.assert_allclose(log.force_hill_n - log.safety_force_hill_n, np.clip(asked, -1, 1), atol=1e-6)


SETTINGS = planned_settings(composed("lqr").experiment.controller)
MISSION, STARTS = starts("lqr", "sun=random")


def costs():
    tolerated = [SETTINGS.position_tolerance_m] * 2 + [SETTINGS.height_tolerance_m]
    tolerated += [SETTINGS.velocity_tolerance_m_s] * 3
    return np.diag(1.0 / np.square(tolerated)), np.eye(3) / SETTINGS.force_tolerance_n**2


def test_the_gain_is_that_of_scipys_riccati_solution():
    transition, control = discrete()
    state_cost, force_cost = costs()
    solution = solve_discrete_are(transition, control, state_cost, force_cost)
    expected = np.linalg.inv(force_cost + control.T @ solution @ control) @ control.T @ solution @ transition
    np.testing.assert_allclose(gain(SETTINGS, transition, control), expected, rtol=1e-6, atol=1e-9)


def test_the_closed_loop_is_stable():
    transition, control = discrete()
    poles = np.linalg.eigvals(transition - control @ gain(SETTINGS, transition, control))
    assert np.abs(poles).max() < 1.0
    # within a quarter of an orbit errors fall to a fifth
    assert np.abs(poles).max() ** 142 < 0.2


def test_forces_follow_the_law_to_a_ring_in_phase_with_the_sun():
    controller = load(composed("lqr", "sun=random").experiment.controller, MISSION)
    feedback = gain(SETTINGS, *discrete())
    for start in STARTS:
        plan = fly_logged(MISSION, controller, start).force_hill_n
        states = flown(start, plan)
        turned = MEAN_MOTION * 10.0 * np.arange(361)
        phase = start.sun_angle_rad - SETTINGS.ring_lead_rad - turned
        size, height = SETTINGS.ring_size_m, SETTINGS.max_height_m
        height = np.clip(start.position_m[2], -height, height)
        ring = np.column_stack(
            [
                size * np.cos(phase),
                2 * size * np.sin(phase),
                height * np.cos(turned + SETTINGS.height_lead_rad),
            ]
        )
        # the ring's velocity is the derivative of its position: the phase falls at n
        speed = MEAN_MOTION * np.column_stack(
            [
                size * np.sin(phase),
                -2 * size * np.cos(phase),
                -height * np.sin(turned + SETTINGS.height_lead_rad),
            ]
        )
        error = states - np.hstack([ring, speed])
        asked = np.clip(-(error[:-1] @ feedback.T), -1.0, 1.0)
        asked[np.abs(asked) < SETTINGS.dead_band_n] = 0.0
        np.testing.assert_allclose(plan, asked, atol=1e-7)
        assert np.linalg.norm(error[-1, :3]) < 0.2 * np.linalg.norm(error[0, :3])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"ring_size_m": 110.0}, "a ring from 110 to 221.5 m from the chief; it must stay within"),
        ({"ring_size_m": 10.0}, "controller.ring_size_m is 10"),
        ({"ring_size_m": "big"}, "controller.ring_size_m is 'big'; it must be a number"),
        ({"position_tolerance_m": 0.0}, "controller.position_tolerance_m is 0.0; it must be greater than 0"),
        ({"ring_lead_rad": 4.0}, "controller.ring_lead_rad is 4.0; it must be from -3.14159 to 3.14159 "),
        ({"force_tolerance_n": 1e-30}, "controller.force_tolerance_n is 1e-30; it must be from 1e-09 to "),
    ],
)
def test_regulators_that_cannot_be(changes, message):
    with pytest.raises(SettingError, match=message):
        planner("lqr", **changes)


WORLD = ("world=leo", "navigation=perfect", "actuators=ideal", "dynamics=cw", "controller.follows=route")
LIT, LIT_STARTS = starts("lqr", *WORLD)
START = LIT_STARTS[0]


@pytest.fixture(scope="module")
def route() -> Route:
    return Routes(LIT, 40)(START)


@pytest.mark.slow
def test_it_follows_from_its_few_burns(route: Route) -> None:
    transition, control = discrete()
    forces, states = route
    assert len(states) == len(forces) + 41 == LIT.num_controls + 41
    np.testing.assert_array_equal(states[0], np.r_[START.position_m, START.velocity_m_s])
    held = np.vstack([forces, np.zeros((40, 3))])
    np.testing.assert_allclose(states[1:], states[:-1] @ transition.T + held @ control.T, atol=1e-9)
    assert 0 < np.count_nonzero(forces.any(axis=1)) < 20
    distances = np.linalg.norm(states[: len(forces) + 1, :3], axis=1)
    assert distances.min() >= 15.0
    assert distances.max() <= 200.0


@pytest.mark.slow
def test_it_shows_what_makes_a_success_and_more(route: Route) -> None:
    path = route.states[: LIT.num_controls + 1, :3]
    log = fly_logged(LIT, load(composed("lqr", *WORLD).experiment.controller, LIT), START)
    needed = points_needed(int(log.is_inspectable.sum()), 95.0)
    # a camera that is on the chief from the start sees a little more than one that has to turn to it
    assert count_seen(pack_world(LIT), START, path[np.newaxis])[0] >= needed + SPARE_POINTS
    # nothing is unknown here, so that the regulator has nothing to answer
    np.testing.assert_allclose(log.position_m, path, atol=1e-6)
    np.testing.assert_allclose(log.force_hill_n, route.forces, atol=1e-9)


@pytest.mark.slow
def test_the_receding_horizon_ends_on_it(route: Route) -> None:
    plan_for = planner("receding_horizon", *WORLD)
    beyond = plan_for.routes(START).states
    np.testing.assert_allclose(plan_for.elements @ beyond[300], plan_for.wanted(START, 300), atol=1e-12)
    np.testing.assert_array_equal(beyond[: len(route.states)], route.states[: len(beyond)])
