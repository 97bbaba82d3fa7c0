"""The decorator of every compiled function: numba at the first call, with our own cache and notices.

Without numba, or with NUMBA_DISABLE_JIT=1, every function runs as plain Python, to the same bits.

Importing a module with compiled functions does not import numba. The first call creates numba's dispatcher
and gives it its own cache folder (`fis_tools.compiled.cache`). numba's settings for the process, and the
compiled functions of other packages, are unaffected.
"""

import os
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cache as cached
from functools import update_wrapper
from importlib.util import find_spec
from pathlib import Path
from typing import Any, TypeVar, cast, overload

import numpy as np

from fis_tools.compiled import cache

F = TypeVar("F", bound=Callable[..., Any])

#: Dispatchers and their caches are created one at a time: this changes numba's setting for a moment.
_making = threading.RLock()

#: The package whose functions currently run as plain Python, and what runs instead of some; see `plainly`.
_plain: ContextVar[tuple[str, dict[Any, Callable[..., Any]]]] = ContextVar("plain", default=("", {}))


class Compiled:
    """A function that numba compiles when it is first called, from Python or from another one.

    It has every attribute of numba's dispatcher, which is created when the first of them is requested. There
    is one for calls from Python, and one without an entry for Python for calls from compiled functions.
    """

    dispatcher: Any
    inside: Any

    def __init__(self, function: Callable[..., Any], options: dict[str, Any]) -> None:
        update_wrapper(self, function)
        self.py_func = function
        self._options = options
        self._package = function.__module__.partition(".")[0]
        cache.packages.add(self._package)

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        """Call the compiled function."""
        plain, instead = _plain.get()
        # what takes vectors is called in compiled code, or in plain Python with those of NumPy
        if plain and (plain == self._package or {"forceinline", "inline"} & self._options.keys()):
            return instead.get(self, self.py_func)(*args, **kwargs)
        if kwargs:  # numba takes a tenth of a microsecond longer if there may be some
            return self.dispatcher(*args, **kwargs)
        return self.dispatcher(*args)

    def prepared(self, *args: Any) -> Callable[..., Any]:
        """Return the compiled code for arguments of these types.

        Calling it skips type resolution, which takes numba longer than a short function does when many
        arrays are passed. It must be called with exactly these types.
        """
        if not is_compiling():
            return self.py_func
        from numba import typeof  # noqa: PLC0415 - takes a while, and most commands compile nothing

        return cast(Callable[..., Any], self.dispatcher.compile(tuple(map(typeof, args))))

    def __getattr__(self, name: str) -> Any:
        # Only names that are not yet set get here. One is `_numba_type_`, by which numba asks a global
        # of a function that it compiles for its type: the type is that of the dispatcher.
        if name.startswith("__") or name in {"py_func", "_options", "_package"}:
            raise AttributeError(name)
        if name not in {"dispatcher", "inside"}:
            return getattr(self.inside if name == "_numba_type_" else self.dispatcher, name)
        with _making:
            if name not in self.__dict__:
                make = _inside if name == "inside" else _dispatcher
                self.__dict__[name] = make(self.py_func, self._options)
        return self.__dict__[name]


@overload
def compiled(function: F, /) -> F: ...
@overload
def compiled(**options: Any) -> Callable[[F], F]: ...
def compiled(function: F | None = None, /, **options: Any) -> F | Callable[[F], F]:
    """Compile a function at module level with numba, in nopython mode, at its first call, and keep the code.

    Functions that it calls in compiled code must be decorated as well. The options are those of
    ``numba.njit`` except ``cache``, such as ``error_model="numpy"``. It is typed as the function, so that
    type checkers see its arguments. It must hold products in place of powers: numba multiplies where Python
    calls the C library, which rounds otherwise.
    """

    def decorate(function: F) -> F:
        return cast(F, Compiled(function, options))

    return decorate if function is None else decorate(function)


@contextmanager
def plainly(package: str, instead: dict[Any, Callable[..., Any]] | None = None) -> Iterator[None]:
    """Run the compiled functions of a package as plain Python inside; the results are the same.

    Instead of some of them, others of the same signature may run.
    """
    token = _plain.set((package, instead or {}))
    try:
        with np.errstate(all="ignore"):  # compiled code does not warn
            yield
    finally:
        _plain.reset(token)


