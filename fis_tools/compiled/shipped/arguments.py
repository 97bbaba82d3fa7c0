"""Arguments of compiled code as one block of numbers, and their types as a text, without numba."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

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
        if not (value.flags.c_contiguous and value.flags.aligned and value.dtype.isnative):
            raise UnknownArgumentError("an array is not contiguous")
        return f"{_element(value.dtype)}[{value.ndim}]"
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

    The arrays are not copied: the block holds their addresses, and the arguments as long as it lives.
    """

    def __init__(self, arguments: Sequence[Any]) -> None:
        self.arguments = tuple(arguments)
        numbers = np.array([*_leaves(self.arguments)], dtype=np.int64)
        self.numbers: NDArray[np.int64] = numbers
        self.address = int(numbers.ctypes.data)


def _leaves(value: Any) -> Iterator[int]:
    if value is None:
        yield 0
    elif isinstance(value, tuple):
        for part in value:
            yield from _leaves(part)
    elif isinstance(value, np.ndarray):
        # its owner and parent, which this code counts no references of, then size, item size and data
        yield from (0, 0, value.size, value.itemsize, value.ctypes.data)
        yield from value.shape
        yield from value.strides
    elif isinstance(value, np.void):
        yield value.__array_interface__["data"][0]
    elif isinstance(value, float):
        yield int(np.float64(value).view(np.int64))
    else:
        yield int(value)
