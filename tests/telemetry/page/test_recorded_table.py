"""The samples of a recording's page, recomputed from the flight that was recorded, without a browser."""

import base64

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import telemetry
from telemetry.file.topics import PointState
from telemetry.page import recorded
from tests.telemetry import synthetic_flight
from tests.telemetry.synthetic_flight import CONTROL_PERIOD, NUM_POINTS


def floats(text: str, *shape: int) -> np.ndarray:
    return np.frombuffer(base64.b64decode(text), "<f4").reshape(*shape)


def bits(text: str, count: int) -> np.ndarray:
    packed = np.frombuffer(base64.b64decode(text), np.uint8)
    return np.unpackbits(packed, bitorder="little")[: count * NUM_POINTS].reshape(count, NUM_POINTS) > 0


def test_samples_are_those_that_were_flown(short_flight, short_file):
    flight, samples = recorded.table_of(telemetry.read(short_file))
    count = len(short_flight.time_s)
    assert (flight["numSamples"], flight["periodS"], flight["numPoints"]) == (
        count,
        CONTROL_PERIOD,
        NUM_POINTS,
    )
    assert flight["radius"] == pytest.approx(synthetic_flight.POINT_RADIUS)
    np.testing.assert_allclose(floats(flight["points"], NUM_POINTS, 3), short_flight.points_m, atol=1e-5)
    for name, flown in (("position", short_flight.position_m), ("velocity", short_flight.velocity_m_s)):
        np.testing.assert_allclose(floats(samples[name], count, 3), flown, rtol=1e-6, atol=1e-6)
    # the last force lasts to the end
    fired = np.vstack([short_flight.force_hill_n, short_flight.force_hill_n[-1]])
    np.testing.assert_allclose(floats(samples["force"], count, 3), fired, rtol=1e-5, atol=1e-9)
    np.testing.assert_allclose(floats(samples["spent"], count), short_flight.delta_v_m_s, rtol=1e-6)
    angle = short_flight.sun_angle_rad
    sun = np.stack([np.cos(angle), np.sin(angle), np.zeros(count)], axis=1)
    np.testing.assert_allclose(floats(samples["sun"], count, 3), sun, atol=1e-6)
    np.testing.assert_array_equal(bits(samples["isSeen"], count), short_flight.states == PointState.INSPECTED)
    np.testing.assert_array_equal(bits(samples["isLit"], count), short_flight.states == PointState.LIT)
    assert samples["attitude"] == ""


def test_points_of_a_chief_that_turns_begin_in_its_first_attitude(tmp_path):
    flown = synthetic_flight.fly(20)
    turns = Rotation.from_rotvec(np.outer(0.3 + 0.05 * np.arange(21.0), [0.2, -0.5, 0.9]))
    path = synthetic_flight.record(flown.but(chief_quaternion=turns.as_quat()), tmp_path / "turning.mcap")
    flight, samples = recorded.table_of(telemetry.read(path))
    attitude = Rotation.from_quat(floats(samples["attitude"], 21, 4))
    assert (attitude * turns.inv()).magnitude().max() < 1e-5
    points = floats(flight["points"], NUM_POINTS, 3)
    at_first = attitude[0].apply(flown.points_m)
    np.testing.assert_allclose(points, at_first, atol=1e-5)


def test_the_page_tells_how_long_and_what_is_missing(short_flight, short_file):
    flight, _ = recorded.table_of(telemetry.read(short_file))
    words = recorded._about(telemetry.read(short_file), flight, short_file)
    minutes = round(short_flight.num_controls * CONTROL_PERIOD / 60.0)
    assert words == f"{short_file.name}: {minutes} minutes, a sample every 10 s."
