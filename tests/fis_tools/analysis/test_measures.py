"""Indices against closed forms and counts by hand."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fis_tools.analysis.measures import centre, completeness, complexity, rule_consistency
from fis_tools.engines.compiler import compile
from fis_tools.model import (
    And,
    Consequent,
    Expression,
    FuzzySystem,
    Is,
    Not,
    Or,
    Rule,
    Term,
    Variable,
    table_rules,
)
from fis_tools.model.shapes import Sampled, Trapezoidal, Triangular
from tests.fis_tools.sample_controllers import FORCE_X, ROOM
from tests.fis_tools.step_by_step import firing_strengths


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


def concluding(term: str, *asked: Expression) -> tuple[Rule, ...]:
    return tuple(Rule(one, (Consequent("z", term),)) for one in asked)


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
        found = completeness(product_of(X, Y, rules, and_operator=operator))
        assert found.is_exact
        assert found.least == pytest.approx(least, abs=1e-12)
        assert found.at[0] % 0.5 == pytest.approx(0.25)


def test_completeness_finds_the_missing_rule() -> None:
    rules = table_rules((X, Y), Z, ["low"] * 9)
    found = completeness(product_of(X, Y, rules[:4] + rules[5:]))
    assert found.is_exact
    assert found.least == pytest.approx(0.0, abs=1e-12)
    np.testing.assert_allclose(found.at, [0.5, 4.0], atol=1e-12)
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
    found = completeness(system)
    assert found.is_exact
    dense = np.linspace(0.0, 4.0, 97)
    grid = np.stack([part.ravel() for part in np.meshgrid(dense, dense)], axis=1)
    assert found.least <= compile(system).firing_strengths(grid).max(axis=1).min() + 1e-12
    assert firing_strengths(system, found.at[np.newaxis]).max() == pytest.approx(found.least, abs=1e-12)


def test_rules_of_even_triangles_are_fully_meant() -> None:
    """At its cell only one rule fires, so the system answers what the rule alone would."""
    system = FuzzySystem("s", (X, Y), (Z,), table_rules((X, Y), Z, list(THREE) * 3))
    found = rule_consistency(system)
    np.testing.assert_allclose(found.values, 1.0, atol=1e-9)
    np.testing.assert_allclose(found.points[5], [0.5, 8.0])
    # half a triangle from 1/2 to 1, the centre of which lies a third of the way from its higher end
    assert found.outputs[5, 0] == pytest.approx(1.0 - 0.5 / 3, abs=1e-12)
    assert found.index == pytest.approx(1.0)


def test_samples_are_said_to_be_samples() -> None:
    """The product of three rules of one input is weakest off the grid of their crossings."""
    told = (And((Is("x", "low"), Not(Is("y", "low")))), Is("x", "high"), Is("x", "medium"))
    rules = concluding("low", *told)
    found = completeness(product_of(X, Y, rules, and_operator="product"))
    assert found.least == pytest.approx(0.0, abs=1e-12)
    rules = concluding("low", *told, Is("x", "low"))
    found = completeness(product_of(X, Y, rules, and_operator="product"))
    assert not found.is_exact
    assert found.least == pytest.approx(0.5, abs=1e-12)


def test_a_rule_that_is_outvoted_means_little() -> None:
    """Two rules hold in full at x = 0, on low and on high: the answer 1/2 is neither."""
    x = Variable("x", "", 0.0, 1.0, even_terms(("low", "high"), 0.0, 1.0))
    rules = concluding("low", Is("x", "low")) + concluding("high", Not(Is("x", "high")))
    rules += concluding("medium", Is("x", "high"))
    found = rule_consistency(FuzzySystem("s", (x,), (Z,), rules))
    np.testing.assert_allclose(found.values, [0.0, 0.0, 1.0], atol=1e-9)
    np.testing.assert_allclose(found.outputs[:, 0], 0.5, atol=1e-12)
    np.testing.assert_allclose(found.alone[:, 0], [1 / 6, 5 / 6, 0.5], atol=1e-9)
