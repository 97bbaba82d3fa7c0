"""Real machine faults, induced: full disks, deleted folders, exhausted memory, signals."""

import os
import resource
import shutil
import signal
import subprocess
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Final

#: bytes that a process may still allocate once its memory runs out
LAST_BYTES: Final = 8 * 1024**2


def may_mount() -> bool:
    """Return whether a separate disk can be made here."""
    return os.geteuid() == 0 and shutil.which("mount") is not None and _done("mount", "--version")


def _done(*command: str) -> bool:
    return subprocess.run(command, capture_output=True, check=False).returncode == 0  # noqa: S603


def without_privilege() -> list[str]:
    """Return how a command begins that writes only where its user may: root could write everywhere."""
    return ["setpriv", "--bounding-set=-dac_override"] if os.geteuid() == 0 else []


@contextmanager
def small_disk(folder: Path, kibibytes: int) -> Iterator[Callable[[str], bool]]:
    """Make a folder a separate disk, in memory.

    Yields
    ------
    callable
        Changes it: ``size=64m`` makes room, ``ro`` prevents opening files for writing, ``rw`` ends that;
        returns whether it worked.

    Raises
    ------
    OSError
        If it cannot be made.
    """
    folder.mkdir(parents=True, exist_ok=True)
    if not _done("mount", "-t", "tmpfs", "-o", f"size={kibibytes}k,mode=700", "tmpfs", str(folder)):
        raise OSError(f"{folder} cannot be a disk")
    try:
        yield partial(_change, str(folder))
    finally:
        while _done("umount", "-l", str(folder)):
            pass


def _change(folder: str, option: str) -> bool:
    if option == "ro":  # by a second mount: the disk itself has open files
        return _done("mount", "--bind", folder, folder) and _done("mount", "-o", "remount,bind,ro", folder)
    if option == "rw":
        return not os.statvfs(folder).f_flag & os.ST_RDONLY or _done("umount", "-l", folder)
    return _done("mount", "-o", f"remount,{option}", folder)


def take_memory(pid: int) -> None:
    """Limit a process to almost no more memory than it has."""
    with suppress(OSError, IndexError):
        pages = int(Path(f"/proc/{pid}/statm").read_text(encoding="ascii").split()[0])
        most = pages * resource.getpagesize() + LAST_BYTES
        resource.prlimit(pid, resource.RLIMIT_AS, (most, most))


def take_folder(folder: Path) -> None:
    """Delete a folder that may be in use."""
    shutil.rmtree(folder, ignore_errors=True)


def send(number: signal.Signals, pid: int) -> None:
    """Send a signal to a process group."""
    with suppress(ProcessLookupError):
        os.killpg(pid, number)


#: faults of a process at some moment
SIGNALS: Final[Mapping[str, Callable[[int], None]]] = {
    "SIGKILL": partial(send, signal.SIGKILL),
    "SIGTERM": partial(send, signal.SIGTERM),
    "Ctrl-C": partial(send, signal.SIGINT),
    "no memory": take_memory,
}


#: made in the folder of `killed_at` as the process is killed
KILLED: Final = "killed"
_KILLER: Final = """
import os, signal, sys

left = [int(os.environ["KILLED_COUNT"])]

def kill(event, arguments):
    if event == "os.rename" and os.fsdecode(arguments[1]).endswith(os.environ["KILLED_AT"]):
        left[0] -= 1
        if left[0] == 0:
            try:
                os.close(os.open(os.environ["KILLED_MARK"], os.O_CREAT | os.O_EXCL))
            except FileExistsError:
                return
            os.kill(os.getpid(), signal.SIGKILL)

sys.addaudithook(kill)
"""


def killed_at(path: str, count: int, folder: Path) -> dict[str, str]:
    """Return the environment in which one Python process is killed as it puts a file in its place.

    Parameters
    ----------
    path : str
        How the file's path ends.
    count : int
        Of the times that a process puts it there; before the last it is killed, once.
    folder : Path
        Made; holds what every Python process reads as it starts.
    """
    folder.mkdir(exist_ok=True)
    (folder / KILLED).unlink(missing_ok=True)
    (folder / "sitecustomize.py").write_text(_KILLER)
    paths = filter(None, [str(folder), os.environ.get("PYTHONPATH", "")])
    return {
        "PYTHONPATH": os.pathsep.join(paths),
        "KILLED_AT": path,
        "KILLED_COUNT": str(count),
        "KILLED_MARK": str(folder / KILLED),
    }
