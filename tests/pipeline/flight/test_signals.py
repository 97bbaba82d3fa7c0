"""Signals: where each stands, what must be computed for it; controllers that cannot fly; plans of forces."""

from dataclasses import replace

import numpy as np
import pytest
import yaml

from fis_tools.formats import serialize
from fis_tools.model import FuzzyController, FuzzySystem, Variable
from pipeline.controllers.source import load
from pipeline.flight.control.controller import Controller, ControllerError, coast, from_fuzzy, open_loop
from pipeline.flight.control.law import law_of
from pipeline.flight.fly.simulation import fly_all, fly_logged
from pipeline.flight.period.look.guidance import POINTS
from pipeline.flight.state.log import FlightLog, Scenario
from pipeline.flight.state.signals import AXES, NOTHING, SIGNALS, Signal, constant, slot
from pipeline.flight.world.pack import by_neighbourhood, inspection_points
from tests.pipeline.flight import cases
from tests.pipeline.flight.cases import HURRYING, STARTS, mission, touring, with_attributes
from tests.pipeline.flight.missions import MEAN_MOTION, steering_systems

BODY = (("force_axes", "body"),)


def test_a_signal_behind_the_last_needs_what_its_row_says(monkeypatch):
    """It once was taken for urgent, whose constants it has not."""
    monkeypatch.setitem(SIGNALS, "added", Signal("m", "a signal that every flight knows", NOTHING))
    system = cases.leaning_system("force_x", 0.02, ("added", "m", 100.0))
    law = law_of(from_fuzzy(FuzzyController("tried", (system,), BODY)), mission())
    assert law.signals[0, 0] == len(SIGNALS) - 1
    assert law.needs == NOTHING


def test_signals_that_are_written_together_stand_together():
    first = slot("target_radial", "target_along_track", "target_cross_track")
    assert (slot("target_along_track"), slot("target_cross_track")) == (first + 1, first + 2)
    with pytest.raises(ValueError, match="put their rows together"):
        slot("target_radial", "target_cross_track")


SIZE_M, LEAD_RAD, SUN_RAD = 35.0, 0.7, 2.0


def watching(*names: str, **constants: float) -> Controller:
    """Never fires, and senses lengths, along x."""
    senses = {"x": (0.01, dict.fromkeys(names, 60.0))}
    return cases.leaning(senses, {"dead_band_force_x_n": 1.0} | constants)


def sensed(watcher: Controller, start: Scenario) -> tuple[FlightLog, np.ndarray]:
    """The log of a flight without force, and what is sensed in it, a row each."""
    log = fly_logged(mission(), watcher, start)
    assert not log.force_hill_n.any()
    return log, log.fis_input[:, 0].T


def test_in_free_motion_the_centre_keeps_its_height_and_drifts_along_the_track_as_predicted():
    names = "centre_radial", "centre_along_track", "predicted_centre_along_track"
    log, (radial, along, predicted) = sensed(watching(*names, prediction_time_s=700.0), STARTS[0])
    np.testing.assert_allclose(radial, radial[0], rtol=0, atol=1e-9)
    time_s = 10.0 * np.arange(360)
    np.testing.assert_allclose(along, along[0] - 1.5 * MEAN_MOTION * radial[0] * time_s, rtol=0, atol=1e-8)
    # an ellipse: the offsets from the centre, the one along the track halved, keep their distance
    x, y = log.position_m[:-1, 0] - radial, 0.5 * (log.position_m[:-1, 1] - along)
    np.testing.assert_allclose(np.hypot(x, y), np.hypot(x[0], y[0]), rtol=0, atol=1e-9)
    np.testing.assert_allclose(predicted[:-70], along[70:], rtol=0, atol=1e-8)
    assert abs(predicted[0] - along[0]) > 10.0
    _, (_, along, predicted) = sensed(watching(*names), STARTS[0])
    np.testing.assert_array_equal(predicted, along)


