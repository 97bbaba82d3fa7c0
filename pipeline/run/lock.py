"""One process at a time in a run's folder: the kernel holds the lock, and a file there names its holder.

The lock ends with its process, in whatever way; a file left by a killed process is reported and taken
over.
"""

import json
import os
import platform
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import IO, Final

from pipeline.run import artifacts, writing
from plain_files.file_access import open_folder, open_lock, open_text
from plain_files.plain_text import parse_json

LOCK: Final = ".lock"


class HeldError(artifacts.ArtifactError):
    """A run's folder in which another process is, or may be, at work."""


@contextmanager
def held(folder: Path) -> Iterator[None]:
    """Keep other processes out of a run's folder.

    Parameters
    ----------
    folder : Path
        Made if missing.

    Raises
    ------
    HeldError
        If another process holds it, or its file system has no locks.
    pipeline.run.artifacts.ArtifactError
        If it contains links, pipes or devices.
    pipeline.run.writing.WriteError
        If the folder cannot be made or written to.
    """
    path = folder / LOCK
    with ExitStack() as stack:
        try:
            folder.mkdir(parents=True, exist_ok=True)
            artifacts.check_no_strangers(folder)
            stack.enter_context(_folder_locked(path))
            stream = stack.enter_context(_locked(path))
            left = _holder(stream)
            _sign(stream)
        except OSError as error:
            raise writing.WriteError(
                f"{folder} cannot be a run's folder ({error.strerror}); choose one that can be written to, "
                "hydra.run.dir=..., or make room"
            ) from error
        if left:
            sys.stderr.write(f"{folder} was held by {left}, which is gone; its lock is taken over\n")
        writing.drop_unfinished(folder)
        try:
            yield
        finally:
            # while still locked: a process that waits for it finds that the file is another, and retries
            path.unlink(missing_ok=True)


def drop_left(folder: Path) -> None:
    """Remove what a killed process left in the folder of a finished run; a lock that is held stays."""
    if (folder / LOCK).exists():
        with suppress(HeldError), held(folder):
            pass


@contextmanager
def _folder_locked(path: Path) -> Iterator[None]:
    """Lock the folder of a lock file too, since the file may be deleted while it is held."""
    descriptor = open_folder(path.parent)
    try:
        _lock(descriptor, path)
        yield
    finally:
        os.close(descriptor)


def _locked(path: Path) -> IO[str]:
    """Open and lock a file, and check that it still has this name."""
    while True:
        stream = open_lock(path)
        try:
            _lock(stream.fileno(), path)
        except HeldError:
            stream.close()
            raise
        if _is_at(stream, path):
            return stream
        stream.close()


def _lock(descriptor: int, path: Path) -> None:
    """Lock an open file or folder; raise HeldError if another process holds it, or nobody can lock it."""
    import fcntl  # noqa: PLC0415 - not on every system

    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        holder = "another process"
        with suppress(OSError, UnicodeDecodeError), open_text(path) as stream:  # file: a lock, shown alone
            holder = _holder(stream) or holder
        raise HeldError(
            f"{path.parent} is held by {holder}; wait for it, stop it, or choose another folder"
        ) from error
    except OSError as error:
        raise HeldError(
            f"{path.parent} cannot be locked by its file system ({error.strerror}), so that a second process "
            "could work in it unnoticed; choose a folder on another, hydra.run.dir=..., and move the run "
            "there if it is to go on"
        ) from error


def _is_at(stream: IO[str], path: Path) -> bool:
    """Return whether a path still names an open file."""
    try:
        return os.path.samestat(os.fstat(stream.fileno()), path.stat())
    except FileNotFoundError:
        return False


def _sign(stream: IO[str]) -> None:
    """Write the holder into a lock file."""
    stream.truncate(0)
    now = datetime.now(UTC).strftime("%Y-%m-%d %H:%M:%S UTC")
    json.dump({"process": os.getpid(), "host": platform.node(), "since": now}, stream)
    stream.flush()


def _holder(stream: IO[str]) -> str:
    """Return the holder named in a lock file; empty if it cannot be read."""
    stream.seek(0)
    try:
        holder = parse_json(stream.read(1000))
        return f"process {int(holder['process'])} on {holder['host']} since {holder['since']}"
    except (ValueError, KeyError, TypeError):
        return ""
