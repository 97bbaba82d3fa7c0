"""A cut or damaged file: every flushed step comes back, and never a wrong one."""

import random
import struct
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

import telemetry
from telemetry import EpisodeWriter, RecordingError
from telemetry.file import claims
from telemetry.file.reader import Recording
from telemetry.file.recover import recover
from tests.telemetry import synthetic_flight
from tests.telemetry.full_disk import fill_disk

MessageRow = tuple[str, int, int, bytes]


def messages_of(path: Path) -> list[MessageRow]:
    """(topic, sequence, time, bytes) of each message in the order of the file, by the mcap library."""
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        return [
            (channel.topic, message.sequence, message.log_time, message.data)
            for _, channel, message in reader.iter_messages(log_time_order=False)
        ]


@pytest.fixture(scope="module")
def chunks(short_file):
    """(last byte, messages up to there) of each chunk."""
    with short_file.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    ends = [index.chunk_start_offset + index.chunk_length for index in summary.chunk_indexes]
    starts = [index.message_start_time for index in summary.chunk_indexes]
    rows = messages_of(short_file)
    last = [*starts[1:], rows[-1][2] + 1]
    return [(end, sum(row[2] < before for row in rows)) for end, before in zip(ends, last, strict=True)]


def uncompressed(source: Path, folder: Path) -> Path:
    """The same messages in one chunk that is not compressed."""
    path = folder / "plain.mcap"
    with source.open("rb") as stream, path.open("wb") as output:
        writer = Writer(output, compression=CompressionType.NONE, chunk_size=2**30)
        writer.start()
        channels: dict[str, int] = {}
        for schema, channel, message in make_reader(stream).iter_messages(log_time_order=False):
            assert schema is not None
            if channel.topic not in channels:
                schema_id = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[channel.topic] = writer.register_channel(channel.topic, "protobuf", schema_id)
            writer.add_message(channels[channel.topic], message.log_time, message.data, message.publish_time)
        writer.add_metadata("episode", {"scenario_id": "plain"})
        writer.finish()
    return path


def cut(source: Path, num_bytes: int, folder: Path) -> Path:
    path = folder / f"cut_{num_bytes}.mcap"
    path.write_bytes(source.read_bytes()[:num_bytes])
    return path


@pytest.mark.slow
def test_a_wrong_byte_never_gives_a_wrong_message_or_number(short_file, tmp_path):
    rows, whole = set(messages_of(short_file)), telemetry.read(short_file)
    content = short_file.read_bytes()
    generator = np.random.default_rng(3)
    num_rescued, num_refused = [], 0
    for position in generator.integers(8, len(content), 80).tolist():
        damaged = bytearray(content)
        damaged[position] ^= 1 << int(generator.integers(8))
        path = tmp_path / f"damaged_{position}.mcap"
        path.write_bytes(damaged)
        output = tmp_path / f"rescued_{position}.mcap"
        if recover(path, output).output is not None:
            rescued = messages_of(output)
            assert set(rescued) <= rows, position
            num_rescued.append(len(rescued))
        try:
            read = telemetry.read(path)
        except RecordingError:
            num_refused += 1
            continue
        assert read.topics.keys() == whole.topics.keys()
        assert_is_beginning(read, whole)
        assert sum(map(len, read.topics.values())) == len(messages_of(short_file))
    assert max(num_rescued) > 1000
    assert num_refused > 40


def test_without_compression_the_checksum_alone_tells_a_wrong_byte(short_file, tmp_path):
    plain = uncompressed(short_file, tmp_path)
    content = bytearray(plain.read_bytes())
    # the number 75.0 of the first sample's distance becomes another one
    position = content.index(struct.pack("<d", 75.0))
    content[position + 6] ^= 1
    plain.write_bytes(content)
    recovery = recover(plain, tmp_path / "rescued.mcap")
    assert recovery.num_damaged_records == 1
    assert recovery.num_messages == 0


def test_a_damaged_attachment_does_not_come_back(short_file, tmp_path):
    content = short_file.read_bytes()
    path = tmp_path / "damaged.mcap"
    path.write_bytes(content.replace(b'{"name": "circle"}', b'{"name": "square"}'))
    with pytest.raises(RecordingError, match="an attachment does not match its checksum"):
        telemetry.read(path)
    recovery = recover(path, tmp_path / "rescued.mcap")
    assert recovery.num_damaged_records == 1
    assert telemetry.read(tmp_path / "rescued.mcap").attachments == {"config.yaml": b"seed: 7\n"}
    assert messages_of(tmp_path / "rescued.mcap") == messages_of(short_file)


