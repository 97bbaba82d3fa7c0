"""FCL: what jFuzzyLogic computes by hand, what is refused, and back again."""

from dataclasses import replace

import numpy as np
import pytest

from fis_tools.engines.compiler import compile
from fis_tools.engines.inference import infer
from fis_tools.errors import ControllerFileError
from fis_tools.formats import serialize
from fis_tools.formats.exchange import fcl
from fis_tools.formats.exchange.antecedents import NotExpressible
from fis_tools.model import (
    And,
    Constant,
    Cosine,
    Formula,
    FuzzySystem,
    Gaussian,
    Is,
    Not,
    Or,
    Polyline,
    SigmoidDifference,
)
from tests.fis_tools.formats.exchange.systems import FLAT, alone, without_comment

TIP = """(* a comment *) // another
FUNCTION_BLOCK tip
VAR_INPUT food : REAL; service : REAL; END_VAR
VAR_OUTPUT tip : REAL; END_VAR
FUZZIFY food
  TERM bad := (0, 1) (5, 0);
  TERM fine := (5, 0) (10, 1);
END_FUZZIFY
FUZZIFY service
  TERM poor := gauss 0 2;
  TERM good := COSINE 1 5;
END_FUZZIFY
DEFUZZIFY tip
  TERM small := 4;
  TERM big := 12;
  METHOD : COGS;
  DEFAULT := NC;
END_DEFUZZIFY
RULEBLOCK one
  AND : MIN;
  RULE 1 : IF food IS bad OR service IS poor AND food IS NOT fine THEN tip IS small;
  RULE 2 : IF NOT (food IS bad) THEN tip IS big WITH 0.5;
END_RULEBLOCK
END_FUNCTION_BLOCK
"""


def read(text: str) -> FuzzySystem:
    (system,) = serialize.loads(text, "fcl").systems
    return system


def test_a_file_means_what_jfuzzylogic_makes_of_it():
    reading = serialize.reads(TIP, "fcl")
    (system,) = reading.controller.systems
    assert system.semantics == "fcl"
    food, service = system.inputs
    assert (food.minimum, food.maximum) == (0.0, 10.0)
    assert (service.minimum, service.maximum) == (-8.0, 8.0)  # four deviations about a Gaussian's mean
    assert food.terms[0].membership == Polyline((0.0, 5.0), (1.0, 0.0))
    assert [term.membership for term in service.terms] == [Gaussian(0.0, 2.0), Cosine(5.0, 2.0)]
    assert system.outputs[0].default is None
    assumptions = " ".join(reading.assumptions)
    assert "tip keeps its last value" in assumptions
    assert "numbers are those of jFuzzyLogic" in assumptions
    # one precedence, from left to right
    first = system.rules[0].antecedent
    assert first == And((Or((Is("food", "bad"), Is("service", "poor"))), Not(Is("food", "fine"))))
    # food 2 is bad by 0.6; service 30 is poor by nothing; (4 * 0.6 + 12 * 0.4 / 2) / 0.8
    outputs = compile(system)(np.array([[2.0, 30.0], [-7.0, 30.0]]))[:, 0]
    assert outputs.tolist() == pytest.approx([(4.0 * 0.6 + 12.0 * 0.2) / 0.8, 4.0])


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("AND : MIN;", "AND : PROD;", ("product", "probabilistic_sum")),
        ("AND : MIN;", "OR : BSUM;", ("bounded_difference", "bounded_sum")),
        ("AND : MIN;", "OR : ASUM; AND : MIN;", ("min", "max")),
    ],
)
def test_an_operator_sets_the_other_and_the_last_counts(old, new, expected):
    system = read(TIP.replace(old, new))
    assert (system.and_operator, system.or_operator) == expected


SETS = TIP.replace("TERM small := 4;", "TERM small := TRIAN 0 4 8;").replace(
    "TERM big := 12;", "TERM big := trape 8 12 12 16;"
)
SETS = SETS.replace("METHOD : COGS;", "RANGE := (0 .. 16); METHOD : COG;")


@pytest.mark.parametrize("method", ["COG", "COA", "LM", "RM", "MM"])
def test_accumulation_is_the_sum_at_the_left_edges_of_a_thousand_intervals(method):
    system = read(SETS.replace("METHOD : COG", f"METHOD : {method}"))
    (tip,) = system.outputs
    assert tip.aggregation == "unbounded_sum"
    x = np.cumsum([0.0, *[16.0 / 1000] * 999])
    np.testing.assert_array_equal(system.points_of(tip), x)
    small, big = np.interp(x, [0.0, 4.0, 8.0], [0, 1, 0]), np.interp(x, [8.0, 12.0, 16.0], [0, 1, 0])
    heights = np.minimum(small, 0.6) + np.minimum(big, 0.2)
    top = x[heights >= heights.max() * (1.0 - 1e-12)]
    low, high, sums = 0, 999, [0.0, 0.0]
    while low < high:
        if sums[0] <= sums[1]:
            low += 1
            sums[0] += heights[low]
        else:
            high -= 1
            sums[1] += heights[high]
    expected = {
        "COG": (x * heights).sum() / heights.sum(),
        "COA": 16.0 / 1000 * low,
        "LM": top[0],
        "RM": top[-1],
        "MM": top.mean(),
    }
    assert compile(system)(np.array([[2.0, 30.0]]))[0, 0] == pytest.approx(expected[method], abs=1e-11)


