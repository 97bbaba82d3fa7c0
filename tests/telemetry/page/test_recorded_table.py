"""The samples of a recording's page, recomputed from the flight that was recorded, without a browser."""

import base64

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType
from scipy.spatial.transform import Rotation

import telemetry
from telemetry.file import RecordingError, reader
from telemetry.file.schema import inspection_pb2
from telemetry.file.topics import DEPUTY_ATTITUDE, DEPUTY_CONTROL, DEPUTY_STATE, PointState
from telemetry.page import recorded
from telemetry.scene import replay
from tests.telemetry import synthetic_flight
from tests.telemetry.odd_files import fill_disk, plain_file
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


def changed(source, path, topic, change):
    """Copy a recording whose messages on a topic are changed, or left out where the change says so."""
    kind = {
        DEPUTY_STATE: inspection_pb2.DeputyState,
        DEPUTY_ATTITUDE: inspection_pb2.AttitudeHistory,
        DEPUTY_CONTROL: inspection_pb2.Control,
    }[topic]

    def messages(reader):
        for schema, channel, message in reader.iter_messages():
            if channel.topic == topic:
                content = kind.FromString(message.data)
                if not change(content, message.log_time / 1e9):
                    continue
                message.data = content.SerializeToString()
            yield schema, channel, message

    with source.open("rb") as stream:
        return plain_file(path, CompressionType.ZSTD, 100_000, messages(make_reader(stream)))


@pytest.mark.parametrize("position", [[], [1.0, 2.0], [1.0, np.nan, 2.0], [1e300, 0.0, 0.0]])
def test_positions_that_are_none_are_refused_with_their_time(short_file, tmp_path, position):
    def change(state, time_s):
        if time_s >= 40.0:
            state.position_m[:] = position
        return len(position) == 3 or time_s >= 40.0

    path = changed(short_file, tmp_path / "odd.mcap", DEPUTY_STATE, change)
    for show in (recorded.write, lambda path: replay.scene([path])):
        with pytest.raises(
            RecordingError, match=r"no 3 finite numbers as position_m on /deputy/state at 40 s"
        ):
            show(path)


def test_forces_that_nobody_tells_are_said_to_be_missing(short_file, tmp_path):
    def change(control, _time_s):
        control.ClearField("force_hill_n")
        return True

    path = changed(short_file, tmp_path / "odd.mcap", DEPUTY_CONTROL, change)
    assert "It does not tell forces." in recorded.write(path)
    with pytest.raises(RecordingError, match=r"no 3 finite numbers as force_hill_n"):
        replay.scene([path])


@pytest.mark.parametrize(
    ("part", "since_s", "reason"),
    [("quaternion", 0.0, "cannot be decoded"), ("time_offset_s", 40.0, "has rows of")],
)
def test_a_topic_that_cannot_be_decoded_is_left_out_of_the_page(short_file, tmp_path, part, since_s, reason):
    def change(attitude, time_s):
        if time_s >= since_s:
            del getattr(attitude, part)[-1]
        return True

    path = changed(short_file, tmp_path / "odd.mcap", DEPUTY_ATTITUDE, change)
    with pytest.raises(RecordingError, match=reason):
        telemetry.read(path)
    text = recorded.write(path)
    assert "Left out: odd.mcap" in text
    assert DEPUTY_ATTITUDE in text
    assert reason in text
    played, _ = reader.read_decoded(path)
    whole = changed(short_file, tmp_path / "whole.mcap", DEPUTY_ATTITUDE, lambda *_: True)
    assert str(recorded.table_of(played)) == str(recorded.table_of(telemetry.read(whole)))
    assert "Left out" not in recorded.write(whole)

    def cut(state, time_s):
        if time_s >= 40.0:
            del state.position_m[-1]
        return True

    with pytest.raises(RecordingError, match=f"on {DEPUTY_STATE}, the field 'position_m' has rows of"):
        recorded.write(changed(short_file, tmp_path / "odd.mcap", DEPUTY_STATE, cut))


def test_the_page_tells_when_a_recording_begins_and_what_it_lacks(short_file, tmp_path):
    path = changed(
        short_file,
        tmp_path / "odd.mcap",
        DEPUTY_STATE,
        lambda _, time_s: 120 <= time_s <= 300 or time_s > 700,
    )
    text = recorded.write(path)
    assert "It begins at 120 s, which is 0 here. From 300 to 710 s nothing is recorded; the page" in text


def test_a_replay_needs_what_is_told_to_be_there(short_file, tmp_path):
    def messages(reader):
        for schema, channel, message in reader.iter_messages():
            if not channel.topic.startswith("/fis/"):
                yield schema, channel, message

    metadata = telemetry.read(short_file).metadata
    with short_file.open("rb") as stream:
        path = plain_file(
            tmp_path / "odd.mcap", CompressionType.ZSTD, 100_000, messages(make_reader(stream)), metadata
        )
    with pytest.raises(RecordingError, match="holds no messages on /fis/"):
        replay.scene([path])


def test_a_page_without_room_is_a_sentence_and_no_file(ran, short_file, tmp_path, monkeypatch):
    assert (
        "nowhere/x.html cannot be written: No such file"
        in ran("page", short_file, "-o", "nowhere/x.html", code=2).err
    )
    fill_disk(monkeypatch, 1000)
    refusal = ran("page", short_file, "-o", tmp_path / "x.html", code=2).err
    assert "x.html cannot be written: No space left on device; make room, or choose another" in refusal
    assert list(tmp_path.iterdir()) == []