def test_a_deputy_on_the_ring_stays_on_it_and_away_from_it_the_error_turns_with_the_sun():
    angle = SUN_RAD - LEAD_RAD
    on_the_ring = Scenario(
        SIZE_M * np.array([np.cos(angle), 2.0 * np.sin(angle), 0.0]),
        SIZE_M * MEAN_MOTION * np.array([np.sin(angle), -2.0 * np.cos(angle), 0.0]),
        SUN_RAD,
    )
    for larger in (0.0, 1.0):
        size = {"ring_size_m": (1.0 + larger) * SIZE_M, "ring_lead_rad": LEAD_RAD}
        ring = watching("ring_error_radial", "ring_error_along_track", **size)
        log, (radial, along, _) = sensed(ring, on_the_ring)
        turned = log.sun_angle_rad[:-1] - LEAD_RAD
        np.testing.assert_allclose(radial, -larger * SIZE_M * np.cos(turned), rtol=0, atol=1e-9)
        np.testing.assert_allclose(along, -larger * SIZE_M * np.sin(turned), rtol=0, atol=1e-9)


def test_a_flight_that_coasts_misses_what_was_foreseen_or_a_little_less():
    """Foreseen are the places every two minutes, flown are twelve times as many."""
    watcher = watching("missed", "coasting_nearest", "coasting_farthest")
    for start in cases.random_starts(12, 21):
        log = fly_logged(mission(attitude={"mode": "ideal"}), watcher, start)
        missed = 99 - log.is_inspected[-1].sum()
        foreseen, nearest, farthest = log.fis_input[:, 0].T
        assert np.all(foreseen >= missed)
        assert foreseen[0] - missed <= 8
        assert foreseen[-1] == missed  # nothing lies between the last sample but one and the end
        distance = np.linalg.norm(log.position_m, axis=1)
        least, most = np.array([(distance[k:].min(), distance[k:].max()) for k in range(360)]).T
        np.testing.assert_allclose([nearest, farthest], [least, most], rtol=0, atol=6.0)
        assert np.all(nearest >= least - 1e-9)
        assert np.all(farthest <= most + 1e-9)


@pytest.mark.parametrize("text", ["wide", "nan", "inf", "-1"])
def test_a_constant_that_is_no_length_is_told(text):
    with pytest.raises(ControllerError, match=f"has ring_size_m '{text}'; give a number from 0 on"):
        with_attributes(cases.ORBITAL, ring_size_m=text)


def test_neighbours_share_a_vector():
    points = inspection_points(mission())
    order = by_neighbourhood(points)
    assert sorted(order) == list(range(99))

    def widest(ordered):
        return float(max(np.ptp(ordered[j : j + POINTS], axis=0).max() for j in range(0, 99, POINTS)))

    assert widest(points[order]) < 0.65 * widest(points)


@pytest.mark.parametrize(
    ("controller", "name", "value"),
    [
        (cases.SEEING, "see_damping_ks2", 0.08),
        (cases.HURRYING, "urgency_time_s", 150.0),
        (cases.TOURING, "tour_time_s", 700.0),
        (cases.ORBITAL, "ring_size_m", 31.0),
    ],
)
def test_a_controller_must_set_what_its_signals_need_and_no_more(controller, name, value):
    assert controller.constants[constant(name)] == value
    if name == "ring_size_m":  # which has a default
        assert with_attributes(controller, **{name: None}).constants[constant(name)] == 0.0
    else:
        with pytest.raises(ControllerError, match=f"sets no {name}; give it"):
            _ = with_attributes(controller, **{name: None}).constants


@pytest.mark.parametrize("name", ["tour_time_s", "tour_wait_s"])
def test_from_half_an_orbit_on_no_push_across_the_track_leads_anywhere(name):
    with pytest.raises(ControllerError, match=rf"{name} 2839.*less than half an orbit, 2838"):
        fly_logged(mission(), touring(**{name: 2839.0}), STARTS[0])


