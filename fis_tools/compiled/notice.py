"""Says on standard error which function is being compiled, for how long, and why its code is not kept.

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
from functools import cache as cached
from types import ModuleType
from typing import Any

from fis_tools.compiled.numba_parts import event
from fis_tools.waiting import waiting

#: Compilations shorter than this are not announced.
SHORTEST_S = 0.5
#: Where compiling takes at least this long, it is said that a function runs as plain Python.
LONG_S = 5.0
#: What compiling a function takes on average, s (`python -m benchmarks start`).
SECONDS_A_FUNCTION = 0.12
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
        self._timer = threading.Timer(SHORTEST_S, self._show, [function])
        self._timer.start()
        self._hook, sys.unraisablehook = sys.unraisablehook, self._heed
        self._collects = gc.isenabled()
        gc.disable()

    def on_end(self, event: Any) -> None:
        function = event.data["dispatcher"].py_func
        if function not in self.functions:
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

    def _show(self, function: Callable[..., Any]) -> None:
        """Say what is compiled: with the seconds in a terminal, until compilation ends; else as a line."""
        name = f"{function.__module__}.{function.__qualname__}"
        line = f"compiling {name}: about {expected_s(function):.0f} s, once"
        if sys.stderr is None or not sys.stderr.isatty():
            _write(line)
            return
        self._shown.enter_context(waiting(line))

    def _heed(self, unraisable: Any) -> None:
        if issubclass(unraisable.exc_type, KeyboardInterrupt):
            threading.Timer(PAUSE_S, _thread.interrupt_main).start()
        else:
            self._hook(unraisable)


_notice = _Notice()


@cached
def expected_s(function: Callable[..., Any]) -> float:
    """Return about how many seconds compiling a function takes, by how many others it calls."""
    return max(1.0, SECONDS_A_FUNCTION * len(_called(function, set())))


def _called(function: Callable[..., Any], known: set[Callable[..., Any]]) -> set[Callable[..., Any]]:
    """Add a function to the known ones, and the compiled functions that its code names, directly or not."""
    known.add(function)
    names, around = function.__code__.co_names, function.__globals__
    values = [around[name] for name in names if name in around]
    values += [getattr(one, name, None) for one in values if isinstance(one, ModuleType) for name in names]
    for called in (value.py_func for value in values if "py_func" in getattr(value, "__dict__", ())):
        if called not in known:
            _called(called, known)
    return known


@cached
def tell_plain(function: Callable[..., Any]) -> None:
    """Say once that a function runs in plain Python for now, if compiling it takes long."""
    if (seconds := expected_s(function)) >= LONG_S:
        name = f"{function.__module__}.{function.__qualname__}"
        _write(f"{name} runs as plain Python for now: compiling takes about {seconds:.0f} s, once")


def announce(function: Callable[..., Any]) -> None:
    """Announce from now on when numba compiles this function."""
    if not _notice.functions:
        event.register("numba:compile", _notice)
    _notice.functions.add(function)


@cached
def tell_refusal(reason: str) -> None:
    """Say once why compiled code is not kept."""
    _write(f"compiled code is not kept: {reason}")


def _write(line: str) -> None:
    if sys.stderr is not None:
        sys.stderr.write(f"  {line}\n")
        sys.stderr.flush()
