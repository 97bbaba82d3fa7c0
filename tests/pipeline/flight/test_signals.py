"""The table of signals: where each stands, and what must be computed for it."""

from dataclasses import replace

import numpy as np
import pytest

from fis_tools.model import FuzzyController
from pipeline.flight.control.controller import Controller, ControllerError, coast, from_fuzzy, law_of
from pipeline.flight.fly.simulation import fly_all, fly_logged
from pipeline.flight.period.look.guidance import POINTS
from pipeline.flight.state.log import FlightLog, Scenario
from pipeline.flight.state.signals import (
    ANGLES,
    APPROACH,
    NOTHING,
    ORBIT,
    PREVIEW,
    SETTING,
    SIGNALS,
    URGENCY,
    Signal,
    constant,
    slot,
)
from pipeline.flight.world.pack import by_neighbourhood, inspection_points
from tests.pipeline.flight.cases import (
    FORESEEING,
    HURRYING,
    LOOKING_AHEAD,
    ORBITAL,
    SEEING,
    STARTS,
    STEERING,
    TOURING,
    controller,
    leaning_system,
    mission,
    random_starts,
    touring,
)
from tests.pipeline.flight.missions import MEAN_MOTION

BODY = (("force_axes", "body"),)


def test_a_signal_behind_the_last_needs_what_its_row_says(monkeypatch):
    """It once was taken for urgent, whose constants it has not."""
    monkeypatch.setitem(SIGNALS, "added", Signal("m", "a signal that every flight knows", NOTHING))
    system = leaning_system("force_x", 0.02, ("added", "m", 100.0))
    law = law_of(from_fuzzy(FuzzyController("tried", (system,), BODY)), mission())
    assert law.signals[0, 0] == len(SIGNALS) - 1
    assert law.needs == NOTHING


@pytest.mark.parametrize(
    ("controller", "needs"),
    [
        (STEERING, ANGLES),
        (ORBITAL, ORBIT),
        (LOOKING_AHEAD, ORBIT | APPROACH),
        (FORESEEING, ORBIT | PREVIEW),
        (HURRYING, URGENCY),
        (SEEING, URGENCY | SETTING),
    ],
)
def test_what_must_be_computed_adds_up(controller, needs):
    assert law_of(controller, mission()).needs == needs


def test_signals_that_are_written_together_stand_together():
    first = slot("target_radial", "target_along_track", "target_cross_track")
    np.testing.assert_array_equal(
        [slot("target_along_track"), slot("target_cross_track")], [first + 1, first + 2]
    )
    with pytest.raises(ValueError, match="put their rows together"):
        slot("target_radial", "target_cross_track")


SIZE_M, LEAD_RAD, SUN_RAD = 35.0, 0.7, 2.0


def sensed(log: FlightLog, system: int, place: int) -> np.ndarray:
    return log.fis_input[:, system, place]


def silent(*systems: tuple) -> list:
    """Systems that sense, and never fire."""
    return [leaning_system(*system) for system in systems]


def test_in_free_motion_the_centre_keeps_its_height_and_drifts_along_the_track():
    systems = silent(("force_x", 0.01, ("centre_radial", "m", 60.0), ("centre_along_track", "m", 60.0)))
    quiet = controller(tuple(systems), "hill", dead_band_force_x_n=1.0)
    log = fly_logged(mission(), quiet, STARTS[0])
    assert not log.force_hill_n.any()
    radial, along = sensed(log, 0, 0), sensed(log, 0, 1)
    np.testing.assert_allclose(radial, radial[0], rtol=0, atol=1e-9)
    time_s = 10.0 * np.arange(360)
    np.testing.assert_allclose(along, along[0] - 1.5 * MEAN_MOTION * radial[0] * time_s, rtol=0, atol=1e-8)
    # an ellipse: the offsets from the centre, the one along the track halved, keep their distance
    x, y = log.position_m[:-1, 0] - radial, 0.5 * (log.position_m[:-1, 1] - along)
    np.testing.assert_allclose(np.hypot(x, y), np.hypot(x[0], y[0]), rtol=0, atol=1e-9)


