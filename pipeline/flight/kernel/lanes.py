"""Vectors with a lane for each flight: how they are read from rows of numbers, and written to them."""

import numpy as np
from numpy.typing import NDArray

from fis_tools.engines.compiled import compiled
from fis_tools.engines.kernel import LANES
from fis_tools.engines.vectors import Vector, load, store

Floats = NDArray[np.float64]


@compiled(forceinline=True)
def one(row: Floats) -> Vector:
    """Return a row of shape (LANES,)."""
    return load(row, 0, LANES)


@compiled(forceinline=True)
def two(rows: Floats) -> tuple[Vector, Vector]:
    """Return the rows of shape (2, LANES)."""
    return load(rows, 0, LANES), load(rows, 1, LANES)


@compiled(forceinline=True)
def three(rows: Floats) -> tuple[Vector, Vector, Vector]:
    """Return the rows of shape (3, LANES)."""
    return load(rows, 0, LANES), load(rows, 1, LANES), load(rows, 2, LANES)


@compiled(forceinline=True)
def four(rows: Floats, first: int) -> tuple[Vector, Vector, Vector, Vector]:
    """Return four rows of shape (n, LANES), from one on."""
    return (
        load(rows, first, LANES),
        load(rows, first + 1, LANES),
        load(rows, first + 2, LANES),
        load(rows, first + 3, LANES),
    )


@compiled(forceinline=True)
def write_two(rows: Floats, first: int, x: Vector, y: Vector) -> None:
    """Write two rows, from one on."""
    store(rows, first, x)
    store(rows, first + 1, y)


@compiled(forceinline=True)
def write_three(rows: Floats, first: int, x: Vector, y: Vector, z: Vector) -> None:
    """Write three rows, from one on."""
    store(rows, first, x)
    store(rows, first + 1, y)
    store(rows, first + 2, z)


@compiled(forceinline=True)
def write_four(rows: Floats, first: int, a: Vector, b: Vector, c: Vector, d: Vector) -> None:
    """Write four rows, from one on."""
    store(rows, first, a)
    store(rows, first + 1, b)
    store(rows, first + 2, c)
    store(rows, first + 3, d)
