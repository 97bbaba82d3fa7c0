"""Vectors with a lane for each flight: reading them from rows of numbers, and writing them there."""

import numpy as np
from numpy.typing import NDArray

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.vectors import Vector, least, load, most, store, width_of

Floats = NDArray[np.float64]


@compiled(forceinline=True)
def one(row: Floats) -> Vector:
    """Return a field of one row."""
    return load(row, 0, width_of(row))


@compiled(forceinline=True)
def two(rows: Floats) -> tuple[Vector, Vector]:
    """Return the first two rows of a field."""
    width = width_of(rows)
    return load(rows, 0, width), load(rows, 1, width)


@compiled(forceinline=True)
def three(rows: Floats) -> tuple[Vector, Vector, Vector]:
    """Return the first three rows of a field."""
    width = width_of(rows)
    return load(rows, 0, width), load(rows, 1, width), load(rows, 2, width)


@compiled(forceinline=True)
def four(rows: Floats) -> tuple[Vector, Vector, Vector, Vector]:
    """Return the first four rows of a field."""
    width = width_of(rows)
    return load(rows, 0, width), load(rows, 1, width), load(rows, 2, width), load(rows, 3, width)


@compiled(forceinline=True)
def write_two(rows: Floats, first: int, x: Vector, y: Vector) -> None:
    """Write two rows, from `first` on."""
    store(rows, first, x)
    store(rows, first + 1, y)


@compiled(forceinline=True)
def write_three(rows: Floats, first: int, x: Vector, y: Vector, z: Vector) -> None:
    """Write three rows, from `first` on."""
    store(rows, first, x)
    store(rows, first + 1, y)
    store(rows, first + 2, z)


@compiled(forceinline=True)
def write_four(rows: Floats, a: Vector, b: Vector, c: Vector, d: Vector) -> None:
    """Write the first four rows."""
    store(rows, 0, a)
    store(rows, 1, b)
    store(rows, 2, c)
    store(rows, 3, d)


@compiled(error_model="numpy", forceinline=True)
def clip(x: Vector, limit: float) -> Vector:
    """Return x, limited to ± the limit."""
    return most(least(x, limit), -limit)
