"""Controllers that plan, flown like any other: by any number of threads, from the command line, recorded."""

import json

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

from pipeline.controllers.planned.lqr import gain
from pipeline.controllers.planned.natural_motion import count_seen
from pipeline.controllers.planned.paths import SPARE_POINTS, Route, Routes
from pipeline.controllers.source import load
from pipeline.flight.control.controller import PlanningController, open_loop
from pipeline.flight.fly.simulation import fly_all, fly_logged
from pipeline.flight.reference.motion import transition
from pipeline.flight.state.log import points_needed
from pipeline.flight.world.pack import pack_world
from pipeline.recording.recorder import controller_text
from pipeline.settings.controllers import Planned
from pipeline.settings.experiment import SettingError
from tests.pipeline.controllers.planned import cases
from tests.pipeline.controllers.planned.cases import MEAN_MOTION, flown


@pytest.mark.slow
@pytest.mark.parametrize("kind", cases.KINDS)
def test_the_number_of_threads_changes_nothing(kind):
    mission, scenarios = cases.starts(kind, "sun=random")
    controller = load(cases.composed(kind).experiment.controller, mission)
    tracks = [np.empty((8, 361, 3), dtype=np.float32) for _ in range(2)]
    single, two = (
        fly_all(mission, controller, scenarios, n, track) for n, track in zip((1, 2), tracks, strict=True)
    )
    for name, values in vars(single).items():
        np.testing.assert_array_equal(values, vars(two)[name])
    np.testing.assert_array_equal(*tracks)
    last = fly_all(mission, controller, scenarios[-1:], 1)
    assert last.delta_v_m_s[0] == single.delta_v_m_s[-1]


@pytest.mark.parametrize("kind", cases.KINDS)
def test_a_flight_is_its_plan_flown(kind):
    mission, scenarios = cases.starts(kind)
    controller = load(cases.composed(kind).experiment.controller, mission)
    assert controller.name == kind
    log = fly_logged(mission, controller, scenarios[2])
    plan = log.force_hill_n
    assert plan.any()
    if isinstance(
        controller, PlanningController
    ):  # in this world nothing comes otherwise than it is known beforehand
        np.testing.assert_allclose(plan, cases.planned_ahead(controller.planner, scenarios[2]), atol=1e-7)
    np.testing.assert_allclose(log.position_m, flown(scenarios[2], plan)[:, :3], atol=1e-6)
    assert log.delta_v_m_s[-1] == pytest.approx(np.abs(plan).sum() * 10.0 / 12.0, rel=1e-12)
    again = fly_logged(mission, open_loop("plan", plan), scenarios[2])
    np.testing.assert_array_equal(log.is_inspected, again.is_inspected)
    assert json.loads(controller_text(controller)) == {"kind": kind, "name": kind}


def test_under_the_safety_layer_the_law_answers_to_where_it_led():
    overrides = ("sun=random", "safety=filter", "monte_carlo.num_cases=30")
    mission, scenarios = cases.starts("lqr", *overrides)
    controller = load(cases.composed("lqr", *overrides).experiment.controller, mission)
    outcomes = fly_all(mission, controller, scenarios, 1)
    assert not outcomes.is_violated.any()
    case = int(np.argmax(outcomes.safety_periods))
    assert outcomes.safety_periods[case] > 3
    log = fly_logged(mission, controller, scenarios[case])
    feedback = cases.planner("lqr", *overrides).gain
    force = regulated(feedback, scenarios[case], np.hstack([log.position_m, log.velocity_m_s]))
    np.testing.assert_allclose(log.force_hill_n - log.safety_force_hill_n, force, atol=1e-6)


SETTINGS = Planned(**cases.composed("lqr").experiment.controller)
MISSION, STARTS = cases.starts("lqr", "sun=random")
TRANSITION, CONTROL = transition(MEAN_MOTION, cases.PERIOD, cases.MASS)


