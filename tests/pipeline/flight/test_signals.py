"""The table of signals: where each stands, and what must be computed for it."""

import numpy as np
import pytest

from fis_tools.model import FuzzyController
from pipeline.flight.control.controller import Controller, ControllerError, from_fuzzy, law_of
from pipeline.flight.fly.simulation import fly_logged
from pipeline.flight.period.look.guidance import POINTS
from pipeline.flight.state.log import FlightLog, Scenario
from pipeline.flight.state.signals import NOTHING, SIGNALS, Signal, constant, slot
from pipeline.flight.world.pack import by_neighbourhood, inspection_points
from tests.pipeline.flight import cases
from tests.pipeline.flight.cases import STARTS, mission, touring, with_attributes
from tests.pipeline.flight.missions import MEAN_MOTION

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
    np.testing.assert_array_equal(
        [slot("target_along_track"), slot("target_cross_track")], [first + 1, first + 2]
    )
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
    place = SUN_RAD - LEAD_RAD
    on_the_ring = Scenario(
        SIZE_M * np.array([np.cos(place), 2.0 * np.sin(place), 0.0]),
        SIZE_M * MEAN_MOTION * np.array([np.sin(place), -2.0 * np.cos(place), 0.0]),
        SUN_RAD,
    )
    for larger in (0.0, 1.0):
        size = {"ring_size_m": (1.0 + larger) * SIZE_M, "ring_lead_rad": LEAD_RAD}
        ring = watching("ring_error_radial", "ring_error_along_track", **size)
        log, (radial, along, _) = sensed(ring, on_the_ring)
        turned = log.sun_angle_rad[:-1] - LEAD_RAD
        np.testing.assert_allclose(radial, -larger * SIZE_M * np.cos(turned), rtol=0, atol=1e-9)
        np.testing.assert_allclose(along, -larger * SIZE_M * np.sin(turned), rtol=0, atol=1e-9)


@pytest.mark.parametrize("text", ["wide", "nan", "inf", "-1"])
def test_a_constant_that_is_no_length_is_told(text):
    with pytest.raises(ControllerError, match=f"has ring_size_m '{text}'; give a number from 0 on"):
        with_attributes(cases.ORBITAL, ring_size_m=text)


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
