"""Says on standard error which function is being compiled, and why its code is not kept.

Only our own functions are announced, and only what takes longer than half a second: what is loaded from the
cache is not. While one is compiled, Python's garbage collector rests, because next to nothing of what numba
allocates is garbage before the end, and a Ctrl-C that comes in a callback from LLVM, where nothing can be
raised, is repeated.
"""

import _thread
import gc
import sys
import threading
from collections.abc import Callable
from contextlib import ExitStack
from functools import cache
from typing import Any

from fis_tools.compiled.numba_parts import event
from fis_tools.waiting import waiting

#: Compilations shorter than this are not announced.
SHORTEST_S = 0.5
#: How long after a swallowed Ctrl-C the next one is sent.
PAUSE_S = 0.1


class _Notice(event.Listener):
    """Follows the compilation of our functions; numba's lock lets one thread compile at a time."""

    def __init__(self) -> None:
        self.functions: set[Callable[..., Any]] = set()
        self._depth = 0
        self._shown = ExitStack()

    def on_start(self, event: Any) -> None:
        function = event.data["dispatcher"].py_func
        if function not in self.functions:
            return
        self._depth += 1
        if self._depth > 1:
            return
        self._timer = threading.Timer(
            SHORTEST_S, self._show, [f"{function.__module__}.{function.__qualname__}"]
        )
        self._timer.start()
        self._hook, sys.unraisablehook = sys.unraisablehook, self._heed
        self._collects = gc.isenabled()
        gc.disable()

    def on_end(self, event: Any) -> None:
        if event.data["dispatcher"].py_func not in self.functions:
            return
        self._depth -= 1
        if self._depth > 0:
            return
        self._timer.cancel()
        self._timer.join()
        self._shown.close()
        sys.unraisablehook = self._hook
        if self._collects:
            gc.enable()

    def _show(self, name: str) -> None:
        """Show the name: with the seconds in a terminal, until compilation ends; else as a line."""
        if sys.stderr is None or not sys.stderr.isatty():
            _write(f"compiling {name}")
            return
        self._shown.enter_context(waiting(f"compiling {name}"))

    def _heed(self, unraisable: Any) -> None:
        if issubclass(unraisable.exc_type, KeyboardInterrupt):
            threading.Timer(PAUSE_S, _thread.interrupt_main).start()
        else:
            self._hook(unraisable)


_notice = _Notice()


def announce(function: Callable[..., Any]) -> None:
    """Announce from now on when numba compiles this function."""
    if not _notice.functions:
        event.register("numba:compile", _notice)
    _notice.functions.add(function)


@cache
def tell_refusal(reason: str) -> None:
    """Say once why compiled code is not kept."""
    _write(f"compiled code is not kept: {reason}")


def _write(line: str) -> None:
    if sys.stderr is not None:
        sys.stderr.write(f"  {line}\n")
        sys.stderr.flush()