def test_damaged_metadata_does_not_come_back(short_file, tmp_path):
    """MCAP gives metadata no checksum, so a record carries one of its own."""
    path = tmp_path / "damaged.mcap"
    path.write_bytes(short_file.read_bytes().replace(b"circle-0", b"circle-8"))
    with pytest.raises(RecordingError, match="metadata episode does not match its checksum"):
        telemetry.read(path)
    recovery = recover(path, tmp_path / "rescued.mcap")
    assert recovery.num_damaged_records == 1
    rescued = telemetry.read(tmp_path / "rescued.mcap")
    assert set(rescued.metadata) == {"fis.f_x", "fis.f_y", "fis.f_z", "recovery"}
    assert messages_of(tmp_path / "rescued.mcap") == messages_of(short_file)


def test_metadata_of_another_writer_is_read_without_a_checksum(short_file, tmp_path):
    plain = uncompressed(short_file, tmp_path)
    assert telemetry.read(plain).metadata == {"episode": {"scenario_id": "plain"}}


def test_a_damaged_chunk_costs_that_chunk_alone(short_file, chunks, tmp_path):
    """The first chunk names the channels, and so does the summary at the end of the file."""
    content = bytearray(short_file.read_bytes())
    content[chunks[0][0] - 500] ^= 0xFF
    path = tmp_path / "damaged.mcap"
    path.write_bytes(content)
    with pytest.raises(RecordingError, match="is damaged"):
        telemetry.read(path)
    recovery = recover(path, tmp_path / "rescued.mcap")
    assert recovery.num_damaged_records == 1
    assert messages_of(tmp_path / "rescued.mcap") == messages_of(short_file)[chunks[0][1] :]


def test_messages_that_nothing_explains_stay_behind(short_file, chunks, tmp_path):
    """Without its first chunk and its end, nothing in a file says what its channels are."""
    content = bytearray(short_file.read_bytes()[: chunks[1][0]])
    content[chunks[0][0] - 500] ^= 0xFF
    path = tmp_path / "damaged.mcap"
    path.write_bytes(content)
    recovery = recover(path, tmp_path / "rescued.mcap")
    assert (recovery.num_messages, recovery.end_s) == (0, None)
    assert "episode" in telemetry.read(tmp_path / "rescued.mcap").metadata


def test_a_whole_file_needs_no_rescue(short_file, tmp_path):
    recovery = recover(short_file, tmp_path / "rescued.mcap")
    assert recovery.output is None
    assert recovery.num_messages == len(messages_of(short_file))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("room", [0, 20_000])
def test_a_rescue_on_a_full_disk_leaves_the_source_alone(short_file, tmp_path, monkeypatch, room):
    path = cut(short_file, 90_000, tmp_path)
    content = path.read_bytes()
    fill_disk(monkeypatch, room)
    with pytest.raises(
        RecordingError, match=r"rescued\.mcap cannot be written: No space left on device; make room"
    ):
        recover(path, tmp_path / "rescued.mcap")
    assert [file.name for file in tmp_path.iterdir()] == [path.name]
    assert path.read_bytes() == content


def test_a_rescue_overwrites_nothing(short_file, tmp_path):
    path = cut(short_file, 60_000, tmp_path)
    kept = tmp_path / "kept.mcap"
    kept.write_bytes(b"precious")
    with pytest.raises(RecordingError, match="exists; remove it or choose another name with -o"):
        recover(path, kept)
    assert kept.read_bytes() == b"precious"


@pytest.mark.parametrize(
    ("content", "text"),
    [
        (b"", "nothing in .* is intact"),
        (b"\x89MCAP0\r\n", "nothing in .* is intact"),
        (b"time_s,force_x_n\n0,0\n", "is not an MCAP file"),
    ],
)
def test_nothing_to_rescue_is_said(tmp_path, content, text):
    path = tmp_path / "odd.mcap"
    path.write_bytes(content)
    with pytest.raises(RecordingError, match=text):
        recover(path)


def packed(path, size, *, compression=CompressionType.ZSTD):
    """A small file of one chunk that unpacks to so many bytes."""
    with path.open("wb") as stream:
        writer = Writer(stream, compression=compression, chunk_size=2 * size)
        writer.start()
        schema = writer.register_schema("x", "protobuf", b"")
        channel = writer.register_channel("/x", "protobuf", schema)
        writer.add_message(channel, 0, bytes(size), 0)
        writer.finish()
    return path


def test_a_chunk_that_unpacks_to_more_than_is_read(tmp_path):
    path = packed(tmp_path / "bomb.mcap", 200_000_000)
    assert path.stat().st_size < 100_000
    tracemalloc.start()
    with pytest.raises(
        RecordingError, match=f"a chunk unpacks to .* bytes; at most {claims.MOST_IN_CHUNK} are"
    ):
        telemetry.read(path)
    with pytest.raises(RecordingError, match=r"nothing in .* is intact"):
        recover(path, tmp_path / "out.mcap")
    assert tracemalloc.get_traced_memory()[1] < 20e6
    tracemalloc.stop()


