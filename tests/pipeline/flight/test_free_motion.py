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
