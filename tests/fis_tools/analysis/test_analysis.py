"""Measures against closed forms and counts by hand, and surfaces against scikit-fuzzy.

Shares of rules against every coalition enumerated, the axioms that define them, and values by hand.
"""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import erf
from scipy.stats import qmc

from fis_tools.analysis.arrays import coverage, distinguishability, rule_usage, spread_inputs, surface
from fis_tools.analysis.contribution import contributions, importance
from fis_tools.analysis.domain import as_mapping, box_of, departures, from_mapping
from fis_tools.analysis.measures import centre, completeness, complexity, rule_consistency
from fis_tools.engines.compiler import compile
from fis_tools.errors import ControllerFileError
from fis_tools.model import (
    And,
    Consequent,
    Expression,
    FuzzySystem,
    Hedged,
    Is,
    Not,
    Or,
    Rule,
    Term,
    Variable,
)
from fis_tools.model.membership import MembershipFunction
from fis_tools.model.rule_tables import table_rules
from fis_tools.model.shapes import Gaussian, Sampled, Trapezoidal, Triangular
from tests.fis_tools import step_by_step
from tests.fis_tools.analysis.test_shapley import silenced
from tests.fis_tools.control_systems import ReferenceEngine
from tests.fis_tools.sample_controllers import FORCE_X, FORCE_Z, ROOM, ramp_system, terms


def test_a_surface_is_what_scikit_fuzzy_computes_at_its_grid_points() -> None:
    result = surface(FORCE_X, num_points=5)
    engine = ReferenceEngine(FORCE_X)
    np.testing.assert_array_equal(result.x, [0, 50, 100, 150, 200])
    np.testing.assert_allclose(result.y, [-0.3, -0.15, 0, 0.15, 0.3], rtol=0, atol=1e-15)
    for row, column in ((0, 0), (1, 4), (3, 2)):
        expected = engine.compute(np.array([result.x[column], result.y[row]]))[0]
        assert result.values[row, column] == pytest.approx(expected, abs=1e-13)
    assert result.x_variable.name == "distance"
    assert result.values.shape == (5, 5)


def test_axes_can_be_swapped_and_inputs_held() -> None:
    grid = surface(FORCE_Z, x="distance", y="eta_u", fixed={"velocity_body_z": 0.1}, num_points=4)
    other = surface(FORCE_Z, x="eta_u", y="distance", fixed={"velocity_body_z": 0.1}, num_points=4)
    np.testing.assert_array_equal(grid.values, other.values.T)
    expected = ReferenceEngine(FORCE_Z).compute(np.array([grid.y[1], 0.1, grid.x[3]]))[0]
    assert grid.values[1, 3] == pytest.approx(expected, abs=1e-13)
    assert grid.fixed == {"velocity_body_z": 0.1}
    assert surface(FORCE_Z, num_points=2).fixed == {"distance": 100.0}


