"""Vectors of floats: one formula for many samples, as instructions of the processor where it is compiled.

A vector holds a float in each of its lanes; comparing vectors gives a mask, which holds a truth in each lane.
``+ - * /``, comparisons, ``& | ^ ~``, `abs` and NumPy's ``sqrt``, ``floor`` and ``rint`` work lane by lane,
between vectors and floats as well. A function that is written for floats therefore works on vectors, unless
it branches on a comparison: it calls `select`, `least` or `most` instead, which take floats, too.

Here stands what the operations mean, in NumPy: a vector is an array of shape (width,), a mask one of bools.
Kernels run on that where numba is switched off. `fis_tools.engines.vector_code` gives the same operations to
numba, where a vector is a value like a float. Its width is part of its type: where an operation takes a
`width`, it is a constant, a power of two up to 64. See docs/explanation/vectors.md.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
#: A vector, or a float in its place; a mask, or a bool in its place.
Vector = Any
Mask = Any
#: The fields of a record that are rows of vectors: how many of each, along any number of axes.
Rows = dict[str, tuple[int, ...]]
#: Where in an array a vector begins.
Place = int | tuple[int, ...]

#: elements that `gather_rows` reads from each offset on
ROW = 8

#: bytes that processors fetch at once, most of them
CACHE_LINE = 64


class Lanes(np.ndarray[Any, Any]):
    """An array of shape (width,) that is a value: `a += b` makes another `a`, as for numbers."""


for _name in ("add", "sub", "mul", "truediv", "and", "or", "xor"):
    setattr(Lanes, f"__i{_name}__", getattr(np.ndarray, f"__{_name}__"))


def rows_of(fields: Rows, width: int) -> np.dtype[Any]:
    """Return the type of records with such fields, for vectors of a width."""
    return np.dtype([(name, np.float64, (*count, width)) for name, count in fields.items()], align=True)


def make_rows(fields: Rows, width: int, count: int = 1) -> Any:
    """Allocate such records, zeros, shape (count,), so that no vector lies across two lines of the cache."""
    return aligned(count, rows_of(fields, width)).view(np.recarray)


def width_of(rows: Any) -> int:
    """Return how many lanes the rows of a record have, or those of one of its fields.

    In compiled code this is a constant: the type of a record tells the shapes of its fields.
    """
    fields = rows.dtype.names
    return int((rows[fields[0]] if fields else rows).shape[-1])


def splat(value: float, width: int) -> Vector:
    """Return a vector with the same value in each of its lanes."""
    return np.full(width, value, dtype=np.float64).view(Lanes)


def load(array: Floats, at: Place, width: int) -> Vector:
    """Return consecutive elements of an array, from an index on.

    The index has as many numbers as the array has dimensions; of an array of shape (n, m) the number of a row
    will do. Compiled code does not check that the elements lie inside the row, and counts no index from the
    end.
    """
    return np.array(_row_from(array, at)[:width]).view(Lanes)


def spread(array: Floats, at: int, width: int) -> Vector:
    """Return a vector with one element of an array of shape (n,) in each of its lanes.

    Compiled code does not check that it lies inside the array, and counts no index from the end.
    """
    return splat(array[at], width)


def store(array: Floats, at: Place, vector: Vector) -> None:
    """Write a vector to where `load` reads it."""
    _row_from(array, at)[: len(vector)] = vector


def _row_from(array: Floats, at: Place) -> Floats:
    *rows, first = at if isinstance(at, tuple) else (at, 0)[: array.ndim]
    row: Floats = array[tuple(rows)]
    return row[first:]


def gather(array: Floats, at: int, offsets: Vector) -> Vector:
    """Return the elements of an array of shape (n,) at offsets from an index; their fractions are cut off.

    Compiled code does not check that they lie inside the array.
    """
    whole: NDArray[np.int64] = np.trunc(offsets).astype(np.int64)
    return array[at + whole].view(Lanes)


def gather_rows(array: Floats, at: int, offsets: Vector, count: int, out: Floats) -> None:
    """Write up to `ROW` consecutive elements from each offset on: the k-th of each lane to ``out[k]``.

    It equals `gather` from `at`, from ``at + 1`` and so on, and takes about as long as two of them. `out` has
    the shape (n, width), n not less than `count`. Compiled code reads `ROW` elements from each offset on,
    whatever the count, and does not check that they lie inside the array.
    """
    for row in range(count):
        out[row] = gather(array, at + row, offsets)


def select(mask: Mask, one: Vector, other: Vector) -> Vector:
    """Return `one` where the mask holds, elsewhere `other`."""
    chosen: Any = np.where(mask, one, other)
    return chosen.view(Lanes) if chosen.ndim else chosen[()]


def least(one: Vector, other: Vector) -> Vector:
    """Return the lesser; `other` where they are equal or one of them is NaN."""
    return select(one < other, one, other)


def most(one: Vector, other: Vector) -> Vector:
    """Return the greater; `other` where they are equal or one of them is NaN."""
    return select(one > other, one, other)


def higher(one: Vector, other: Vector) -> Vector:
    """Return the greater of two degrees: numbers not below zero, none of them NaN.

    It is `most` for those, whose bits are in order as whole numbers are: processors compare whole numbers
    while they compare floats for `least`.
    """
    return most(one, other)


def total(vector: Vector) -> float:
    """Return the sum over the lanes: the upper half is added to the lower one until one lane is left."""
    while len(vector) > 1:
        vector = vector[: len(vector) // 2] + vector[len(vector) // 2 :]
    return float(vector[0])


def highest(vector: Vector) -> float:
    """Return the greatest of the lanes, found by halves as by `total`; no lane is NaN."""
    while len(vector) > 1:
        vector = most(vector[: len(vector) // 2], vector[len(vector) // 2 :])
    return float(vector[0])


def some(mask: Mask) -> bool:
    """Tell whether a mask holds in any lane."""
    return bool(np.any(mask))


def count(mask: Mask) -> int:
    """Return in how many lanes a mask holds."""
    return int(np.count_nonzero(mask))


def bits(mask: Mask) -> int:
    """Return a mask as the bits of an integer, the first lane lowest; of at most 64 lanes."""
    return int(sum(1 << lane for lane in np.flatnonzero(mask).tolist()))


def power_of_two(exponent: Vector) -> Vector:
    """Return two to the power of whole numbers from -1022 to 1023."""
    return np.ldexp(1.0, np.asarray(exponent).astype(np.int64))[()]


def borrowed(value: Any) -> Any:
    """Return an array, or a tuple with arrays in it, whose references compiled code does not count.

    numba counts references by atomic operations, also where a function merely reads an element of an array in
    a tuple. And it hands a tuple down number by number, which is most of what there is to compile where there
    are hundreds; a named tuple that is borrowed is handed down as one pointer. Whoever calls has to hold what
    is borrowed for as long as the call takes.
    """
    return value


def padded(count: int, width: int) -> int:
    """Return the least number of lanes of whole vectors that hold so many values."""
    return -(-count // width) * width


def aligned(count: int, dtype: Any = np.float64) -> Any:
    """Allocate zeros, shape (count,), so that no vector in whole rows lies across two lines of the cache."""
    kind = np.dtype(dtype)
    room = np.zeros(count * kind.itemsize + CACHE_LINE, dtype=np.uint8)
    skipped = -room.ctypes.data % CACHE_LINE
    return room[skipped : skipped + count * kind.itemsize].view(kind)
