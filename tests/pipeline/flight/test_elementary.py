"""Functions of vectors against NumPy's, and at the places where they are easily wrong."""

import numpy as np
import pytest
from numba import njit
from numpy.typing import NDArray

from fis_tools.compiled.vectors import load, store
from pipeline.flight.state.lanes import arctangent, exponential

Floats = NDArray[np.float64]
WIDTH = 8
ROUNDING = 2.0**-52


@njit(error_model="numpy")
def exponentials(x: Floats, out: Floats) -> None:
    for i in range(0, len(x), WIDTH):
        store(out, i, exponential(load(x, i, WIDTH)))


@njit(error_model="numpy")
def angles(y: Floats, x: Floats, out: Floats) -> None:
    for i in range(0, len(x), WIDTH):
        store(out, i, arctangent(load(y, i, WIDTH), load(x, i, WIDTH)))


@pytest.mark.parametrize(("low", "high"), [(-1e-6, 1e-6), (-1.0, 1.0), (-40.0, 40.0), (-699.0, 699.0)])
def test_the_exponential_is_right_to_rounding(low: float, high: float) -> None:
    x = np.random.default_rng(1).uniform(low, high, 8000)
    found = np.empty_like(x)
    exponentials(x, found)
    np.testing.assert_allclose(found, np.exp(x), rtol=2 * ROUNDING, atol=0.0)


def test_the_exponential_of_zero_is_one_and_of_little_nothing() -> None:
    x = np.array([0.0, -0.0, -701.0, -1e300, -np.inf, 1.0, -1.0, np.log(2.0)])
    found = np.empty_like(x)
    exponentials(x, found)
    np.testing.assert_array_equal(found[:5], [1.0, 1.0, 0.0, 0.0, 0.0])
    np.testing.assert_allclose(found[5:], [np.e, 1.0 / np.e, 2.0], rtol=2 * ROUNDING)


@pytest.mark.parametrize("scale", [1e-150, 1.0, 1e150])
def test_angles_are_right_to_rounding(scale: float) -> None:
    y, x = scale * np.random.default_rng(2).normal(size=(2, 8000))
    found = np.empty_like(x)
    angles(y, x, found)
    np.testing.assert_allclose(found, np.arctan2(y, x), rtol=2 * ROUNDING, atol=0.0)


def test_angles_on_the_axes_are_those_from_minus_to_plus_pi_without_the_former() -> None:
    y = np.array([0.0, 0.0, -0.0, 1.0, -1.0, 1.0, -1.0, 1e-300])
    x = np.array([1.0, -1.0, -1.0, 0.0, 0.0, 1.0, -1.0, -1.0])
    found = np.empty_like(x)
    angles(y, x, found)
    turn = np.pi / 4.0
    np.testing.assert_allclose(
        found, turn * np.array([0, 4, 4, 2, -2, 1, -3, 4]), rtol=2 * ROUNDING, atol=0.0
    )
