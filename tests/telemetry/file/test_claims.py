"""Recordings that claim more than they are: refused before anything is allocated."""

import tracemalloc

import pytest
from mcap.writer import CompressionType, Writer

import telemetry
from telemetry.file import RecordingError, claims
from telemetry.file.recover import recover


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
