"""Products of three-vectors and 3x3 matrices, spelled out: a BLAS call would cost more than the work."""

from math import sqrt

import numpy as np

from fis_tools.compiled.decorator import compiled
from pipeline.array_types import Floats


@compiled
def dot(a: Floats, b: Floats) -> float:
    """Return the scalar product of two vectors of shape (3,)."""
    return float(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


@compiled
def norm(a: Floats) -> float:
    """Return the length of a vector of shape (3,)."""
    return sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])


@compiled
def cross(a: Floats, b: Floats) -> Floats:
    """Return the vector product of two vectors of shape (3,)."""
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


@compiled
def times(matrix: Floats, a: Floats) -> Floats:
    """Return ``matrix @ a`` for shapes (3, 3) and (3,)."""
    return np.array(
        [
            matrix[0, 0] * a[0] + matrix[0, 1] * a[1] + matrix[0, 2] * a[2],
            matrix[1, 0] * a[0] + matrix[1, 1] * a[1] + matrix[1, 2] * a[2],
            matrix[2, 0] * a[0] + matrix[2, 1] * a[1] + matrix[2, 2] * a[2],
        ]
    )


@compiled(error_model="numpy")
def assign(target: Floats, source: Floats) -> None:
    """Write the elements of one vector, shape (n,), into another.

    Compiled assignments to slices include an error message for different shapes, and with it some eighty
    string functions to compile.
    """
    for i in range(len(target)):
        target[i] = source[i]
