"""Numbers that rules conclude by formulas: parsed, alike in all engines, refused where they cannot be."""

from dataclasses import replace

import numpy as np
import pytest

from fis_tools.analysis.shapley import shares
from fis_tools.engines import inference, interval
from fis_tools.engines.compiler import compile
from fis_tools.formats import serialize
from fis_tools.formats.c import source
from fis_tools.formats.exchange import fcl, fll
from fis_tools.model import Constant, Formula, FuzzyController, FuzzySystem, Linear
from fis_tools.model.numbers import NotAFormula, parse
from fis_tools.model.validate import problems

#: fuzzylite's example of an approximation, in few words.
FLL = """Engine: near
InputVariable: x
  range: 0 10
  term: low Triangle 0 1 9
  term: high Triangle 1 9 10
InputVariable: the_y
  range: -1 1
  term: up Ramp -1 1
OutputVariable: rough
  range: -1 1
  defuzzifier: WeightedAverage TakagiSugeno
  default: nan
  lock-previous: true
  term: first Constant 0.84
  term: last Function 2*x/4 - (the_y + 1)
OutputVariable: exact
  range: -1 1
  defuzzifier: WeightedAverage Automatic
  default: nan
  term: sine Function sin ( x )/x + max(the_y, -0.5)^2
OutputVariable: error
  range: -1 1
  defuzzifier: WeightedSum Automatic
  default: nan
  term: gap Function fabs(rough-exact)
RuleBlock:
  rule: if x is low then rough is first
  rule: if x is high then rough is last
  rule: if x is any then exact is sine and error is gap
"""
ROWS = np.array([[2.0, 0.3], [9.5, -0.9], [10.0, 0.5], [7.0, 1.0]])


def near() -> FuzzySystem:
    (system,) = serialize.loads(FLL, "fll").systems
    return system


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


@pytest.mark.parametrize(
    "text",
    [
        "",
        "a b",
        "sin x",
        "sin(x",
        "pow(1)",
        "1 +",
        "__import__('os')",
        "a.b",
        "a[0]",
        "(" * 90,
        "-" * 900,
        "a" + "+a" * 499,
    ],
)
def test_what_is_no_formula_is_refused(text: str) -> None:
    with pytest.raises(NotAFormula):
        parse(text)


def test_all_engines_agree_about_formulas_of_inputs_and_outputs() -> None:
    system = near()
    assert isinstance(system.outputs[0].terms[0].membership, Constant)
    assert system.outputs[0].terms[1].membership == Linear((0.5, -1.0), -1.0)
    assert problems(system) == []
    compiled = compile(system)
    outputs = compiled(ROWS)
    x, y = ROWS.T
    exact = np.sin(x) / x + np.fmax(y, -0.5) ** 2
    np.testing.assert_allclose(outputs[:, 1], exact, rtol=1e-15)
    np.testing.assert_allclose(outputs[:, 2], np.abs(outputs[:, 0] - exact), rtol=1e-14)
    np.testing.assert_allclose(outputs, inference.evaluate(system, ROWS), rtol=1e-14)
    np.testing.assert_array_equal([compiled.prepare()(*row) for row in ROWS], outputs)
    parts = shares(compiled, ROWS).values.sum(axis=1)
    np.testing.assert_allclose(parts, outputs, atol=1e-12)


def test_a_value_is_held_where_no_rule_fires() -> None:
    """pyfuzzylite's `lock_previous` on a batch does the same."""
    answers = compile(near()).infer(ROWS, on_no_fire="hold")
    assert answers.no_rule_fired.tolist() == [[row == 2, False, False] for row in range(4)]
    assert answers.outputs[2, 0] == answers.outputs[1, 0]
    assert compile(near()).infer(ROWS[2:], on_no_fire="hold").outputs[0, 0] == 0.0
    text = fcl.write(FuzzyController("near", (near(),))).text.replace("DEFAULT := 0.0;", "DEFAULT := NC;", 1)
    for kept, kind in ((FLL, "fll"), (text, "fcl")):
        notes = serialize.reads(kept, kind).assumptions  # type: ignore[arg-type]
        assert any("rough keeps its last value where no rule fires" in sentence for sentence in notes)


def test_files_hold_formulas_with_the_names_that_they_write() -> None:
    system = near()
    second = replace(system.inputs[1], name="the y")
    formula = replace(system.outputs[1].terms[0], membership=Formula("sin(x) / x"))
    outputs = (system.outputs[0], replace(system.outputs[1], terms=(formula,)), system.outputs[2])
    named = FuzzyController("near", (replace(system, inputs=(system.inputs[0], second), outputs=outputs),))
    assert serialize.loads(serialize.dump_json(named), "json") == named
    assert serialize.loads(fll.write(named).text, "fll") == named
    (read,) = serialize.loads(fcl.write(FuzzyController("near", (system,))).text, "fcl").systems
    np.testing.assert_allclose(compile(read)(ROWS), compile(system)(ROWS), atol=1e-12)


def test_what_cannot_take_formulas_says_so() -> None:
    system = near()
    with pytest.raises(ValueError, match="C is written for numbers linear in the inputs"):
        source.write(FuzzyController("near", (system,)))
    with pytest.raises(interval.NotBounded, match="bounds are for numbers linear in the inputs"):
        interval.pack(system)
    swapped = replace(system, outputs=(system.outputs[2], *system.outputs[:2]))
    assert any("'rough', no input and no output before this one" in notes for notes in problems(swapped))
    with pytest.raises(serialize.ControllerFileError, match="line 20: the formula 'gamma"):
        serialize.loads(FLL.replace("sin (", "gamma (", 1), "fll")