def test_a_range_of_an_output_counts_where_it_is_defuzzified_alone():
    """jFuzzyLogic sums to the ends of the terms whatever VAR_OUTPUT says; its values."""
    ranged = """FUNCTION_BLOCK ranged
    VAR_INPUT x : REAL; END_VAR
    VAR_OUTPUT y : REAL; RANGE := (0 .. 40); END_VAR
    FUZZIFY x TERM low := (0, 1) (10, 0); TERM high := (0, 0) (10, 1); END_FUZZIFY
    DEFUZZIFY y TERM small := TRIAN -10 0 10; TERM large := TRIAN 10 20 30; METHOD : COG; END_DEFUZZIFY
    RULEBLOCK one AND : MIN; ACCU : MAX;
    RULE 1 : IF x IS low THEN y IS small; RULE 2 : IF x IS high THEN y IS large;
    END_RULEBLOCK END_FUNCTION_BLOCK"""
    reading = serialize.reads(ranged, "fcl")
    answers = compile(reading.controller.systems[0])(np.array([[3.0], [8.5]]))[:, 0]
    np.testing.assert_allclose(answers, [7.183098591549319, 15.577724798245816], rtol=1e-14)
    assert any("y has no RANGE in DEFUZZIFY, where jFuzzyLogic looks" in note for note in reading.assumptions)


def test_formulas_and_numbers_that_are_equal():
    text = TIP.replace("TERM big := 12;", "TERM big := FUNCTION 2 * food + LN(service); TERM same := 4;")
    system = read(text.replace("tip IS big WITH 0.5", "tip IS same"))
    assert [type(term.membership) for term in system.outputs[0].terms].count(Constant) == 2
    joined = read(text.replace("tip IS big WITH 0.5", "tip IS same").replace("COGS;", "COGS; ACCU : MAX;"))
    rows = np.array([[2.0, 30.0]])
    assert compile(system)(rows) == compile(joined)(rows) == 4.0
    formula = read(text.replace("tip IS big WITH 0.5", "tip IS big"))
    expected = (4.0 * 0.6 + (2.0 * 2.0 + np.log(3.0)) * 0.4) / 1.0
    assert compile(formula)(np.array([[2.0, 3.0]]))[0, 0] == pytest.approx(expected, rel=0.2)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("TERM small := 4;", "TERM small := limit;", "weighted average, and its term is a fuzzy set"),
        ("(0, 1) (5, 0)", "(edge, 1) (5, 0)", "the variable 'edge' stands for a number"),
        ("(0, 1) (5, 0)", "(7, 1) (5, 0)", "do not ascend"),
        ("METHOD : COGS", "METHOD : BEST", "METHOD 'BEST' cannot be read"),
        ("THEN tip IS small", "THEN tip IS NOT small", "the rule concludes 'not small'"),
        ("END_RULEBLOCK\nEND_FUNCTION_BLOCK", "", "is not FCL here|the file ends"),
        ("AND : MIN;", "AND : MIN; AND", "line 2"),
        ("gauss 0 2", "gauss 0", "has 1 numbers; expected 2"),
        (
            "END_FUNCTION_BLOCK",
            "END_FUNCTION_BLOCK FUNCTION_BLOCK b END_FUNCTION_BLOCK",
            "'b' is unfinished: it",
        ),
        ("tip IS small", "tip IS very small", "'very' is no hedge of jFuzzyLogic's"),
        ("gauss 0 2", "dsigm 2 4 2 1", "the second sigmoid of DSIGM exceeds the first somewhere"),
        ("gauss 0 2", "dsigm 2 1 -2 4", "the second sigmoid of DSIGM exceeds the first somewhere"),
        ("TERM big := 12;", "TERM big := FUNCTION acosh(food);", "the function 'acosh' cannot be read"),
    ],
)
def test_what_cannot_be_read_is_refused(old, new, words):
    assert old in TIP
    with pytest.raises(ControllerFileError, match=words):
        read(TIP.replace(old, new, 1))


def test_function_blocks_become_systems_of_one_controller():
    second = TIP.replace("FUNCTION_BLOCK tip\n", "FUNCTION_BLOCK more\n", 1)
    reading = serialize.reads(TIP + second, "fcl")
    assert [system.name for system in reading.controller.systems] == ["tip", "more"]
    assert reading.controller.systems[0] == read(TIP)
    assert len(reading.assumptions) == 2 * len(serialize.reads(TIP, "fcl").assumptions)
    with pytest.raises(ControllerFileError, match="2 systems called 'tip'"):
        serialize.loads(TIP + TIP, "fcl")


