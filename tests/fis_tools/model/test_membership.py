"""Sampled membership functions against scikit-fuzzy's generators."""

import subprocess
from collections.abc import Iterator
from dataclasses import astuple, replace
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
import skfuzzy
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from fis_tools.document import text
from fis_tools.engines.compiler import compile
from fis_tools.findings.simplification.draft import rounded
from fis_tools.formats import serialize
from fis_tools.formats.c import source
from fis_tools.formats.exchange import fis, fll
from fis_tools.formats.serialize import Kind
from fis_tools.model import (
    Arc,
    Concave,
    Consequent,
    Cosine,
    FuzzyController,
    FuzzySystem,
    Gaussian,
    GeneralizedBell,
    Is,
    MembershipFunction,
    PiShape,
    Rule,
    Sampled,
    SemiEllipse,
    Sigmoid,
    SigmoidDifference,
    SigmoidProduct,
    Spike,
    SShape,
    Term,
    Trapezoidal,
    Triangular,
    TwoSidedGaussian,
    Variable,
    ZShape,
)
from fis_tools.model.operators import ACCUMULATIONS, AND_OPERATORS, OR_OPERATORS, Operator
from fis_tools.model.shape import SHAPES, Floats, Place, Width, shape
from fis_tools.model.validate import problems
from fis_tools.model.variables import is_unimodal, sample, shape_values
from fis_tools.words.text import outline, shape_words
from tests.programs import library, program

UNIVERSE = st.tuples(st.floats(-1e3, 1e3), st.floats(1e-3, 1e3), st.integers(2, 60))


