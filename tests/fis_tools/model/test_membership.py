"""Sampled membership functions against scikit-fuzzy's generators."""

import subprocess
from dataclasses import astuple
from functools import partial
from math import exp
from pathlib import Path

import numpy as np
import pytest
import skfuzzy
from hypothesis import given, settings
from hypothesis import strategies as st

from fis_tools.array_types import Floats
from fis_tools.findings.simplification.draft import rounded
from fis_tools.model import Term, Variable, shapes
from fis_tools.model.fuzzylite_shapes import Arc, Concave, Cosine, SemiEllipse, Spike
from fis_tools.model.membership import MembershipFunction
from fis_tools.model.operators import AND_OPERATORS, OR_OPERATORS, Operator
from fis_tools.model.variables import is_unimodal, sample, shape_values
from tests.fis_tools.sample_controllers import table_system, terms
from tests.programs import library, program

UNIVERSE = st.tuples(st.floats(-10, 10), st.floats(1e-3, 40), st.integers(2, 60))


def test_gaussian_far_tails_are_zero_not_denormal():
    variable = Variable("x", "", 0.0, 40.0, (Term("t", shapes.Gaussian(0.0, 1.0)),), 4001)
    values = variable.memberships[0]
    positive = values[values > 0]
    assert positive.min() >= 1e-290
    # exp(-x^2/2) = 1e-290 at x = sqrt(2 * 290 * ln 10) = 36.544
    assert variable.universe[len(positive) - 1] == pytest.approx(36.544, abs=0.011)
    assert not values[len(positive) :].any()


SPREAD = st.floats(1e-3, 1e3)
STEEPNESS = st.floats(-50, 50)
CORNERS = st.lists(st.floats(-15, 60), min_size=4, max_size=4, unique=True).map(sorted)


@st.composite
def _smooth_shapes(draw: st.DrawFn) -> tuple[MembershipFunction, object]:
    """A shape with scikit-fuzzy's function for it: a function of the universe."""
    a, b, c, d = draw(CORNERS)
    width, other_width, slope, other_slope = draw(st.tuples(SPREAD, SPREAD, STEEPNESS, STEEPNESS))
    bell = draw(st.floats(0.1, 20))
    deviations = np.array([width]), np.array([other_width])
    two_sided = shapes.TwoSidedGaussian(a, width, b, other_width)
    slopes = (a, slope, b, other_slope)
    triangles = ((a, b, c), (a, a, b), (a, b, b))
    trapezoids = ((a, b, c, d), (a, a, b, c))
    pairs = [
        (shapes.Gaussian(a, width), lambda x: skfuzzy.gaussmf(x, np.array([a]), deviations[0])),
        (two_sided, lambda x: skfuzzy.gauss2mf(x, a, deviations[0], b, deviations[1])),
        *((shapes.Triangular(*corners), partial(skfuzzy.trimf, abc=corners)) for corners in triangles),
        *((shapes.Trapezoidal(*corners), partial(skfuzzy.trapmf, abcd=corners)) for corners in trapezoids),
        (shapes.GeneralizedBell(width, bell, a), lambda x: skfuzzy.gbellmf(x, width, bell, a)),
        (shapes.Sigmoid(a, slope), lambda x: skfuzzy.sigmf(x, a, slope)),
        (shapes.SigmoidProduct(*slopes), lambda x: skfuzzy.psigmf(x, *slopes)),
        (shapes.SigmoidDifference(*slopes), lambda x: np.abs(skfuzzy.dsigmf(x, *slopes))),
        (shapes.SShape(a, b), lambda x: skfuzzy.smf(x, a, b)),
        (shapes.ZShape(a, b), lambda x: skfuzzy.zmf(x, a, b)),
        (shapes.PiShape(a, b, c, d), lambda x: skfuzzy.pimf(x, a, b, c, d)),
    ]
    return draw(st.sampled_from(pairs))


