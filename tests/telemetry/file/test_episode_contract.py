"""What a recording holds, seen through the mcap library's own readers, and when its file appears."""

import re
from collections import Counter, defaultdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.records import Attachment, Chunk, Message, Metadata
from mcap.stream_reader import StreamReader
from mcap_protobuf.decoder import DecoderFactory
from rerun.chunk import McapReader
from scipy.spatial.transform import Rotation

import telemetry
from telemetry import EpisodeWriter, RecordingError
from telemetry.file import topics
from telemetry.file.metadata import unsealed
from telemetry.file.recover import recover
from tests.telemetry import synthetic_flight
from tests.telemetry.odd_files import fill_disk
from tests.telemetry.synthetic_flight import SyntheticFlight

#: the schema of each topic, and how many messages it has
TOPICS = {
    "/tf": ("foxglove.FrameTransform", 1 + 2 * 361),
    "/deputy/pose": ("foxglove.PoseInFrame", 361),
    "/chief/points": ("foxglove.PointCloud", 361),
    "/deputy/state": ("inspection.DeputyState", 361),
    "/deputy/attitude": ("inspection.AttitudeHistory", 360),
    "/deputy/control": ("inspection.Control", 360),
    "/guidance": ("inspection.Guidance", 361),
    "/mission": ("inspection.MissionStatus", 361),
    "/log": ("foxglove.Log", 2),
    **{f"/fis/force_{axis}": ("inspection.FisActivation", 360) for axis in "xyz"},
}
FRAMES = {("hill", "deputy"): 361, ("hill", "chief"): 361}
#: the first that applies: inspected, in view but dark, lit, dark
COLOURS = {3: (0, 190, 130, 255), 2: (204, 121, 167, 255), 1: (240, 228, 66, 255), 0: (86, 88, 102, 255)}


@pytest.fixture(scope="module")
def messages(flight_file):
    """(log time, decoded message) by topic."""
    by_topic = defaultdict(list)
    with flight_file.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        for schema, channel, message, decoded in reader.iter_decoded_messages():
            assert schema is not None
            assert schema.name == TOPICS[channel.topic][0]
            assert (schema.encoding, channel.message_encoding) == ("protobuf", "protobuf")
            assert message.publish_time == message.log_time
            by_topic[channel.topic].append((message.log_time, decoded))
    return by_topic


def test_every_topic_has_its_messages_and_the_root_transform_comes_first(messages):
    counts = {topic: count for topic, (_, count) in TOPICS.items()}
    assert {topic: len(rows) for topic, rows in messages.items()} == counts
    (time, root), *rest = messages["/tf"]
    assert (time, root.rotation.w, root.parent_frame_id, root.child_frame_id) == (0, 1.0, "tf#/", "hill")
    assert Counter((m.parent_frame_id, m.child_frame_id) for _, m in rest) == FRAMES
    assert {cloud.pose.orientation.w for _, cloud in messages["/chief/points"]} == {1.0}


def test_chunks_are_compressed_and_small_enough_to_lose(flight_file):
    with flight_file.open("rb") as stream:
        chunks = [r for r in StreamReader(stream, emit_chunks=True).records if isinstance(r, Chunk)]
    assert {chunk.compression for chunk in chunks} == {"zstd"}
    assert all(chunk.uncompressed_crc for chunk in chunks)
    assert max(chunk.message_end_time - chunk.message_start_time for chunk in chunks) <= 59e10


def test_metadata_and_attachments_come_before_the_first_message(flight, flight_file):
    with flight_file.open("rb") as stream:
        records = list(StreamReader(stream, validate_crcs=True).records)
    first_message = next(i for i, record in enumerate(records) if isinstance(record, Message))
    metadata = {r.name: r.metadata for r in records[:first_message] if isinstance(r, Metadata)}
    attachments = {r.name: r.data for r in records[:first_message] if isinstance(r, Attachment)}
    # each record carries a checksum besides, which MCAP does not give it
    opened = {name: unsealed(name, entries) for name, entries in metadata.items()}
    assert opened == synthetic_flight.metadata(flight)
    assert all("crc32" in entries for entries in metadata.values())
    assert attachments == synthetic_flight.ATTACHMENTS
    kinds = Counter(type(record) for record in records)
    assert (kinds[Metadata], kinds[Attachment]) == (4, 2)


def test_the_same_flight_gives_the_same_bytes_also_sample_by_sample(flight, flight_file, tmp_path):
    assert synthetic_flight.record(flight, tmp_path / "again.mcap").read_bytes() == flight_file.read_bytes()
    content = {"metadata": synthetic_flight.metadata(flight), "attachments": synthetic_flight.ATTACHMENTS}
    with EpisodeWriter(tmp_path / "one_by_one.mcap", **content) as writer:
        synthetic_flight.write_samples(writer, flight, range(361))
    assert (tmp_path / "one_by_one.mcap").read_bytes() == flight_file.read_bytes()


def test_a_full_flight_of_three_systems_of_125_rules_stays_below_a_mebibyte(flight, tmp_path):
    # random numbers, which nothing compresses: no flight is larger
    strengths = np.random.default_rng(5).random((3, 360, 125))
    path = synthetic_flight.record(flight.but(firing_strengths=strengths), tmp_path / "many.mcap")
    assert strengths.astype(np.float32).nbytes < path.stat().st_size < 1024 * 1024