def test_a_deputy_on_the_ring_stays_on_it_and_away_from_it_the_error_turns_with_the_sun():
    systems = silent(
        ("force_y", 0.01, ("ring_error_radial", "m", 60.0), ("ring_error_along_track", "m", 60.0))
    )
    place = SUN_RAD - LEAD_RAD
    on_the_ring = Scenario(
        SIZE_M * np.array([np.cos(place), 2.0 * np.sin(place), 0.0]),
        SIZE_M * MEAN_MOTION * np.array([np.sin(place), -2.0 * np.cos(place), 0.0]),
        SUN_RAD,
    )
    constants = {"ring_size_m": SIZE_M, "ring_lead_rad": LEAD_RAD, "dead_band_force_y_n": 1.0}
    log = fly_logged(mission(), controller(tuple(systems), "hill", **constants), on_the_ring)
    np.testing.assert_allclose(log.fis_input[:, 0, :2], 0.0, rtol=0, atol=1e-9)

    larger = controller(tuple(systems), "hill", **(constants | {"ring_size_m": 2.0 * SIZE_M}))
    log = fly_logged(mission(), larger, on_the_ring)
    turned = log.sun_angle_rad[:-1] - LEAD_RAD
    np.testing.assert_allclose(sensed(log, 0, 0), -SIZE_M * np.cos(turned), rtol=0, atol=1e-9)
    np.testing.assert_allclose(sensed(log, 0, 1), -SIZE_M * np.sin(turned), rtol=0, atol=1e-9)


def test_the_predicted_centre_is_where_the_centre_comes_to():
    systems = silent(
        ("force_x", 0.01, ("predicted_centre_along_track", "m", 60.0), ("centre_along_track", "m", 60.0))
    )
    constants = {"prediction_time_s": 700.0, "dead_band_force_x_n": 1.0}
    log = fly_logged(mission(), controller(tuple(systems), "hill", **constants), STARTS[0])
    predicted, along = sensed(log, 0, 0), sensed(log, 0, 1)
    np.testing.assert_allclose(predicted[:-70], along[70:], rtol=0, atol=1e-8)
    assert abs(predicted[0] - along[0]) > 10.0

    now = controller(tuple(systems), "hill", dead_band_force_x_n=1.0)
    log = fly_logged(mission(), now, STARTS[0])
    np.testing.assert_array_equal(sensed(log, 0, 0), sensed(log, 0, 1))


@pytest.mark.parametrize("text", ["wide", "nan", "inf", "-1"])
def test_a_constant_that_is_no_length_is_told(text):
    fuzzy = FuzzyController("tried", ORBITAL.systems, (("force_axes", "hill"), ("ring_size_m", text)))
    with pytest.raises(ControllerError, match=f"has ring_size_m '{text}'; give a number from 0 on"):
        from_fuzzy(fuzzy)


def test_constants_go_with_the_controller():
    np.testing.assert_array_equal(ORBITAL.constants[:6], [31.0, 0.4, 0.002, 0.004, 0.001, 0.0])
    np.testing.assert_array_equal(LOOKING_AHEAD.constants[:6], [0, 0, 0.001, 0, 0, 800.0])
    assert not ORBITAL.constants[6:].any()
    assert not LOOKING_AHEAD.constants[6:].any()
    plain = replace(ORBITAL, fuzzy=FuzzyController("tried", ORBITAL.systems, (("force_axes", "hill"),)))
    np.testing.assert_array_equal(plain.constants, 0.0)


IDEAL = {"mode": "ideal"}
#: never fires, and senses all that is foreseen
WATCHING = controller(
    (
        leaning_system(
            "force_x",
            0.01,
            ("missed", "", 20.0),
            ("coasting_nearest", "m", 60.0),
            ("coasting_farthest", "m", 60.0),
        ),
        leaning_system("force_y", 0.01, ("target_setting", "", 1.0)),
    ),
    "hill",
    dead_band_force_x_n=1.0,
    dead_band_force_y_n=1.0,
)


def test_a_flight_that_coasts_misses_what_was_foreseen_or_a_little_less():
    """Foreseen are the places every two minutes, flown are twelve times as many."""
    for start in random_starts(12, 21):
        log = fly_logged(mission(attitude=IDEAL), WATCHING, start)
        missed = 99 - log.is_inspected[-1].sum()
        foreseen = log.fis_input[:, 0, 0]
        assert np.all(foreseen >= missed)
        assert foreseen[0] - missed <= 8
        assert foreseen[-1] == missed  # nothing lies between the last sample but one and the end
        distance = np.linalg.norm(log.position_m, axis=1)
        ahead = np.array([(distance[k:].min(), distance[k:].max()) for k in range(360)])
        np.testing.assert_allclose(log.fis_input[:, 0, 1:], ahead, rtol=0, atol=6.0)
        assert np.all(log.fis_input[:, 0, 1] >= ahead[:, 0] - 1e-9)
        assert np.all(log.fis_input[:, 0, 2] <= ahead[:, 1] + 1e-9)