X, Y, Z = steering_systems()
#: four control periods
SHORT = mission(duration_s=40.0)


def renamed(system: FuzzySystem, **changes: str) -> FuzzySystem:
    """A system whose first input is called or measured otherwise."""
    return replace(system, inputs=(replace(system.inputs[0], **changes), *system.inputs[1:]))


def driving(system: FuzzySystem, *outputs: Variable) -> FuzzySystem:
    return replace(system, outputs=outputs)


@pytest.mark.parametrize(
    ("systems", "attributes", "message"),
    [
        ((X, Y, Z), (), r"'tried' has force_axes ''; set the attribute to body or hill"),
        ((X,), (("force_axes", "chief"),), r"force_axes 'chief'; set the attribute to body or hill"),
        ((), BODY, r"'tried' has no system; give one to three"),
        ((renamed(X, name="range"),), BODY, r"'steer_x' senses 'range', which is no signal; the signals"),
        ((renamed(X, unit="km"),), BODY, r"'steer_x' takes 'distance' in 'km'; this signal comes in 'm'"),
        ((driving(X, replace(X.outputs[0], name="thrust")),), BODY, r"drives thrust; each system drives"),
        ((driving(X, X.outputs[0], Y.outputs[0]),), BODY, r"drives force_x, force_y; each system drives"),
        ((driving(X),), BODY, r"drives nothing; each system drives one of"),
        ((X, driving(Y, X.outputs[0])), BODY, r"'steer_x' and 'steer_y' both drive force_x; give each axis"),
        ((driving(X, replace(X.outputs[0], unit="mN")),), BODY, r"'force_x' of 'steer_x' is in 'mN'; use N"),
        ((replace(X, and_operator="product"),), BODY, r"'tried' cannot fly: system 'steer_x' cannot be"),
    ],
)
def test_what_cannot_fly_is_told_why(systems, attributes, message):
    with pytest.raises(ControllerError, match=message):
        from_fuzzy(FuzzyController("tried", systems, attributes))


def test_a_controller_is_wired_by_the_names_of_its_variables():
    law = law_of(from_fuzzy(FuzzyController("tried", (Z, X), BODY)), mission())
    np.testing.assert_array_equal(law.axes, [AXES["force_z"], AXES["force_x"]])
    names = ("eta_u", "velocity_body_z"), ("distance", "velocity_body_x")
    np.testing.assert_array_equal(law.signals[:, :2], [list(map(slot, pair)) for pair in names])
    assert not law.has_plan


def test_a_plan_is_flown_without_force_after_its_last_row_and_none_is_longer_than_the_flight():
    law = law_of(open_loop("plan", np.ones((2, 3))), SHORT)
    np.testing.assert_array_equal(law.plans.forces, [[[1, 1, 1], [1, 1, 1], [0, 0, 0], [0, 0, 0]]])
    assert law.has_plan
    assert law_of(coast(), SHORT).plans.forces.shape == (1, 4, 3)
    with pytest.raises(ControllerError, match=r"'plan' has 5 forces, the flight 4 control periods; shorten"):
        law_of(open_loop("plan", np.ones((5, 3))), SHORT)


@pytest.mark.parametrize("period", ["25", "4"])
def test_decisions_off_the_clock_are_told_before_the_flight(period, tmp_path):
    controller = with_attributes(HURRYING, decision_period_s=period)
    text, path = serialize.dump_yaml(controller.fuzzy), tmp_path / "off.yaml"
    path.write_text(text)
    message = rf"has decision_period_s {period}; give a whole number of control periods of 10 s"
    for given in (yaml.safe_load(text), {"path": str(path)}):
        with pytest.raises(ControllerError, match=message):
            load(given, mission())
    with pytest.raises(ControllerError, match=message):
        fly_all(mission(), controller, STARTS)
