"""The signals of free motion against its closed form, and the constants of controllers."""

from dataclasses import replace

import numpy as np
import pytest

from fis_tools.model import FuzzyController
from pipeline.flight.control.controller import ControllerError, from_fuzzy
from pipeline.flight.fly.simulation import fly_logged
from pipeline.flight.state.log import FlightLog, Scenario
from tests.pipeline.flight.cases import (
    LOOKING_AHEAD,
    ORBITAL,
    STARTS,
    controller,
    drifting_through,
    leaning_system,
    mission,
)
from tests.pipeline.flight.missions import MEAN_MOTION

SIZE_M, LEAD_RAD, SUN_RAD = 35.0, 0.7, 2.0


def sensed(log: FlightLog, system: int, place: int) -> np.ndarray:
    return log.fis_input[:, system, place]


def silent(*systems: tuple) -> list:
    """Systems that sense, and never fire."""
    return [leaning_system(*system) for system in systems]


def test_in_free_motion_the_centre_keeps_its_height_and_drifts_along_the_track() -> None:
    systems = silent(
        ("force_x", 0.01, ("centre_radial", "m", 60.0), ("centre_along_track", "m", 60.0)),
    )
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


def test_a_deputy_on_the_ring_stays_on_it_and_away_from_it_the_error_turns_with_the_sun() -> None:
    systems = silent(
        ("force_y", 0.01, ("ring_error_radial", "m", 60.0), ("ring_error_along_track", "m", 60.0)),
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


def test_the_predicted_centre_is_where_the_centre_comes_to() -> None:
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


def test_the_closest_approach_is_what_a_flight_without_force_comes_to() -> None:
    systems = silent(("force_y", 0.01, ("closest_approach", "m", 60.0)))
    quiet = controller(tuple(systems), "hill", dead_band_force_y_n=1.0)
    orbit = round(2.0 * np.pi / MEAN_MOTION / 10.0)
    log = fly_logged(mission(duration_s=20.0 * orbit), quiet, drifting_through((9.0, 12.0, 8.0), 2000.0))
    distance, found = np.linalg.norm(log.position_m, axis=1), sensed(log, 0, 0)
    least = np.array([distance[k : k + orbit + 1].min() for k in range(orbit)])
    np.testing.assert_allclose(found[:orbit], least, rtol=0, atol=0.004 * distance[: 2 * orbit].max())
    assert found[0] < 20.0
    assert distance[0] > 60.0
    assert np.ptp(found[:orbit]) > 1.0  # what is past counts no more


def test_directions_are_those_of_the_log() -> None:
    log = fly_logged(mission(), ORBITAL, STARTS[1])
    has_target = log.num_candidates[:-1] > 0
    length = np.linalg.norm(log.target_m[:-1], axis=1)[has_target]
    for (system, place), axis in (((0, 2), 0), ((2, 0), 1), ((2, 1), 2)):
        expected = log.target_m[:-1][has_target, axis] / length
        np.testing.assert_allclose(sensed(log, system, place)[has_target], expected, rtol=0, atol=1e-12)
    bearing = log.sun_angle_rad[:-1] - np.arctan2(log.position_m[:-1, 1], log.position_m[:-1, 0])
    np.testing.assert_allclose(sensed(log, 2, 2), np.cos(bearing), rtol=0, atol=1e-12)
    np.testing.assert_allclose(sensed(log, 1, 2), np.sin(bearing), rtol=0, atol=1e-12)


def test_forces_below_a_dead_band_are_not_fired() -> None:
    log = fly_logged(mission(), ORBITAL, STARTS[2])
    bands = ORBITAL.constants[2:5]
    kept = np.where(np.abs(log.fis_output_n) < bands, 0.0, log.fis_output_n)
    np.testing.assert_array_equal(log.force_hill_n, kept)
    is_dropped = log.fis_output_n != kept
    assert 10 < is_dropped.sum() < log.fis_output_n.size - 10


@pytest.mark.parametrize("text", ["wide", "nan", "inf", "-1"])
def test_a_constant_that_is_no_length_is_told(text: str) -> None:
    fuzzy = FuzzyController("tried", ORBITAL.systems, (("force_axes", "hill"), ("ring_size_m", text)))
    with pytest.raises(ControllerError, match=f"has ring_size_m '{text}'; give a number from 0 on"):
        from_fuzzy(fuzzy)


def test_constants_go_with_the_controller() -> None:
    np.testing.assert_array_equal(ORBITAL.constants[:6], [31.0, 0.4, 0.002, 0.004, 0.001, 0.0])
    np.testing.assert_array_equal(LOOKING_AHEAD.constants[:6], [0, 0, 0.001, 0, 0, 800.0])
    assert not ORBITAL.constants[6:].any()
    assert not LOOKING_AHEAD.constants[6:].any()
    plain = replace(ORBITAL, fuzzy=FuzzyController("tried", ORBITAL.systems, (("force_axes", "hill"),)))
    np.testing.assert_array_equal(plain.constants, 0.0)
