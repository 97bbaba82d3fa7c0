"""Numbers that rules conclude, by formulas or as weighed outputs: alike in all engines, by closed forms."""

from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from benchmarks.by_hand import work_out
from fis_tools.analysis.shapley import shares
from fis_tools.engines import inference, interpreter, interval
from fis_tools.engines.codes import INVERTED
from fis_tools.engines.compiler import compile
from fis_tools.engines.defuzzifier import invert
from fis_tools.engines.program import assemble
from fis_tools.formats import serialize
from fis_tools.formats.c import source
from fis_tools.formats.exchange import fll
from fis_tools.model import Consequent, FuzzyController, FuzzySystem, Is, Rule, Triangular, Variable
from fis_tools.model.numbers import Constant, Formula, Linear, NotAFormula, parse
from fis_tools.model.operators import AGGREGATIONS, AND_OPERATORS, HEDGES
from fis_tools.model.validate import problems
from fis_tools.model.variables import shape_values
from tests.fis_tools import step_by_step
from tests.fis_tools.engines.random_systems import hedged, inputs_for, otherwise, random_general_system
from tests.fis_tools.engines.weighed_systems import ENDLESS, MONOTONE, SYSTEMS, samples
from tests.fis_tools.sample_controllers import SHIPPED, terms, with_output

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
    fires = ~np.isnan(outputs)
    assert np.argwhere(~fires).tolist() == [[2, 0], [2, 2]]  # as in fuzzylite, also of what is made of it
    np.testing.assert_allclose(parts[fires], outputs[fires], atol=1e-12)


def test_a_value_is_held_where_no_rule_fires() -> None:
    """pyfuzzylite's `lock_previous` on a batch does the same."""
    answers = compile(NEAR).infer(ROWS, on_no_fire="hold")
    assert answers.no_rule_fired.tolist() == [[row == 2, False, False] for row in range(4)]
    assert answers.outputs[2, 0] == answers.outputs[1, 0]
    assert np.isnan(compile(NEAR).infer(ROWS[2:], on_no_fire="hold").outputs[0, 0])
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
    with pytest.raises(ValueError, match="linear in the inputs"):
        source.write(FuzzyController("near", (NEAR,)))
    with pytest.raises(interval.NotBounded, match="linear in the inputs"):
        interval.pack(NEAR)
    swapped = replace(NEAR, outputs=(NEAR.outputs[2], *NEAR.outputs[:2]))
    assert any("'rough', no input and no output before this one" in notes for notes in problems(swapped))
    with pytest.raises(serialize.ControllerFileError, match="line 20: the formula 'gamma"):
        serialize.loads(FLL.replace("sin (", "gamma (", 1), "fll")


@pytest.mark.parametrize("name", ["champion_27", "champion_27_fixed_sun", "champion_81"])
def test_readable_champions_answer_as_by_hand(name: str) -> None:
    generator = np.random.default_rng(27)
    for system in serialize.load(SHIPPED[name]).systems:
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


def assert_as_defined(outputs: np.ndarray, system: FuzzySystem, rows: np.ndarray) -> None:
    """The step-by-step inference gives the same, of a system without faults."""
    assert problems(system) == []
    with np.errstate(all="ignore"):
        step_by_step.assert_near(outputs, step_by_step.evaluate(system, rows), system)


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
    both = with_output(system, accumulation="bounded_sum")
    assert "'y' has the accumulation bounded_sum, which is for terms cut by min" in problems(both)[0]


@pytest.mark.parametrize("name", SYSTEMS)
def test_the_compiled_form_is_the_readable_one(name: str) -> None:
    system = SYSTEMS[name]
    rows = samples(system)
    np.testing.assert_allclose(compile(system)(rows), step_by_step.evaluate(system, rows), rtol=0, atol=1e-13)