@settings(max_examples=300, deadline=None)
@given(UNIVERSE, _smooth_shapes())
def test_smooth_shapes_are_scikit_fuzzys(extent, drawn):
    shape, generate = drawn
    low, width, num_points = extent
    variable = Variable("x", "", low, low + width, (), num_points)
    with np.errstate(all="ignore"):
        expected = generate(variable.universe)
    without_tails = np.where(expected < 1e-290, 0.0, expected)
    np.testing.assert_array_equal(sample(variable, Term("t", shape)), without_tails)


@pytest.mark.parametrize(
    ("shape", "generate"),
    [
        (shapes.SShape(2.0, 6.0), skfuzzy.smf),
        (shapes.ZShape(2.0, 6.0), skfuzzy.zmf),
        (shapes.PiShape(2.0, 6.0, 6.0, 8.0), skfuzzy.pimf),
        (shapes.PiShape(0.0, 2.0, 2.0, 6.0), skfuzzy.pimf),
    ],
)
def test_parabolas_on_grid_points_are_scikit_fuzzys(shape, generate):
    """Corners and middles on the grid, where scikit-fuzzy's cases meet."""
    for universe in (np.linspace(0, 10, 21), np.linspace(0, 10, 31), np.linspace(0, 10, 11)):
        values = shape_values(universe, shape)
        np.testing.assert_array_equal(values, generate(universe, *astuple(shape)))


@pytest.mark.parametrize(
    ("shape", "expected"),
    [
        (shapes.TwoSidedGaussian(6.0, 2.0, 4.0, 1.0), {5.0: exp(-0.625), 4.0: exp(-0.5), 6.0: exp(-2.0)}),
        (Spike(4.0, 5.0), {4.0: 1.0, 4.5: exp(-1.0), 3.0: exp(-2.0)}),
        (Cosine(4.0, 2.0), {4.0: 1.0, 4.5: 0.5, 3.0: 0.0, 3.75: 0.5 + np.sqrt(0.125), 6.0: 0.0}),
        (Concave(2.0, 5.0), {2.0: 0.5, 4.0: 0.75, 5.0: 1.0, 9.0: 1.0, -1.0: 1 / 3}),
        (Concave(5.0, 2.0), {5.0: 0.5, 3.0: 0.75, 2.0: 1.0, 0.0: 1.0, 8.0: 1 / 3}),
        (SemiEllipse(2.0, 12.0), {1.0: 0.0, 2.0: 0.0, 4.0: 0.8, 7.0: 1.0, 11.0: 0.6, 13.0: 0.0}),
        (Arc(2.0, 7.0), {1.0: 0.0, 3.0: 0.6, 4.0: 0.8, 7.0: 1.0, 9.0: 1.0}),
        (Arc(7.0, 2.0), {8.0: 0.0, 6.0: 0.6, 5.0: 0.8, 2.0: 1.0, 0.0: 1.0}),
    ],
)
def test_smooth_shapes_have_the_values_their_formulas_say(shape, expected):
    values = shape_values(np.array(list(expected)), shape)
    np.testing.assert_allclose(values, list(expected.values()), rtol=0, atol=1e-4)


def test_samples_are_taken_as_they_are_and_terms_stack():
    terms = (Term("a", shapes.Sampled((0.0, 0.25, 1e-300))), Term("b", shapes.Triangular(0.0, 0.0, 2.0)))
    variable = Variable("x", "", 0.0, 2.0, terms, 3)
    np.testing.assert_array_equal(variable.memberships, [[0.0, 0.25, 0.0], [1.0, 0.5, 0.0]])


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        *((values, True) for values in ([0, 1, 0], [0, 0.5, 0.5, 0.2], [1, 1, 1], [0, 1], [1, 0], [0.5])),
        *((values, False) for values in ([1, 0, 1], [0, 1, 0, 0, 0.1], [0, 0.5, 0.4, 0.4, 0.6])),
    ],
)
def test_unimodal_means_up_then_down(values, expected):
    assert is_unimodal(np.array(values)) is expected


