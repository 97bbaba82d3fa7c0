"""The steps of an inference by hand; compiled systems: by scikit-fuzzy, and what they accept and refuse."""

from dataclasses import replace
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
import skfuzzy
from skfuzzy import control

from fis_tools.engines import compiler, interpreter
from fis_tools.engines.compiler import NoRuleFired, compile
from fis_tools.engines.inference import infer
from fis_tools.model import Gaussian, Triangular, Variable
from fis_tools.model.expressions import And, Expression, Is, Not, Or
from fis_tools.model.systems import Consequent, FuzzySystem, Rule
from fis_tools.model.validate import InvalidSystem
from fis_tools.scikit_fuzzy.read import UnreadableControlSystem
from tests.fis_tools import step_by_step
from tests.fis_tools.sample_controllers import FORCE_X, ROOM, table_system, terms

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
    small, large = (Gaussian(base + share * width, width / 4) for share in (0.2, 0.9))
    amounts = terms(small=small, large=large)
    inputs = (Variable("service", "", 0.0, 10.0, gap), Variable("food", "", 0.0, 10.0, tastes))
    output = Variable("tip", "", base, base + width, amounts, default=base + width / 2)
    return table_system("tipper", inputs, output, ["small", "large"] * 2)


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
    by_name, by_column = (step_by_step.evaluate(system(), columns) for columns in (table, by_place))
    np.testing.assert_array_equal(by_name, by_column)
    named = infer(system(), {"food": 8.0, "service": 1.0})
    np.testing.assert_array_equal(named.values, infer(system(), np.array([1.0, 8.0])).values)


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


def test_control_systems_take_a_default_for_when_no_rule_fires():
    x, y = control.Antecedent(np.linspace(0, 1, 11), "x"), control.Consequent(np.linspace(2, 3, 11), "y")
    x["high"], y["high"] = skfuzzy.trimf(x.universe, [0.5, 1, 1]), skfuzzy.trimf(y.universe, [2, 3, 3])
    system = control.ControlSystem([control.Rule(x["high"], y["high"])])
    inputs = np.array([[0.2], [1.0]])
    assert compile(system)(inputs)[0, 0] == 2.0  # the end of the universe that is nearest to zero
    outputs = compile(system, defaults={"y": 2.25})(inputs)
    assert outputs[0, 0] == 2.25
    assert outputs[1, 0] == pytest.approx(2.0 + 2.0 / 3.0, abs=1e-15)


def test_a_chain_of_rules_is_computed_as_scikit_fuzzy_does():
    """Two rules raise a term that a third asks for, and one raises a term after it was asked for."""
    universe = np.linspace(0, 1, 11)
    x, w = control.Antecedent(universe, "x"), control.Antecedent(universe, "w")
    y, z = control.Consequent(universe, "y"), control.Consequent(universe, "z")
    for variable in (x, w, y, z):
        variable["off"], variable["on"] = (skfuzzy.trimf(universe, p) for p in ([0, 0, 0.8], [0.2, 1, 1]))
    rules = [
        control.Rule(x["on"] & w["on"], y["on"]),
        control.Rule(y["on"] & ~w["off"], z["on"]),
        control.Rule(w["on"], y["on"]),
        control.Rule(x["off"], y["off"]),
        control.Rule(w["off"], y["off"]),
        control.Rule(y["off"], z["off"]),
    ]
    source = control.ControlSystem(rules)
    inputs = np.random.default_rng(3).uniform(0, 1, (20, 2))
    answers = compile(source)({"x": inputs[:, 0], "w": inputs[:, 1]})
    for index, (first, second) in enumerate(inputs):
        simulation = control.ControlSystemSimulation(source)
        simulation.input["x"], simulation.input["w"] = first, second
        simulation.compute()
        for name in ("y", "z"):
            assert answers[name][index] == simulation.output[name]
    assert np.ptp(answers["z"]) > 0.2


def test_anything_else_is_refused():
    with pytest.raises(UnreadableControlSystem, match="pass a scikit-fuzzy ControlSystem"):
        compile("controller.yaml")
    with pytest.raises(ValueError, match="declare them in the outputs"):
        compile(FORCE_X, defaults={"force_x": 1.0})
    with pytest.raises(InvalidSystem, match="has no inputs"):
        compile(FuzzySystem("broken", (), (), ()))


