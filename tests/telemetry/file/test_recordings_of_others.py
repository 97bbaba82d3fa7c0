"""Recordings that the official writer writes in every way that it can: read to equal tables, and rescued."""

import importlib
import inspect
import struct
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType, IndexType, Writer
from mcap_protobuf.decoder import DecoderFactory
from rerun.chunk import McapReader

import telemetry
from telemetry import RecordingError
from telemetry.file.recording import Recording
from telemetry.file.recover import recover
from tests.telemetry import synthetic_flight

#: the writer's switches, with their defaults
SWITCHES = {
    name: parameter.default
    for name, parameter in inspect.signature(Writer).parameters.items()
    if isinstance(parameter.default, bool)
}
COMPRESSIONS = {f"compression {way.name}": {"compression": way} for way in CompressionType}
INDEXES = {
    f"indexes {kind.name}": {"index_types": kind} for kind in (IndexType.NONE, *IndexType, IndexType.ALL)
}
SWITCHED = {f"{name} {not default}": {name: not default} for name, default in SWITCHES.items()}
BARE: dict[str, Any] = {**dict.fromkeys(SWITCHES, False), "index_types": IndexType.NONE}
VARIANTS: dict[str, dict[str, Any]] = {
    "as it is": {},
    **COMPRESSIONS,
    **INDEXES,
    **SWITCHED,
    "small chunks": {"chunk_size": 2000},
    "bare": BARE,
    **{f"bare chunks, {name}": {**BARE, "use_chunking": True, **way} for name, way in COMPRESSIONS.items()},
    "only the data's checksum": {**BARE, "enable_data_crcs": True},
}


def written(source: Path, path: Path, **options: Any) -> Path:
    """Copy a recording by the official writer."""
    with source.open("rb") as stream, path.open("wb") as output:
        reader = make_reader(stream)
        summary = reader.get_summary()
        assert summary is not None
        writer = Writer(output, **options)
        writer.start()
        for metadata in reader.iter_metadata():
            writer.add_metadata(metadata.name, metadata.metadata)
        schemas = {
            schema.id: writer.register_schema(schema.name, schema.encoding, schema.data)
            for schema in summary.schemas.values()
        }
        channels = {
            channel.id: writer.register_channel(
                channel.topic, channel.message_encoding, schemas[channel.schema_id]
            )
            for channel in summary.channels.values()
        }
        for _schema, channel, message in reader.iter_messages(log_time_order=False):
            writer.add_message(
                channels[channel.id], message.log_time, message.data, message.publish_time, message.sequence
            )
        for attachment in reader.iter_attachments():
            writer.add_attachment(
                *(attachment.create_time, attachment.log_time, attachment.name),
                *(attachment.media_type, attachment.data),
            )
        writer.finish()
    return path


def assert_equal(read: Recording, expected: Recording) -> None:
    """Compare two recordings value by value."""
    assert read.topics.keys() == expected.topics.keys()
    assert read.metadata == expected.metadata
    assert read.attachments == expected.attachments
    for name, topic in expected.topics.items():
        np.testing.assert_array_equal(read[name].time_s, topic.time_s)
        assert read[name].columns.keys() == topic.columns.keys()
        assert read[name].units == topic.units
        for field, values in topic.columns.items():
            assert read[name][field].dtype == values.dtype
            np.testing.assert_array_equal(read[name][field], values, err_msg=f"{name} {field}")


@pytest.mark.parametrize("name", VARIANTS)
def test_every_variant_is_read_to_equal_tables_and_needs_no_rescue(name, short_file, tmp_path):
    path = written(short_file, tmp_path / "other.mcap", **VARIANTS[name])
    assert_equal(telemetry.read(path), telemetry.read(short_file))
    part = {"topics": ["/deputy/*", "/log"], "start_s": 300.0, "end_s": 905.0}
    assert_equal(telemetry.read(path, **part), telemetry.read(short_file, **part))
    with pytest.raises(RecordingError, match="has no topic '/none'; choose from /chief/points") as refused:
        telemetry.read(path, "/none")
    assert "damaged" not in str(refused.value)
    recovery = recover(path, tmp_path / "rescued.mcap")
    assert recovery.output is None
    assert recovery.num_messages == sum(map(len, telemetry.read(short_file).topics.values()))
    options = SWITCHES | VARIANTS[name]
    is_checked = options["enable_crcs" if options["use_chunking"] else "enable_data_crcs"]
    assert recovery.num_unchecked == (0 if is_checked else recovery.num_messages)


