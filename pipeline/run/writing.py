"""Files of a run that are written whole or not at all."""

import errno
import json
import math
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

from pipeline.run.artifacts import CONFIG, ArtifactError
from pipeline.settings.keys import dotted
from plain_files.file_access import UNFINISHED, replacing


class WriteError(OSError):
    """A file of a run that could not be written; the one it was to replace is unchanged."""


def write_atomically(path: Path, content: bytes | str) -> None:
    """Write a file atomically: at every moment either the old or the new content is there, never a part.

    Parameters
    ----------
    path : Path
        Its folder is made if missing.
    content : bytes or str
        Text is written as UTF-8 with its line ends unchanged.

    Raises
    ------
    WriteError
        If the disk is full, or the folder may not be written to.
    """
    with beside(path) as stream:
        stream.write(content.encode() if isinstance(content, str) else content)


@contextmanager
def beside(path: Path) -> Iterator[BinaryIO]:
    """Yield a temporary file that replaces a path once it is complete and on disk.

    Raises
    ------
    WriteError
        As `write_atomically`.
    """
    try:
        _make_folder_of(path)
        with replacing(path) as stream:
            yield stream
    except OSError as error:
        raise WriteError(
            f"{path} cannot be written: {error.strerror or error}; make room, or choose a folder that may be "
            "written to"
        ) from error


def _make_folder_of(path: Path) -> None:
    """Make the missing folder of a file, but no run's folder anew, which somebody has moved."""
    folder = path.parent
    missing = [each for each in path.parents if not each.exists()]
    # a run's files stand in its folder or in one inside, such as evaluate/
    is_in_run = missing and any((each / CONFIG).exists() for each in missing[-1].parents[:2])
    if len(missing) > 1 and path.name != CONFIG and not is_in_run:
        raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(missing[-1]))
    folder.mkdir(parents=True, exist_ok=True)


def drop_unfinished(folder: Path) -> None:
    """Remove the files that a process was writing when it was killed; no other process may be at work there.

    Those of runs inside it, where others may be at work, stay: each run removes its own.
    """
    for path in folder.rglob(f".*{UNFINISHED}"):
        inner = [parent for parent in path.parents if folder in parent.parents]
        if not any((parent / CONFIG).exists() for parent in inner):
            path.unlink(missing_ok=True)


def write_json(path: Path, content: Any) -> None:
    """Write plain data as JSON.

    Raises
    ------
    ArtifactError
        If a number is not finite, which JSON cannot hold.
    WriteError
        See `write_atomically`.
    """
    try:
        text = json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False)
    except ValueError as error:
        key = next(_not_finite(content), "a number")
        raise ArtifactError(
            f"{path} is not written, for {key} is not finite; settings or files that were read make no sense"
        ) from error
    write_atomically(path, text + "\n")


def _not_finite(content: Any, key: str = "") -> Iterator[str]:
    """Yield the keys of the numbers that JSON cannot hold."""
    if isinstance(content, float) and not math.isfinite(content):
        yield key
    elif isinstance(content, Mapping | list | tuple):
        for name, value in content.items() if isinstance(content, Mapping) else enumerate(content):
            yield from _not_finite(value, dotted(key, (name,)))
