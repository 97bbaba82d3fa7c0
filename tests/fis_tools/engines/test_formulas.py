"""Numbers that rules conclude by formulas: parsed, alike in all engines, refused where they cannot be."""

from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from benchmarks.by_hand import work_out
from fis_tools.analysis.shapley import shares
from fis_tools.engines import inference, interpreter, interval
from fis_tools.engines.compiler import compile
from fis_tools.engines.program import assemble
from fis_tools.formats import serialize
from fis_tools.formats.c import source
from fis_tools.formats.exchange import fll
from fis_tools.model import Consequent, FuzzyController, FuzzySystem, Is, Rule, Triangular, Variable
from fis_tools.model.numbers import Constant, Formula, Linear, NotAFormula, parse
from fis_tools.model.operators import AGGREGATIONS, AND_OPERATORS, HEDGES
from fis_tools.model.validate import problems
from tests.fis_tools import step_by_step
from tests.fis_tools.engines.random_systems import hedged, inputs_for, otherwise, random_general_system
from tests.fis_tools.sample_controllers import terms
from tests.places import PROJECT

#: fuzzylite's example of an approximation, in few words
FLL = (Path(__file__).parent / "near.fll").read_text(encoding="utf-8")
ROWS = np.array([[2.0, 0.3], [9.5, -0.9], [10.0, 0.5], [7.0, 1.0]])


(NEAR,) = serialize.loads(FLL, "fll").systems


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("2 + 3 * 4 ^ 2 / 8 - 1", 7.0),
        ("2 ** 3 ** 2", 512.0),
        ("-a ^ 2", -9.0),
        ("~a ^ 2", 9.0),
        ("-(-a) % 2", 1.0),
        ("pow(a, 2) + atan2(0, 1) * sqrt(16.) + min(1e1, .5)", 9.5),
        ("b / (a - 3)", np.inf),
    ],
)
def test_formulas_come_to_what_they_do_by_hand(text: str, value: float) -> None:
    assert Formula(text).value({"a": np.float64(3.0), "b": np.float64(1.0)}) == value
    assert Formula(parse(text).text({"a": "a", "b": "b"})).value({"a": 3.0, "b": 1.0}) == value  # type: ignore[dict-item]


NO_FORMULAS = ["", "a b", "sin x", "sin(x", "pow(1)", "1 +", "__import__('os')", "a.b", "a[0]"]


@pytest.mark.parametrize("text", [*NO_FORMULAS, "(" * 90, "-" * 900, "a" + "+a" * 499])
def test_what_is_no_formula_is_refused(text: str) -> None:
    with pytest.raises(NotAFormula):
        parse(text)


def test_all_engines_agree_about_formulas_of_inputs_and_outputs() -> None:
    assert isinstance(NEAR.outputs[0].terms[0].membership, Constant)
    assert NEAR.outputs[0].terms[1].membership == Linear((0.5, -1.0), -1.0)
    assert problems(NEAR) == []
    compiled = compile(NEAR)
    outputs = compiled(ROWS)
    x, y = ROWS.T
    exact = np.sin(x) / x + np.fmax(y, -0.5) ** 2
    np.testing.assert_allclose(outputs[:, 1], exact, rtol=1e-15)
    np.testing.assert_allclose(outputs[:, 2], np.abs(outputs[:, 0] - exact), rtol=1e-14)
    np.testing.assert_allclose(outputs, step_by_step.evaluate(NEAR, ROWS), rtol=1e-14)
    np.testing.assert_array_equal([compiled.prepare()(*row) for row in ROWS], outputs)
    parts = shares(compiled, ROWS).values.sum(axis=1)
    np.testing.assert_allclose(parts, outputs, atol=1e-12)


def test_a_value_is_held_where_no_rule_fires() -> None:
    """pyfuzzylite's `lock_previous` on a batch does the same."""
    answers = compile(NEAR).infer(ROWS, on_no_fire="hold")
    assert answers.no_rule_fired.tolist() == [[row == 2, False, False] for row in range(4)]
    assert answers.outputs[2, 0] == answers.outputs[1, 0]
    assert compile(NEAR).infer(ROWS[2:], on_no_fire="hold").outputs[0, 0] == 0.0
    notes = serialize.reads(FLL, "fll").assumptions
    assert any("rough keeps its last value where no rule fires" in sentence for sentence in notes)


def test_files_hold_formulas_with_the_names_that_they_write() -> None:
    second = replace(NEAR.inputs[1], name="the y")
    formula = replace(NEAR.outputs[1].terms[0], membership=Formula("sin(x) / x"))
    outputs = (NEAR.outputs[0], replace(NEAR.outputs[1], terms=(formula,)), NEAR.outputs[2])
    named = FuzzyController("near", (replace(NEAR, inputs=(NEAR.inputs[0], second), outputs=outputs),))
    assert serialize.loads(serialize.dump_json(named), "json") == named
    assert serialize.loads(fll.write(named).text, "fll") == named


def test_what_cannot_take_formulas_says_so() -> None:
    with pytest.raises(ValueError, match="C is written for numbers linear in the inputs"):
        source.write(FuzzyController("near", (NEAR,)))
    with pytest.raises(interval.NotBounded, match="bounds are for numbers linear in the inputs"):
        interval.pack(NEAR)
    swapped = replace(NEAR, outputs=(NEAR.outputs[2], *NEAR.outputs[:2]))
    assert any("'rough', no input and no output before this one" in notes for notes in problems(swapped))
    with pytest.raises(serialize.ControllerFileError, match="line 20: the formula 'gamma"):
        serialize.loads(FLL.replace("sin (", "gamma (", 1), "fll")


