"""Foreign files that say what a fuzzy system of ours cannot, or that are wrong, are refused with the line."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fis_tools.engines.compiler import compile
from fis_tools.formats import serialize
from fis_tools.formats.exchange import fis, fll
from fis_tools.formats.serialize import ControllerFileError, Kind, dump_json, loads
from fis_tools.model.validate import controller_problems
from tests.fis_tools.formats.exchange.systems import DENIED, FLAT, alone, without_comment
from tests.fis_tools.sample_controllers import EXAMPLES

TEXTS = {
    "fis": (EXAMPLES / "tipper.fis").read_text(encoding="utf-8"),
    "fll": (EXAMPLES / "dimmer.fll").read_text(encoding="utf-8"),
}


def refusal(text: str, kind: Kind) -> str:
    with pytest.raises(ControllerFileError) as refused:
        loads(text, kind)
    return str(refused.value)


def line_of(kind: Kind, words: str) -> int:
    return next(number for number, line in enumerate(TEXTS[kind].splitlines(), 1) if words in line)


@pytest.mark.parametrize(
    ("kind", "old", "new", "words"),
    [
        ("fis", "Type='mamdani'", "Type='sugeno'", "'sugeno', but line 14: the DefuzzMethod is 'centroid'"),
        ("fis", "ImpMethod='min'", "ImpMethod='mean'", "ImpMethod 'mean' cannot be read"),
        ("fis", "AggMethod='max'", "AggMethod='mean'", "AggMethod 'mean' cannot be read"),
        ("fis", "AndMethod='min'", "AndMethod='my_and'", "AndMethod 'my_and' cannot be read"),
        ("fis", "OrMethod='max'", "OrMethod=max", "expected a word in quotes"),
        ("fis", "DefuzzMethod='centroid'", "DefuzzMethod='wtaver'", "DefuzzMethod is 'wtaver'"),
        ("fis", "NumInputs=2", "NumInputs=two", "'two' is not a whole number"),
        ("fis", "Version=2.0", "Version", "'Version' is not key=value"),
        ("fis", "Version=2.0", "Wersion=2.0", "did you mean 'Version'?"),
        ("fis", "'trimf',[0 5 10]", "'trimf',[0 5]", "trimf has 2 numbers; expected 3: left, peak, right"),
        ("fis", "'trimf',[0 5 10]", "'trumf',[0 5 10]", "did you mean 'trimf'?"),
        ("fis", "'trimf',[0 5 10]", "'trimf',[0 nan 10]", "'nan' is not a finite number"),
        ("fis", "'trimf',[0 5 10]", "'trimf',[0 1e999 10]", "not a finite number"),
        ("fis", "'trimf',[0 5 10]", "'discretemf',[0 0 5 1 5 0]", "do not ascend"),
        ("fis", "'trimf',[0 5 10]", "'discretemf',[0 0 5]", "not pairs"),
        ("fis", "'trimf',[0 5 10]", "'discretemf',[0 0 5 2]", "outside [0, 1]"),
        ("fis", "'trimf',[0 5 10]", "trimf [0 5 10]", "is not a term"),
        ("fis", "Range=[0 30]", "Range=[0 10 30]", "Range has 3 numbers; expected 2"),
        ("fis", "Range=[0 30]", "Range=0 30", "expected numbers in brackets"),
        ("fis", "2 0, 2 (1) : 1", "1.25 0, 2 (1) : 1", "has a hedge"),
        ("fis", "2 0, 2 (1) : 1", "4 0, 2 (1) : 1", "service has 3 terms, and none numbered 4"),
        ("fis", "2 0, 2 (1) : 1", "0.2 0, 2 (1) : 1", "service has 3 terms, and none numbered 0.2"),
        ("fis", "NumRules=3", "NumRules=0", "is 0: the file is unfinished"),
        ("fis", "2 0, 2 (1) : 1", "0 0, 2 (1) : 1", "asks or concludes nothing"),
        ("fis", "2 0, 2 (1) : 1", "2 0 2 (1) : 1", "is not a rule"),
        ("fis", "2 0, 2 (1) : 1", "2 0 1, 2 (1) : 1", "3 term numbers for 2 variables"),
        ("fis", "2 0, 2 (1) : 1", "2 0, 2 (x) : 1", "not a finite number"),
        ("fll", "aggregation: Maximum", "aggregation: Mean", "the aggregation 'Mean' cannot be read"),
        ("fll", "Centroid 200", "Centroid 1000000000", "not a whole number from 1 to 3999999"),
        ("fll", "off Triangle 0.0 0.0 0.2", "off Constant 0.0", "a Constant, a number and no fuzzy set"),
        ("fll", "off Triangle 0.0 0.0 0.2", "off Triangle 0.0 0.0 0.2 0.5", "height 0.5"),
        ("fll", "off Triangle 0.0 0.0 0.2", "off", "is not a term"),
        ("fll", "off Triangle 0.0 0.0 0.2", "off Discrete 0 0 0.1 nan", "not a finite number"),
        ("fll", "lock-previous: false", "lock-previous: no", "expected false or true"),
        ("fll", "default: 0.0", "default: none", "not a finite number"),
        ("fll", "description: share", "deskription: share", "did you mean 'description'?"),
        ("fll", "presence is not nobody", "presence is slightly nobody", "must be"),
        ("fll", "then power is off", "then power is not off", "concludes 'not'"),
        ("fll", "then power is off with 0.9", "power is off", "must be"),
        ("fll", "with 0.9", "with 0.9 more", "'more' follows the rule"),
        ("fll", "(presence is nobody", "(" * 25 + "presence is nobody", "more than 20 deep"),
        ("fll", "conjunction: AlgebraicProduct", "conjunction: none", "has no conjunction"),
        ("fll", "disjunction: AlgebraicSum", "disjunction: Sum", "'Sum' cannot be read"),
    ],
)  # fmt: skip
def test_what_cannot_be_read_is_refused_with_its_line(kind: Kind, old: str, new: str, words: str) -> None:
    text = TEXTS[kind]
    assert text.count(old) >= 1
    sentence = refusal(text.replace(old, new, 1), kind)
    assert words in sentence
    lines = {line_of(kind, old), line_of(kind, old) + 1}
    # a missing operator is told where it is needed
    if "has no conjunction" not in words:
        assert any(f"line {line}" in sentence for line in lines)


@pytest.mark.parametrize(
    ("kind", "old", "new", "words"),
    [
        ("fis", "[Input2]", "[Input3]", "not one of the sections"),
        ("fis", "3 2, 3 (1)", "3 2, 3.2 (1)", "the hedge on 'generous', which the rule concludes"),
        ("fis", "'trimf',[0 5 10]", "'function',[sin(x)]", "the term is a function, a number and no fuzzy"),
        ("fis", "NumRules=3", "NumRules=4", "[Rules] has 3 lines"),
        ("fis", "NumMFs=2", "NumMFs=3", "NumMFs=3 but has MF1, MF2"),
        ("fis", "NumOutputs=1\n", "", "[System] has no NumOutputs"),
        ("fis", "[System]", "", "stands before [System]"),
        ("fis", "(1) : 1", "(1.5) : 1", "weight 1.5 lies outside [0, 1]"),
        ("fis", "'cheap':'trimf',[0 5 10]", "'cheap':'trimf',[10 5 0]", "do not ascend"),
        ("fll", "term: off", "term: low", "2 terms called 'low'"),
        ("fis", "Range=[0 30]", "Range=[30 0]", "the range [30.0, 0.0] is empty"),
        ("fll", "Engine: dimmer", "", "before 'Engine:'"),
        ("fll", "daylight is dark", "daylight is dusk", "no term 'dusk'"),
        ("fll", "  enabled: true", "  enabled: false", "enabled of a InputVariable is 'false'"),
    ],
)
def test_what_contradicts_itself_is_refused(kind: Kind, old: str, new: str, words: str) -> None:
    assert old in TEXTS[kind]
    assert words in refusal(TEXTS[kind].replace(old, new, 1), kind)


@pytest.mark.parametrize(
    ("kind", "assumed"),
    [
        (
            "fis",
            [
                "of MATLAB, which sums over 101 points of each output",
                "inputs beyond their ranges are taken as they are",
                "tip is 15 when no rule fires",
            ],
        ),
        ("fll", ["those of fuzzylite, which sums over 1000 intervals"]),
    ],
)
def test_what_a_file_does_not_state_is_told(kind: Kind, assumed: list[str]) -> None:
    assumptions = serialize.reads(TEXTS[kind], kind).assumptions
    assert len(assumptions) == len(assumed)
    for sentence, words in zip(assumptions, assumed, strict=True):
        assert words in sentence


WHOLE: dict[Kind, list[str]] = {
    "fis": [TEXTS["fis"], fis.write(alone(DENIED)).text],
    "fll": [TEXTS["fll"], fll.write(alone(DENIED)).text],
}
DAMAGE = st.sampled_from([*"[](){}<>,:;='\"#%/&!-.0159e \n\t\\", "nan", "-1", "1e999", "not ", "--"])


def read_or_refused(text: str, kind: Kind) -> str:
    """Read what may be damaged; tell what came of it: read, refused, or what is wrong about either."""
    try:
        controller = loads(text, kind)
    except ControllerFileError as error:
        is_told = all(0 < len(line.strip()) < 1000 for line in str(error).split("\n"))
        return "refused" if is_told else f"refused without a sentence a fault: {error}"
    if problems := controller_problems(controller):
        return f"read with faults: {problems}"
    return "read" if loads(dump_json(controller), "json") == controller else "read, and another when written"


@settings(max_examples=60, deadline=None)
@given(st.sampled_from(list(WHOLE)), st.booleans(), st.data())
def test_damage_anywhere(kind: Kind, is_ours: bool, data: st.DataObject) -> None:
    text = WHOLE[kind][is_ours]
    for _ in range(data.draw(st.integers(1, 4))):
        start, length = data.draw(st.integers(0, len(text))), data.draw(st.integers(0, 8))
        text = text[:start] + data.draw(DAMAGE | st.text(max_size=3)) + text[start + length :]
    assert read_or_refused(text, kind) in ("read", "refused")


@pytest.mark.parametrize("kind", list(WHOLE))
def test_our_files_cut_anywhere_are_refused(kind: Kind) -> None:
    text = WHOLE[kind][1].rstrip()
    for length in [*range(0, len(text), 61), len(text) - 1]:
        assert read_or_refused(text[:length], kind) == "refused"
    assert read_or_refused(text, kind) == "read"


SPIKY = (Path(__file__).parent / "spiky.fis").read_text(encoding="utf-8")


def test_spikes_and_walls_of_inputs_between_points_are_exact() -> None:
    system = serialize.loads(SPIKY, "fis").systems[0]
    inside = [np.nextafter(0.123456, 1.0), 0.123456, 0.5, 1.1, np.nextafter(1.1, 0.0)]
    outside = [0.1234, 0.12345599, 1.1000001, 1.9999999, 2.0000001]
    y = compile(system)({"x": [2.0, *inside, *outside]})["y"]
    assert y[0] == 70.0
    assert (y[1:6] < 26.0).all()
    np.testing.assert_array_equal(y[6:], 50.0)


def test_corners_lie_on_evenly_spaced_points_where_some_number_of_them_does() -> None:
    text = SPIKY.replace("[2 2 2]", "[1 2 3]").replace("[0.123456 0.123456 1.1 1.1]", "[0 0 0.7 1]")
    (variable,) = serialize.loads(text, "fis").systems[0].inputs
    assert variable.points is None
    assert np.abs(np.subtract.outer(variable.universe, [0.7, 1.0, 2.0])).min(axis=0).max() < 1e-12


def test_walls_of_outputs_between_points_are_told() -> None:
    notes = serialize.reads(SPIKY, "fis").assumptions
    assert any("y b jumps at 15.5, between two points of its universe" in sentence for sentence in notes)
    notes = serialize.reads(SPIKY.replace("[60 70 80]", "[70.5 70.5 70.5]"), "fis").assumptions
    assert any("y a jumps at 70.5" in each and "its rules conclude nothing" in each for each in notes)


def test_an_fll_file_without_a_resolution_has_fuzzylites_own() -> None:
    text = without_comment(fll.write(alone(FLAT)).text)
    resolution = FLAT.outputs[0].num_points - 1
    bare = serialize.reads(text.replace(f"Centroid {resolution}", "Centroid"), "fll")
    assert [output.num_points for output in bare.controller.systems[0].outputs] == [1001, 1001]
    assert "1000 intervals of an output that states no number" in bare.assumptions[0]