def test_an_average_is_the_mean_of_numbers_by_strength() -> None:
    """The formula of Takagi and Sugeno, written out over the table of rules."""
    system = SYSTEMS["linear"]
    rows = np.clip(samples(system), 0.0, 10.0)
    degrees = np.exp(-((rows[:, :, None] - [0.0, 5.0, 10.0]) ** 2) / (2 * 1.5**2))
    strengths = (degrees[:, 0, :, None] * degrees[:, 1, None, :]).reshape(-1, 9)
    factors = np.array([[0.1, -0.15, 0.5], [0.0, 0.0, -1.0], [-0.05, 0.2, 0.0]] * 3)
    numbers = rows @ factors[:, :2].T + factors[:, 2]
    expected = (strengths * numbers).sum(axis=1) / strengths.sum(axis=1)
    np.testing.assert_allclose(compile(system)(rows)[:, 0], expected, atol=2e-4)  # linear between 501 points


@pytest.mark.parametrize("shape", [*MONOTONE, *ENDLESS])
def test_a_shape_has_the_degree_where_its_inverse_says(shape: object) -> None:
    degrees = np.linspace(0.01, 0.99, 50)
    np.testing.assert_allclose(shape_values(shape.inverse(degrees), shape), degrees, atol=1e-12)  # type: ignore[attr-defined, arg-type]
    kind = INVERTED.index(type(shape))  # type: ignore[arg-type]
    numbers = [getattr(shape, name) for name in shape.entry.kinds]  # type: ignore[attr-defined]
    compiled = [invert(kind, *numbers, degree) for degree in degrees]
    np.testing.assert_allclose(compiled, shape.inverse(degrees), atol=1e-13)  # type: ignore[attr-defined]


def test_a_sigmoid_at_full_strength_leads_to_the_end_of_the_range() -> None:
    system = SYSTEMS["tsukamoto_endless"]
    assert np.isfinite(compile(system)(np.array([[0.0, 0.0]]))).all()


@pytest.mark.parametrize("name", [name for name in SYSTEMS if name != "tsukamoto_endless"])
def test_no_output_leaves_its_bounds(name: str) -> None:
    system = SYSTEMS[name]
    compiled = compile(system)
    program = interval.pack(system)
    low = np.clip(samples(system, 60), 0.0, 10.0)
    high = np.minimum(low + np.random.default_rng(1).uniform(0.0, 2.0, low.shape), 10.0)
    least, greatest, _ = interval.bound(program, low, high)
    for share in np.random.default_rng(2).uniform(size=(40, low.shape[1])):
        outputs = compiled(low + share * (high - low))
        assert (outputs >= least).all()
        assert (outputs <= greatest).all()
    assert np.median(greatest - least) < 2.0  # of 4, the range: the bounds say something


def test_endless_terms_have_no_bounds() -> None:
    with pytest.raises(interval.NotBounded, match="has no limit"):
        interval.pack(SYSTEMS["tsukamoto_endless"])


@pytest.mark.parametrize("name", [name for name in SYSTEMS if name != "mixed"])
def test_shares_of_rules_add_up_to_the_output(name: str) -> None:
    system = SYSTEMS[name]
    rows, compiled = samples(system), compile(system)
    outputs = shares(compiled, rows)
    assert not outputs.error.any()
    np.testing.assert_allclose(outputs.values.sum(axis=1) + 0.25, compiled(rows), atol=1e-12)


@pytest.mark.parametrize("name", ["constant", "linear", "mixed"])
def test_a_prepared_function_gives_what_arrays_give(name: str) -> None:
    compiled = compile(SYSTEMS[name])
    rows, infer = samples(compiled.system, 30), compiled.prepare()
    np.testing.assert_allclose([infer(*row) for row in rows.tolist()], compiled(rows), atol=1e-14)
    assert infer(*[np.inf] * rows.shape[1]) == infer(*[10.0] * rows.shape[1])
    with pytest.raises(ValueError, match="is NaN"):
        infer(*[np.nan] * rows.shape[1])
    with pytest.raises(ValueError, match="0 inputs are given; pass"):
        infer()