def test_mappings_come_back_as_mappings_of_the_same_shape():
    room = compile(ROOM)
    temperatures = np.linspace(-5.0, 45.0, 6).reshape(2, 3)
    outputs = room({"wind": 3.0, "temperature": temperatures})
    rows = np.stack([temperatures.ravel(), np.full(6, 3.0)], axis=1)
    assert list(outputs) == ["heat", "vent"]
    np.testing.assert_array_equal(outputs["vent"], room(rows)[:, 1].reshape(2, 3))
    assert room({"wind": 3.0, "temperature": 20})["heat"].shape == ()


def test_values_out_of_range_and_infinite_ones_are_clipped():
    for compiled in (compile(ROOM), compile(FORCE_X)):
        (a, c), (b, d) = step_by_step.ends(compiled.system)
        beyond = compiled(np.array([[-np.inf, np.inf], [b + 7.0, c - 7.0]]))
        np.testing.assert_array_equal(beyond, compiled(np.array([[a, d], [b, c]])))


@pytest.mark.parametrize("system", [FORCE_X, ROOM])
def test_nan_and_wrong_shapes_are_refused(system):
    compiled = compile(system)
    with pytest.raises(ValueError, match="an input is NaN"):
        compiled(np.array([[1.0, np.nan]]))
    for wrong in (np.zeros(2), np.zeros((3, 1)), np.zeros((1, 2, 2))):
        with pytest.raises(ValueError, match="a row a sample"):
            compiled(wrong)
        with pytest.raises(ValueError, match="a row a sample"):
            compiled.firing_strengths(wrong)
    with pytest.raises(ValueError, match="one for each rule"):
        compiled.conclude(np.zeros((1, 99)))
    with pytest.raises(ValueError, match="a firing strength is NaN"):
        compiled.conclude(np.full((1, len(compiled.system.rules)), np.nan))


def test_names_that_are_missing_or_unknown_are_told():
    with pytest.raises(ValueError, match="no input 'temprature'; did you mean 'temperature'"):
        compile(ROOM)({"temprature": 3.0, "wind": 1.0})
    with pytest.raises(ValueError, match="input 'wind' is missing; pass temperature, wind"):
        compile(ROOM)({"temperature": 3.0})


def test_no_samples_are_no_mistake():
    for compiled in (compile(ROOM), compile(FORCE_X)):
        assert compiled(np.empty((0, 2))).shape == (0, len(compiled.system.outputs))
        assert compiled.firing_strengths(np.empty((0, 2))).shape == (0, len(compiled.system.rules))


@pytest.mark.parametrize("system", [FORCE_X, ROOM])
def test_threads_change_nothing(system, monkeypatch):
    monkeypatch.setattr(compiler, "SAMPLES_A_THREAD", 100)
    rows = np.random.default_rng(2).uniform(*step_by_step.ends(system), (1003, len(system.inputs)))
    alone, together = compile(system, threads=1), compile(system, threads=3)
    np.testing.assert_array_equal(alone(rows), together(rows))
    firing = alone.firing_strengths(rows)
    np.testing.assert_array_equal(alone.conclude(firing), together.conclude(firing))
    np.testing.assert_array_equal(alone.conclude(firing), interpreter.evaluate(alone.program, rows))


def test_rows_with_nan_are_an_error_or_nan_by_choice():
    compiled = compile(FORCE_X)
    low, high = step_by_step.ends(FORCE_X)
    rows = np.array([low, 0.5 * (low + high), high])
    expected = compiled(rows)
    rows[1, 0] = np.nan
    with pytest.raises(ValueError, match="on_nan='nan'"):
        compiled(rows)
    outputs = compiled(rows, on_nan="nan")
    np.testing.assert_array_equal(outputs[[0, 2]], expected[[0, 2]])
    assert np.isnan(outputs[1]).all()
    by_name = compiled({v.name: rows[:, n] for n, v in enumerate(FORCE_X.inputs)}, on_nan="nan")
    np.testing.assert_array_equal(by_name[FORCE_X.outputs[0].name], outputs[:, 0])
    assert not compiled.infer(rows, on_nan="nan").no_rule_fired.any()
    with pytest.raises(ValueError, match="on_nan is 'drop'"):
        compiled(rows, on_nan="drop")
