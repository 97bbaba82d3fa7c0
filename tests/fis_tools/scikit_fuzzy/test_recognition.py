"""Shapes are found again from their samples, and nothing else is taken for a shape."""

from typing import Any

import numpy as np
import pytest
import skfuzzy
from hypothesis import given, settings
from hypothesis import strategies as st

from fis_tools.model import (
    Gaussian,
    GeneralizedBell,
    MembershipFunction,
    PiShape,
    Sampled,
    Sigmoid,
    SigmoidDifference,
    SigmoidProduct,
    SShape,
    Term,
    Trapezoidal,
    Triangular,
    TwoSidedGaussian,
    Variable,
    ZShape,
)
from fis_tools.model.variables import sample, shape_values
from fis_tools.scikit_fuzzy.recognition import recognise
from tests.fis_tools.engines.random_systems import any_shape

GRID = np.linspace(0.0, 10.0, 101)


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        (skfuzzy.gaussmf(GRID, 3.7, 1.25), Gaussian(3.7, 1.25)),
        (skfuzzy.gaussmf(GRID, -1.0, 2.0), Gaussian(-1.0, 2.0)),
        (skfuzzy.gaussmf(GRID, 10 / 3, 1 / 7), Gaussian(10 / 3, 1 / 7)),
        (skfuzzy.trimf(GRID, [1, 4.5, 9.05]), Triangular(1.0, 4.5, 9.05)),
        (skfuzzy.trimf(GRID, [1, 4.555, 9.05]), Triangular(1.0, 4.555, 9.05)),
        (skfuzzy.trimf(GRID, [0, 0, 5]), Triangular(0.0, 0.0, 5.0)),
        (skfuzzy.trimf(GRID, [5, 10, 10]), Triangular(5.0, 10.0, 10.0)),
        (skfuzzy.trimf(GRID, [3, 3, 3]), Triangular(3.0, 3.0, 3.0)),
        (skfuzzy.trapmf(GRID, [1, 2.25, 6.5, 9]), Trapezoidal(1.0, 2.25, 6.5, 9.0)),
        (skfuzzy.trapmf(GRID, [0, 0, 2, 7.7]), Trapezoidal(0.0, 0.0, 2.0, 7.7)),
        (skfuzzy.trapmf(GRID, [2, 2, 5, 5]), Trapezoidal(2.0, 2.0, 5.0, 5.0)),
        (skfuzzy.gauss2mf(GRID, 3, 0.8, 5.5, 1.5), TwoSidedGaussian(3.0, 0.8, 5.5, 1.5)),
        (skfuzzy.gbellmf(GRID, 2.1, 3.5, 4.4), GeneralizedBell(2.1, 3.5, 4.4)),
        (skfuzzy.gbellmf(GRID, 2.1, 2.0, -1.5), GeneralizedBell(2.1, 2.0, -1.5)),
        (skfuzzy.sigmf(GRID, 4.2, 1.7), Sigmoid(4.2, 1.7)),
        (skfuzzy.sigmf(GRID, 4.2, -0.3), Sigmoid(4.2, -0.3)),
        (skfuzzy.dsigmf(GRID, 2, 5, 7, 6), SigmoidDifference(2.0, 5.0, 7.0, 6.0)),
        (skfuzzy.psigmf(GRID, 3, 2.5, 6, -4), SigmoidProduct(3.0, 2.5, 6.0, -4.0)),
        (skfuzzy.smf(GRID, 1.1, 8.3), SShape(1.1, 8.3)),
        (skfuzzy.zmf(GRID, 2, 7), ZShape(2.0, 7.0)),
        (skfuzzy.pimf(GRID, 1, 3.3, 5, 9.9), PiShape(1.0, 3.3, 5.0, 9.9)),
        (skfuzzy.piecemf(GRID, [2.0, 4.0, 8.0]), None),
        (np.where(GRID < 5, 0.25, 0.5), None),
        (np.abs(GRID - 5.0) / 5.0, None),
        (np.zeros(101), None),
    ],
)
def test_what_scikit_fuzzy_samples_is_found_again(values: Any, expected: MembershipFunction | None) -> None:
    assert recognise(GRID, values) == (Sampled(tuple(values.tolist())) if expected is None else expected)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(2, 60), st.floats(-10, 10), st.floats(0.1, 100))
def test_whatever_is_found_gives_the_samples_to_the_last_bit(
    seed: int, num_points: int, low: float, width: float
) -> None:
    variable = Variable("x", "", low, low + width, (), num_points)
    values = sample(variable, Term("t", any_shape(np.random.default_rng(seed), variable)))
    found = recognise(variable.universe, values)
    np.testing.assert_array_equal(sample(variable, Term("t", found)), values)


def test_another_formula_of_the_same_shape_is_recognised_if_asked_for() -> None:
    values = np.exp(-0.5 * ((GRID - 3.1) / 0.7) ** 2)
    assert not np.array_equal(values, shape_values(GRID, Gaussian(3.1, 0.7)))
    assert isinstance(recognise(GRID, values), Sampled)
    assert recognise(GRID, values, tolerance=1e-15) == Gaussian(3.1, 0.7)


def test_a_value_away_from_its_shape_makes_samples_of_it() -> None:
    values = skfuzzy.gaussmf(GRID, 3.7, 1.25)
    values[40] += 1e-9
    assert isinstance(recognise(GRID, values), Sampled)


def test_uneven_universes_are_no_hindrance() -> None:
    universe = np.array([0.0, 0.5, 0.75, 2.0, 3.5, 4.0, 7.0, 10.0])
    assert recognise(universe, skfuzzy.trimf(universe, [0.5, 3.5, 10])) == Triangular(0.5, 3.5, 10.0)
    assert recognise(universe, skfuzzy.gaussmf(universe, 2.5, 1.5)) == Gaussian(2.5, 1.5)