def regulated(feedback, start, states):
    """The forces that answer to where states are off the ring, N."""
    force = -(states - cases.ring(SETTINGS, start, np.arange(361)))[:-1] @ feedback.T
    return np.where(np.abs(force) < SETTINGS.dead_band_n, 0.0, np.clip(force, -1.0, 1.0))


def test_the_gain_is_that_of_scipys_riccati_solution_and_the_closed_loop_is_stable():
    tolerated = [SETTINGS.position_tolerance_m] * 2 + [SETTINGS.height_tolerance_m]
    tolerated += [SETTINGS.velocity_tolerance_m_s] * 3
    state_cost = np.diag(1.0 / np.square(tolerated))
    force_cost = np.eye(3) / SETTINGS.force_tolerance_n**2
    solution = solve_discrete_are(TRANSITION, CONTROL, state_cost, force_cost)
    inverse = np.linalg.inv(force_cost + CONTROL.T @ solution @ CONTROL)
    computed = gain(SETTINGS, TRANSITION, CONTROL)
    np.testing.assert_allclose(computed, inverse @ CONTROL.T @ solution @ TRANSITION, rtol=1e-6, atol=1e-9)
    # within a quarter of an orbit errors fall to a fifth
    assert np.abs(np.linalg.eigvals(TRANSITION - CONTROL @ computed)).max() ** 142 < 0.2


@pytest.mark.parametrize(
    ("kind", "changes", "message"),
    [
        ("natural_motion", {"points": 0}, "controller.points is 0; it must be"),
        ("lqr", {"ring_size_m": 110.0}, "a ring from 110 to 221.5 m from the chief; it must stay within"),
        ("lqr", {"ring_size_m": 10.0}, "controller.ring_size_m is 10"),
        ("lqr", {"ring_size_m": "big"}, "controller.ring_size_m is 'big'; it must be a number"),
        ("lqr", {"position_tolerance_m": 0.0}, "controller.position_tolerance_m is 0.0; it must be greater"),
        ("lqr", {"ring_lead_rad": 4.0}, "controller.ring_lead_rad is 4.0; it must be at most 3.14"),
        ("lqr", {"force_tolerance_n": 1e-30}, "controller.force_tolerance_n is 1e-30; it must be from 1e-09"),
        ("receding_horizon", {"ring_size_m": 0.0}, "controller.ring_size_m is 0.0; it must be"),
        ("receding_horizon", {"solution_period_s": 500.0}, "no solution may be flown beyond its horizon"),
        ("receding_horizon", {"first_horizon_s": 300.0}, "controller.first_horizon_s 300; no solution"),
        ("receding_horizon", {"horizon_s": 0.0}, "controller.horizon_s is 0.0; it must be greater than 0"),
        ("receding_horizon", {"margin_m": -1.0}, "controller.margin_m is -1.0; it must be at least 0"),
    ],
)
def test_planners_that_cannot_be(kind, changes, message):
    with pytest.raises(SettingError, match=message):
        cases.planner(kind, **changes)


@pytest.mark.parametrize("kind", cases.KINDS)
def test_values_that_cannot_be_are_refused_with_the_configuration(kind):
    with pytest.raises(SettingError, match=f"controller.kind={kind}; the keys are kind"):
        cases.composed(kind, "+controller.colour=red")


WORLD = ("world=leo", "navigation=perfect", "actuators=ideal", "dynamics=cw", "controller.follows=route")
LIT, LIT_STARTS = cases.starts("lqr", *WORLD)
START = LIT_STARTS[0]


@pytest.fixture(scope="module")
def route() -> Route:
    return Routes(LIT, 40)(START)


@pytest.mark.slow
def test_it_follows_from_its_few_burns(route: Route) -> None:
    forces, states = route
    assert len(states) == len(forces) + 41 == LIT.num_controls + 41
    np.testing.assert_array_equal(states[0], np.r_[START.position_m, START.velocity_m_s])
    held = np.vstack([forces, np.zeros((40, 3))])
    np.testing.assert_allclose(states[1:], states[:-1] @ TRANSITION.T + held @ CONTROL.T, atol=1e-9)
    assert 0 < np.count_nonzero(forces.any(axis=1)) < 20
    distances = np.linalg.norm(states[: len(forces) + 1, :3], axis=1)
    assert distances.min() >= 15.0
    assert distances.max() <= 200.0


