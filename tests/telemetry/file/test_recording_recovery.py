"""A cut or damaged file: every flushed step comes back, and never a wrong one."""

import random
import struct
import tracemalloc
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType

import telemetry
from telemetry import EpisodeWriter, RecordingError
from telemetry.file import claims
from telemetry.file.recording import Recording
from telemetry.file.recover import recover
from tests.telemetry import synthetic_flight
from tests.telemetry.odd_files import fill_disk, plain_file


def messages_of(path: Path) -> list[tuple[str, int, int, bytes]]:
    """(topic, sequence, time, bytes) of each message in the order of the file, by the mcap library."""
    with path.open("rb") as stream:
        messages = make_reader(stream, validate_crcs=True).iter_messages(log_time_order=False)
        return [
            (channel.topic, message.sequence, message.log_time, message.data)
            for _, channel, message in messages
        ]


@pytest.fixture(scope="module")
def chunks(short_file):
    """(last byte, messages up to there) of each chunk."""
    with short_file.open("rb") as stream:
        indexes = make_reader(stream).get_summary().chunk_indexes
    ends = [index.chunk_start_offset + index.chunk_length for index in indexes]
    rows = messages_of(short_file)
    last = [*(index.message_start_time for index in indexes[1:]), rows[-1][2] + 1]
    return [(end, sum(row[2] < before for row in rows)) for end, before in zip(ends, last, strict=True)]


@pytest.fixture
def written(tmp_path):
    """Write some bytes as a file to rescue, whose rescue is then called so."""

    def write(content: bytes) -> tuple[Path, Path]:
        (tmp_path / "odd.mcap").write_bytes(content)
        return tmp_path / "odd.mcap", tmp_path / "rescued.mcap"

    return write


@pytest.fixture
def uncompressed(short_file, tmp_path):
    """The same messages in one chunk that is not compressed."""
    with short_file.open("rb") as stream:
        messages = make_reader(stream).iter_messages(log_time_order=False)
        return plain_file(tmp_path / "plain.mcap", CompressionType.NONE, 2**30, messages)


@pytest.mark.slow
def test_a_wrong_byte_never_gives_a_wrong_message_or_number(short_file, tmp_path):
    rows, whole = set(messages_of(short_file)), telemetry.read(short_file)
    content = short_file.read_bytes()
    generator = np.random.default_rng(3)
    num_rescued, num_refused = [], 0
    for position in generator.integers(8, len(content), 50).tolist():
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
    assert num_refused > 25


def test_without_compression_the_checksum_alone_tells_a_wrong_byte(uncompressed, written):
    # metadata of another writer is read without a checksum
    assert telemetry.read(uncompressed).metadata == {"episode": {"scenario_id": "plain"}}
    content = bytearray(uncompressed.read_bytes())
    # the number 75.0 of the first sample's distance becomes another one
    content[content.index(struct.pack("<d", 75.0)) + 6] ^= 1
    recovery = recover(*written(content))
    assert (recovery.num_damaged_records, recovery.num_messages) == (1, 0)


SYSTEMS = {"fis.force_x", "fis.force_y", "fis.force_z", "recovery"}


@pytest.mark.parametrize(
    ("true", "false", "expected", "files", "words"),
    [
        (b'"circle"}', b'"square"}', "an attachment", {"config.yaml"}, {"episode", *SYSTEMS}),
        # MCAP gives metadata no checksum, so a record carries one of its own
        (b"circle-0", b"circle-8", "metadata episode", {"config.yaml", "controller.json"}, SYSTEMS),
    ],
)
def test_a_damaged_description_does_not_come_back(true, false, expected, files, words, short_file, written):
    path, output = written(short_file.read_bytes().replace(true, false))
    with pytest.raises(RecordingError, match=f"{expected} does not match its checksum"):
        telemetry.read(path)
    assert recover(path, output).num_damaged_records == 1
    rescued = telemetry.read(output)
    assert set(rescued.metadata) == words
    assert rescued.attachments.items() <= synthetic_flight.ATTACHMENTS.items()
    assert set(rescued.attachments) == files
    assert messages_of(output) == messages_of(short_file)


def test_a_damaged_chunk_costs_that_chunk_alone_if_something_names_the_channels(short_file, chunks, written):
    """The first chunk names them, and so does the summary at the end of the file."""
    content = bytearray(short_file.read_bytes())
    content[chunks[0][0] - 500] ^= 0xFF
    path, output = written(content)
    with pytest.raises(RecordingError, match="is damaged"):
        telemetry.read(path)
    assert recover(path, output).num_damaged_records == 1
    assert messages_of(output) == messages_of(short_file)[chunks[0][1] :]
    output.unlink()
    recovery = recover(*written(content[: chunks[1][0]]))
    assert (recovery.num_messages, recovery.end_s) == (0, None)
    assert "episode" in telemetry.read(output).metadata


