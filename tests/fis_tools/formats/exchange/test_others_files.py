"""Files as other programs write them: FCL, hedges, chains, padding, remarks, letters of Latin-1."""

from pathlib import Path

import numpy as np
import pytest

from fis_tools.engines.compiler import compile
from fis_tools.errors import ControllerFileError
from fis_tools.formats import serialize
from fis_tools.formats.exchange import fcl, fll
from fis_tools.model import And, FuzzyController, Hedged, Is, Not, Or, Trapezoidal, Triangular
from tests.fis_tools.formats.exchange.systems import alone, flat_system

TIPPER_FCL = """FUNCTION_BLOCK tipper  // as jFuzzyLogic writes it
VAR_INPUT  service : REAL; food : REAL; END_VAR
VAR_OUTPUT tip : REAL; END_VAR
FUZZIFY service
  TERM poor := (0, 1) (4, 0);
  TERM good := (1, 0) (4, 1) (6, 1) (9, 0) (10, 0);
END_FUZZIFY
FUZZIFY food
  RANGE := (0 .. 10);
  TERM rancid := trape 0 0 1 3; (* a remark
  of two lines *)
  TERM delicious := gauss 9 2;
END_FUZZIFY
DEFUZZIFY tip
  RANGE := (0 .. 30);
  TERM cheap := TRIAN 0 5 10;
  TERM generous := Triangle 20 25 30;
  METHOD : COG;
  ACCU : BSUM;
  DEFAULT := 15;
END_DEFUZZIFY
RULEBLOCK No1
  AND : PROD;
  ACT : PROD;
  RULE 1 : IF service IS poor
    OR food IS rancid THEN tip IS cheap;
  RULE 2 : IF NOT (service IS poor) AND food IS very delicious THEN tip IS generous WITH 0.5;
END_RULEBLOCK
END_FUNCTION_BLOCK
"""


def test_fcl_says_what_it_is_meant_to() -> None:
    (system,) = serialize.loads(TIPPER_FCL, "fcl").systems
    assert (system.implication, system.and_operator, system.outputs[0].aggregation) == (
        "product",
        "product",
        "bounded_sum",
    )
    assert [(v.minimum, v.maximum) for v in system.inputs] == [(0.0, 10.0), (0.0, 10.0)]
    assert [term.membership for term in system.outputs[0].terms] == [
        Triangular(0.0, 5.0, 10.0),
        Triangular(20.0, 25.0, 30.0),
    ]
    assert system.inputs[1].terms[0].membership == Trapezoidal(0.0, 0.0, 1.0, 3.0)
    assert system.rules[0].antecedent == Or((Is("service", "poor"), Is("food", "rancid")))
    assert system.rules[1].antecedent == And(
        (Not(Is("service", "poor")), Hedged("very", Is("food", "delicious")))
    )
    strengths = compile(system).firing_strengths(np.array([[2.0, 7.0]]))
    np.testing.assert_allclose(strengths, [[0.5, 0.5 * np.exp(-0.5) ** 2]], atol=1e-6)


def test_fcl_of_ours_is_read_back() -> None:
    system = flat_system()
    (read,) = serialize.loads(fcl.write(alone(system)).text, "fcl").systems
    rows = np.random.default_rng(2).uniform((-10.0, 0.0), (40.0, 25.0), (40, 2))
    widths = [output.maximum - output.minimum for output in system.outputs]
    # corners of inputs lie between points of the original universe: 4.4e-5 was measured
    np.testing.assert_allclose(compile(read)(rows) / widths, compile(system)(rows) / widths, atol=1e-4)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("COG;", "COGS;", "cannot be weighed"),
        ("TRIAN 0 5 10;", "5;", "a number and no fuzzy set"),
        ("TRIAN 0 5 10;", ";", "is not TERM name := "),
        ("RANGE := (0 .. 30);", "", "has no RANGE"),
        ("RULE 1 : IF", "RULE 1 IF service IS", "line 25"),
        ("END_FUNCTION_BLOCK", "END_FUNCTION_BLOCK\nFUNCTION_BLOCK two", "2 function blocks"),
    ],
)
def test_fcl_that_cannot_be_read_is_refused(old: str, new: str, words: str) -> None:
    with pytest.raises(ControllerFileError, match=words):
        serialize.loads(TIPPER_FCL.replace(old, new), "fcl")


