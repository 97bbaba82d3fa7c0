"""Arguments of compiled code as one block of numbers, and their types as a text, without numba."""

from collections.abc import Iterator, Sequence
from itertools import chain, zip_longest
from math import prod
from typing import Any

import numpy as np
from numpy.typing import NDArray

#: Attributes of arrays; those with named fields take several times as long to answer in Python.
_flags, _dtype, _shape, _strides, _interface = (
    getattr(np.ndarray, name).__get__
    for name in ("flags", "dtype", "shape", "strides", "__array_interface__")
)
#: In the place of an argument that there was none of before.
_NOTHING: Any = (object(), "", [])
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
        fields = getattr(value, "_fields", None)
        name = f"{type(value).__module__}.{type(value).__qualname__}{fields}" if fields else ""
        return f"{name}({','.join(map(_kind, value))})"
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


def _element(dtype: np.dtype[Any]) -> str:
    name = _names.get(dtype)
    if name is None:
        name = _names[dtype] = repr((dtype.descr, dtype.itemsize)) if dtype.names else dtype.str
    return name


class Block:
    """Arguments in the order in which numba's code takes them, eight bytes for each number or pointer.

    The arrays are not copied: the block holds their addresses, and the arguments as long as it lives. What is
    the same object as in an earlier block is taken from there.

    Parameters
    ----------
    arguments : sequence
        Contiguous arrays, records, named and plain tuples of these, numbers, truth values, None.
    before : Block, optional
        An earlier one.

    Attributes
    ----------
    numbers : (n,) int64
        The block; a float64 stands in it with its bits.
    address : int
        Of its first number.
    kinds : list of str
        The type of each argument, as in `signature`.

    Raises
    ------
    UnknownArgumentError
        For an argument of another kind, or an array that is not contiguous.
    """

    def __init__(self, arguments: Sequence[Any], before: "Block | None" = None) -> None:
        self.arguments = tuple(arguments)
        self.kinds: list[str] = []
        parts: list[list[int]] = []
        held = before.held() if before is not None and len(before.arguments) == len(arguments) else ()
        for value, (earlier, kind, part) in zip_longest(arguments, held, fillvalue=_NOTHING):
            is_same = value is earlier
            self.kinds.append(kind if is_same else _kind(value))
            parts.append(part if is_same else [*_leaves(value)])
        self._parts = parts
        self.numbers: NDArray[np.int64] = np.array([*chain.from_iterable(parts)], dtype=np.int64)
        self.address = int(self.numbers.ctypes.data)

    def held(self) -> Iterator[tuple[Any, str, list[int]]]:
        """Return each argument with its type and its numbers."""
        return zip(self.arguments, self.kinds, self._parts, strict=True)


def _leaves(value: Any) -> Iterator[int]:
    if value is None:
        yield 0
    elif isinstance(value, tuple):
        for part in value:
            yield from _leaves(part)
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