def test_a_whole_file_needs_no_rescue(short_file, tmp_path):
    recovery = recover(short_file, tmp_path / "rescued.mcap")
    assert recovery.output is None
    assert recovery.num_messages == len(messages_of(short_file))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("room", [0, 20_000])
def test_a_rescue_on_a_full_disk_leaves_the_source_alone(short_file, written, tmp_path, monkeypatch, room):
    content = short_file.read_bytes()[:90_000]
    path, output = written(content)
    fill_disk(monkeypatch, room)
    with pytest.raises(RecordingError, match=r"rescued\.mcap cannot be written: No space left .*; make room"):
        recover(path, output)
    assert [file.name for file in tmp_path.iterdir()] == [path.name]
    assert path.read_bytes() == content


def test_a_rescue_overwrites_nothing(short_file, written):
    path, kept = written(short_file.read_bytes()[:60_000])
    kept.write_bytes(b"precious")
    with pytest.raises(RecordingError, match=r"exists; .* -o"):
        recover(path, kept)
    assert kept.read_bytes() == b"precious"


@pytest.mark.parametrize("content", [b"", b"\x89MCAP0\r\n"])
def test_nothing_to_rescue_is_said(written, content):
    with pytest.raises(RecordingError, match=r"nothing in .* is intact"):
        recover(written(content)[0])


def repeated(path, size, count, chunk_size):
    """A small file of equal messages of so many bytes."""
    schema, channel = SimpleNamespace(name="x", data=b""), SimpleNamespace(topic="/x")
    messages = ((schema, channel, SimpleNamespace(log_time=time, data=bytes(size))) for time in range(count))
    return plain_file(path, CompressionType.ZSTD, chunk_size, messages)


def test_a_chunk_that_unpacks_to_more_than_is_read(tmp_path):
    path = repeated(tmp_path / "bomb.mcap", 200_000_000, 1, 400_000_000)
    assert path.stat().st_size < 100_000
    tracemalloc.start()
    with pytest.raises(RecordingError, match=f"a chunk unpacks to .*; at most {claims.MOST_IN_CHUNK} are"):
        telemetry.read(path)
    assert recover(path, tmp_path / "out.mcap").num_messages == 0
    assert tracemalloc.get_traced_memory()[1] < 20e6
    tracemalloc.stop()


def test_another_compression_is_named(tmp_path):
    path = repeated(tmp_path / "a.mcap", 1000, 1, 2000)
    path.write_bytes(path.read_bytes().replace(b"zstd", b"zstx", 1))
    with pytest.raises(RecordingError, match=r"not read: a chunk is compressed by 'zstx'; lz4 and zstd are"):
        telemetry.read(path)


def test_many_messages_in_few_bytes(tmp_path, monkeypatch):
    monkeypatch.setattr(claims, "MOST_MESSAGES", 5)
    monkeypatch.setattr(claims, "MOST_MESSAGES_PER_BYTE", 0.0)
    recovery = recover(repeated(tmp_path / "many.mcap", 0, 10_000, 4000), tmp_path / "out.mcap")
    assert 0 < recovery.num_messages < 1000
    assert recovery.num_damaged_records == 0
    assert recovery.refused.startswith("it holds more than 5 messages")


def test_a_file_may_hold_a_message_for_each_sixteen_bytes_beyond_two_hundred_thousand():
    assert [claims.most_messages(size) for size in (0, 15, 16, 1_600_000)] == [
        200_000,
        200_000,
        200_001,
        300_000,
    ]


NUM_CUTS = 100
NUM_CONTROLS = 115
#: samples that end in an event, which brings them to the file at once
EVENTS = (25, 90)


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    """A recording, and what the disk held of it meanwhile: bytes, and samples flushed by then."""
    flight = synthetic_flight.fly(NUM_CONTROLS)
    path = tmp_path_factory.mktemp("flown") / "flight.mcap"
    partial = path.with_name("flight.mcap.partial")
    metadata = synthetic_flight.metadata(flight)
    with EpisodeWriter(path, metadata=metadata, attachments=synthetic_flight.ATTACHMENTS) as writer:
        flushes = [(partial.stat().st_size, 0)]
        for k in range(NUM_CONTROLS + 1):
            synthetic_flight.write_samples(writer, flight, [k])
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
    states, inferences = lengths.get("/mission", 0), lengths.get("/fis/force_z", 0)
    # the last sample of a flight has no inference
    return states if inferences == len(whole["/fis/force_z"]) else min(states, inferences)


@pytest.mark.slow
def test_a_cut_at_any_byte_loses_no_flushed_sample_and_tells_no_wrong_one(flown, tmp_path):
    path, flushes = flown
    # samples reach the disk every sixty, and with every event
    assert [samples for _, samples in flushes] == [0, 26, 86, 91]
    content, whole = path.read_bytes(), telemetry.read(path)
    generator = random.Random(2606)  # noqa: S311 - where to cut
    # kind, length of the record, length of its name: 13 bytes before the name of the second record
    first_record_end = content.index(b"fis.force_x") - 13
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
