"""The steps of an inference against what can be worked out by hand."""

from dataclasses import replace
from typing import Any

import numpy as np
import pyarrow as pa
import pytest

from fis_tools.engines import inference, interpreter
from fis_tools.engines.compiler import NoRuleFired, compile
from fis_tools.engines.inference import infer
from fis_tools.model import Gaussian, Triangular, Variable
from fis_tools.model.systems import And, Consequent, Expression, FuzzySystem, Is, Not, Or, Rule, table_rules
from tests.fis_tools import step_by_step
from tests.fis_tools.sample_controllers import terms

SIDES = terms(left=Triangular(0.0, 0.0, 10.0), right=Triangular(0.0, 10.0, 10.0))
INPUTS = (Variable("a", "", 0.0, 10.0, SIDES, 2), Variable("b", "", 0.0, 10.0, SIDES, 2))
OUTPUT = Variable("y", "", 0.0, 10.0, SIDES, 2, default=-7.0)


def one_rule(antecedent: Expression, weight: float = 1.0, term: str = "left") -> FuzzySystem:
    return FuzzySystem("one", INPUTS, (OUTPUT,), (Rule(antecedent, (Consequent("y", term, weight),)),))


@pytest.mark.parametrize(
    ("antecedent", "by_min_max", "by_product"),
    [
        (Is("a", "left"), 0.8, 0.8),
        (Not(Is("a", "left")), 0.2, 0.2),
        (And((Is("a", "left"), Is("b", "right"))), 0.5, 0.4),
        (Or((Is("a", "left"), Is("b", "right"))), 0.8, 0.9),
        (And((Is("a", "left"), Not(Or((Is("a", "right"), Is("b", "right")))))), 0.5, 0.32),
    ],
)
def test_firing_strengths_by_hand(antecedent: Expression, by_min_max: float, by_product: float) -> None:
    """With a = 2 and b = 5 the memberships are 0.8, 0.2 and 0.5, 0.5."""
    system = one_rule(antecedent)
    inputs = np.array([2.0, 5.0])
    step = infer(system, inputs)
    np.testing.assert_allclose(step.memberships[0], [0.8, 0.2], rtol=0, atol=1e-15)
    assert step.firing_strengths[0] == pytest.approx(by_min_max, abs=1e-15)
    system = replace(system, and_operator="product", or_operator="probabilistic_sum")
    assert infer(system, inputs).firing_strengths[0] == pytest.approx(by_product, abs=1e-15)


def test_a_clipped_triangle_has_the_centre_geometry_gives() -> None:
    """``1 - x/10`` cut at 1/2: a rectangle of 5 x 1/2 and a triangle of 5 x 1/2 beside it."""
    step = infer(one_rule(Is("a", "left")), np.array([5.0, 0.0]))
    (output,) = step.outputs
    np.testing.assert_array_equal(output.universe, [0.0, 5.0, 10.0])
    np.testing.assert_array_equal(output.aggregated, [0.5, 0.5, 0.0])
    expected = (2.5 * 2.5 + 1.25 * (5.0 + 5.0 / 3.0)) / 3.75
    assert output.value == pytest.approx(expected, abs=1e-14)
    assert not output.is_default


def test_terms_nobody_concludes_have_no_cut_and_weights_lessen_it() -> None:
    step = infer(one_rule(Is("a", "left"), 0.5, "right"), np.array([0.0, 9.0]))
    np.testing.assert_allclose(step.outputs[0].cuts, [np.nan, 0.5], rtol=0, atol=1e-15)
    np.testing.assert_allclose(step.firing_strengths, [1.0], rtol=0, atol=1e-15)


def test_inputs_are_clipped_and_kept_as_given() -> None:
    step = infer(one_rule(Is("a", "left")), np.array([-3.0, np.inf]))
    np.testing.assert_array_equal(step.inputs, [-3.0, np.inf])
    np.testing.assert_array_equal(step.clipped, [0.0, 10.0])
    np.testing.assert_array_equal(step.memberships, [[1.0, 0.0], [0.0, 1.0]])


