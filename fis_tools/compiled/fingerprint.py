"""Fingerprints of compiled functions: a hash over everything that their machine code is made from.

They are taken from the loaded program, not from its files: the bytecode of a function and of all compiled
functions that it calls, and the values of the globals that these name. So it does not matter how a value was
imported, nor what became of a file since. What cannot be described so is refused.
"""

import hashlib
import inspect
import platform
import sys
from collections.abc import Callable
from contextlib import suppress
from enum import Enum
from functools import cache
from operator import attrgetter
from types import CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np

#: Packages whose functions are known by their names: the versions of Python, numba and NumPy are hashed.
KNOWN_BY_NAME = frozenset(
    ["builtins", "cmath", "functools", "math", "_operator", "operator", "random", "typing", "numba", "numpy"]
)
#: Functions that numba compiles as the modules say that call `covers_this_module`.
VECTORS = "fis_tools.compiled.vectors"

#: Texts, numbers and tuples of them, whose `repr` is the same in every process.
Description = Any

_extensions: list[CodeType] = []
#: How compiled functions were when they were first described.
_first: dict[Any, Description] = {}


class UnknownPartError(Exception):
    """A part of a program that cannot be described; the message says which, and what to do."""


def covers_this_module() -> None:
    """Let all fingerprints depend on the calling module, which tells numba how something is compiled."""
    frame = inspect.currentframe()
    caller = frame.f_back if frame else None
    if caller is None:
        raise RuntimeError("this Python does not know its frames; use CPython")
    _extensions.append(caller.f_code)


def fingerprint(compiled: Any, kinds: tuple[Any, ...]) -> str:
    """Return 32 hexadecimal digits for the code of a compiled function with arguments of these numba types.

    Raises
    ------
    UnknownPartError
        If the code may depend on something that cannot be described, or if a function is no longer as it was
        when it was first described: code that calls it may hold what it was then.
    """
    from fis_tools.compiled.numba_parts import surroundings  # noqa: PLC0415 - numba takes long to import

    extensions = tuple(map(_described_code, _extensions))
    versions = platform.python_version(), np.__version__, surroundings()
    digest = hashlib.sha256(repr((versions, extensions, *map(_described_type, kinds))).encode())
    functions = described_functions(compiled)
    numbers = {function: number for number, function in enumerate(functions)}
    for function, (description, callees) in functions.items():
        if _first.setdefault(function, (description, callees)) != (description, callees):
            name = f"{function.py_func.__module__}.{function.py_func.__qualname__}"
            raise UnknownPartError(f"{name}, or a value that it uses, has changed; start Python anew")
        digest.update(repr((description, [numbers[callee] for callee in callees])).encode())
    return digest.hexdigest()[:32]


def described_functions(compiled: Any) -> dict[Any, tuple[Description, list[Any]]]:
    """Describe a compiled function and all that it calls at any remove; return with each what it calls."""
    described: dict[Any, tuple[Description, list[Any]]] = {}
    waiting = [compiled]
    while waiting:
        function = waiting.pop()
        if function not in described:
            callees: list[Any] = []
            described[function] = _described_function(function, callees), callees
            waiting += callees
    return described


def reached(compiled: Any) -> dict[Any, list[Any]]:
    """Return a compiled function and all that it calls at any remove, each with what it calls itself."""
    return {function: callees for function, (_, callees) in described_functions(compiled).items()}


def described_values(compiled: Any) -> list[tuple[str, Description]]:
    """Describe the values that a function names, sorted by their names, for no version of Python alone."""
    function: FunctionType = compiled.py_func
    names = tuple(sorted(_names(function.__code__)))
    values = {name: function.__globals__[name] for name in names if name in function.__globals__}
    cells = function.__closure__ or ()
    values |= {
        name: cell.cell_contents for name, cell in zip(function.__code__.co_freevars, cells, strict=True)
    }
    values["defaults"] = (*(function.__defaults__ or ()), *(function.__kwdefaults__ or {}).values())
    return [(name, _described(value, names, [])) for name, value in sorted(values.items())]


def _described_function(compiled: Any, callees: list[Any]) -> Description:
    """Describe a compiled function without those that it calls, which are added to the callees."""
    function: FunctionType = compiled.py_func
    names = _names(function.__code__)
    values = [cell.cell_contents for cell in function.__closure__ or ()]
    values += [function.__defaults__, *(function.__kwdefaults__ or {}).values()]
    values += [function.__globals__[name] for name in names if name in function.__globals__]
    return (
        function.__module__,
        function.__qualname__,
        sorted(compiled.targetoptions.items()),
        _described_code(function.__code__),
        [_described(value, names, callees) for value in values],
    )