def test_neighbours_share_a_vector():
    points = inspection_points(mission())
    order = by_neighbourhood(points)
    assert sorted(order) == list(range(99))

    def widest(ordered):
        return float(max(np.ptp(ordered[j : j + POINTS], axis=0).max() for j in range(0, 99, POINTS)))

    assert widest(points[order]) < 0.65 * widest(points)


def test_with_every_point_allowed_to_be_missed_it_never_fires():
    lazy = replace(
        FORESEEING,
        fuzzy=replace(
            FORESEEING.fuzzy,
            attributes=(("coast_below_points", "100.0"), ("force_axes", "hill"), ("ring_size_m", "20.0")),
        ),
    )
    start = Scenario(np.array([0.0, 60.0, 0.0]), np.zeros(3), 0.3)
    outcomes, coasted = fly_all(mission(), lazy, [start]), fly_all(mission(), coast(), [start])
    assert outcomes.delta_v_m_s[0] == 0.0
    assert outcomes.inspected_count[0] == coasted.inspected_count[0]


def with_attributes(controller: Controller, **changes: str | None) -> Controller:
    """Another controller, without the attributes that are None."""
    fuzzy = controller.fuzzy
    assert fuzzy is not None
    attributes = dict(fuzzy.attributes) | changes
    kept = sorted((name, text) for name, text in attributes.items() if text is not None)
    return from_fuzzy(replace(fuzzy, attributes=tuple(kept)))


@pytest.mark.parametrize("skirt_m", [10.0, 15.5, 70.0])
def test_near_the_chief_it_leads_around_it(skirt_m):
    """At the least distance what leads inwards is mirrored, halfway to the skirt it is left out."""
    what = mission(attitude={"mode": "ideal"}, duration_s=10.0)
    distances = np.array(
        [15.0, 0.5 * (15.0 + skirt_m), 15.0 + 0.75 * (skirt_m - 15.0), skirt_m, 1.2 * skirt_m]
    )
    if skirt_m < 15.0:  # it turns nothing, even of a deputy that is nearer
        distances = np.array([5.0, 8.0, 10.0, 15.0, 18.0])
    inwards = []
    for distance in distances:
        # the tour is on the other side of the chief, where the Sun is
        start = Scenario(np.array([-distance, 0.0, 0.0]), np.zeros(3), 0.0)
        push = [
            fly_logged(what, touring(skirt_distance_m=skirt, tour_lean_m=0.0), start).fis_input[0, :, 0]
            for skirt in (skirt_m, 0.0)
        ]
        np.testing.assert_allclose(push[0][1:], push[1][1:], rtol=0, atol=1e-12)
        assert push[1][0] > 0.02
        inwards.append(push[0][0] / push[1][0])
    kept = [-1.0, 0.0, 0.5, 1.0, 1.0] if skirt_m > 15.0 else [1.0] * 5
    np.testing.assert_allclose(inwards, kept, rtol=0, atol=1e-9)


def test_a_long_urgency_time_takes_the_middle_of_all():
    middling = with_attributes(HURRYING, urgency_time_s="1e9", skirt_distance_m="0", coast_below_points=None)
    log = fly_logged(mission(attitude={"mode": "ideal"}, coast_when_complete=False), middling, STARTS[0])
    target = log.target_m[:-1]
    has_target = np.linalg.norm(target, axis=1) > 0.1
    centroid = target[has_target] / np.linalg.norm(target[has_target], axis=1, keepdims=True)
    np.testing.assert_allclose(log.fis_input[has_target, :, 1], centroid, rtol=0, atol=1e-4)


@pytest.mark.parametrize(
    ("controller", "name", "value"),
    [
        (SEEING, "urgency_time_s", None),
        (SEEING, "see_damping_ks2", 0.08),
        (HURRYING, "urgency_time_s", 150.0),
        (HURRYING, "skirt_distance_m", 70.0),
        (TOURING, "tour_time_s", 700.0),
    ],
)
def test_a_controller_must_set_what_its_signals_need(controller, name, value):
    if value is not None:
        assert controller.constants[constant(name)] == value
    if name != "skirt_distance_m":  # which has a default
        with pytest.raises(ControllerError, match=f"sets no {name}; give it"):
            _ = with_attributes(controller, **{name: None}).constants


@pytest.mark.parametrize("name", ["tour_time_s", "tour_wait_s"])
def test_from_half_an_orbit_on_no_push_across_the_track_leads_anywhere(name):
    with pytest.raises(ControllerError, match=rf"{name} 2839.*less than half an orbit, 2838"):
        fly_logged(mission(), touring(**{name: 2839.0}), STARTS[0])
