"""The decorator of every compiled function: numba at the first call, with our own cache and notices.

Without numba, or with NUMBA_DISABLE_JIT=1, every function runs as plain Python, to the same bits.

Importing a module with compiled functions does not import numba. The first call creates numba's dispatchers
(`fis_tools.compiled.dispatchers`). numba's settings for the process, and the compiled functions of other
packages, are unaffected.
"""

import os
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cache as cached
from functools import partial, update_wrapper
from importlib.util import find_spec
from pathlib import Path
from typing import Any, TypeVar, cast, overload

import numpy as np

from fis_tools.compiled.shipped import load

F = TypeVar("F", bound=Callable[..., Any])

#: Each function has one dispatcher, whichever thread is the first to call it.
_creating = threading.RLock()

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
        self.targetoptions = options
        self._package = function.__module__.partition(".")[0]
        self._is_shipped = f"{function.__module__}.{function.__qualname__}" in load.names()
        self._shipped: load.Shipped | None = None

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        """Call the compiled function."""
        plain, instead = _plain.get()
        # what takes vectors is called in compiled code, or in plain Python with those of NumPy
        if plain and (plain == self._package or {"forceinline", "inline"} & self.targetoptions.keys()):
            return instead.get(self, self.py_func)(*args, **kwargs)
        if self._is_shipped and not kwargs and (code := self.shipped_for(args)) is not None:
            return code(*args)
        if kwargs:  # numba takes a tenth of a microsecond longer if there may be some
            return self.dispatcher(*args, **kwargs)
        return self.dispatcher(*args)

    def shipped_for(self, args: Sequence[Any]) -> Callable[..., Any] | None:
        """Return the code that comes with the product for arguments of these types; None if there is none."""
        if not self._is_shipped or os.environ.get("NUMBA_DISABLE_JIT", "0") != "0":
            return None
        if self._shipped is None:
            self._shipped = load.of(self)
        return None if self._shipped is None else self._shipped.find(args)

    def prepared(self, *args: Any) -> Callable[..., Any]:
        """Return the compiled code for arguments of these types.

        Calling it skips type resolution, which takes numba longer than a short function does when many
        arrays are passed. It must be called with exactly these types.
        """
        if (code := self.shipped_for(args)) is not None:
            return code
        if not is_compiling():
            return self.py_func
        from numba import typeof  # noqa: PLC0415 - takes a while, and most commands compile nothing

        return cast(Callable[..., Any], self.dispatcher.compile(tuple(map(typeof, args))))

    def bound(self, *args: Any) -> Callable[[], Any]:
        """Return what calls the compiled code with these arguments, whose arrays may get other contents."""
        code = self.prepared(*args)
        return code.again if isinstance(code, load.Call) else partial(code, *args)

    def __getattr__(self, name: str) -> Any:
        # Only names that are not yet set get here. One is `_numba_type_`, by which numba asks a global
        # of a function that it compiles for its type: the type is that of the dispatcher.
        if name.startswith("__") or name in {
            *("py_func", "targetoptions", "_package", "_is_shipped", "_shipped")
        }:
            raise AttributeError(name)
        if name not in {"dispatcher", "inside"}:
            return getattr(self.inside if name == "_numba_type_" else self.dispatcher, name)
        with _creating:
            if name not in self.__dict__:
                self.__dict__[name] = self._create(is_inside=name == "inside")
        return self.__dict__[name]

    def _create(self, *, is_inside: bool) -> Any:
        """Create a dispatcher."""
        if not is_compiling():
            return self.py_func
        from fis_tools.compiled import dispatchers  # noqa: PLC0415 - as above

        create = dispatchers.for_compiled_code if is_inside else dispatchers.for_python
        return create(self.py_func, self.targetoptions)


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


def plain(function: F) -> F:
    """Return a compiled function as plain Python, for calls that are not worth compiling."""
    return cast(F, cast(Compiled, function).py_func)


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


def is_compiling() -> bool:
    """Return whether numba is installed, and not switched off by NUMBA_DISABLE_JIT=1."""
    if "numba" not in sys.modules and not Path(".numba_config.yaml").exists():  # importing it takes long
        return find_spec("numba") is not None and os.environ.get("NUMBA_DISABLE_JIT", "0") == "0"
    try:
        from numba import config  # noqa: PLC0415 - as above
    except ModuleNotFoundError:
        return False
    settings: Any = config  # numba sets its attributes at run time, unseen by type checkers
    return not settings.DISABLE_JIT


@cached
def advise_numba() -> None:
    """Print once, if numba is not installed, how much faster it makes this."""
    if find_spec("numba") is None and sys.stderr is not None:
        sys.stderr.write(
            "  plain Python computes this; compiled it takes a thousandth of the time, and has the same "
            "bits: python -m pip install numba\n"
        )