def test_plain_rerun_sees_points_pose_and_transforms(flight, flight_file):
    columns: dict[tuple[str, str], list[Any]] = defaultdict(list)
    kinds = ("Points3D", "InstancePoses3D", "Transform3D", "TextLog", "CoordinateFrame")
    for chunk in McapReader(str(flight_file)).stream():
        batch = chunk.to_record_batch()
        for name in batch.schema.names:
            if name.startswith(kinds):
                columns[chunk.entity_path, name] += batch.column(name).to_pylist()
    colours = columns["/chief/points", "Points3D:colors"]
    for k in (0, 200, 360):
        expected = [int.from_bytes(bytes(COLOURS[int(state)]), "big") for state in flight.states[k]]
        assert colours[k] == expected
    assert len(colours) == 361
    positions = np.array(columns["/chief/points", "Points3D:positions"][100])
    np.testing.assert_array_equal(positions, flight.points_m.astype(np.float32))
    assert set(map(tuple, columns["/chief/points", "CoordinateFrame:frame"])) == {("chief",)}
    pose = np.array(columns["/deputy/pose", "InstancePoses3D:translations"])[:, 0]
    np.testing.assert_allclose(pose, flight.position_m, atol=1e-4)
    # the body's x axis, turned as a viewer turns it, points from the chief to the deputy
    turned = Rotation.from_quat(np.array(columns["/deputy/pose", "InstancePoses3D:quaternions"])[:, 0])
    np.testing.assert_allclose(turned.apply([75.0, 0.0, 0.0]), flight.position_m, atol=1e-4)
    parents = [parent for (parent,) in columns["/tf", "Transform3D:parent_frame"]]
    children = [child for (child,) in columns["/tf", "Transform3D:child_frame"]]
    assert Counter(zip(parents, children, strict=True)) == {("tf#/", "hill"): 1, **FRAMES}
    assert len(columns["/log", "TextLog:text"]) == 2


def open_writer(flight: SyntheticFlight, path: Path) -> EpisodeWriter:
    return EpisodeWriter(path, metadata=synthetic_flight.metadata(flight), attachments={})


def test_a_file_takes_the_place_of_an_earlier_one_only_once_it_is_complete(short_flight, tmp_path):
    path = tmp_path / "flight.mcap"
    path.write_bytes(b"old")
    with open_writer(short_flight, path) as writer:
        synthetic_flight.write_samples(writer, short_flight, range(131))
        assert path.read_bytes() == b"old"
    assert [p.name for p in tmp_path.iterdir()] == ["flight.mcap"]
    assert len(telemetry.read(path)["/deputy/state"]) == 131


def test_an_exception_leaves_what_was_flown_to_be_rescued(short_flight, tmp_path):
    path = tmp_path / "flight.mcap"

    def fly_until_interrupted():
        with open_writer(short_flight, path) as writer:
            synthetic_flight.write_samples(writer, short_flight, range(41))
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fly_until_interrupted()
    assert not path.exists()
    rescued = recover(path.with_name("flight.mcap.partial"))
    assert rescued.output == tmp_path / "flight.recovered.mcap"
    state = telemetry.read(rescued.output)["/deputy/state"]
    np.testing.assert_array_equal(state["position_m"], short_flight.position_m[:41])


@pytest.mark.parametrize("room", [0, 20_000, 90_000])
def test_a_full_disk_is_said_and_leaves_nothing_half_written(short_flight, tmp_path, monkeypatch, room):
    fill_disk(monkeypatch, room)
    path = tmp_path / "flight.mcap"
    with pytest.raises(RecordingError, match=r"No space left on device.*make room or choose another"):
        synthetic_flight.record(short_flight, path)
    assert not path.exists()
    monkeypatch.undo()
    if room == 90_000:
        recover(tmp_path / "flight.mcap.partial", tmp_path / "rescued.mcap")
        state = telemetry.read(tmp_path / "rescued.mcap")["/deputy/state"]
        assert len(state) >= 60
        np.testing.assert_array_equal(state["position_m"], short_flight.position_m[: len(state)])


def test_a_missing_folder_is_said(short_flight, tmp_path):
    with pytest.raises(RecordingError, match=r"nowhere/flight\.mcap cannot be written: No such file"):
        synthetic_flight.record(short_flight, tmp_path / "nowhere" / "flight.mcap")


@pytest.mark.parametrize(
    ("mistake", "text"),
    [
        (lambda w: w.log(5.0, "info", "before what is in the file"), "are in order of time"),
        (lambda w: w.record(topics.GUIDANCE, [20.0, 15.0], num_candidates=[1, 1]), "follows one of 20.0 s"),
        (lambda w: w.record(topics.DEPUTY_CONTROL, 20.0, force_body_n=np.zeros(2)), "has 2 values, but 3"),
        (lambda w: w.record(topics.DEPUTY_STATE, 20.0, place_m=np.zeros(3)), "has no field 'place_m'"),
        (
            lambda w: w.record("/fis/force_w", 20.0, inputs=[0.0]),
            "does not describe the fuzzy system 'force_w'",
        ),
        (lambda w: w.log(20.0, "loud", "words"), "no log level 'loud'"),
        (lambda w: w.points(20.0, np.zeros((4, 3)), np.zeros(5)), "one state for each point"),
        (lambda w: w.points(20.0, np.zeros((4, 3)), np.full(4, 4)), "from 4 to 4, but 0 to 3"),
        (
            lambda w: w.record(topics.DEPUTY_ATTITUDE, 20.0, time_offset_s=[0, 1], torque_n_m=np.zeros(3)),
            "torque_n_m has 3 values, but 6",
        ),
    ],
)
def test_a_wrong_record_is_refused(short_flight, tmp_path, mistake, text):
    def fly_and_err():
        with open_writer(short_flight, tmp_path / "flight.mcap") as writer:
            synthetic_flight.write_samples(writer, short_flight, [1])
            writer.log(10.0, "info", "everything so far is in the file")
            mistake(writer)

    with pytest.raises(RecordingError, match=re.escape(text)):
        fly_and_err()