@pytest.mark.parametrize("name", VARIANTS)
def test_what_is_left_of_a_cut_variant_is_rescued(name, short_file, tmp_path):
    whole = written(short_file, tmp_path / "whole.mcap", **{"chunk_size": 20_000} | VARIANTS[name])
    content = whole.read_bytes()
    cut = tmp_path / "cut.mcap"
    # two thirds of what is before the attachments and the summary
    cut.write_bytes(content[: content.index(b"config.yaml") * 2 // 3])
    with pytest.raises(RecordingError, match=r"is truncated.*telemetry recover"):
        telemetry.read(cut)
    recovery = recover(cut, tmp_path / "rescued.mcap")
    rescued, expected = telemetry.read(tmp_path / "rescued.mcap"), telemetry.read(short_file)
    assert recovery.num_messages > 300
    for topic in rescued:
        count = len(rescued[topic])
        np.testing.assert_array_equal(rescued[topic].time_s, expected[topic].time_s[:count])
        for field, values in rescued[topic].columns.items():
            np.testing.assert_array_equal(values, expected[topic][field][:count])


@pytest.mark.parametrize(
    "options", [{"use_chunking": False, "enable_data_crcs": True}, {"use_chunking": True}]
)
def test_a_wrong_byte_shows_where_the_writer_gave_a_checksum(options, short_file, tmp_path):
    path = written(short_file, tmp_path / "x.mcap", compression=CompressionType.NONE, **options)
    content = bytearray(path.read_bytes())
    content[content.index(struct.pack("<d", 75.0)) + 6] ^= 1
    path.write_bytes(content)
    with pytest.raises(RecordingError, match=r"is damaged \(.*checksum"):
        telemetry.read(path)


def test_what_the_format_allows_and_is_not_read_is_not_called_damaged(short_file, tmp_path):
    path = written(
        short_file, tmp_path / "x.mcap", index_types=IndexType.NONE, compression=CompressionType.LZ4
    )
    path.write_bytes(path.read_bytes().replace(b"\x03\0\0\0lz4", b"\x03\0\0\0br\x31"))
    for refuse in (telemetry.read, recover):
        try:
            refuse(path)
        except RecordingError as error:
            assert "a chunk is compressed by 'br1'; lz4 and zstd are read, and none" in str(error)  # noqa: PT017
            assert "damaged" not in str(error)  # noqa: PT017
    assert recover(path, tmp_path / "y.mcap").num_damaged_records == 0
    assert telemetry.read(tmp_path / "y.mcap").metadata["episode"]["scenario_id"] == "circle-0"


def test_records_of_everybodys_own_are_passed_over(short_file, tmp_path):
    """Kinds from 0x80 on are for private use, before, between and after the others."""
    private = struct.pack("<BQ", 0x80, 5) + b"hello"
    for name, use_chunking in product(("a", "b"), (True, False)):
        path = written(
            short_file, tmp_path / f"{name}{use_chunking}.mcap", **BARE | {"use_chunking": use_chunking}
        )
        content = path.read_bytes()
        # behind the header, whose length stands at byte 9
        begin = 8 + 9 + int.from_bytes(content[9:17], "little")
        path.write_bytes(content[:begin] + private + content[begin:])
        assert_equal(telemetry.read(path), telemetry.read(short_file))
        assert recover(path, tmp_path / "none.mcap").output is None


def test_a_flight_with_an_epoch_counts_from_it_and_is_read_from_0(short_file, tmp_path):
    """The time stamps are those of the clock, as Foxglove and rerun show them."""
    flight = synthetic_flight.fly(130)
    metadata = synthetic_flight.metadata(flight)
    metadata["episode"]["epoch"] = "2026-11-26T12:00:00+01:00"
    path = synthetic_flight.record(flight, tmp_path / "dated.mcap", metadata=metadata)
    with path.open("rb") as stream:
        times = [message.log_time for _, _, message in make_reader(stream).iter_messages()]
    # date -u -d 2026-11-26T11:00:00 +%s
    assert (times[0], times[-1]) == (1_795_690_800 * 10**9, (1_795_690_800 + 1300) * 10**9)
    shown = [chunk.to_record_batch() for chunk in McapReader(str(path)).stream()]
    shown = [batch for batch in shown if "message_log_time" in batch.schema.names]
    assert min(str(batch.column("message_log_time")[0]) for batch in shown) == "2026-11-26 11:00:00"
    dated, plain = telemetry.read(path), telemetry.read(short_file)
    assert dated.metadata["episode"].pop("epoch") == "2026-11-26T12:00:00+01:00"
    assert_equal(dated, plain)
    late = telemetry.read(path, "/deputy/state", start_s=600.0, end_s=700.0)["/deputy/state"]
    np.testing.assert_array_equal(late.time_s, np.arange(600.0, 701.0, 10.0))
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(path.read_bytes()[:-100])
    assert recover(cut, tmp_path / "rescued.mcap").end_s == 1300.0


def test_what_foxglove_reads_has_the_date(tmp_path):
    """By the official reader: its times of log and publication, its schemas' own times, and the metadata."""
    flight = synthetic_flight.fly(130)
    metadata = synthetic_flight.metadata(flight)
    metadata["episode"]["epoch"] = "2026-11-26T12:00:00+01:00"
    path = synthetic_flight.record(flight, tmp_path / "dated.mcap", metadata=metadata)
    epoch_ns, kinds = 1_795_690_800 * 10**9, set()
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        statistics = reader.get_summary().statistics
        assert (statistics.message_start_time, statistics.message_end_time) == (
            epoch_ns,
            epoch_ns + 1300 * 10**9,
        )
        (episode,) = [each.metadata for each in reader.iter_metadata() if each.name == "episode"]
        assert episode["epoch"] == "2026-11-26T12:00:00+01:00"
        for schema, channel, message, decoded in reader.iter_decoded_messages():
            assert (schema.encoding, channel.message_encoding) == ("protobuf", "protobuf")
            assert message.publish_time == message.log_time
            assert (message.log_time - epoch_ns) % (10 * 10**9) == 0
            package, _, name = schema.name.rpartition(".")
            if package == "foxglove":
                assert decoded.timestamp.ToNanoseconds() == message.log_time
                if name not in kinds:
                    theirs = getattr(
                        importlib.import_module(f"foxglove_schemas_protobuf.{name}_pb2"), name
                    ).DESCRIPTOR
                    kept = {(field.name, field.number, field.type) for field in decoded.DESCRIPTOR.fields}
                    assert kept == {(field.name, field.number, field.type) for field in theirs.fields}
                kinds.add(name)
    assert kinds == {"FrameTransform", "Log", "PointCloud", "PoseInFrame"}


@pytest.mark.parametrize(("epoch", "text"), [("soon", "a date and time of UTC"), ("1950-01-01", None)])
def test_an_epoch_that_is_none_or_before_the_first_time_of_the_format(epoch, text, tmp_path):
    flight = synthetic_flight.fly(3)
    metadata = synthetic_flight.metadata(flight)
    metadata["episode"]["epoch"] = epoch
    if text is not None:
        with pytest.raises(RecordingError, match=text):
            synthetic_flight.record(flight, tmp_path / "x.mcap", metadata=metadata)
        return
    path = synthetic_flight.record(flight, tmp_path / "x.mcap", metadata=metadata)
    np.testing.assert_array_equal(telemetry.read(path)["/mission"].time_s, [0.0, 10.0, 20.0, 30.0])
