"""Vectors of floats: one formula for many samples, as the processor's vector instructions when compiled.

A vector holds a float in each of its lanes; comparing vectors gives a mask, with a truth value in each lane.
``+ - * /``, comparisons, ``& | ^ ~``, `abs` and NumPy's ``sqrt``, ``floor`` and ``rint`` work lane by lane,
between vectors and floats as well. A function written for floats therefore works on vectors, unless
it branches on a comparison: it must call `select`, `least` or `most` instead, which also take floats.

This module defines the operations in NumPy: a vector is an array of shape (width,), a mask one of bools.
`fis_tools.compiled.borrowed_code` gives the same operations to numba. Where an operation takes a `width`, it
is a constant, a power of two up to 64. See docs/explanation/compiled-code.md.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fis_tools.compiled.fingerprint import covers_this_module

covers_this_module()

Floats = NDArray[np.float64]
#: A vector, or a float instead; a mask, or a bool instead.
Vector = Any
Mask = Any
#: The fields of a record that are rows of vectors: their number, along any number of axes.
Rows = dict[str, tuple[int, ...]]
#: Where a vector begins in an array.
Index = int | tuple[int, ...]

#: elements that `gather_rows` reads from each offset on
ROW = 8

#: what vectors can, as NumPy names it, and what masks can; compiled vectors have the same
OF_VECTORS = (
    *(np.add, np.subtract, np.multiply, np.divide, np.negative, np.absolute, np.sqrt, np.floor, np.rint),
    *(np.less, np.less_equal, np.greater, np.greater_equal, np.equal, np.not_equal),
)
OF_MASKS = (np.bitwise_and, np.bitwise_or, np.bitwise_xor, np.invert)

#: size of a cache line on most processors, bytes
CACHE_LINE = 64


class Lanes(np.ndarray[Any, Any]):
    """An array of shape (width,) with value semantics: `a += b` makes another `a`, as for numbers.

    Division by zero is silent, as in compiled code: lanes that divide by zero are not the ones selected.
    """

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **kwargs: Any) -> Any:
        """Compute what compiled vectors can; refuse the rest, which would only work until it is compiled."""
        is_mask = any(isinstance(value, Lanes) and value.dtype == np.bool_ for value in inputs)
        known = OF_MASKS if is_mask else OF_VECTORS
        if ufunc not in known or method != "__call__" or kwargs:
            names = ", ".join(each.__name__ for each in known)
            kind, what = "masks" if is_mask else "vectors", ufunc.__name__
            raise TypeError(
                f"compiled {kind} have no {what if method == '__call__' else f'{what}.{method}'}; they have "
                f"{names}, and the functions of fis_tools.compiled.vectors"
            )
        plain = [np.asarray(value) if isinstance(value, Lanes) else value for value in inputs]
        return np.asarray(ufunc(*plain)).view(Lanes)

    def __truediv__(self, other: Any) -> Any:
        with np.errstate(divide="ignore", invalid="ignore"):
            return super().__truediv__(other)

    def __rtruediv__(self, other: Any) -> Any:
        with np.errstate(divide="ignore", invalid="ignore"):
            return super().__rtruediv__(other)


for _name in ("add", "sub", "mul", "truediv", "and", "or", "xor"):
    setattr(Lanes, f"__i{_name}__", getattr(Lanes, f"__{_name}__"))


class Three(NamedTuple):
    """A vector along three axes, which its user names: formulas of mechanics without x, y and z.

    A component is a float, or in its place a vector with a lane for each sample; all are of the same kind.
    Three-vectors are added and subtracted, and multiplied and divided by a number.
    """

    x: float
    y: float
    z: float

    def __add__(self, other: "Three") -> "Three":  # type: ignore[override]
        return Three(self.x + other.x, self.y + other.y, self.z + other.z)

    def __sub__(self, other: "Three") -> "Three":
        return Three(self.x - other.x, self.y - other.y, self.z - other.z)

    def __mul__(self, factor: float) -> "Three":  # type: ignore[override]
        return Three(self.x * factor, self.y * factor, self.z * factor)

    def __rmul__(self, factor: float) -> "Three":  # type: ignore[override]
        return self * factor

    def __truediv__(self, divisor: float) -> "Three":
        return Three(self.x / divisor, self.y / divisor, self.z / divisor)


# so that NumPy's numbers and vectors leave products to it
Three.__array_ufunc__ = None  # type: ignore[attr-defined]


def rows_of(fields: Rows, width: int) -> np.dtype[Any]:
    """Return the type of records with such fields, for vectors of a width."""
    return np.dtype([(name, np.float64, (*count, width)) for name, count in fields.items()], align=True)


def make_rows(fields: Rows, width: int, shape: int | tuple[int, ...] = 1) -> Any:
    """Return such records, zeros, aligned so that no vector crosses a cache line."""
    return aligned(shape, rows_of(fields, width)).view(np.recarray)


def width_of(rows: Any) -> int:
    """Return the number of lanes in the rows of a record, or in those of one of its fields.

    In compiled code this is a constant: a record's type includes the shapes of its fields.
    """
    fields = rows.dtype.names
    return int((rows[fields[0]] if fields else rows).shape[-1])


def splat(value: float, width: int) -> Vector:
    """Return a vector with the same value in each of its lanes."""
    return np.full(width, value, dtype=np.float64).view(Lanes)


def load(array: Floats, at: Index, width: int) -> Vector:
    """Return consecutive elements of an array from an index on, or from the start of a row.

    Compiled code does not check that they lie inside the row, and does not support negative indices.
    """
    return np.array(_row_from(array, at)[:width]).view(Lanes)


def spread(array: Floats, at: int, width: int) -> Vector:
    """Return a vector with one element of an array of shape (n,) in each of its lanes; see `load`."""
    return splat(array[at], width)


def store(array: Floats, at: Index, vector: Vector) -> None:
    """Write a vector where `load` reads it from an index on."""
    _row_from(array, at)[: len(vector)] = vector


def _row_from(array: Floats, at: Index) -> Floats:
    """Return the rest of an array's row from an index on, as a view."""
    *rows, first = at if isinstance(at, tuple) else (at, 0)[: array.ndim]
    row: Floats = array[tuple(rows)]
    return row[first:]