def system(base: float = 0.0, width: float = 30.0) -> FuzzySystem:
    """Two inputs that differ in meaning, with a gap between two terms, where no rule fires."""
    gap = terms(low=Triangular(0.0, 0.0, 4.0), high=Triangular(6.0, 10.0, 10.0))
    tastes = terms(bad=Gaussian(0.0, 4.0), good=Gaussian(10.0, 4.0))
    amounts = terms(
        small=Gaussian(base + 0.2 * width, width / 4), large=Gaussian(base + 0.9 * width, width / 4)
    )
    inputs = (Variable("service", "", 0.0, 10.0, gap), Variable("food", "", 0.0, 10.0, tastes))
    output = Variable("tip", "", base, base + width, amounts, default=base + width / 2)
    rules = table_rules(inputs, output, ["small", "large", "small", "large"])
    return FuzzySystem("tipper", inputs, (output,), rules)


SERVICE, FOOD = np.array([1.0, 9.0, 5.0]), np.array([8.0, 2.0, 3.0])


def tables() -> list[Any]:
    """The same samples by name, with the columns the other way round and one besides."""
    structured = np.zeros(3, dtype=[("food", float), ("time", float), ("service", float)])
    structured["service"], structured["food"] = SERVICE, FOOD
    return [pa.table({"food": FOOD, "time": np.zeros(3), "service": SERVICE}), structured]


@pytest.mark.parametrize("table", tables(), ids=["data frame", "structured array"])
def test_columns_go_by_their_names(table: Any) -> None:
    tip = compile(system())
    by_place = np.stack([SERVICE, FOOD], axis=1)
    expected = tip(by_place)
    assert abs(expected[0, 0] - tip(by_place[:, ::-1])[0, 0]) > 1.0
    np.testing.assert_array_equal(tip(table)["tip"], expected[:, 0])
    np.testing.assert_array_equal(tip.firing_strengths(table), tip.firing_strengths(by_place))
    by_name, by_column = (step_by_step.evaluate(system(), one) for one in (table, by_place))
    np.testing.assert_array_equal(by_name, by_column)
    named = inference.infer(system(), {"food": 8.0, "service": 1.0})
    np.testing.assert_array_equal(named.values, inference.infer(system(), np.array([1.0, 8.0])).values)


def test_a_table_without_an_input_is_refused() -> None:
    with pytest.raises(ValueError, match="column 'service' is missing; pass service, food"):
        compile(system())(pa.table({"food": FOOD, "0": SERVICE}))


def test_answers_tell_where_no_rule_fires() -> None:
    tip = compile(system())
    answers = tip.infer({"service": SERVICE, "food": FOOD})
    np.testing.assert_array_equal(answers.no_rule_fired["tip"], [False, False, True])
    assert answers.count == {"tip": 1}
    assert answers.outputs["tip"][2] == 15.0
    rows = np.stack([SERVICE, FOOD], axis=1)
    np.testing.assert_array_equal(np.isnan(tip(rows, on_no_fire="nan")[:, 0]), [False, False, True])
    with pytest.raises(NoRuleFired, match=r"'tip' fires at 1 of 3 samples, first at number 2 \(service 5"):
        tip(rows, on_no_fire="raise")
    np.testing.assert_array_equal(tip(rows[:2], on_no_fire="raise"), tip(rows[:2]))


@pytest.mark.parametrize("width", [1.0, 365.0])
def test_outputs_far_from_zero_are_scikit_fuzzys(width: float) -> None:
    julian = system(2.46e6, width)
    rows = np.random.default_rng(15).uniform(0.0, 10.0, (50, 2))
    compiled = compile(julian)
    plain = interpreter.evaluate(compiled.program, rows)
    assert np.abs(compiled(rows) - plain).max() <= 1e-12 * width
    np.testing.assert_array_equal(plain, step_by_step.evaluate(julian, rows))
    assert np.ptp(plain) > 0.2 * width
