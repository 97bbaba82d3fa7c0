"""Recordings of another writer, and files on a disk without room."""

import errno
import io
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import pytest
from mcap.writer import CompressionType, Writer

from plain_files import file_access

PLAIN = {"episode": {"scenario_id": "plain"}}


def plain_file(
    path: Path,
    compression: CompressionType,
    chunk_size: int,
    messages: Iterable[Any],
    metadata: Mapping[str, Mapping[str, str]] = PLAIN,
) -> Path:
    """Write (schema, channel, message), as the mcap library reads them."""
    with path.open("wb") as output:
        writer = Writer(output, compression=compression, chunk_size=chunk_size)
        writer.start()
        channels: dict[str, int] = {}
        for schema, channel, message in messages:
            if channel.topic not in channels:
                schema_id = writer.register_schema(schema.name, "protobuf", schema.data)
                channels[channel.topic] = writer.register_channel(channel.topic, "protobuf", schema_id)
            writer.add_message(channels[channel.topic], message.log_time, message.data, message.log_time)
        for name, entries in metadata.items():
            writer.add_metadata(name, dict(entries))
        writer.finish()
    return path


class FullDisk(io.FileIO):
    """A file on a disk with room for so many bytes."""

    def __init__(self, path: Path, room: int):
        super().__init__(path, "wb")
        self.room = room

    def write(self, data: object) -> int:
        size = len(memoryview(data))  # type: ignore[arg-type]
        if size > self.room:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        self.room -= size
        return super().write(data)  # type: ignore[arg-type]


def fill_disk(monkeypatch: pytest.MonkeyPatch, room: int) -> None:
    """Leave room for so many bytes in each file that is opened through `plain_files.file_access`."""
    monkeypatch.setattr(file_access, "create", lambda path: io.BufferedWriter(FullDisk(path, room)))
