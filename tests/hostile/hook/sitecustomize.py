"""Ends a process of Python at one of its file operations, by environment variables; runs before all else.

KILL_UNDER is a folder: operations on paths below it count. Each process appends their number to the file
KILL_COUNTS when it ends. It signals itself (KILL_GROUP: its group) by KILL_BY before operation KILL_AT, and
appends "killed" to that file.
"""

import atexit
import os
import sys

OPERATIONS = {
    "open": 1, "os.rename": 2, "os.remove": 1, "os.mkdir": 1, "os.rmdir": 1, "os.truncate": 1, "os.link": 2,
    "os.symlink": 2, "os.utime": 1, "os.listdir": 1, "os.scandir": 1,
}  # fmt: skip
UNDER = os.path.abspath(os.environ["KILL_UNDER"])
AT = int(os.environ.get("KILL_AT", "0"))
counts = [0]
_busy = []


def note(text: str) -> None:
    """Append a line to the file of counts."""
    _busy.append(True)
    descriptor = os.open(os.environ["KILL_COUNTS"], os.O_WRONLY | os.O_APPEND | os.O_CREAT)
    os.write(descriptor, f"{text}\n".encode())
    os.close(descriptor)
    _busy.pop()


def is_under(path: object) -> bool:
    """Return whether an operation's path counts."""
    if isinstance(path, bytes | str):
        whole = os.path.abspath(os.fsdecode(path))
        return whole == UNDER or whole.startswith(UNDER + os.sep)
    return False


def hook(event: str, arguments: tuple[object, ...]) -> None:
    """Count an operation; end the process before the one that was named."""
    if event not in OPERATIONS or _busy or not any(map(is_under, arguments[: OPERATIONS[event]])):
        return
    counts[0] += 1
    if counts[0] == AT:
        note(f"killed {event} {arguments[0]!r}")
        number = int(os.environ["KILL_BY"])
        if "KILL_GROUP" in os.environ:
            os.killpg(0, number)
        else:
            os.kill(os.getpid(), number)


sys.addaudithook(hook)
atexit.register(lambda: note(str(counts[0])))
