"""Reading by topic and by time, with units, and what a reader says of a bad file."""

from collections.abc import Mapping
from itertools import chain, groupby
from math import inf, nan

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType

import telemetry
from telemetry import EpisodeWriter, RecordingError
from tests.telemetry import synthetic_flight
from tests.telemetry.odd_files import plain_file


def test_columns_are_the_flight(flight, flight_file):
    recording = telemetry.read(flight_file)
    state, history = recording["/deputy/state"], recording["/deputy/attitude"]
    np.testing.assert_array_equal(state.time_s, flight.time_s)
    np.testing.assert_array_equal(state["position_m"], flight.position_m)
    np.testing.assert_array_equal(history["quaternion"], flight.attitude_quaternion.astype(np.float32))
    np.testing.assert_array_equal(recording["/mission"]["inspected_mask"], flight.inspected)
    np.testing.assert_array_equal(recording["/chief/points"]["state"], flight.states)
    np.testing.assert_array_equal(recording["/deputy/pose"]["quaternion"], flight.quaternion)
    np.testing.assert_array_equal(recording["/guidance"]["num_candidates"], flight.num_candidates)
    is_deputy = recording["/tf"]["child_frame"] == "deputy"
    np.testing.assert_array_equal(recording["/tf"]["translation_m"][is_deputy], flight.position_m)
    assert recording["/log"]["message"].tolist() == ["50 of 99 points inspected", "95 of 99 points inspected"]
    assert recording.fis_names == ("force_x", "force_y", "force_z")
    assert recording.attachments == synthetic_flight.ATTACHMENTS
    for topic, field, kind in (
        ("/deputy/state", "position_m", np.float64),
        ("/deputy/attitude", "torque_n_m", np.float32),
        ("/fis/force_x", "firing_strengths", np.float32),
        ("/mission", "inspected_count", np.int64),
        ("/mission", "inspected_mask", np.bool_),
    ):
        assert recording[topic][field].dtype == kind


def test_topics_are_chosen_by_name_or_pattern(flight_file):
    assert list(telemetry.read(flight_file, "/mission").topics) == ["/mission"]
    chosen = telemetry.read(flight_file, ["/fis/*", "/log"])
    assert list(chosen.topics) == ["/log", "/fis/force_x", "/fis/force_y", "/fis/force_z"]
    nothing = telemetry.read(flight_file, [])
    assert (len(nothing.topics), len(nothing.metadata)) == (0, 4)


def test_time_is_chosen_with_both_ends(flight, flight_file):
    state = telemetry.read(flight_file, "/deputy/state", start_s=600.0, end_s=700.0)["/deputy/state"]
    np.testing.assert_array_equal(state.time_s, np.arange(600.0, 701.0, 10.0))
    np.testing.assert_array_equal(state["position_m"], flight.position_m[60:71])
    late = telemetry.read(flight_file, "/deputy/state", start_s=3595.0)["/deputy/state"]
    assert late.time_s.tolist() == [3600.0]
    whole = telemetry.read(flight_file, "/deputy/state", start_s=-inf, end_s=inf)["/deputy/state"]
    np.testing.assert_array_equal(whole.time_s, flight.time_s)


def test_samples_that_were_written_in_any_order_are_read_in_that_of_time(short_file, tmp_path):
    with short_file.open("rb") as stream:
        messages = make_reader(stream).iter_messages()
        instants = [list(each) for _, each in groupby(messages, lambda message: message[2].log_time)]
    order = np.random.default_rng(2).permutation(len(instants))
    mixed = chain.from_iterable(instants[index] for index in order)
    path = plain_file(tmp_path / "shuffled.mcap", CompressionType.ZSTD, 20_000, mixed)
    shuffled, ordered = telemetry.read(path), telemetry.read(short_file)
    assert set(shuffled.topics) == {name for name, topic in ordered.topics.items() if len(topic)}
    for name, topic in shuffled.topics.items():
        np.testing.assert_array_equal(topic.time_s, ordered[name].time_s)
        for field, values in topic.columns.items():
            np.testing.assert_array_equal(values, ordered[name][field])


