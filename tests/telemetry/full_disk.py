"""A disk without room, for whatever opens its files through `telemetry.file.partial_file`."""

import errno
import io
import os
from pathlib import Path

import pytest

from telemetry.file import partial_file


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
    """Leave room for so many bytes in each file."""

    def open_on_full_disk(path: Path) -> io.BufferedWriter:
        return io.BufferedWriter(FullDisk(path, room))

    monkeypatch.setattr(partial_file, "open_stream", open_on_full_disk)