#: Degrees with exact sums, so that no side of a comparison is a matter of rounding.
DEGREES = np.array([0.0, 1 / 1024, 0.125, 0.25, 0.3125, 0.5, 0.6875, 0.75, 0.875, 1023 / 1024, 1.0])
A, B = (grid.ravel() for grid in np.meshgrid(DEGREES, DEGREES))

OPERATORS: dict[str, Operator] = {**AND_OPERATORS, **OR_OPERATORS}
FUZZYLITE = {name: name.title().replace("_", "") for name in OPERATORS}
FUZZYLITE |= {"min": "Minimum", "product": "AlgebraicProduct", "max": "Maximum"}
FUZZYLITE |= {"probabilistic_sum": "AlgebraicSum"}


def _fuzzylite_table(folder: Path) -> dict[str, Floats]:
    """Every norm of fuzzylite at every pair of degrees, by a program of a few lines."""
    compiler = program("g++", "g++")
    library("/usr/include/fl/norm/Norm.h", "libfuzzylite-dev")
    kinds = {name: "t" if name in AND_OPERATORS else "s" for name in FUZZYLITE}
    includes = "".join(f"#include <fl/norm/{kinds[name]}/{norm}.h>\n" for name, norm in FUZZYLITE.items())
    pairs = ", ".join(f"{{{a!r}, {b!r}}}" for a, b in zip(A.tolist(), B.tolist(), strict=True))
    calls = "".join(
        f'    for (auto& p : pairs) std::printf("%.17g\\n", fl::{norm}().compute(p[0], p[1]));\n'
        for norm in FUZZYLITE.values()
    )
    source = folder / "norms.cpp"
    source.write_text(
        f"#include <cstdio>\n{includes}const double pairs[][2] = {{{pairs}}};\nint main() {{\n{calls}}}\n"
    )
    binary = folder / "norms"
    subprocess.run([compiler, str(source), "-lfuzzylite", "-o", str(binary)], check=True)  # noqa: S603
    printed = subprocess.run([str(binary)], check=True, capture_output=True, text=True).stdout  # noqa: S603
    rows = np.array(printed.split(), dtype=np.float64).reshape(len(FUZZYLITE), len(A))
    return dict(zip(FUZZYLITE, rows, strict=True))


def test_every_operator_is_fuzzylites(tmp_path):
    for name, expected in _fuzzylite_table(tmp_path).items():
        np.testing.assert_allclose(OPERATORS[name](A, B), expected, rtol=0, atol=1e-15, err_msg=name)


@pytest.mark.parametrize("name", [*AND_OPERATORS, *OR_OPERATORS])
def test_degrees_stay_degrees_next_to_zero_and_one(name):
    ends = [0.0, 5e-324, 1e-300, 1e-16, 0.5, 1.0 - 2**-52, 1.0 - 2**-53, 1.0]
    a, b = (grid.ravel() for grid in np.meshgrid(ends, ends))
    combined = (AND_OPERATORS | OR_OPERATORS)[name](a, b)
    assert np.all((combined >= 0.0) & (combined <= 1.0))
    nearest = np.minimum(a, b) if name in AND_OPERATORS else np.maximum(a, b)
    beyond = combined - nearest if name in AND_OPERATORS else nearest - combined
    assert np.all(beyond <= 1e-15)


def test_single_numbers_combine_as_arrays_do():
    for name, combine in OPERATORS.items():
        singles = [float(combine(a, b)) for a, b in zip(A.tolist(), B.tolist(), strict=True)]
        np.testing.assert_array_equal(singles, combine(A, B), err_msg=name)


def test_the_numbers_of_any_shape_are_rounded() -> None:
    """To tens the width would be zero, so that it keeps another digit."""
    x = Variable("x", "m", 0.0, 10.0, terms(bump=Cosine(4.04, 3.0)))
    y = Variable("y", "", -1.0, 1.0, terms(high=shapes.Triangular(0.0, 1.0, 1.0)), default=0.0)
    system = table_system("s", (x,), y, ["high"])
    (variable,) = rounded(system, {("x", "bump"): 1}).inputs
    assert variable.terms[0].membership == Cosine(4.0, 3.0)