def gather(array: Floats, at: int, offsets: Vector) -> Vector:
    """Return elements of an array, shape (n,), at offsets from an index, cut to whole ones; see `load`."""
    whole: NDArray[np.int64] = np.trunc(np.asarray(offsets)).astype(np.int64)
    return array[at + whole].view(Lanes)


def gather_rows(array: Floats, at: int, offsets: Vector, count: int, out: Floats) -> None:
    """Write up to `ROW` consecutive elements from each offset on: the k-th of each lane to ``out[k]``.

    It equals `gather` from `at`, from ``at + 1`` and so on, and takes about as long as two of them. `out` has
    the shape (n, width), n at least `count`. Compiled code reads `ROW` elements from each offset on,
    for any count, and does not check that they lie inside the array.
    """
    for row in range(count):
        out[row] = gather(array, at + row, offsets)


def select(mask: Mask, x: Vector, y: Vector) -> Vector:
    """Return `x` where the mask holds, elsewhere `y`."""
    values: Any = np.where(mask, x, y)
    return values.view(Lanes) if values.ndim else values[()]


def least(x: Vector, y: Vector) -> Vector:
    """Return the smaller value; `y` where they are equal or one of them is NaN."""
    return select(x < y, x, y)


def most(x: Vector, y: Vector) -> Vector:
    """Return the larger value; `y` where they are equal or one of them is NaN."""
    return select(x > y, x, y)


def higher(x: Vector, y: Vector) -> Vector:
    """Return the larger of two degrees of truth: nonnegative numbers, neither NaN.

    It equals `most` for those, since their bits are in the same order as integers, which a processor compares
    while it compares floats for `least`.
    """
    return most(x, y)


def total(vector: Vector) -> float:
    """Return the sum over the lanes: the upper half is added to the lower one until one lane is left."""
    while len(vector) > 1:
        vector = vector[: len(vector) // 2] + vector[len(vector) // 2 :]
    return float(vector[0])


def some(mask: Mask) -> bool:
    """Return whether a mask holds in any lane."""
    return bool(np.any(np.asarray(mask)))


def count(mask: Mask) -> int:
    """Return the number of lanes in which a mask holds."""
    return int(np.count_nonzero(np.asarray(mask)))


def power_of_two(exponent: Vector) -> Vector:
    """Return two to the power of whole numbers from -1022 to 1023."""
    return np.ldexp(1.0, np.asarray(exponent).astype(np.int64))[()]


def borrowed(value: Any) -> Any:
    """Return an array, or a tuple with arrays in it, whose references compiled code does not count.

    numba counts references by atomic operations, even where a function merely reads an element of an array in
    a tuple. It also passes a tuple number by number, which dominates compilation where there
    are hundreds; a borrowed named tuple is passed as one pointer. The caller must hold what
    is borrowed for the duration of the call: only parameters may be borrowed, since numba frees what a
    function allocates after its last use by name.
    """
    return value


def padded(count: int, width: int) -> int:
    """Return the least number of lanes in whole vectors that holds `count` values."""
    return -(-count // width) * width


def aligned(shape: int | tuple[int, ...], dtype: Any = np.float64) -> Any:
    """Return zeros, aligned so that no vector in whole rows crosses a cache line."""
    kind = np.dtype(dtype)
    size = int(np.prod(shape)) * kind.itemsize
    room = np.zeros(size + CACHE_LINE, dtype=np.uint8)
    skipped = -room.ctypes.data % CACHE_LINE
    return room[skipped : skipped + size].view(kind).reshape(shape)