def _without_tails(expected: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.where(expected < 1e-290, 0.0, expected)


def _variable(extent: tuple[float, float, int], *terms: Term) -> Variable:
    low, width, num_points = extent
    return Variable("x", "", low, low + width, terms, num_points)


def test_gaussian_far_tails_are_zero_not_denormal():
    variable = Variable("x", "", 0.0, 40.0, (Term("t", Gaussian(0.0, 1.0)),), 4001)
    values = variable.memberships[0]
    positive = values[values > 0]
    assert positive.min() >= 1e-290
    # exp(-x^2/2) = 1e-290 at x = sqrt(2 * 290 * ln 10) = 36.544
    assert variable.universe[len(positive) - 1] == pytest.approx(36.544, abs=0.011)
    assert not values[len(positive) :].any()


SPREAD = st.floats(1e-3, 1e3)
STEEPNESS = st.floats(-50, 50)
CORNERS = st.lists(st.floats(-2e3, 2e3), min_size=4, max_size=4, unique=True).map(sorted)


@st.composite
def _smooth_shapes(draw: st.DrawFn) -> tuple[MembershipFunction, object]:
    """A shape with scikit-fuzzy's function for it: a function of the universe."""
    a, b, c, d = draw(CORNERS)
    width, other_width, slope, other_slope = draw(st.tuples(SPREAD, SPREAD, STEEPNESS, STEEPNESS))
    bell = draw(st.floats(0.1, 20))
    deviations = np.array([width]), np.array([other_width])
    return draw(
        st.sampled_from(
            [
                (
                    TwoSidedGaussian(a, width, b, other_width),
                    lambda x: skfuzzy.gauss2mf(x, a, deviations[0], b, deviations[1]),
                ),
                (Gaussian(a, width), lambda x: skfuzzy.gaussmf(x, np.array([a]), deviations[0])),
                *(
                    (Triangular(*corners), lambda x, corners=corners: skfuzzy.trimf(x, corners))
                    for corners in ((a, b, c), (a, a, b), (a, b, b))
                ),
                *(
                    (Trapezoidal(*corners), lambda x, corners=corners: skfuzzy.trapmf(x, corners))
                    for corners in ((a, b, c, d), (a, a, b, c))
                ),
                (GeneralizedBell(width, bell, a), lambda x: skfuzzy.gbellmf(x, width, bell, a)),
                (Sigmoid(a, slope), lambda x: skfuzzy.sigmf(x, a, slope)),
                (
                    SigmoidProduct(a, slope, b, other_slope),
                    lambda x: skfuzzy.psigmf(x, a, slope, b, other_slope),
                ),
                (
                    SigmoidDifference(a, slope, b, other_slope),
                    lambda x: np.abs(skfuzzy.dsigmf(x, a, slope, b, other_slope)),
                ),
                (SShape(a, b), lambda x: skfuzzy.smf(x, a, b)),
                (ZShape(a, b), lambda x: skfuzzy.zmf(x, a, b)),
                (PiShape(a, b, c, d), lambda x: skfuzzy.pimf(x, a, b, c, d)),
            ]
        )
    )


@settings(max_examples=300, deadline=None)
@given(UNIVERSE, _smooth_shapes())
def test_smooth_shapes_are_scikit_fuzzys(extent, drawn):
    shape, generate = drawn
    variable = _variable(extent)
    with np.errstate(all="ignore"):
        expected = generate(variable.universe)
    np.testing.assert_array_equal(sample(variable, Term("t", shape)), _without_tails(expected))


@pytest.mark.parametrize(
    "shape", [SShape(2.0, 6.0), ZShape(2.0, 6.0), PiShape(2.0, 6.0, 6.0, 8.0), PiShape(0.0, 2.0, 2.0, 6.0)]
)
def test_parabolas_on_grid_points_are_scikit_fuzzys(shape):
    """Corners and middles on the grid, where scikit-fuzzy's cases meet."""
    generate = {SShape: skfuzzy.smf, ZShape: skfuzzy.zmf, PiShape: skfuzzy.pimf}[type(shape)]
    for universe in (np.linspace(0, 10, 21), np.linspace(0, 10, 31), np.linspace(0, 10, 11)):
        values = shape_values(universe, shape)
        np.testing.assert_array_equal(values, generate(universe, *astuple(shape)))


@pytest.mark.parametrize(
    ("shape", "expected"),
    [
        (TwoSidedGaussian(6.0, 2.0, 4.0, 1.0), {5.0: np.exp(-0.625), 4.0: np.exp(-0.5), 6.0: np.exp(-2.0)}),
        (Spike(4.0, 5.0), {4.0: 1.0, 4.5: np.exp(-1.0), 3.0: np.exp(-2.0)}),
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


def test_a_peak_on_a_grid_point_is_one_and_the_feet_are_zero():
    variable = Variable("x", "", 0.0, 10.0, (), 11)
    values = sample(variable, Term("t", Triangular(2.0, 4.0, 8.0)))
    np.testing.assert_allclose(values, [0, 0, 0, 0.5, 1, 0.75, 0.5, 0.25, 0, 0, 0], rtol=0, atol=1e-15)


def test_samples_are_taken_as_they_are_and_terms_stack():
    terms = (Term("a", Sampled((0.0, 0.25, 1e-300))), Term("b", Triangular(0.0, 0.0, 2.0)))
    variable = Variable("x", "", 0.0, 2.0, terms, 3)
    np.testing.assert_array_equal(variable.memberships, [[0.0, 0.25, 0.0], [1.0, 0.5, 0.0]])


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
def test_unimodal_means_up_then_down(values, expected):
    assert is_unimodal(np.array(values)) is expected


#: Degrees with exact sums, so that no side of a comparison is a matter of rounding.
DEGREES = np.array([0.0, 1 / 1024, 0.125, 0.25, 0.3125, 0.5, 0.6875, 0.75, 0.875, 1023 / 1024, 1.0])
A, B = (grid.ravel() for grid in np.meshgrid(DEGREES, DEGREES))

FUZZYLITE = {
    "min": "Minimum",
    "product": "AlgebraicProduct",
    "bounded_difference": "BoundedDifference",
    "einstein_product": "EinsteinProduct",
    "hamacher_product": "HamacherProduct",
    "drastic_product": "DrasticProduct",
    "nilpotent_minimum": "NilpotentMinimum",
    "max": "Maximum",
    "probabilistic_sum": "AlgebraicSum",
    "bounded_sum": "BoundedSum",
    "einstein_sum": "EinsteinSum",
    "hamacher_sum": "HamacherSum",
    "drastic_sum": "DrasticSum",
    "nilpotent_maximum": "NilpotentMaximum",
}
OPERATORS: dict[str, Operator] = {**AND_OPERATORS, **OR_OPERATORS}


def _fuzzylite_table(folder: Path) -> dict[str, list[float]]:
    """Every norm of fuzzylite at every pair of degrees, by a program of a few lines."""
    compiler = program("g++", "g++")
    library("/usr/include/fl/norm/Norm.h", "libfuzzylite-dev")
    kinds = {name: "t" if name in AND_OPERATORS else "s" for name in FUZZYLITE}
    includes = "".join(f"#include <fl/norm/{kinds[name]}/{norm}.h>\n" for name, norm in FUZZYLITE.items())
    pairs = ", ".join(f"{{{a!r}, {b!r}}}" for a, b in zip(A.tolist(), B.tolist(), strict=True))
    calls = "".join(
        f'    for (auto& p : pairs) std::printf("{name} %.17g\\n", fl::{norm}().compute(p[0], p[1]));\n'
        for name, norm in FUZZYLITE.items()
    )
    source = folder / "norms.cpp"
    source.write_text(
        f"#include <cstdio>\n{includes}const double pairs[][2] = {{{pairs}}};\nint main() {{\n{calls}}}\n"
    )
    binary = folder / "norms"
    subprocess.run([compiler, str(source), "-lfuzzylite", "-o", str(binary)], check=True)  # noqa: S603
    printed = subprocess.run([str(binary)], check=True, capture_output=True, text=True).stdout  # noqa: S603
    table: dict[str, list[float]] = {name: [] for name in FUZZYLITE}
    for line in printed.splitlines():
        name, value = line.split()
        table[name].append(float(value))
    return table


def test_every_operator_is_fuzzylites(tmp_path):
    table = _fuzzylite_table(tmp_path)
    assert set(table) == set(OPERATORS)
    for name, expected in table.items():
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


def test_rules_accumulate_by_any_disjunction_or_the_product():
    assert {name: ACCUMULATIONS[name] for name in OR_OPERATORS} == OR_OPERATORS
    assert set(ACCUMULATIONS) - set(OR_OPERATORS) == {"product"}


@shape("cosine_bump", "cosine bump, centre {centre}, half width {width}", fll=("Bump", "width", "centre"))
class CosineBump(MembershipFunction):
    """``(1 + cos(pi (x - centre) / width)) / 2`` within `width` of the `centre`, zero beyond."""

    centre: Place
    width: Width

    def at(self, x: Floats) -> Floats:
        """Evaluate the formula."""
        away = np.minimum(np.abs(x - self.centre) / self.width, 1.0)
        values: Floats = 0.5 * (1.0 + np.cos(np.pi * away))
        return values


del SHAPES["cosine_bump"]  # it is there for these tests alone


@pytest.fixture(autouse=True)
def _entered() -> Iterator[None]:
    SHAPES["cosine_bump"] = CosineBump
    yield
    del SHAPES["cosine_bump"]


def _system(bump: MembershipFunction) -> FuzzySystem:
    """A system that says low where x is near the bump and high where it is near the hill."""
    x = Variable("x", "m", 0.0, 10.0, (Term("bump", bump), Term("hill", Gaussian(8.0, 1.0))), 1001)
    terms = (Term("low", CosineBump(-1.0, 1.0)), Term("high", CosineBump(1.0, 1.0)))
    y = Variable("y", "", -1.0, 1.0, terms, default=0.0)
    rules = (
        Rule(Is("x", "bump"), (Consequent("y", "low"),)),
        Rule(Is("x", "hill"), (Consequent("y", "high"),)),
    )
    return FuzzySystem("s", (x,), (y,), rules)


SYSTEM = _system(CosineBump(4.04, 3.0))
CONTROLLER = FuzzyController("s", (SYSTEM,))
INPUTS = np.linspace(0.0, 10.0, 201)


def test_it_is_checked() -> None:
    assert problems(SYSTEM) == []
    (notes,) = problems(_system(CosineBump(4.0, -3.0)))
    assert notes.endswith("term 'bump': width -3.0 is not positive; give a number above 0")
    (notes,) = problems(_system(CosineBump(np.nan, 3.0)))
    assert notes.endswith("centre, width = (nan, 3.0) must be finite numbers")


def test_it_is_worded() -> None:
    assert shape_words(SYSTEM.inputs[0].terms[0]) == "cosine bump, centre 4.04, half width 3"
    assert "cosine bump, centre 4.04, half width 3" in text.write(outline(CONTROLLER))


def test_it_is_inferred_with() -> None:
    """The centroid of ``(1 + cos(pi (y - 1))) / 2`` from 0 to 1 is ``1/2 + 2 / pi^2``."""
    outputs = compile(SYSTEM)({"x": np.array([8.0])})["y"]
    np.testing.assert_allclose(outputs, 0.5 + 2.0 / np.pi**2, atol=1e-4)


@pytest.mark.parametrize("kind", ["json", "yaml"])
def test_our_own_files_hold_it(kind: Kind) -> None:
    text = serialize.dump_json(CONTROLLER) if kind == "json" else serialize.dump_yaml(CONTROLLER)
    assert "cosine_bump" in text
    assert serialize.loads(text, kind) == CONTROLLER


@pytest.mark.parametrize(("kind", "form"), [("fis", fis), ("fll", fll)])
def test_other_programs_files_hold_it_or_its_points(kind: Kind, form: ModuleType) -> None:
    written = form.write(CONTROLLER).text
    assert serialize.loads(written, kind) == CONTROLLER
    shown = "\n".join(line for line in written.splitlines() if "fis_tools carries" not in line)
    (system,) = serialize.loads(shown, kind).systems
    membership = system.inputs[0].terms[0].membership
    if kind == "fll":
        assert membership == CosineBump(4.04, 3.0)
    else:
        assert isinstance(membership, Sampled)
    outputs = compile(replace(system, name="s"))({"x": INPUTS})["y"]
    np.testing.assert_allclose(outputs, compile(SYSTEM)({"x": INPUTS})["y"], atol=1e-12)


def test_c_holds_its_points() -> None:
    assert "double" in source.write(CONTROLLER)


def test_its_numbers_are_rounded() -> None:
    """To tens the width would be zero, so that it keeps another digit."""
    (variable,) = rounded(SYSTEM, {("x", "bump"): 1}).inputs
    assert variable.terms[0].membership == CosineBump(4.0, 3.0)