@pytest.mark.slow
def test_it_shows_what_makes_a_success_and_more(route: Route) -> None:
    path = route.states[: LIT.num_controls + 1, :3]
    log = fly_logged(LIT, load(cases.composed("lqr", *WORLD).experiment.controller, LIT), START)
    needed = points_needed(int(log.is_inspectable.sum()), 95.0)
    # a camera that is on the chief from the start sees a little more than one that has to turn to it
    assert count_seen(pack_world(LIT), START, path[np.newaxis])[0] >= needed + SPARE_POINTS
    # nothing is unknown here, so that the regulator has nothing to answer
    np.testing.assert_allclose(log.position_m, path, atol=1e-6)
    np.testing.assert_allclose(log.force_hill_n, route.forces, atol=1e-9)


@pytest.mark.slow
def test_the_receding_horizon_ends_on_it(route: Route) -> None:
    plan_for = cases.planner("receding_horizon", *WORLD)
    beyond = plan_for.routes(START).states
    np.testing.assert_allclose(plan_for.elements @ beyond[300], plan_for.wanted(START, 300), atol=1e-12)
    np.testing.assert_array_equal(beyond[: len(route.states)], route.states[: len(beyond)])


#: beside a transfer orbit, where a circle's equations lead hundreds of metres astray
ELLIPSE = (
    *("dynamics=two_body", "orbit=elements", "orbit.semi_major_axis_m=24478137", "orbit.eccentricity=0.725"),
    *("orbit.true_anomaly_deg=290", "sun=random", "duration_s=3000"),
)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["lqr", "receding_horizon"])
def test_routes_beside_an_ellipse_are_paths_of_true_motion(kind):
    words = (*ELLIPSE, "controller.follows=route")
    mission, scenarios = cases.starts(kind, *words)
    controller = load(cases.composed(kind, *words).experiment.controller, mission)
    log = fly_logged(mission, controller, scenarios[0])
    if kind == "lqr":
        route = controller.regulator.routes(scenarios[0])
        # what the regulator answers to is of the second order in the distance
        np.testing.assert_allclose(route.states[: len(log.position_m), :3], log.position_m, atol=0.05)
        np.testing.assert_allclose(log.force_hill_n, route.forces, atol=0.002)
        return
    planner = controller.planner
    for decision in list(planner.decisions)[::7]:
        horizon = planner.horizons[decision]
        ahead = slice(decision, min(decision + planner.lengths[decision], mission.num_controls))
        forces = log.force_hill_n[ahead]
        # forces fired after the next decision are others than the horizon has
        solved = np.zeros((len(horizon.periods), 3))
        count = np.searchsorted(horizon.periods, planner.solution_period)
        solved[:count] = forces[horizon.periods[:count]]
        state = np.r_[log.position_m[decision], log.velocity_m_s[decision]]
        path = horizon.free @ state + horizon.path @ solved.ravel()
        last = min(planner.solution_period, len(forces))
        np.testing.assert_allclose(
            path[:last], log.position_m[decision + 1 : decision + last + 1], rtol=0.0, atol=0.01
        )


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        ("lqr", "controller.follows=ring is an ellipse .* set controller.follows=route"),
        ("receding_horizon", "controller.follows=ring is an ellipse .* set controller.follows=route"),
        ("natural_motion", "the path of natural_motion is an ellipse .* choose another controller"),
    ],
)
def test_ellipses_that_close_about_a_circle_alone_are_refused(kind, words):
    experiment = cases.composed(kind, *ELLIPSE).experiment
    with pytest.raises(SettingError, match=f"orbit.eccentricity is 0.725, and {words}"):
        load(experiment.controller, experiment.mission)
    uniform = cases.composed(kind, *ELLIPSE, "orbit.course=uniform").experiment
    load(uniform.controller, uniform.mission)