OLD_FIS = """[System]  % a remark
Name='caf\u00e9 #1';
Type='mamdani';
NumInputs=1
NumOutputs=1
NumRules=2
AndMethod=''
OrMethod='max'
ImpMethod='prod'; // another
AggMethod='sum'
DefuzzMethod='centroid'
[Input1]
Name='x'
Range=[0 1];
NumMFs=2
MF1='low':'rampmf',[1 0]; % falls
MF2='high':'trimf',[0 1 1 0]
[Output1]
Name='y'
Range=[0 1]
NumMFs=2
MF1='small':'spikemf',[0.25 1]
MF2='large':'cosinemf',[0.75 0.5]
[Rules]
1.2, 1 (1) : 1   % very
-2.3, 2 (1) : 1
"""


def test_old_fis_files_are_read_and_latin_letters_told(tmp_path: Path) -> None:
    path = tmp_path / "old.fis"
    path.write_bytes(OLD_FIS.encode("latin-1"))
    reading = serialize.read(path)
    (system,) = reading.controller.systems
    assert system.name == "caf\u00e9 #1"
    assert "Latin-1" in reading.assumptions[0]
    assert (system.implication, system.outputs[0].aggregation) == ("product", "unbounded_sum")
    assert system.inputs[0].terms[1].membership == Triangular(0.0, 1.0, 1.0)
    strengths = compile(system).firing_strengths(np.array([[0.3]]))
    np.testing.assert_allclose(strengths, [[0.49, 1.0 - 0.3**3]], atol=1e-6)


SLIPS = """[System]
Name='slips'
Type='hybrid'
NumInputs=1
NumOutputs=2
NumRules=2
AndMethod='min'
OrMethod='max'
ImpMethod='min'
AggMethod='max'
DefuzzMethod='centroid'
[Input1]
Name='x'
Range=[-pi/4 pi/4]
NumMFs=3
MF1='low':'trimf',[-2 -1 0]
MF2='middle':'trimf',[-1 0 1]
MF2='high':'trimf',[0 1 2]
[Output1]
Name='y'
Range=[0 1]
NumMFs=1
MF1='same':'trimf',[0 0.2 0.4]
MF2='same':'trimf',[0.6 0.8 1]
[Output2]
Name='z'
Range=[0 8]
NumMFs=2
MF1='two':'constant',[2]
MF2='six':'constant',[6]
[Rules]
1, 1 1 (1) : 1
2, 2 1 (1) : 1
3, 2 2 (1) : 1
"""


def test_slips_of_fis_files_are_put_right_and_told() -> None:
    """Each slip is one of the files that MathWorks and fuzzylite ship."""
    reading = serialize.reads(SLIPS, "fis")
    (system,) = reading.controller.systems
    assert (system.inputs[0].minimum, system.inputs[0].maximum) == (-np.pi / 4, np.pi / 4)
    assert [term.name for term in system.inputs[0].terms] == ["low", "middle", "high"]
    assert [term.name for term in system.outputs[0].terms] == ["same 1", "same 2"]
    for words in (
        "[Input1] has MF2 twice",
        "[Output1] says NumMFs=1 but has 2 terms",
        "y has 2 terms called 'same'",
        "[System] says NumRules=2 but has 3 rules",
        "z concludes numbers: their weighted average is taken",
    ):
        assert any(words in sentence for sentence in reading.assumptions), words
    y, z = compile(system)(np.array([[0.5]]))[0]
    assert z == pytest.approx(0.5 * 2 + 0.5 * 6)
    assert y == pytest.approx(0.8, abs=1e-9)


