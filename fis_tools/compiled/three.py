"""Products of three-vectors, `fis_tools.compiled.vectors.Three`, and arrays with a row for each component."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.vectors import Mask, Three, load, select, splat, store, total, width_of

Floats = NDArray[np.float64]


@compiled(forceinline=True)
def load_three(rows: Floats, first: int) -> Three:
    """Return three rows of lanes, shape (n, L), from row `first` on."""
    width = width_of(rows)
    return Three(load(rows, first, width), load(rows, first + 1, width), load(rows, first + 2, width))


@compiled(forceinline=True)
def store_three(rows: Floats, first: int, a: Three) -> None:
    """Write three rows of lanes, from row `first` on."""
    store(rows, first, a.x)
    store(rows, first + 1, a.y)
    store(rows, first + 2, a.z)


@compiled(inline="always")  # so that the width stays a constant
def load_from(rows: Floats, row: int, first: int, width: int) -> Three:
    """Return three rows of an array, shape (n, lanes), from row and lane on; `width` is a constant."""
    return Three(
        load(rows, (row, first), width),
        load(rows, (row + 1, first), width),
        load(rows, (row + 2, first), width),
    )


@compiled(inline="always")  # so that the width stays a constant
def load_at(array: Floats, index: int, row: int, first: int, width: int) -> Three:
    """Return three rows of an entry of an array, shape (n, rows, lanes), from row and lane on.

    Their number of lanes is the constant `width`.
    """
    return Three(
        load(array, (index, row, first), width),
        load(array, (index, row + 1, first), width),
        load(array, (index, row + 2, first), width),
    )


@compiled(forceinline=True)
def store_at(array: Floats, index: int, row: int, a: Three) -> None:
    """Write three rows of an entry of an array, shape (n, rows, lanes)."""
    store(array, (index, row, 0), a.x)
    store(array, (index, row + 1, 0), a.y)
    store(array, (index, row + 2, 0), a.z)


@compiled(forceinline=True)
def lane_of(rows: Floats, first: int, lane: int) -> Three:
    """Return the floats of one lane in three rows, from row `first` on."""
    return Three(rows[first, lane], rows[first + 1, lane], rows[first + 2, lane])


@compiled(forceinline=True)
def write_lane(rows: Floats, first: int, lane: int, a: Three) -> None:
    """Write the floats of one lane into three rows, from row `first` on."""
    rows[first, lane], rows[first + 1, lane], rows[first + 2, lane] = a.x, a.y, a.z


@compiled(forceinline=True)
def three_of(array: Floats) -> Three:
    """Return an array of shape (3,) as a vector of floats."""
    return Three(array[0], array[1], array[2])


@compiled(forceinline=True)
def write_three(target: Any, a: Three) -> None:
    """Write a vector of floats into the first elements of an array of shape (n,).

    Compiled assignments to slices include an error message for different shapes, and with it some eighty
    string functions to compile.
    """
    target[0], target[1], target[2] = a.x, a.y, a.z


@compiled(inline="always")  # so that the width stays a constant
def same(value: float, width: int) -> Three:
    """Return the vector whose components all hold one value in each of their lanes."""
    return Three(splat(value, width), splat(value, width), splat(value, width))


@compiled(forceinline=True)
def dot(a: Three, b: Three) -> float:
    """Return the scalar product."""
    return a.x * b.x + a.y * b.y + a.z * b.z


@compiled(forceinline=True)
def cross(a: Three, b: Three) -> Three:
    """Return the vector product."""
    return Three(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x)


@compiled(forceinline=True)
def length(a: Three) -> float:
    """Return the Euclidean length."""
    root: float = np.sqrt(dot(a, a))
    return root


@compiled(forceinline=True)
def totals(a: Three) -> Three:
    """Return the sum over the lanes of each component, floats."""
    return Three(total(a.x), total(a.y), total(a.z))


@compiled(forceinline=True)
def cofactors(first: Three, second: Three, third: Three) -> tuple[Three, Three, Three]:
    """Return the rows of the cofactors of a matrix by its rows; ``first . x`` is its determinant."""
    return cross(second, third), cross(third, first), cross(first, second)


@compiled(forceinline=True)
def chosen(mask: Mask, a: Three, b: Three) -> Three:
    """Return `a` in the lanes where the mask holds, elsewhere `b`."""
    return Three(select(mask, a.x, b.x), select(mask, a.y, b.y), select(mask, a.z, b.z))


@compiled(forceinline=True)
def times(matrix: Floats, a: Three) -> Three:
    """Return a matrix, shape (3, 3), times a vector."""
    return Three(
        matrix[0, 0] * a.x + matrix[0, 1] * a.y + matrix[0, 2] * a.z,
        matrix[1, 0] * a.x + matrix[1, 1] * a.y + matrix[1, 2] * a.z,
        matrix[2, 0] * a.x + matrix[2, 1] * a.y + matrix[2, 2] * a.z,
    )