def test_a_system_the_kernel_does_not_cover_has_surfaces_too() -> None:
    result = surface(ROOM, output="vent", num_points=3)
    expected = ReferenceEngine(ROOM).compute(np.array([20.0, 16.0]))[1]
    assert result.values[2, 1] == expected
    assert result.output.name == "vent"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"x": "distanse"}, "no input 'distanse'; did you mean 'distance'"),
        ({"fixed": {"speed": 1.0}}, "no input 'speed'"),
        ({"x": "distance", "y": "distance"}, "two different inputs"),
        ({"x": "distance", "fixed": {"distance": 1.0}}, "is an axis and is held"),
        ({"fixed": {"distance": 1.0}}, "two free inputs"),
        ({"output": "force_y"}, "no output 'force_y'; did you mean 'force_x'"),
    ],
)
def test_wrong_axes_are_refused_with_a_sentence(arguments: dict[str, object], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        surface(FORCE_X, **arguments)  # type: ignore[arg-type]


def of_two(a: MembershipFunction, b: MembershipFunction, maximum: float, num_points: int) -> Variable:
    return Variable("x", "", 0.0, maximum, terms(a=a, b=b), num_points)


def test_coverage_of_two_gaussians_is_their_crossing() -> None:
    result = coverage(of_two(Gaussian(0.0, 1.0), Gaussian(4.0, 1.0), 4.0, 4001))
    assert result.at == pytest.approx(2.0, abs=1e-9)
    assert result.least == pytest.approx(np.exp(-2.0), abs=1e-9)


def test_coverage_between_the_points_of_the_universe() -> None:
    """Two lines cross half way between the only two points."""
    result = coverage(of_two(Triangular(0.0, 0.0, 1.0), Triangular(0.0, 1.0, 1.0), 1.0, 2))
    assert (result.least, result.at) == (0.5, 0.5)


def test_likeness_of_triangles_has_a_closed_form() -> None:
    """Two triangles of half width 2, peaks 2 apart: they share a triangle of base 2 and height 1/2."""
    # the universe misses the crossing at 3
    result = distinguishability(of_two(Triangular(0.0, 2.0, 4.0), Triangular(2.0, 4.0, 6.0), 6.0, 4))
    np.testing.assert_allclose(result.similarity, [[1, 0.5 / 3.5], [0.5 / 3.5, 1]], rtol=0, atol=1e-15)
    np.testing.assert_allclose(result.possibility, [[1, 0.5], [0.5, 1]], rtol=0, atol=1e-15)


def test_likeness_of_gaussians_has_a_closed_form() -> None:
    """Equal Gaussians d apart cross half way: the shared area is 2 Phi(-d / 2 sigma) of one of them."""
    sigma, apart = 0.5, 1.2
    result = distinguishability(of_two(Gaussian(5.0, sigma), Gaussian(5.0 + apart, sigma), 12.0, 6001))
    shared = 1.0 - erf(apart / (2.0 * sigma) / np.sqrt(2.0))
    assert result.similarity[0, 1] == pytest.approx(shared / (2.0 - shared), abs=1e-6)
    assert result.possibility[0, 1] == pytest.approx(np.exp(-((apart / 2 / sigma) ** 2) / 2), abs=1e-6)


def test_a_term_that_is_never_above_zero_is_like_no_other() -> None:
    result = distinguishability(of_two(Gaussian(0.5, 1e-6), Gaussian(0.0, 1.0), 1.0, 2))
    np.testing.assert_array_equal(result.similarity, [[0, 0], [0, 1]])


def test_rule_usage_counts() -> None:
    strengths = np.array([[0.9, 0.1, 0.0], [0.2, 0.2, 0.0], [0.0, 0.0, 0.0], [0.04, 0.6, 0.0]])
    usage = rule_usage(strengths, threshold=0.1)
    np.testing.assert_array_equal(usage.fired, [0.5, 0.75, 0.0])
    np.testing.assert_array_equal(usage.leading, [0.5, 0.5, 0.0])
    np.testing.assert_array_equal(usage.max_strength, [0.9, 0.6, 0.0])
    with pytest.raises(ValueError, match="at least one"):
        rule_usage(np.empty((0, 3)))


@pytest.mark.parametrize("num_inputs", [1, 3, 12])
def test_spread_inputs_are_scipys_halton_sequence(num_inputs: int) -> None:
    variable = replace(FORCE_Z.inputs[0], minimum=-2.0, maximum=6.0)
    inputs = tuple(replace(variable, name=f"input_{number}") for number in range(num_inputs))
    sequence = qmc.Halton(num_inputs, scramble=False)
    sequence.fast_forward(1)
    expected = qmc.scale(sequence.random(3000), [-2.0] * num_inputs, [6.0] * num_inputs)
    samples = spread_inputs(replace(FORCE_Z, inputs=inputs), 3000)
    np.testing.assert_allclose(samples, expected, rtol=0, atol=1e-14)


MET = np.random.default_rng(1).uniform(-1.0, 1.0, (50, len(FORCE_X.inputs)))
BOX = box_of(FORCE_X, MET)


def test_the_box_holds_what_was_met_and_no_more():
    assert BOX.low == tuple(MET.min(axis=0))
    assert BOX.high == tuple(MET.max(axis=0))
    assert BOX.num_samples == 50
    assert not BOX.beyond(MET).any()
    just = np.array(BOX.high)
    just[1] = np.nextafter(just[1], np.inf)
    assert (BOX.beyond(just[np.newaxis]) > 0.0).tolist() == [[False, True] + [False] * (len(just) - 2)]


def test_each_stretch_outside_is_a_departure_with_its_farthest_value():
    inputs = np.zeros((8, len(FORCE_X.inputs)))
    inputs[2:5, 0] = [1.5, 3.0, 2.0]
    inputs[7, 0] = -4.0
    inputs[0, 1] = 9.0
    left = departures(BOX, 10.0 * np.arange(8), inputs)
    names = [variable.name for variable in FORCE_X.inputs]
    expected = [(names[1], 0.0, 0.0, 9.0), (names[0], 20.0, 40.0, 3.0), (names[0], 70.0, 70.0, -4.0)]
    assert [
        (departure.name, departure.first_s, departure.last_s, departure.value) for departure in left
    ] == expected
    assert (left[1].low, left[1].high) == (BOX.low[0], BOX.high[0])
    assert departures(BOX, np.empty(0), np.empty((0, len(names)))) == ()


def test_a_domain_is_what_its_file_says():
    mapping = json.loads(json.dumps(as_mapping([BOX])))
    assert from_mapping(mapping, "domain.json") == (BOX,)


@pytest.mark.parametrize(
    "mapping",
    [
        {},
        [],
        {"schema": "operational-domain", "schema_version": 2},
        None,
        as_mapping([replace(BOX, low=(math.nan, *BOX.low[1:]))]),
        as_mapping([replace(BOX, low=BOX.high, high=BOX.low)]),
        as_mapping([replace(BOX, high=(10**400, *BOX.high[1:]))]),
    ],
)
def test_something_else_is_refused(mapping):
    with pytest.raises(ControllerFileError, match=r"that\.json holds no operational domain"):
        from_mapping(mapping, "that.json")


ADDING_ROOM = replace(ROOM, outputs=tuple(replace(v, accumulation="bounded_sum") for v in ROOM.outputs))


@pytest.mark.parametrize("system", [FORCE_X, ROOM, ADDING_ROOM])
def test_a_contribution_is_what_silencing_the_rule_takes_away(system: FuzzySystem) -> None:
    inputs = spread_inputs(system, 20)
    result = contributions(compile(system), inputs)
    outputs = step_by_step.evaluate(system, inputs)
    assert result.shape == (20, len(system.rules), len(system.outputs))
    for index in range(len(system.rules)):
        expected = outputs - step_by_step.evaluate(silenced(system, {index}), inputs)
        np.testing.assert_allclose(result[:, index], expected, rtol=0, atol=1e-14)
    assert np.count_nonzero(result) > 20


def test_importance_by_hand() -> None:
    result = importance(compile(ramp_system()), np.array([[0.0], [0.5], [1.0]]))
    np.testing.assert_allclose(result, [[6.5 / 3 / 10], [5.5 / 3 / 10]], rtol=0, atol=1e-15)


def test_many_samples_come_out_as_few_do() -> None:
    compiled = compile(FORCE_Z)
    inputs = spread_inputs(FORCE_Z, 1500)
    whole = contributions(compiled, inputs)
    np.testing.assert_array_equal(whole[700:720], contributions(compiled, inputs[700:720]))


def test_importance_needs_samples() -> None:
    with pytest.raises(ValueError, match="there are no samples"):
        importance(compile(ramp_system()), np.empty((0, 1)))


def even_terms(names: tuple[str, ...], low: float, high: float) -> tuple[Term, ...]:
    """Triangles that peak evenly from end to end and fall to zero where their neighbours peak."""
    peaks = np.linspace(low, high, len(names))
    step = peaks[1] - peaks[0]
    return tuple(
        Term(name, Triangular(max(low, peak - step), peak, min(high, peak + step)))
        for name, peak in zip(names, peaks.tolist(), strict=True)
    )


THREE = ("low", "medium", "high")
X = Variable("x", "", 0.0, 1.0, even_terms(THREE, 0.0, 1.0))
Y = Variable("y", "", 0.0, 8.0, even_terms(THREE, 0.0, 8.0))
Z = Variable("z", "", 0.0, 1.0, even_terms(THREE, 0.0, 1.0), default=0.0)


def product_of(x: Variable, y: Variable, rules: tuple[Rule, ...], **how: object) -> FuzzySystem:
    return FuzzySystem("s", (x, y), (Z,), rules, **how)  # type: ignore[arg-type]


def concluding(term: str, *antecedents: Expression) -> tuple[Rule, ...]:
    return tuple(Rule(antecedent, (Consequent("z", term),)) for antecedent in antecedents)


def test_complexity_is_counted_by_hand() -> None:
    counted = complexity(ROOM)
    # cold and (calm or not hot); hot
    assert (counted.rules, counted.premises, counted.input_terms, counted.output_terms) == (2, 4, 3, 3)
    assert complexity(FORCE_X).premises == 50


def test_centres_of_every_shape() -> None:
    points = (0.0, 1.0, 2.0, 3.0, 4.0, 5.0)
    sampled = Term("t", Sampled((0.0, 0.8, 0.8, 0.6, 0.2, 0.0)))
    variable = Variable("x", "", 0.0, 5.0, (sampled,), 6, points=points)
    assert centre(variable, sampled) == 1.5
    term = Term("t", Trapezoidal(0.0, 2.0, 4.0, 5.0))
    assert centre(variable, term) == 3.0


def test_completeness_of_a_full_table_is_where_both_inputs_are_worst() -> None:
    """Even triangles hold by one half between two peaks, so min gives 1/2 and the product 1/4."""
    rules = table_rules((X, Y), Z, ["low"] * 9)
    for operator, least in (("min", 0.5), ("product", 0.25)):
        result = completeness(product_of(X, Y, rules, and_operator=operator))
        assert result.is_exact
        assert result.least == pytest.approx(least, abs=1e-12)
        assert result.at[0] % 0.5 == pytest.approx(0.25)


def test_completeness_finds_the_missing_rule() -> None:
    rules = table_rules((X, Y), Z, ["low"] * 9)
    result = completeness(product_of(X, Y, rules[:4] + rules[5:]))
    assert result.is_exact
    assert result.least == pytest.approx(0.0, abs=1e-12)
    np.testing.assert_allclose(result.at, [0.5, 4.0], atol=1e-12)
    by_product = completeness(product_of(X, Y, rules[:4] + rules[5:], and_operator="product"))
    assert by_product.least == pytest.approx(0.0, abs=1e-12)


@st.composite
def small_systems(draw: st.DrawFn) -> FuzzySystem:
    """Two inputs of few points, rules of and, or and not."""

    def variable(name: str) -> Variable:
        values = st.lists(st.integers(0, 4), min_size=5, max_size=5)
        terms = tuple(Term(term, Sampled(tuple(v / 4 for v in draw(values)))) for term in "ab")
        return Variable(name, "", 0.0, 4.0, terms, 5)

    statement = st.builds(Is, st.sampled_from("xy"), st.sampled_from("ab"))
    either = st.one_of(statement, st.builds(Not, statement))
    pair = st.tuples(either, either)
    antecedent = st.one_of(either, st.builds(And, pair), st.builds(Or, pair))
    rules = draw(st.lists(antecedent, min_size=1, max_size=3))
    return product_of(variable("x"), variable("y"), concluding("low", *rules))


@settings(max_examples=60, deadline=None)
@given(small_systems())
def test_an_exact_completeness_is_below_a_dense_grid_and_is_met(system: FuzzySystem) -> None:
    result = completeness(system)
    assert result.is_exact
    dense = np.linspace(0.0, 4.0, 97)
    grid = np.stack([part.ravel() for part in np.meshgrid(dense, dense)], axis=1)
    assert result.least <= compile(system).firing_strengths(grid).max(axis=1).min() + 1e-12
    assert step_by_step.firing_strengths(system, result.at[np.newaxis]).max() == pytest.approx(
        result.least, abs=1e-12
    )


def test_rules_of_even_triangles_are_fully_meant() -> None:
    """At its cell only one rule fires, so the system answers what the rule alone would."""
    system = FuzzySystem("s", (X, Y), (Z,), table_rules((X, Y), Z, list(THREE) * 3))
    result = rule_consistency(system)
    np.testing.assert_allclose(result.values, 1.0, atol=1e-9)
    np.testing.assert_allclose(result.points[5], [0.5, 8.0])
    # half a triangle from 1/2 to 1, the centre of which lies a third of the way from its higher end
    assert result.outputs[5, 0] == pytest.approx(1.0 - 0.5 / 3, abs=1e-12)
    assert result.index == pytest.approx(1.0)


def test_samples_are_said_to_be_samples() -> None:
    """The product of three rules of one input is weakest off the grid of their crossings."""
    antecedents = (And((Is("x", "low"), Not(Is("y", "low")))), Is("x", "high"), Is("x", "medium"))
    rules = concluding("low", *antecedents)
    result = completeness(product_of(X, Y, rules, and_operator="product"))
    assert result.least == pytest.approx(0.0, abs=1e-12)
    rules = concluding("low", *antecedents, Is("x", "low"))
    result = completeness(product_of(X, Y, rules, and_operator="product"))
    assert not result.is_exact
    assert result.least == pytest.approx(0.5, abs=1e-12)


def lowest(system: FuzzySystem) -> float:
    """How strongly the strongest rule fires where it is weakest, on a dense line along x."""
    along = np.stack([np.linspace(0.0, 10.0, 20_001), np.full(20_001, 5.0)], axis=1)
    return float(compile(system).firing_strengths(along).max(axis=1).min())


def test_hedged_terms_cross_where_they_are_hedged() -> None:
    x = Variable("x", "", 0.0, 10.0, even_terms(("low", "high"), 0.0, 10.0), 11)
    system = product_of(x, Y, concluding("low", Is("x", "low"), Hedged("somewhat", Is("x", "high"))))
    result = completeness(system)
    assert not result.is_exact
    assert result.least == pytest.approx(lowest(system), abs=1e-3)
    assert result.least > 0.6  # both hold by one half where the terms cross


def test_a_gap_between_the_points_of_a_universe_is_found_where_memberships_are_formulas() -> None:
    corners = {"low": (-1.0, 0.0, 2.0, 4.3), "medium": (4.7, 6.0, 6.5, 7.8), "high": (7.5, 10.0, 11.0, 12.0)}
    terms = tuple(Term(name, Trapezoidal(*numbers)) for name, numbers in corners.items())
    rules = concluding("low", *(Is("x", name) for name in corners))
    system = product_of(Variable("x", "", 0.0, 10.0, terms, 6), Y, rules, semantics="matlab")
    result = completeness(system)
    assert result.least == lowest(system) == 0.0
    assert 4.3 <= result.at[0] <= 4.7
    held = replace(system, inputs=(replace(system.inputs[0], terms=even_terms(THREE, 0.0, 10.0)), Y))
    held = replace(held, rules=concluding("low", *(Is("x", name) for name in THREE)))
    assert not completeness(held).is_exact


def test_a_rule_that_is_outvoted_means_little() -> None:
    """Two rules hold in full at x = 0, on low and on high: the answer 1/2 is neither."""
    x = Variable("x", "", 0.0, 1.0, even_terms(("low", "high"), 0.0, 1.0))
    rules = concluding("low", Is("x", "low")) + concluding("high", Not(Is("x", "high")))
    rules += concluding("medium", Is("x", "high"))
    result = rule_consistency(FuzzySystem("s", (x,), (Z,), rules))
    np.testing.assert_allclose(result.values, [0.0, 0.0, 1.0], atol=1e-9)
    np.testing.assert_allclose(result.outputs[:, 0], 0.5, atol=1e-12)
    np.testing.assert_allclose(result.alone[:, 0], [1 / 6, 5 / 6, 0.5], atol=1e-9)
