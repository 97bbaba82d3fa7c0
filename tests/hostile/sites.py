"""Which of the program's functions open files while something is read."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

from tests.places import PACKAGES
from tests.smoke.file_calls import DOOR, READERS, calls

#: sets that are being filled; a hook that was added stays
_open: list[set[str]] = []
_hooked: list[bool] = []


def reading_sites() -> frozenset[str]:
    """Return every function of the packages that opens a file for reading, by the source.

    Without those whose line says that the program wrote the file itself.
    """
    return frozenset(
        each.site
        for each in calls()
        if each.name.rpartition("file_access.")[2] in READERS and not each.reason
    )


@contextmanager
def sites_reached() -> Iterator[set[str]]:
    """Yield a set that receives the functions that open files meanwhile."""
    if not _hooked:
        sys.addaudithook(_note)
        _hooked.append(True)
    reached: set[str] = set()
    _open.append(reached)
    try:
        yield reached
    finally:
        _open.remove(reached)


def _note(event: str, _arguments: object) -> None:
    if event == "open" and _open:
        site = _caller(sys._getframe(1))
        for reached in _open:
            reached.add(site)


def _caller(frame: FrameType | None) -> str:
    """Return the first function of ours that is not the door's."""
    while frame is not None:
        module = str(frame.f_globals.get("__name__"))
        if module != DOOR and module.partition(".")[0] in PACKAGES:
            parts = frame.f_code.co_qualname.split(".")
            return ".".join([module, *(part for part in parts if not part.startswith("<"))])
        frame = frame.f_back
    return ""