@cache
def _described_code(code: CodeType) -> Description:
    """Describe bytecode, without files and lines."""
    counts = code.co_argcount, code.co_posonlyargcount, code.co_kwonlyargcount, code.co_flags
    names = code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars
    consts = tuple(map(_described_constant, code.co_consts))
    return code.co_name, code.co_code, code.co_exceptiontable, counts, names, consts


def _described_constant(constant: Any) -> Description:
    """Describe a constant of bytecode."""
    if isinstance(constant, CodeType):
        return _described_code(constant)
    if isinstance(constant, frozenset):
        return "frozenset", sorted(map(repr, constant))
    return type(constant).__name__, repr(constant)


@cache
def _names(code: CodeType) -> tuple[str, ...]:
    """Return the names of all globals and attributes in bytecode."""
    inner = (name for part in code.co_consts if isinstance(part, CodeType) for name in _names(part))
    return tuple(dict.fromkeys((*code.co_names, *inner)))


def _described(  # noqa: PLR0911 - a case each
    value: Any, names: tuple[str, ...], callees: list[Any]
) -> Description:
    """Describe a value that code with these names uses; compiled functions are added to the callees."""
    if isinstance(value, Enum):
        return _described_class(type(value)), value.name
    if value is None or isinstance(value, (bool, int, float, complex, str, bytes)):
        return type(value).__name__, repr(value)
    if isinstance(value, tuple):
        return _described_class(type(value)), [_described(member, names, callees) for member in value]
    if isinstance(value, (np.ndarray, np.generic)) and not value.dtype.hasobject:
        return str(value.dtype), value.shape, value.strides, hashlib.sha256(value.tobytes()).hexdigest()
    if isinstance(value, ModuleType):
        attributes = {} if _is_known(value.__name__) else vars(value)
        used = [(name, attributes[name]) for name in names if name in attributes]
        return value.__name__, [(name, _described(part, names, callees)) for name, part in used]
    if isinstance(value, type):
        return _described_class(value)
    if isinstance(getattr(value, "py_func", None), FunctionType):
        callees.append(value)
        return "compiled"
    module = getattr(value, "__module__", None) or type(value).__module__
    name = str(getattr(value, "__qualname__", None) or getattr(value, "__name__", ""))
    if module == VECTORS or _is_known(module):
        with suppress(AttributeError, KeyError):
            if attrgetter(name)(sys.modules[module]) is value:
                return module, name
    raise UnknownPartError(f"it uses {module}.{name or type(value).__qualname__}, which is not compiled")


def _described_class(kind: type) -> Description:
    """Describe a class: a named tuple by its fields, an enumeration by its members, others by name."""
    name = f"{kind.__module__}.{kind.__qualname__}"
    if issubclass(kind, Enum):
        return name, [(member.name, repr(member.value)) for member in kind]
    if issubclass(kind, tuple) and hasattr(kind, "_fields"):
        return name, kind._fields
    if _is_known(kind.__module__) or issubclass(kind, BaseException):
        return name
    raise UnknownPartError(f"it uses the class {name}, which is no named tuple")


def _is_known(module: str) -> bool:
    return module.partition(".")[0] in KNOWN_BY_NAME


def _described_type(kind: Any) -> Description:
    """Describe a numba type: by its name, and named tuples in it by their fields, which the name lacks."""
    from numba import types  # noqa: PLC0415 - as above

    if isinstance(kind, types.Callable):
        raise UnknownPartError(f"it is called with a function, {kind}")
    is_named = isinstance(kind, types.BaseNamedTuple)
    fields = _described_class(getattr(kind, "instance_class")) if is_named else ()  # noqa: B009 - untyped
    inner: list[Any] = []
    for part in vars(kind).values():
        inner += part if isinstance(part, tuple) else [part]
    return str(kind), fields, [_described_type(part) for part in inner if isinstance(part, types.Type)]


def functions_of(compiled: Any) -> list[Callable[..., Any]]:
    """Return the plain functions of a compiled one and of all that it calls at any remove, if known."""
    functions: list[Callable[..., Any]] = []
    waiting = [compiled]
    while waiting:
        function = waiting.pop()
        if function.py_func not in functions:
            functions.append(function.py_func)
            with suppress(UnknownPartError):
                _described_function(function, waiting)
    return functions