def test_formulas_of_equal_value_join_by_the_accumulation():
    """Rules 1 and 3 conclude 0.5 * food by different terms, with a number between them."""
    terms = "TERM small := FUNCTION 0.5 * food; TERM big := 12; TERM same := FUNCTION food * 0.5;"
    third = "RULE 3 : IF food IS NOT fine THEN tip IS same;\nEND_RULEBLOCK"
    text = TIP.replace("TERM small := 4;\n  TERM big := 12;", terms).replace("END_RULEBLOCK", third)
    system = read(text.replace("METHOD : COGS;", "METHOD : COGF; ACCU : MAX;"))
    expected = (1.0 * 1.0 + 12.0 * 0.2) / 1.2  # strengths 0.6, 0.2 and 1; of 0.6 and 1 the greater counts
    assert compile(system)(np.array([[2.0, 30.0]]))[0, 0] == pytest.approx(expected, rel=1e-14)
    assert infer(system, np.array([2.0, 30.0])).values[0] == pytest.approx(expected, rel=1e-14)


def test_hedges_on_conclusions_of_fuzzylites_files_change_strengths():
    hedged = TIP.replace("tip IS big WITH 0.5", "tip IS very big").replace("gauss 0 2", "Gaussian 0 2")
    text = "// Code automatically generated with fuzzylite 6.0.\n" + hedged.replace(
        "COSINE 1 5", "Cosine 5 2"
    )
    strengths = compile(read(text)).firing_strengths(np.array([[2.0, 30.0]]))
    np.testing.assert_allclose(strengths, [[0.6, 0.16]], atol=1e-12)


def test_what_declares_memberships_alone_is_unfinished():
    text = TIP[: TIP.index("RULEBLOCK")] + "END_FUNCTION_BLOCK"
    with pytest.raises(ControllerFileError, match=r"'tip' is unfinished: it has no rules; add"):
        read(text)


@pytest.mark.parametrize("text", [TIP, SETS, TIP.replace("AND : MIN", "OR : ASUM")])
def test_what_is_written_is_read_again(text):
    system = read(text)
    written = fcl.write(alone(system)).text
    assert read(written) == replace(system)
    bare = read(without_comment(written))
    rows = np.random.default_rng(3).uniform(-3.0, 12.0, (50, 2))
    np.testing.assert_allclose(compile(bare)(rows), compile(system)(rows), rtol=1e-14)
    assert bare == system


def test_a_system_of_our_own_is_written_as_jfuzzylogic_has_it():
    text = fcl.write(alone(FLAT)).text
    assert read(text) == FLAT
    bare = read(without_comment(text))
    assert bare.semantics == "fcl"
    rows = np.array(
        [[v.minimum + share * v.span for v in FLAT.inputs] for share in np.linspace(0.0, 1.0, 21)]
    )
    spans = [output.span for output in FLAT.outputs]
    assert np.nanmax(np.abs(compile(bare)(rows) - compile(FLAT)(rows)) / spans) < 0.01


FORMULA = TIP.replace("TERM big := 12", "TERM big := FUNCTION ln(service) + log(food) + abs(0 - food) ^ 2")


@pytest.mark.parametrize("write", [str, lambda text: without_comment(fcl.write(alone(read(text))).text)])
def test_functions_are_jfuzzylogics_where_they_are_read_and_written(write):
    """Its `log` is the decimal one; its own answers."""
    answers = compile(read(write(FORMULA)))(np.array([[7.0, 3.0], [9.0, 5.0]]))[:, 0]
    np.testing.assert_allclose(answers, [32.4627235, 77.13686156], rtol=1e-9)


def test_a_difference_of_sigmoids_with_a_negative_part_becomes_a_table():
    """JFuzzyLogic takes it for zero there, and other programs for its absolute value."""
    (term, *terms), *others = FLAT.inputs[0].terms, *FLAT.inputs[1:]
    counts = []
    for slope in (9.0, 7.0):
        shape = SigmoidDifference(0.2, slope, 0.6, 9.0)
        first = replace(FLAT.inputs[0], terms=(replace(term, membership=shape), *terms))
        counts.append(fcl.write(alone(replace(FLAT, inputs=(first, *others)))).text.count("DSIGM"))
    assert counts[0] == counts[1] + 1


def test_what_fcl_cannot_say_is_refused():
    formula = read(FORMULA)
    (small, big), output = formula.outputs[0].terms, formula.outputs[0]
    unknown = replace(output, terms=(small, replace(big, membership=Formula("acosh(food)"))))
    with pytest.raises(NotExpressible, match=r"a formula has acosh\(\), and FCL knows only abs, cos"):
        fcl.write(alone(replace(formula, outputs=(unknown,))))
    system = read(TIP)
    with pytest.raises(NotExpressible, match="no duals"):
        fcl.write(alone(replace(system, or_operator="bounded_sum")))
