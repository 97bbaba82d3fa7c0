"""Sampled membership functions against scikit-fuzzy's generators."""

import numpy as np
import pytest
import skfuzzy
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from fis_tools.membership import is_unimodal, sample, sample_terms
from fis_tools.model import Gaussian, Sampled, Term, Trapezoidal, Triangular, Variable

UNIVERSE = st.tuples(st.floats(-1e3, 1e3), st.floats(1e-3, 1e3), st.integers(2, 60))


def _without_tails(expected: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.where(expected < 1e-290, 0.0, expected)


def _variable(extent: tuple[float, float, int], *terms: Term) -> Variable:
    low, width, num_points = extent
    return Variable("x", "", low, low + width, terms, num_points)


@settings(max_examples=60, deadline=None)
@given(UNIVERSE, st.floats(-2e3, 2e3), st.floats(1e-3, 1e3))
def test_gaussian_is_scikit_fuzzys(extent: tuple[float, float, int], mean: float, width: float) -> None:
    variable = _variable(extent)
    values = sample(variable, Term("t", Gaussian(mean, width)))
    with np.errstate(under="ignore", over="ignore"):
        expected = skfuzzy.gaussmf(variable.universe, np.array([mean]), np.array([width]))
    np.testing.assert_array_equal(values, _without_tails(expected))


def test_gaussian_far_tails_are_zero_not_denormal() -> None:
    variable = Variable("x", "", 0.0, 40.0, (Term("t", Gaussian(0.0, 1.0)),), 4001)
    values = sample_terms(variable)[0]
    positive = values[values > 0]
    assert positive.min() >= 1e-290
    # exp(-x^2/2) = 1e-290 at x = sqrt(2 * 290 * ln 10) = 36.544
    assert variable.universe[len(positive) - 1] == pytest.approx(36.544, abs=0.011)
    assert not values[len(positive) :].any()


@settings(max_examples=60, deadline=None)
@given(UNIVERSE, st.lists(st.floats(-2e3, 2e3), min_size=3, max_size=3), st.booleans(), st.booleans())
def test_triangle_is_scikit_fuzzys(
    extent: tuple[float, float, int], corners: list[float], is_left_steep: bool, is_right_steep: bool
) -> None:
    left, peak, right = sorted(corners)
    left, right = (peak if is_left_steep else left), (peak if is_right_steep else right)
    variable = _variable(extent)
    np.testing.assert_array_equal(
        sample(variable, Term("t", Triangular(left, peak, right))),
        _without_tails(skfuzzy.trimf(variable.universe, [left, peak, right])),
    )


@settings(max_examples=60, deadline=None)
@given(UNIVERSE, st.lists(st.floats(-2e3, 2e3), min_size=4, max_size=4), st.booleans())
def test_trapezoid_is_scikit_fuzzys(
    extent: tuple[float, float, int], corners: list[float], is_left_steep: bool
) -> None:
    left, left_top, right_top, right = sorted(corners)
    left = left_top if is_left_steep else left
    variable = _variable(extent)
    np.testing.assert_array_equal(
        sample(variable, Term("t", Trapezoidal(left, left_top, right_top, right))),
        _without_tails(skfuzzy.trapmf(variable.universe, [left, left_top, right_top, right])),
    )


def test_a_peak_on_a_grid_point_is_one_and_the_feet_are_zero() -> None:
    variable = Variable("x", "", 0.0, 10.0, (), 11)
    values = sample(variable, Term("t", Triangular(2.0, 4.0, 8.0)))
    np.testing.assert_allclose(values, [0, 0, 0, 0.5, 1, 0.75, 0.5, 0.25, 0, 0, 0], rtol=0, atol=1e-15)


def test_samples_are_taken_as_they_are_and_terms_stack() -> None:
    terms = (Term("a", Sampled((0.0, 0.25, 1e-300))), Term("b", Triangular(0.0, 0.0, 2.0)))
    variable = Variable("x", "", 0.0, 2.0, terms, 3)
    np.testing.assert_array_equal(sample_terms(variable), [[0.0, 0.25, 0.0], [1.0, 0.5, 0.0]])


def test_samples_do_not_change_the_term() -> None:
    term = Term("a", Sampled((0.0, 1e-300)))
    sample(Variable("x", "", 0.0, 1.0, (term,), 2), term)
    assert term.membership == Sampled((0.0, 1e-300))


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ([0, 1, 0], True),
        ([0, 0.5, 0.5, 0.2], True),
        ([1, 1, 1], True),
        ([0, 1], True),
        ([1, 0], True),
        ([0.5], True),
        ([1, 0, 1], False),
        ([0, 1, 0, 0, 0.1], False),
        ([0, 0.5, 0.4, 0.4, 0.6], False),
    ],
)
def test_unimodal_means_up_then_down(values: list[float], expected: bool) -> None:
    assert is_unimodal(np.array(values)) is expected