def test_what_is_not_asked_for_is_not_read(flight_file, tmp_path):
    """Damage in the last chunk shows only to a reader that goes there."""
    with flight_file.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    content = bytearray(flight_file.read_bytes())
    content[summary.chunk_indexes[-1].chunk_start_offset + 200] ^= 0xFF
    path = tmp_path / "damaged.mcap"
    path.write_bytes(content)
    assert len(telemetry.read(path, end_s=1000.0)["/deputy/state"]) == 101
    with pytest.raises(RecordingError, match=r"is damaged.*python -m telemetry recover"):
        telemetry.read(path)


def test_a_wrong_byte_in_the_index_is_noticed(short_file, tmp_path):
    """The index at the end repeats the names of the topics."""
    content = bytearray(short_file.read_bytes())
    content[content.rindex(b"/deputy/state") + 1] ^= 1
    path = tmp_path / "damaged.mcap"
    path.write_bytes(content)
    with pytest.raises(RecordingError, match="index does not match its checksum"):
        telemetry.read(path)


def test_a_topic_on_which_nothing_happened_is_there_and_empty(tmp_path):
    path = synthetic_flight.record(synthetic_flight.fly(3), tmp_path / "flight.mcap")
    assert len(telemetry.read(path)["/log"]) == 0


def test_a_recording_is_a_mapping_of_topics(flight_file):
    recording = telemetry.read(flight_file)
    assert isinstance(recording, Mapping)
    assert list(recording) == list(recording.topics)
    assert len(recording) == len(recording.topics) > 3
    assert dict(recording.items()) == recording.topics
    assert "/deputy/state" in recording
    assert "/navigation/none" not in recording
    assert recording.get("/navigation/none") is None
    assert "position_m" in recording["/deputy/state"]
    assert "height" not in recording["/deputy/state"]


def test_a_topic_or_field_that_is_not_there_is_named(flight_file):
    with pytest.raises(RecordingError, match=r"no topic '/fis/force_w'; choose from /chief/points, "):
        telemetry.read(flight_file, "/fis/force_w")
    recording = telemetry.read(flight_file, "/mission")
    with pytest.raises(KeyError, match="no topic '/log' here"):
        recording["/log"]
    with pytest.raises(KeyError, match=r"no field 'distance'; it has sun_angle_rad, "):
        recording["/mission"]["distance"]


@pytest.mark.parametrize(
    ("content", "text"),
    [
        (b"", "is empty"),
        (b"time_s,force_x_n\n", "is not an MCAP file"),
        (b"\x89MCAP0\r\n", "is truncated"),
        (b"\x89MCAP0\r\n" * 2, "is damaged"),
        (b"\x89MCAP0\r\n" + bytes(100) + b"\x89MCAP0\r\n", "is damaged"),
    ],
)
def test_a_bad_file_is_said(tmp_path, content, text):
    path = tmp_path / "odd.mcap"
    path.write_bytes(content)
    with pytest.raises(RecordingError, match=text):
        telemetry.read(path)


def test_metadata_that_does_not_fit_the_inferences_is_refused(tmp_path):
    metadata = synthetic_flight.metadata(synthetic_flight.fly(2))
    with EpisodeWriter(tmp_path / "odd.mcap", metadata=metadata, attachments={}) as writer:
        writer.record("/fis/force_x", 0.0, inputs=[1.0, 2.0], firing_strengths=[0.5] * 9, output_n=0.1)
    with pytest.raises(RecordingError, match="2 inputs and 25 rules, but 2 and 9 are recorded"):
        telemetry.read(tmp_path / "odd.mcap").fis_description("force_x")


@pytest.mark.parametrize(
    ("start_s", "end_s"), [(500.0, 100.0), (nan, None), (None, nan), (inf, None), (None, -inf)]
)
def test_times_that_are_no_span_are_not_taken_for_damage(short_file, start_s, end_s):
    with pytest.raises(RecordingError, match="there is no time"):
        telemetry.read(short_file, start_s=start_s, end_s=end_s)