@pytest.mark.parametrize("name", ["champion_27", "champion_27_fixed_sun", "champion_81"])
def test_readable_champions_answer_as_by_hand(name: str) -> None:
    generator = np.random.default_rng(27)
    for system in serialize.load(PROJECT / "conf" / "controller" / f"{name}.yaml").systems:
        reaches = np.array([variable.maximum for variable in system.inputs])
        inputs = generator.uniform(-1.2, 1.2, (200, len(reaches))) * reaches
        by_hand = [work_out(system, row).force for row in inputs.tolist()]
        reach = system.outputs[0].maximum
        # the grid of 101 points cuts corners between its points
        np.testing.assert_allclose(compile(system)(inputs)[:, 0], by_hand, rtol=0, atol=2e-3 * reach)


@pytest.mark.parametrize(
    ("hedge", "quarter", "most"),
    [
        ("very", 0.0625, 0.6724),
        ("somewhat", 0.5, 0.9055385138137417),
        ("extremely", 0.015625, 0.551368),
        ("intensely", 0.125, 0.9352),
        ("seldom", 0.3535533905932738, 0.7),
    ],
)
def test_degrees_are_those_of_the_standard(hedge: str, quarter: float, most: float) -> None:
    """IEEE 1855, annex A, at 0.25 and 0.82 by hand; 0 and 1 stay, and so they do but for rounding."""
    change = HEDGES[hedge]  # type: ignore[index]
    degrees = change(np.array([0.0, 0.25, 0.82, 1.0]))
    np.testing.assert_allclose(degrees, [0.0, quarter, most, 1.0], rtol=0, atol=1e-15)
    grown = change(np.linspace(0.0, 1.0, 1001))
    assert np.all(np.diff(grown) > 0.0)
    assert not np.isnan(change(np.array([-1e-16, 1.0 + 1e-15]))).any()


def assert_as_defined(found: np.ndarray, system: FuzzySystem, rows: np.ndarray) -> None:
    """The step-by-step inference gives the same, of a system without faults."""
    assert problems(system) == []
    with np.errstate(all="ignore"):
        step_by_step.assert_near(found, step_by_step.evaluate(system, rows), system)


def test_all_engines_agree_about_hedges_anywhere() -> None:
    for seed in range(12):
        generator = np.random.default_rng([61, seed])
        system = hedged(random_general_system(generator), generator)
        rows = inputs_for(system, generator, 30)
        program = assemble(system)
        expected = step_by_step.firing_strengths(system, rows)
        np.testing.assert_allclose(interpreter.fire(program, rows), expected, rtol=0, atol=1e-14)
        assert_as_defined(interpreter.evaluate(program, rows), system, rows)


def two_rules(implication: str, aggregation: str) -> FuzzySystem:
    """Two rules of strength 0.6 and 0.5 that conclude one triangle."""
    sides = terms(a=Triangular(-0.1, 0.5, 0.9), b=Triangular(0.0, 0.5, 1.0))
    x = Variable("x", "", 0.0, 1.0, sides, num_points=11)
    y = Variable("y", "", 0.0, 4.0, terms(t=Triangular(0.0, 2.0, 4.0)), num_points=5, default=0.0)
    weights = {"a": 0.6, "b": 0.5}
    rules = tuple(Rule(Is("x", name), (Consequent("y", "t", weight),)) for name, weight in weights.items())
    output = replace(y, aggregation=aggregation)
    return FuzzySystem("two", (x,), (output,), rules, implication=implication)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("implication", "aggregation", "heights"),
    [
        ("min", "max", [0.0, 0.5, 0.6, 0.5, 0.0]),
        ("product", "max", [0.0, 0.3, 0.6, 0.3, 0.0]),
        ("product", "bounded_sum", [0.0, 0.55, 1.0, 0.55, 0.0]),
        ("product", "unbounded_sum", [0.0, 0.55, 1.1, 0.55, 0.0]),
        ("min", "probabilistic_sum", [0.0, 0.75, 0.8, 0.75, 0.0]),
        ("bounded_difference", "max", [0.0, 0.1, 0.6, 0.1, 0.0]),
    ],
)
def test_rules_count_as_a_pencil_says(implication: str, aggregation: str, heights: list[float]) -> None:
    (output,) = inference.infer(two_rules(implication, aggregation), np.array([0.5])).outputs
    at_points = np.interp(np.arange(5.0), output.universe, output.aggregated)
    np.testing.assert_allclose(at_points, heights, atol=1e-15)


def test_every_pair_is_compiled_as_it_is_defined() -> None:
    generator = np.random.default_rng(315)
    for implication, aggregation in product(AND_OPERATORS, AGGREGATIONS):
        system = otherwise(random_general_system(generator), implication, aggregation)
        rows = inputs_for(system, generator, 6)
        assert_as_defined(compile(system)(rows), system, rows)


def test_a_file_of_our_own_keeps_them() -> None:
    controller = FuzzyController("two", (two_rules("product", "unbounded_sum"),))
    for dump, kind in ((serialize.dump_json, "json"), (serialize.dump_yaml, "yaml")):
        assert serialize.loads(dump(controller), kind) == controller  # type: ignore[arg-type]


def test_an_accumulation_besides_is_refused() -> None:
    system = two_rules("product", "max")
    both = replace(system, outputs=(replace(system.outputs[0], accumulation="bounded_sum"),))
    assert "'y' has the accumulation bounded_sum, which is for terms cut by min" in problems(both)[0]