def test_another_compression_is_named(tmp_path):
    content = bytearray(packed(tmp_path / "a.mcap", 1000).read_bytes())
    at = content.index(b"zstd")
    content[at : at + 4] = b"lz4\0"
    (tmp_path / "b.mcap").write_bytes(content)
    with pytest.raises(RecordingError, match=r"compressed by 'lz4.*; only zstd is read"):
        telemetry.read(tmp_path / "b.mcap")


def test_many_messages_in_few_bytes(tmp_path, monkeypatch):
    monkeypatch.setattr(claims, "MOST_MESSAGES", 5)
    monkeypatch.setattr(claims, "MOST_MESSAGES_PER_BYTE", 0.0)
    path = tmp_path / "many.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream, compression=CompressionType.ZSTD, chunk_size=4000)
        writer.start()
        schema = writer.register_schema("inspection.Mission", "protobuf", b"")
        channel = writer.register_channel("/mission", "protobuf", schema)
        for index in range(10_000):
            writer.add_message(channel, index, b"", 0)
        writer.finish()
    found = recover(path, tmp_path / "out.mcap")
    assert 0 < found.num_messages < 1000
    assert found.num_damaged_records > 10


NUM_CUTS = 200
NUM_CONTROLS = 115
#: samples that end in an event, which brings them to the file at once
EVENTS = (25, 90)
#: (bytes in the file, samples that have been flushed by then)
Flushes = list[tuple[int, int]]


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    """A recording, and what the disk held of it while it was written."""
    flight = synthetic_flight.fly(NUM_CONTROLS)
    path = tmp_path_factory.mktemp("flown") / "flight.mcap"
    partial = path.with_name("flight.mcap.partial")
    flushes = []
    metadata = synthetic_flight.metadata(flight)
    with EpisodeWriter(path, metadata=metadata, attachments=synthetic_flight.ATTACHMENTS) as writer:
        flushes.append((partial.stat().st_size, 0))
        for k in range(NUM_CONTROLS + 1):
            synthetic_flight.write_sample(writer, flight, k)
            if partial.stat().st_size > flushes[-1][0]:
                # the sample after the sixtieth brings those before it to the file
                flushes.append((partial.stat().st_size, k))
            if k in EVENTS:
                writer.log(float(flight.time_s[k]), "warning", f"sample {k}")
                flushes.append((partial.stat().st_size, k + 1))
    return path, flushes


def assert_is_beginning(rescued: Recording, whole: Recording) -> int:
    """Compare every value of what came back with the original; return how many whole samples it holds."""
    for name, topic in rescued.topics.items():
        original = whole[name]
        np.testing.assert_array_equal(topic.time_s, original.time_s[: len(topic)])
        for field, values in topic.columns.items():
            np.testing.assert_array_equal(values, original[field][: len(topic)], err_msg=f"{name} {field}")
    for name, entries in rescued.metadata.items():
        assert name == "recovery" or entries == whole.metadata[name]
    for name, content in rescued.attachments.items():
        assert content == whole.attachments[name]
    lengths = {name: len(topic) for name, topic in rescued.topics.items()}
    states, inferences = lengths.get("/mission", 0), lengths.get("/fis/f_z", 0)
    # the last sample of a flight has no inference
    return states if inferences == len(whole["/fis/f_z"]) else min(states, inferences)


def test_samples_reach_the_disk_every_sixty_and_with_every_event(flown):
    _, flushes = flown
    assert [samples for _, samples in flushes] == [0, 26, 86, 91]


@pytest.mark.slow
def test_a_cut_at_any_byte_loses_no_flushed_sample_and_tells_no_wrong_one(flown, tmp_path):
    path, flushes = flown
    content, whole = path.read_bytes(), telemetry.read(path)
    generator = random.Random(2606)  # noqa: S311 - where to cut
    # kind, length of the record, length of its name: 13 bytes before the name of the second record
    first_record_end = content.index(b"fis.f_x") - 13
    num_whole = []
    for num_bytes in sorted(generator.sample(range(len(content)), NUM_CUTS)):
        cut = tmp_path / f"cut_{num_bytes}.mcap.partial"
        cut.write_bytes(content[:num_bytes])
        output = tmp_path / f"rescued_{num_bytes}.mcap"
        num_flushed = max((samples for size, samples in flushes if size <= num_bytes), default=0)
        if num_bytes < first_record_end:
            with pytest.raises(RecordingError, match=r"nothing in .* is intact"):
                recover(cut, output)
            continue
        recover(cut, output)
        num_whole.append(assert_is_beginning(telemetry.read(output), whole))
        assert num_whole[-1] >= num_flushed, num_bytes
    assert len(num_whole) > 0.9 * NUM_CUTS
    assert {0, 26, 86, 91} <= set(num_whole)
