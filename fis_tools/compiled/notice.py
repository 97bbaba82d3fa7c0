"""Reports on standard error: what is being compiled, for how long, and why its code is not kept.

Only our own functions are announced, and only what takes longer than half a second: what is loaded from the
cache is not.
"""

import os
import sys
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import cache as cached
from typing import Any

from fis_tools.compiled.cache import NotKeptError
from fis_tools.compiled.fingerprint import functions_of
from fis_tools.compiled.numba_parts import event
from fis_tools.waiting import waiting

#: Compilations shorter than this are not announced.
SHORTEST_S = 0.5
#: Where compiling takes at least this long, it is said that a function runs as plain Python.
LONG_S = 5.0
#: Set to 1 by a package's command that compiles beforehand.
WARMING = "FIS_TOOLS_WARMING"
#: What compiling a function takes on average, s (`python -m benchmarks start`).
SECONDS_A_FUNCTION = 0.12


class _Notice(event.Listener):
    """Follows the compilation of our functions; numba's lock lets one thread compile at a time."""

    def __init__(self) -> None:
        self.dispatchers: set[Any] = set()
        self._depth = 0
        self._shown = ExitStack()

    def on_start(self, event: Any) -> None:
        """Start the timer after which the outermost compilation is announced."""
        dispatcher = event.data["dispatcher"]
        if dispatcher not in self.dispatchers:
            return
        self._depth += 1
        if self._depth == 1:
            self._timer = threading.Timer(SHORTEST_S, self._show, [dispatcher])
            self._timer.start()

    def on_end(self, event: Any) -> None:
        """End the notice with the outermost compilation."""
        if event.data["dispatcher"] not in self.dispatchers:
            return
        self._depth -= 1
        if self._depth == 0:
            self._timer.cancel()
            self._timer.join()
            self._shown.close()

    def _show(self, dispatcher: Any) -> None:
        """Announce a compilation: in a terminal with the seconds, until it ends; else as a line."""
        line = (
            f"compiling {_name(dispatcher)}: about {expected_s(dispatcher):.0f} s, once{_advice(dispatcher)}"
        )
        if sys.stderr is None or not sys.stderr.isatty():
            _write(line)
            return
        self._shown.enter_context(waiting(line))


_notice = _Notice()


@cached
def expected_s(compiled: Any) -> float:
    """Return about how many seconds compiling a function takes, by how many others it calls."""
    return max(1.0, SECONDS_A_FUNCTION * len(functions_of(compiled)))


def _advice(compiled: Any) -> str:
    """Return the command that compiles a package beforehand, if it has one and this takes long, in words."""
    package = sys.modules.get(_name(compiled).partition(".")[0])
    command = getattr(package, "COMPILE_COMMAND", "")
    # that command itself needs no advice
    is_needed = expected_s(compiled) >= LONG_S and os.environ.get(WARMING) != "1"
    return f", or beforehand by {command}" if command and is_needed else ""


def announce(dispatcher: Any) -> None:
    """Announce from now on when this dispatcher compiles."""
    if not _notice.dispatchers:
        event.register("numba:compile", _notice)
    _notice.dispatchers.add(dispatcher)


_reported: set[object] = set()


@contextmanager
def reporting_refusals() -> Iterator[None]:
    """Report, once for each reason, why compiled code is not kept, instead of raising it."""
    try:
        yield
    except NotKeptError as error:
        if error.reason not in _reported:
            _reported.add(error.reason)
            _write(f"compiled code is not kept: {error}")


def _name(compiled: Any) -> str:
    return f"{compiled.py_func.__module__}.{compiled.py_func.__qualname__}"


def _write(line: str) -> None:
    """Write a line to standard error, if that is open."""
    with suppress(OSError, ValueError):  # the stream may be closed or full
        if sys.stderr is not None:
            sys.stderr.write(f"  {line}\n")
            sys.stderr.flush()