def sparingly(function: F) -> F:
    """Return a function that calls a compiled function for a single result, at first in plain Python.

    Unless its compiled code is in the cache, the function, and all functions of its package that it calls,
    run as plain Python until they have done so, with arguments of these types and in all processes, for as
    long as compiling is expected to take. The result is the same. Asking numba for types takes long, so the
    function returned stops asking once it is compiled; call it with the same types. With COMPILE_AT_ONCE=1
    nothing runs as plain Python.
    """
    known = cast(Compiled, function)
    is_known = os.environ.get("COMPILE_AT_ONCE") == "1" or not is_compiling()

    def call(*args: Any) -> Any:
        nonlocal is_known
        if is_known:
            return known(*args)
        from numba import typeof  # noqa: PLC0415 - takes a while, and most commands compile nothing

        from fis_tools.compiled import notice  # noqa: PLC0415 - as above

        function, types = known.py_func, tuple(map(typeof, args))
        is_kept = types in known.signatures or cache.is_kept(function, str(types))
        is_known = is_kept or cache.plain_s(function, str(types)) >= notice.expected_s(function)
        if is_known:
            return known(*args)
        notice.tell_plain(function)
        began = time.thread_time()
        with plainly(known._package):
            result = function(*args)
        cache.add_plain_s(function, str(types), time.thread_time() - began)
        return result

    return cast(F, call)


def _dispatcher(function: Callable[..., Any], options: dict[str, Any]) -> Any:
    """Create numba's dispatcher for calls from Python, with a cache folder if one can be trusted."""
    if not is_compiling():
        return function
    from numba import njit  # noqa: PLC0415 - as above

    from fis_tools.compiled import borrowed_code, notice  # noqa: F401, PLC0415 - as above

    notice.announce(function)
    place = cache.place_for(function)
    if isinstance(place, Path):
        with _numba_caching_in(place):
            dispatcher = njit(cache=True, **options)(function)
        if Path(dispatcher.stats.cache_path).is_relative_to(place):
            _keep_apart(dispatcher, place)
            return dispatcher
        place = f"numba cannot write to {place}"
    notice.tell_refusal(place)
    return njit(**options)(function)


def _keep_apart(dispatcher: Any, place: Path) -> None:
    """Give the code for each signature a folder of its own.

    numba keeps one index for all of them, which two processes that compile for different signatures at once
    overwrite for each other: one signature then loads the code of the other.
    """
    compile_, making = dispatcher.compile, threading.RLock()

    def compile_apart(signature: Any) -> Any:
        folder = place / cache.name_of(str(signature))
        with making:  # until it is kept, no other thread may change where
            with _numba_caching_in(folder):
                dispatcher.enable_caching()
            return compile_(signature)

    dispatcher.compile = compile_apart


def _inside(function: Callable[..., Any], options: dict[str, Any]) -> Any:
    """Create numba's dispatcher for calls from compiled code, without an entry for Python.

    It is not cached, for its callers contain its code. A constant among its arguments
    uses the code for a variable; numba would otherwise compile one version for each.
    """
    from numba import njit, types  # noqa: PLC0415 - as above

    from fis_tools.compiled import borrowed_code, notice  # noqa: F401, PLC0415 - as above

    notice.announce(function)
    dispatcher: Any = njit(**{"no_cpython_wrapper": True, "no_cfunc_wrapper": True, **options})(function)
    template = dispatcher.get_call_template
    unliteral: Callable[[Any], Any] = types.unliteral  # as a value: a type checker sees numba's calls untyped
    dispatcher.get_call_template = lambda args, kws: template(
        tuple(map(unliteral, args)), {name: unliteral(kind) for name, kind in kws.items()}
    )
    return dispatcher


def is_compiling() -> bool:
    """Return whether numba is installed, and not switched off by NUMBA_DISABLE_JIT=1."""
    try:
        from numba import config  # noqa: PLC0415 - as above
    except ModuleNotFoundError:
        return False
    settings: Any = config  # numba sets its attributes at run time, unseen by type checkers
    return not settings.DISABLE_JIT


@cached
def advise_numba() -> None:
    """Say once what numba would give, if it is not installed."""
    if find_spec("numba") is None and sys.stderr is not None:
        sys.stderr.write(
            "  plain Python computes this; compiled it takes a thousandth of the time, and has the same "
            "bits: python -m pip install numba\n"
        )


@contextmanager
def _numba_caching_in(folder: Path) -> Iterator[None]:
    """Let dispatchers created inside cache in a folder; numba reads its setting once, at creation."""
    from numba import config  # noqa: PLC0415 - as above

    settings: Any = config  # as above
    with _making:
        before = settings.CACHE_DIR
        settings.CACHE_DIR = os.fspath(folder)
        try:
            yield
        finally:
            settings.CACHE_DIR = before
