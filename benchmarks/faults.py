"""Faults of a machine, really brought about: full disks, folders that go, memory that runs out, signals."""

import os
import resource
import shutil
import signal
import subprocess
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Final

#: bytes that a process may still take once its memory runs out
LAST_BYTES: Final = 8 * 1024**2


def may_mount() -> bool:
    """Tell whether a disk of one's own can be made here."""
    return os.geteuid() == 0 and shutil.which("mount") is not None and _mount("--version")


def _mount(*words: str) -> bool:
    command = ["mount", *words]
    return subprocess.run(command, capture_output=True, check=False).returncode == 0  # noqa: S603


@contextmanager
def small_disk(folder: Path, kibibytes: int) -> Iterator[Callable[[str], bool]]:
    """Make a folder a disk of its own, in memory.

    Yields
    ------
    callable
        Changes it by an option of ``mount``: ``size=64m`` makes room, ``ro`` lets nobody write; tells whether
        it could be done.

    Raises
    ------
    OSError
        If it cannot be made.
    """
    folder.mkdir(parents=True, exist_ok=True)
    if not _mount("-t", "tmpfs", "-o", f"size={kibibytes}k,mode=700", "tmpfs", str(folder)):
        raise OSError(f"{folder} cannot be a disk")
    try:
        yield lambda option: _mount("-o", f"remount,{option}", str(folder))
    finally:
        subprocess.run(["umount", "-l", str(folder)], check=False)  # noqa: S603, S607


def take_memory(pid: int) -> None:
    """Let a process take next to no more memory than it has."""
    with suppress(OSError, IndexError):
        pages = int(Path(f"/proc/{pid}/statm").read_text(encoding="ascii").split()[0])
        most = pages * resource.getpagesize() + LAST_BYTES
        resource.prlimit(pid, resource.RLIMIT_AS, (most, most))


def take_folder(folder: Path) -> None:
    """Delete a folder that may be in use."""
    shutil.rmtree(folder, ignore_errors=True)


def send(number: signal.Signals) -> Callable[[int], None]:
    """Return what sends a signal to the group of a process."""

    def sent(pid: int) -> None:
        with suppress(ProcessLookupError):
            os.killpg(pid, number)

    return sent


#: what is done to a process at some moment
SIGNALS: Final[Mapping[str, Callable[[int], None]]] = {
    "SIGKILL": send(signal.SIGKILL),
    "SIGTERM": send(signal.SIGTERM),
    "Ctrl-C": send(signal.SIGINT),
    "no memory": take_memory,
}
