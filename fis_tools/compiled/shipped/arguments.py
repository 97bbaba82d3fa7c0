"""Arguments of compiled code as one block of numbers, and their types as a text, without numba."""

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from itertools import chain
from math import prod
from operator import is_
from typing import Any, NamedTuple
from weakref import ref

import numpy as np
from numpy.typing import NDArray

#: Attributes of arrays; those with named fields take several times as long to answer in Python.
_flags, _dtype, _shape, _strides, _interface = (
    getattr(np.ndarray, name).__get__
    for name in ("flags", "dtype", "shape", "strides", "__array_interface__")
)
#: The names of types of elements that have been described: a call describes the same ones many times.
_names: dict[Any, str] = {}


class UnknownArgumentError(TypeError):
    """An argument that a block has no place for."""


def signature(arguments: Sequence[Any]) -> str:
    """Return the types of arguments as a text: of arrays the elements and axes, of tuples the classes.

    Raises
    ------
    UnknownArgumentError
        If an argument is of another kind, or an array is not contiguous.
    """
    return ",".join(map(_kind, arguments))


def _kind(value: Any) -> str:  # noqa: PLR0911 - a case each
    if value is None:
        return "none"
    if isinstance(value, tuple):
        return _of_tuple(value, ",".join(map(_kind, value)))
    if isinstance(value, np.ndarray):
        flags, dtype = _flags(value), _dtype(value)
        if not (flags.c_contiguous and flags.aligned and dtype.isnative):
            raise UnknownArgumentError("an array is not contiguous")
        return f"{_element(dtype)}[{len(_shape(value))}]"
    if isinstance(value, np.void):
        return f"record {_element(value.dtype)}"
    if isinstance(value, bool | np.bool_):
        return "bool"
    if isinstance(value, int | np.int64):
        return "int"
    if isinstance(value, float):
        return "float"
    raise UnknownArgumentError(f"{type(value).__qualname__} is none of the kinds that are passed on")


def _of_tuple(value: tuple[Any, ...], kinds: str) -> str:
    fields = getattr(value, "_fields", None)
    name = f"{type(value).__module__}.{type(value).__qualname__}{fields}" if fields else ""
    return f"{name}({kinds})"


def _element(dtype: np.dtype[Any]) -> str:
    name = _names.get(dtype)
    if name is None:
        name = _names[dtype] = repr((dtype.descr, dtype.itemsize)) if dtype.names else dtype.str
    return name


class Passed(NamedTuple):
    """An argument or part of a tuple: what gives it if it still lives, its types, its numbers, its parts."""

    value: Callable[[], Any]
    type: type
    kind: str
    numbers: list[int]
    parts: "tuple[Passed, ...]"


class Block:
    """Arguments in the order in which numba's code takes them, eight bytes for each number or pointer.

    The arrays are not copied: the block holds their addresses, and the arguments as long as it lives. What is
    the same object as in an earlier block is taken from there, within tuples, too.

    Parameters
    ----------
    arguments : sequence
        Contiguous arrays, records, named and plain tuples of these, numbers, truth values, None.
    before : tuple of Passed
        The `parts` of an earlier one.

    Attributes
    ----------
    numbers : (n,) int64
        The block; a float64 stands in it with its bits.
    address : int
        Of its first number.
    kinds : str
        The types of the arguments, as `signature` tells them.
    parts : tuple of Passed
        The arguments, which this does not keep alive.

    Raises
    ------
    UnknownArgumentError
        For an argument of another kind, or an array that is not contiguous.
    """

    def __init__(self, arguments: Sequence[Any], before: tuple[Passed, ...] = ()) -> None:
        self.arguments = tuple(arguments)
        self.parts = _passed_all(self.arguments, before)
        self.kinds = ",".join(part.kind for part in self.parts)
        numbers = [*chain.from_iterable(part.numbers for part in self.parts)]
        self.numbers: NDArray[np.int64] = np.array(numbers, dtype=np.int64)
        self.address = int(self.numbers.ctypes.data)


def _passed_all(values: tuple[Any, ...], before: tuple[Passed, ...]) -> tuple[Passed, ...]:
    if len(before) != len(values):
        return tuple(_passed(value, _NOTHING) for value in values)
    return tuple(
        held if held.type is type(value) and held.value() is value else _passed(value, held)
        for value, held in zip(values, before, strict=True)
    )


def _passed(value: Any, before: Passed) -> Passed:
    if isinstance(value, tuple):  # its parts alone are told again: no reference to it would let it go
        parts = _passed_all(value, before.parts)
        is_same = type(value) is before.type and len(parts) == len(before.parts)
        if is_same and all(map(is_, parts, before.parts)):
            return before
        kind = _of_tuple(value, ",".join(part.kind for part in parts))
        return Passed(
            _no_value, type(value), kind, [*chain.from_iterable(part.numbers for part in parts)], parts
        )
    reference: Callable[[], Any] = _no_value  # a record would keep its memory alive
    if isinstance(value, np.ndarray):
        reference = ref(value)
    elif not isinstance(value, np.void):
        reference = partial(_itself, value)
    return Passed(reference, type(value), _kind(value), [*_leaves(value)], ())


def _itself(value: Any) -> Any:
    return value


def _no_value() -> Any:
    """Return what no argument is."""
    return _NOTHING


_NOTHING = Passed(_no_value, Passed, "", [], ())


def _leaves(value: Any) -> Iterator[int]:
    if value is None:
        yield 0
    elif isinstance(value, np.ndarray):
        # its owner and parent, which this code counts no references of, then size, item size and data
        shape = _shape(value)
        yield from (0, 0, prod(shape), _dtype(value).itemsize, _interface(value)["data"][0])
        yield from shape
        yield from _strides(value)
    elif isinstance(value, np.void):
        yield value.__array_interface__["data"][0]
    elif isinstance(value, float):
        yield int(np.float64(value).view(np.int64))
    else:
        yield int(value)