def test_hedges_in_a_fis_file_of_fuzzylites_are_fuzzylites() -> None:
    text = OLD_FIS.replace("-2.3, 2", "2.3, 2")
    ours = compile(serialize.reads(text, "fis").controller.systems[0])
    theirs = compile(
        serialize.reads(
            f"#Code automatically generated with fuzzylite 6.0.\n{text}", "fis"
        ).controller.systems[0]
    )
    x = np.array([[0.3], [0.8]])
    np.testing.assert_allclose(ours.firing_strengths(x)[:, 1], [0.3**3, 0.8**3], atol=1e-6)
    np.testing.assert_allclose(theirs.firing_strengths(x)[:, 1], [2 * 0.3**2, 1 - 2 * 0.2**2], atol=1e-6)


FLL = """Engine: chain
InputVariable: x
  range: 0 1
  term: low Trapezoid -inf 0.2 0.4 0.8
  term: high Binary 0.5 inf
OutputVariable: y
  range: 0 1
  aggregation: Maximum
  defuzzifier: Centroid 100
  default: nan
  term: small Triangle 0 0.2 0.4
  term: large Arc 0.5 1
OutputVariable: z
  range: 0 1
  aggregation: NormalizedSum
  defuzzifier: Centroid 100
  default: nan
  term: small SemiEllipse 0 0.5
  term: large Concave 0.6 1
RuleBlock:
  conjunction: Minimum
  disjunction: Maximum
  implication: Minimum
  rule: if x is low then y is small
  rule: if x is high then y is large
  rule: if y is small or x is any then z is large
  rule: if y is not somewhat large then z is small
"""


def test_chained_fll_hands_on_degrees_of_truth() -> None:
    text = FLL.replace("not somewhat large", "not large")
    (system,) = serialize.loads(text, "fll").systems
    assert system.rules[2].antecedent == Or((Is("x", "low"), Is("x", "any")))
    assert system.rules[3].antecedent == Not(Is("x", "high"))
    strengths = compile(system).firing_strengths(np.array([[-1.0], [0.1], [0.6]]))
    np.testing.assert_allclose(strengths, [[1, 0, 1, 1], [1, 0, 1, 1], [0.5, 1, 1, 0]], atol=1e-12)


def test_a_hedge_before_what_a_rule_concluded_is_said_of_the_inputs() -> None:
    (system,) = serialize.loads(FLL, "fll").systems
    assert system.rules[3].antecedent == Not(Hedged("somewhat", Is("x", "high")))


def test_fuzzylite_carries_a_hedge_on_to_what_else_a_rule_concludes() -> None:
    """So do its program and pyfuzzylite, whose loops change one strength from conclusion to conclusion."""
    rule = "if x is low and x is any then y is somewhat small and z is very large and z is small"
    text = FLL[: FLL.index("  rule:")] + f"  rule: {rule}\n"
    (system,) = serialize.loads(text, "fll").systems
    strengths = compile(system).firing_strengths(np.array([[0.64]]))
    np.testing.assert_allclose(strengths, [[np.sqrt(0.4), 0.4]], atol=1e-12)
    assert [[c.term for c in rule.consequents] for rule in system.rules] == [["small"], ["large", "small"]]
    written = fll.write(FuzzyController("chain", (system,))).text
    assert "if x is low and x is _any then z is very somewhat small" in written
    assert serialize.loads(written, "fll").systems == (system,)
    with pytest.raises(ControllerFileError, match="and a hedge on what it concludes"):
        serialize.loads(text.replace(rule, f"{rule} with 0.5"), "fll")
    with pytest.raises(ControllerFileError, match="the rule concludes 'not'"):
        serialize.loads(text.replace("somewhat small", "not small"), "fll")
