"""The decorator of every compiled function: numba at the first call, with a cache and a notice of our own.

Importing a module with compiled functions does not import numba. The first call makes numba's dispatcher and
gives it a cache folder of its own (`fis_tools.engines.cache`). numba's settings for the process, and the
compiled functions of other packages, stay as they are.
"""

import os
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import update_wrapper
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import Any, TypeVar, cast, overload

import numpy as np

from fis_tools.engines import cache

F = TypeVar("F", bound=Callable[..., Any])

#: Dispatchers are made one at a time: making one lends numba's setting of the cache folder for a moment.
_making = threading.RLock()

#: The package whose functions run as plain Python here and now; see `sparingly`.
_plain: ContextVar[str] = ContextVar("plain")


class Compiled:
    """A function that numba compiles when it is first called, from Python or from another one.

    It has every attribute of numba's dispatcher, which is made when the first of them is asked for. There is
    one for calls from Python, and one without an entry for Python for calls from compiled functions.
    """

    dispatcher: Any
    inside: Any

    def __init__(self, function: Callable[..., Any], options: dict[str, Any]) -> None:
        update_wrapper(self, function)
        self.py_func = function
        self._options = options
        self._package = function.__module__.partition(".")[0]
        cache.register(function)

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        """Call the compiled function."""
        if _plain.get("") == self._package:
            return self.py_func(*args, **kwargs)
        if kwargs:  # numba takes a tenth of a microsecond longer where there may be some
            return self.dispatcher(*args, **kwargs)
        return self.dispatcher(*args)

    def prepared(self, *args: Any) -> Callable[..., Any]:
        """Return the code for arguments of these types, compiled.

        A call of it does not ask for types, which takes numba longer than a short function does where many
        arrays are given. It must be given the very types again.
        """
        compile_for = getattr(self.dispatcher, "compile", None)
        if compile_for is None:  # numba is switched off
            return cast(Callable[..., Any], self.dispatcher)
        return cast(Callable[..., Any], compile_for(tuple(map(self.dispatcher.typeof_pyval, args))))

    def __getattr__(self, name: str) -> Any:
        # Only names that are not set yet get here. Among them is `_numba_type_`, by which numba asks a global
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
    """Compile a function with numba, in nopython mode, at its first call, and keep the code.

    Parameters
    ----------
    function : callable
        At module level; what it calls in compiled code is decorated likewise.
    **options
        Options of ``numba.njit`` but for ``cache``, such as ``error_model="numpy"``.

    Returns
    -------
    callable
        The function as a `Compiled`; typed as the function, so that type checkers see its arguments.
    """

    def decorate(function: F) -> F:
        return cast(F, Compiled(function, options))

    return decorate if function is None else decorate(function)


def sparingly(function: F) -> F:
    """Return what calls a compiled function for a single result, which plain Python may give sooner.

    The first time that anybody calls it so with arguments of these types, in any process, the function runs
    as plain Python, and so do all functions of its package that it calls; from then on it is compiled. The
    result is the same. What is returned asks for types, which takes numba long, until they are known; it is
    for arguments of the same types.
    """
    known = cast(Compiled, function)
    is_known = False

    def call(*args: Any) -> Any:
        nonlocal is_known
        if is_known:
            return known(*args)
        typeof = getattr(known.dispatcher, "typeof_pyval", None)
        if typeof is None:  # numba is switched off
            return known(*args)
        types = tuple(map(typeof, args))
        is_known = types in known.dispatcher.overloads or cache.was_asked(known.py_func, str(types))
        if is_known:
            return known(*args)
        token = _plain.set(known._package)
        try:
            with np.errstate(all="ignore"):  # compiled code does not warn
                return known.py_func(*args)
        finally:
            _plain.reset(token)

    return cast(F, call)


def _dispatcher(function: Callable[..., Any], options: dict[str, Any]) -> Any:
    """Make numba's dispatcher for calls from Python, with a cache folder where one can be trusted."""
    from numba import njit  # noqa: PLC0415 - takes half a second, and most commands compile nothing

    _import_without_blas()
    # as above; the vectors teach numba what `fis_tools.engines.vectors` means in compiled code
    from fis_tools.engines import borrowed_code, notice  # noqa: F401, PLC0415

    place = cache.place_for(function)
    if isinstance(place, Path):
        with _numba_caching_in(place):
            dispatcher = njit(cache=True, **options)(function)
        stats = getattr(dispatcher, "stats", None)  # a plain function where numba is switched off
        if stats is not None and not Path(stats.cache_path).is_relative_to(place):
            place = cache.Refused(f"numba cannot write to {place}")
    if isinstance(place, cache.Refused):
        dispatcher = njit(**options)(function)
    notice.watch(dispatcher, place)
    return dispatcher


def _import_without_blas() -> None:
    """Import the part of numba that imports SciPy's linear algebra to know whether there is any.

    That takes a fifth of a second, and code that uses it asks again. So for this moment there is an empty
    module of its name, unless another thread might import it meanwhile.
    """
    asked = "scipy.linalg.cython_blas"
    is_known = asked in sys.modules or "numba.np.arraymath" in sys.modules
    if is_known or threading.active_count() > 1 or find_spec("scipy") is None:
        return
    sys.modules[asked] = ModuleType(asked)
    try:
        import_module("numba.np.arraymath")
    finally:
        del sys.modules[asked]


def _inside(function: Callable[..., Any], options: dict[str, Any]) -> Any:
    """Make numba's dispatcher for calls from compiled code.

    It is not cached: a caller compiled with a function from the cache may round otherwise than one compiled
    with it afresh, and results would depend on what was compiled before. A constant among its arguments
    shares the code of a variable; numba would compile one for each.
    """
    from numba import njit, types  # noqa: PLC0415 - as above

    from fis_tools.engines import callees, notice  # noqa: PLC0415 - as above

    dispatcher: Any = njit(**options, **callees.OPTIONS)(function)
    template = dispatcher.get_call_template
    unliteral: Callable[[Any], Any] = types.unliteral  # as a value: a type checker sees numba's calls untyped
    dispatcher.get_call_template = lambda args, kws: template(
        tuple(map(unliteral, args)), {name: unliteral(kind) for name, kind in kws.items()}
    )
    notice.watch(dispatcher)
    return dispatcher


@contextmanager
def _numba_caching_in(folder: Path) -> Iterator[None]:
    """Let dispatchers made inside cache in a folder; numba notes its setting once, when it makes one."""
    from numba import config  # noqa: PLC0415 - as above

    settings: Any = config  # numba makes its attributes at run time, out of a type checker's sight
    before = settings.CACHE_DIR
    settings.CACHE_DIR = os.fspath(folder)
    try:
        yield
    finally:
        settings.CACHE_DIR = before
