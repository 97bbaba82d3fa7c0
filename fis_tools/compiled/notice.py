"""Reports on standard error which function is being compiled, and for how long.

numba notifies listeners when it compiles (``numba.core.event``, in its documentation as the event API).
Functions from the cache, and those of other packages, are not reported.

While one of ours is compiled, Python's garbage collector is paused: almost nothing that numba allocates is
garbage before the end, and searching for some took a sixth of the time.
"""

import _thread
import gc
import sys
import threading
import time
from pathlib import Path
from typing import Any, Protocol
from weakref import WeakSet

from numba.core import event

from fis_tools.compiled.cache import Refused

#: Compilations shorter than this are not reported; then the interval between plain lines.
SHORTEST_S = 0.5
SECONDS_BETWEEN_LINES = 5.0
#: Interval between updates of the line in a terminal.
REFRESH_S = 0.1


class _Display(Protocol):
    """Shows a text about what has been going on for some seconds."""

    def show(self, text: str, seconds: float) -> None: ...

    def close(self) -> None: ...


class _Lines:
    """One line now and then, for files and notebooks; continues from one compilation to the next."""

    def __init__(self) -> None:
        self._next_s = SHORTEST_S

    def show(self, text: str, seconds: float) -> None:
        if seconds >= self._next_s:
            self._next_s = seconds + SECONDS_BETWEEN_LINES
            _write(f"  {text}")

    def close(self) -> None:
        """Keep what has been written."""


class _Terminal:
    """One line that is rewritten and vanishes at the end."""

    def __init__(self) -> None:
        self._status: Any = None

    def show(self, text: str, seconds: float) -> None:
        if self._status is not None:
            self._status.update(text)
        elif seconds >= SHORTEST_S:
            from rich.console import Console  # noqa: PLC0415 - takes long to import

            self._status = Console(stderr=True).status(text)
            self._status.start()

    def close(self) -> None:
        if self._status is not None:
            self._status.stop()
            self._status = None


class _Notice(event.Listener):
    """Follows the compilation of our functions; numba's lock lets one thread compile at a time."""

    def __init__(self) -> None:
        self._watched: WeakSet[Any] = WeakSet()
        self._refusals: set[str] = set()
        self._untold: list[str] = []
        self._names: list[str] = []
        self._display: _Display | None = None
        self._spent_s = 0.0
        self._is_over = threading.Event()
        self._ticker: threading.Thread | None = None
        self._hook: Any = None
        self._collects = False

    def watch(self, dispatcher: Any, place: Path | Refused | None) -> None:
        self._watched.add(dispatcher)
        if isinstance(place, Refused) and place.reason not in self._refusals:
            self._refusals.add(place.reason)
            self._untold.append(place.reason)

    def on_start(self, event: Any) -> None:
        dispatcher = event.data["dispatcher"]
        if dispatcher not in self._watched:
            return
        self._names.append(f"{dispatcher.py_func.__module__}.{dispatcher.py_func.__qualname__}")
        if len(self._names) == 1:
            while self._untold:
                _write(f"  compiled code is not kept: {self._untold.pop()}")
            self._hook, sys.unraisablehook = sys.unraisablehook, self._heed
            self._collects = gc.isenabled()
            gc.disable()
            self._is_over.clear()
            self._ticker = threading.Thread(target=self._tick, args=(time.monotonic(),), daemon=True)
            self._ticker.start()

    def on_end(self, event: Any) -> None:
        if event.data["dispatcher"] not in self._watched:
            return
        if len(self._names) == 1 and self._ticker is not None:
            self._is_over.set()
            self._ticker.join()
            sys.unraisablehook = self._hook
            if self._collects:
                gc.enable()
        self._names.pop()

    def _heed(self, unraisable: Any) -> None:
        """Repeat a Ctrl-C that came in a callback from LLVM, where nothing can be raised."""
        if issubclass(unraisable.exc_type, KeyboardInterrupt):
            threading.Timer(REFRESH_S, _thread.interrupt_main).start()
        else:
            self._hook(unraisable)

    def _tick(self, began: float) -> None:
        """Show the progress until compilation ends."""
        if self._display is None:
            self._display = _Terminal() if _is_terminal() else _Lines()
        is_over = False
        while not is_over:
            is_over = self._is_over.wait(REFRESH_S)
            seconds = self._spent_s + time.monotonic() - began
            if not is_over:
                self._display.show(f"compiling {self._names[-1]}, {seconds:.0f} s so far", seconds)
        self._display.close()
        self._spent_s = seconds


_notice = _Notice()


def watch(dispatcher: Any, place: Path | Refused | None = None) -> None:
    """Report from now on when numba compiles this function, and why its code is not cached, if so."""
    if not hasattr(dispatcher, "py_func"):  # numba is disabled
        return
    if not _notice._watched:
        event.register("numba:compile", _notice)  # type: ignore[no-untyped-call]
    _notice.watch(dispatcher, place)


def _is_terminal() -> bool:
    return sys.stderr is not None and sys.stderr.isatty()


def _write(line: str) -> None:
    if sys.stderr is not None:
        sys.stderr.write(f"{line}\n")
        sys.stderr.flush()
