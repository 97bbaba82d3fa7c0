"""numba's dispatchers of our functions: those called from Python keep their code, those inside do not.

A dispatcher compiles a function for each combination of types of its arguments. Ours derive from numba's and
use what it offers for this: a cache of their own, and the types that a call from compiled code asks for.
"""

import pickle
import threading
from collections.abc import Callable
from concurrent.futures import Future, wait
from contextvars import copy_context
from pathlib import Path
from typing import Any

from numba import types

from fis_tools.compiled import borrowed_code, cache, notice  # noqa: F401 - tells numba what vectors are
from fis_tools.compiled.fingerprint import covers_this_module
from fis_tools.compiled.numba_parts import (
    Cache,
    CompileResult,
    CPUDispatcher,
    dumps,
    event,
    global_compiler_lock,
)

covers_this_module()

#: Stack of the thread that compiles: on some systems threads have less than LLVM needs.
STACK_BYTES = 1 << 26
#: How often the main thread looks for signals meanwhile.
LOOK_S = 0.1


class KeptCode(Cache):
    """The cache of one dispatcher, in place of numba's, which misses changes in what a function calls.

    numba also keeps one index for all types, which processes that compile at once overwrite for each other.
    """

    def __init__(self, dispatcher: Any) -> None:
        self._dispatcher = dispatcher
        self._paths: dict[Any, Path] = {}  # where code would be kept, as of before compiling

    @property
    def cache_path(self) -> str:
        """The folder that holds the code."""
        return str(cache.cache_root())

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return the kept code for the types of some arguments; None if there is none."""
        data = None
        with notice.reporting_refusals():
            self._paths[sig] = cache.path_for(self._dispatcher, sig)
            data = cache.read(self._paths[sig])
        if data is None:
            return None
        target_context.refresh()
        return CompileResult._rebuild(target_context, *pickle.loads(data))  # noqa: S301 - see `cache`

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep what was compiled for the types of some arguments."""
        path = self._paths.pop(sig, None)
        is_whole = not data.library.has_dynamic_globals and all(part.can_cache for part in data.lifted)
        if path is None or not is_whole:
            return
        with notice.reporting_refusals():
            if cache.path_for(self._dispatcher, sig) == path:
                cache.write(path, dumps(data._reduce()))

    def enable(self) -> None:
        """Do nothing: it is always on."""

    def disable(self) -> None:
        """Do nothing: it is always on."""

    def flush(self) -> None:
        """Do nothing: files of code are named by a fingerprint of their source, so none is out of date."""


class FromPython(CPUDispatcher):
    """Compiles a function for calls from Python, and keeps the code."""

    def enable_caching(self) -> None:
        """Keep code in our cache."""
        self._cache = KeptCode(self)

    def compile(self, sig: Any) -> Any:
        """Return the code for some types; Ctrl-C ends the wait for it at once."""
        return _interruptibly(super().compile, sig)


class FromCompiled(CPUDispatcher):
    """Compiles a function for calls from compiled code, which contains the code and is kept with it.

    A constant among the arguments uses the code for a variable; numba would otherwise compile one version for
    each.
    """

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """Return numba's signature of a call."""
        variable: Callable[[Any], Any] = types.unliteral
        return super().get_call_template(
            tuple(map(variable, args)), {name: variable(kind) for name, kind in kws.items()}
        )


def for_python(function: Callable[..., Any], options: dict[str, Any]) -> Any:
    """Return a dispatcher of a function for calls from Python."""
    dispatcher = FromPython(function, targetoptions={"nopython": True, "boundscheck": None, **options})
    dispatcher.enable_caching()
    notice.announce(dispatcher)
    return dispatcher


def for_compiled_code(function: Callable[..., Any], options: dict[str, Any]) -> Any:
    """Return a dispatcher of a function for calls from compiled code."""
    entries = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    dispatcher = FromCompiled(
        function, targetoptions={"nopython": True, "boundscheck": None, **entries, **options}
    )
    notice.announce(dispatcher)
    return dispatcher


class _Interruption(event.Listener):
    """Ends a compilation between two of numba's passes, if it is of the thread to be interrupted."""

    thread: threading.Thread | None = None

    def on_start(self, event: Any) -> None:
        if threading.current_thread() is self.thread:
            raise KeyboardInterrupt

    def on_end(self, event: Any) -> None:
        pass


_interruption = _Interruption()
event.register("numba:run_pass", _interruption)


def _interruptibly(compile_for: Callable[[Any], Any], sig: Any) -> Any:
    """Compile in a thread of its own, so that Ctrl-C reaches this one, the main one.

    Where compiling calls back from LLVM nothing can be raised, and a Ctrl-C that came there would be lost.
    """
    if threading.current_thread() is not threading.main_thread() or global_compiler_lock.is_locked():
        return compile_for(sig)
    future: Future[Any] = Future()

    def work() -> None:
        try:
            future.set_result(compile_for(sig))
        except BaseException as error:  # noqa: BLE001 - raised in the main thread
            future.set_exception(error)

    thread = threading.Thread(target=copy_context().run, args=[work], name="compiling", daemon=True)
    before = threading.stack_size(STACK_BYTES)
    try:
        thread.start()
    finally:
        threading.stack_size(before)
    is_interrupted = False
    while not future.done():
        try:
            wait([future], timeout=LOOK_S)  # a signal that another thread got is seen at the next look
        except KeyboardInterrupt:
            is_interrupted, _interruption.thread = True, thread
    if is_interrupted:
        raise KeyboardInterrupt
    return future.result()
