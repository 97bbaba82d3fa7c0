"""Controllers that plan, flown like any other: by any number of threads, from the command line, recorded."""

import json

import numpy as np
import pytest

from pipeline.controllers.planned.paths import elements_matrix, ring_elements
from pipeline.controllers.source import load
from pipeline.flight.control.controller import open_loop
from pipeline.flight.fly.simulation import fly_all, fly_logged
from pipeline.recording.recorder import controller_text
from pipeline.settings.controllers import planned_settings
from pipeline.settings.experiment import SettingError
from tests.pipeline.controllers.planned.cases import (
    KINDS,
    MEAN_MOTION,
    PERIOD,
    composed,
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
