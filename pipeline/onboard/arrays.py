"""Arrays and records of the state that a function works on while it is translated."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pipeline.onboard.allowed import Kind, TranslationError
from pipeline.onboard.values import Expression, bare, range_of


@dataclass(frozen=True, eq=False)
class Accumulator:
    """A C array with a number for each lane of a vector of points, in which they add up in vectors."""

    name: str


@dataclass(frozen=True, eq=False)
class Array:
    """An array of C, or the part of it that the indices so far lead to.

    Axes of length 1 are left out in C. Of a table `data` holds what stands in it.
    """

    name: str
    shape_whole: tuple[int, ...]
    kind: Kind = "double"
    data: Any = None
    indices: tuple[Any, ...] = ()
    first: Any = 0  # of the next axis, where the array is a slice

    @property
    def shape(self) -> tuple[int, ...]:
        """The lengths of the axes that are left."""
        length, *others = self.shape_whole[len(self.indices) :]
        return (length - (self.first if isinstance(self.first, int) else 0), *others)

    @property
    def ndim(self) -> int:
        """The number of axes that are left."""
        return len(self.shape_whole) - len(self.indices)

    def at(self, key: Any) -> "Array":
        """Return what an index leads to, or several."""
        keys = key if isinstance(key, tuple) else (key,)
        if any(isinstance(each, slice) for each in keys):
            (part,) = keys
            if part.stop is not None or part.step is not None:
                raise TranslationError("a slice with an end")
            start = 0 if part.start is None else part.start
            span = range_of(start)
            if span is not None and span[0] < 0:
                raise TranslationError(f"a slice from {span[0]} on; count from the start of {self.name}")
            return replace(self, first=start + self.first)
        head, *others = keys
        left = self.shape_whole[len(self.indices) :]
        if isinstance(self.first, Expression) or self.first != 0:
            span = range_of(head)
            if span is None or span[0] < 0:
                raise TranslationError(
                    f"an index of a part of {self.name} might be negative; count from its start"
                )
            head = head + self.first
        if len((head, *others)) > len(left):
            raise TranslationError(
                f"{len((head, *others))} indices of {self.name}, which has {len(left)} axes"
            )
        for number, (index, length) in enumerate(zip((head, *others), left, strict=False)):
            span = range_of(index)
            if span is not None and not (span[0] >= 0 and span[1] < length) and span[0] == span[1]:
                raise TranslationError(f"index {span[0]} of axis {number} of {self.name}, which has {length}")
        return replace(self, indices=(*self.indices, head, *others), first=0)

    @property
    def is_element(self) -> bool:
        """Whether the indices lead to a number."""
        return len(self.indices) == len(self.shape_whole)

    @property
    def known(self) -> Any:
        """What stands there, where it is known; else None."""
        if self.data is None or any(isinstance(index, Expression) for index in self.indices):
            return None
        value = self.data[self.indices]
        return value.item() if np.ndim(value) == 0 else None


def within(index: Any, last: int) -> Any:
    """Return an index that is not beyond the last one, for analysers too: they do not relate two numbers."""
    span = range_of(index)
    if not isinstance(index, Expression) or (span is not None and span[1] <= last):
        return index
    limited = None if span is None or span[0] < 0 else (min(span[0], last), last)
    return Expression(f"at_most({bare(index.text)}, {last})", "int", range=limited)


@dataclass(frozen=True, eq=False)
class Begun(Array):
    """An array of which some rows are in use: as many as are counted on board, from one of the state's on."""

    count: Any = 0
    begins: Any = 0

    def at(self, key: Any) -> Array:
        """Return what an index leads to, or several."""
        part = super().at(key)
        if self.indices or not part.indices:
            return part
        row, *others = part.indices
        return replace(part, indices=(within(row + self.begins, self.shape_whole[0] - 1), *others))


@dataclass(frozen=True, eq=False)
class Strided(Begun):
    """An array of which every so many rows are in use."""

    stride: int = 1

    def at(self, key: Any) -> Array:
        """Return what an index leads to, or several."""
        head, *others = key if isinstance(key, tuple) else (key,)
        return super().at((head * self.stride, *others))


@dataclass(frozen=True)
class Transpose:
    """The transpose of an array: `at` returns a column of it, or a number."""

    array: Array
    ndim: int = 2
    used: Sequence[str] = ()

    def at(self, writer: Any, index: Any) -> list[Any]:
        """Return the numbers of a column, or of two indices the number there."""
        if isinstance(index, tuple):
            row, column = index
            return writer.element(self.array, (column, row))
        return [writer.element(self.array, (row, index)) for row in range(self.array.shape[0])]


@dataclass(frozen=True)
class Record:
    """A record of the state: `member` finds its fields."""

    member: Callable[[str, tuple[Any, ...]], Any]
    fields: Sequence[str]
    indices: tuple[Any, ...] = ()

    def __getattr__(self, name: str) -> Any:
        """Return a field."""
        if name.startswith("__") or name not in self.fields:
            raise AttributeError(name)
        return self.member(name, self.indices)

    def at(self, key: Any) -> "Record":
        """Return one record of an array of them."""
        return replace(self, indices=(*self.indices, key))


def leaves(value: Any) -> list[Any]:
    """Return the numbers, arrays and others in a value of nested tuples."""
    if isinstance(value, tuple):
        return [leaf for item in value for leaf in leaves(item)]
    return [value]


def map_leaves(value: Any, change: Callable[[Any, str], Any], name: str = "") -> Any:
    """Return nested tuples of the same types, with each leaf changed; it is given a name, too."""
    if not isinstance(value, tuple):
        return change(value, name)
    names = getattr(value, "_fields", [str(index) for index in range(len(value))])
    items = [
        map_leaves(item, change, f"{name}_{part}" if name else part)
        for item, part in zip(value, names, strict=True)
    ]
    return type(value)(*items) if hasattr(value, "_fields") else tuple(items)


def is_known(value: Any) -> bool:
    """Return whether nothing in a value depends on what is known on board alone."""
    return not any(
        isinstance(leaf, Expression | Accumulator | Record)
        or (isinstance(leaf, Array) and leaf.known is None)
        or (isinstance(leaf, np.ndarray) and leaf.dtype == object)
        for leaf in leaves(value)
    )
