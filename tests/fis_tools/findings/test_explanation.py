"""Explanations against closed forms, and against scikit-fuzzy on both sides of every flip."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from fis_tools.analysis.arrays import spread_inputs
from fis_tools.analysis.flight_data import Points
from fis_tools.engines.compiler import compile
from fis_tools.findings.explanation import Explanation, Flip, explain, flips, missed, shares
from fis_tools.formats.serialize import load
from fis_tools.model import FuzzySystem, Triangular
from fis_tools.model.systems import with_semantics
from plain_files.document import text
from tests import night
from tests.fis_tools.control_systems import ReferenceEngine
from tests.fis_tools.sample_controllers import EXAMPLES, FORCE_X, FORCE_Z, ROOM, SHIPPED, ramp_system, terms


def ramp_output(x: float) -> float:
    left, right = (2 * h - h * h for h in (1 - x, x))
    return 3.0 * (right - left) / (right + left)


def by_way(every_flip: tuple[Flip, ...]) -> dict[int, Flip]:
    return {flip.way: flip for flip in every_flip}


@pytest.mark.parametrize("value", [0.0, -1.5, 2.25])
def test_a_flip_lies_where_the_closed_form_crosses(value: float) -> None:
    expected = brentq(lambda x: ramp_output(x) - value, 0.0, 1.0, xtol=1e-14)
    ways = by_way(flips(ramp_system(), [0.05], value))
    assert ways[1].last - 1e-12 <= expected <= ways[1].first + 1e-12
    assert ways[1].first - ways[1].last <= 1e-9
    assert ways[1].change == pytest.approx(expected - 0.05, abs=2e-9)
    assert ways[1].side == -1
    assert ways[-1].change is None
    down = by_way(flips(ramp_system(), {"x": 0.99}, value))[-1]
    assert down.first == pytest.approx(expected, abs=2e-9)
    assert down.side == 1


def test_a_jump_is_a_flip_and_is_told() -> None:
    """The smallest of the highest points: the left end of one plateau, then that of the other."""
    system = ramp_system(defuzzifier="som")
    flip = by_way(flips(system, [0.2]))[1]
    assert flip.first == pytest.approx(0.5, abs=2e-9)
    assert flip.output_at_last == pytest.approx(-3.5)
    assert flip.output_at_first == pytest.approx(2.55, abs=0.051)
    words = " ".join(explain(system, [0.2]).text().split())
    assert "x up by 0.3 m, to 0.5 m (30 % of its range); there it jumps from -3.5 N to 2." in words


def only_low(default: float) -> FuzzySystem:
    system = ramp_system(default)
    x = replace(system.inputs[0], terms=terms(low=Triangular(0.0, 0.0, 0.4)))
    return replace(system, inputs=(x,), rules=system.rules[:1])


def test_a_flip_into_the_default_is_told() -> None:
    flip = by_way(flips(only_low(0.5), [0.1]))[1]
    assert flip.takes_default
    assert flip.first == pytest.approx(0.4, abs=2e-9)
    assert flip.output_at_first == 0.5
    assert "there no rule fires, and it takes its default, 0.5 N" in explain(only_low(0.5), [0.1]).text()
    explanation = explain(only_low(-0.5), [0.1])
    assert all(flip.change is None for flip in explanation.outputs[0].flips)
    assert "no value of any one input does" in explanation.text()


def test_the_default_itself_is_told() -> None:
    explanation = explain(only_low(0.5), [0.9])
    assert explanation.outputs[0].is_default
    assert explanation.outputs[0].moves == ()
    assert "y = 0.5 N, its default: no rule that concludes on it fires" in explanation.text()
    assert by_way(explanation.outputs[0].flips)[-1].first == pytest.approx(0.4, abs=2e-9)


def test_from_the_value_itself_any_change_leaves_it() -> None:
    explanation = explain(ramp_system(), [0.5])
    assert [flip.side for flip in explanation.outputs[0].flips] == [0, 0]
    assert "What would move y away from 0 N" in explanation.text()
    assert "x up by any change" in explanation.text()


def test_a_change_counts_from_the_input_as_given() -> None:
    explanation = explain(ramp_system(), [1.5])
    assert by_way(explanation.outputs[0].flips)[-1].change == pytest.approx(-1.0, abs=2e-9)
    assert "x = 1.5 m (taken as 1 m, the end of its range)" in explanation.text()
    assert "x up" not in explanation.text()
    # more than the whole range, and so no share of it
    assert "x down by 2 m, to 0.5 m\n" in explain(ramp_system(), [2.5]).text()


def test_parts_of_the_whole_are_told_where_they_are_parts() -> None:
    """Of conclusions that pull the same way; whatever is told lies between 0 and 1."""
    explanation = explain(ramp_system(-5.0), [0.9])
    parts = [re.search(r"\((\d+) %\)", words) for words in explanation.conclusions(explanation.outputs[0])]
    assert len(parts) == 2
    assert all(parts)
    assert sum(int(part[1]) for part in parts if part) == 100
    for path in SHIPPED.values():
        for system in load(path).systems:
            for start in spread_inputs(system, night.count(3, 12)):
                explanation = explain(system, start)
                (output,) = explanation.outputs
                for words in explanation.conclusions(output):
                    if part := re.search(r" \((?:over )?([\d.]+) %\)", words):
                        assert 0.0 <= float(part[1]) <= 100.0


def test_nothing_is_said_of_a_sign_that_cannot_be() -> None:
    system = ramp_system()
    (y,) = system.outputs
    shifted = [replace(term, membership=Triangular(1.0, 2.0, 3.0)) for term in y.terms]
    positive = replace(y, minimum=0.5, maximum=5.0, default=1.0, terms=tuple(shifted))
    words = explain(replace(system, outputs=(positive,)), [0.3]).text()
    assert "What would" not in words
    assert "negative" not in words
    assert "What would take y below 2 N" in explain(replace(system, outputs=(positive,)), [0.3], 2.0).text()


def points(is_missed: list[bool] | None) -> Points:
    count = 5
    latitude, longitude = (
        np.array([80.0, 0.0, 0.0, -40.0, -90.0]),
        np.array([120.0, -180.0, 0.0, 179.0, 10.0]),
    )
    missing = None if is_missed is None else np.array(is_missed)
    return Points(latitude, longitude, np.zeros(count), {}, missing)


def test_points_that_would_stay_unseen_are_named_or_mapped() -> None:
    assert missed(points(None)) is None
    assert text.write(missed(points([False] * 5))) == "firing nothing any more would leave no point unseen\n"
    few = text.write(missed(points([True, False, False, False, False])))
    assert few == "firing nothing any more would leave 1 of 5 points unseen: 0 at 80° N 120° E\n"
    heading, *rows = text.write(missed(points([True, False, True, True, True]))).splitlines()
    assert heading == "firing nothing any more would leave 4 of 5 points unseen, marked o among the others:"
    assert [row.split()[:2] for row in rows[:-1]] == [
        [f"{abs(latitude)}°", "S" if latitude < 0 else "N"] for latitude in range(80, -81, -20)
    ]
    cells = [row[11:] for row in rows[:-1]]
    marks = {
        (row, column // 2): mark
        for row, line in enumerate(cells)
        for column, mark in enumerate(line)
        if mark != " "
    }
    assert marks == {(0, 20): "o", (4, 0): ".", (4, 12): "o", (6, 23): "o", (8, 12): "o"}


def test_a_deputy_of_a_fleet_speaks_for_itself() -> None:
    """What it would not see others may."""
    written = (
        text.write(missed(replace(points([i < count for i in range(5)]), is_shared=True)))
        for count in (0, 1, 4)
    )
    nothing, named, mapped = (" ".join(words.split()) for words in written)
    begin = "firing nothing any more, this vehicle would"
    assert nothing == f"{begin} see all points that it looks for"
    assert named == f"{begin} not see 1 of 5 points that it looks for: 0 at 80° N 120° E"
    assert mapped.startswith(
        f"{begin} not see 4 of 5 points that it looks for, marked o among the others: 80° N"
    )


def test_what_cannot_be_crossed_is_told_as_such() -> None:
    words = explain(ramp_system(), [0.2], 7.0).text()
    assert "nothing can: y lies between -5 N and 5 N, on one side of 7 N" in words


COLUMNS = ("share", "needed", "strength", "rule")
FOREIGN = {"tipper.fis": 16.0, "dimmer.fll": 0.5, "pendulum.yaml": 0.0}
STARTS = {
    "force_x": (FORCE_X, 0.0),
    "force_x to a value": (FORCE_X, 0.021),
    "force_z": (FORCE_Z, 0.0),
    "room": (ROOM, 0.6),
    # as scikit-fuzzy means them
    **{
        name: (with_semantics(load(EXAMPLES / name).systems[0], "scikit-fuzzy"), value)
        for name, value in FOREIGN.items()
    },
}


@pytest.mark.parametrize("name", STARTS)
def test_scikit_fuzzy_agrees_on_both_sides_of_a_flip(name: str) -> None:
    system, value = STARTS[name]
    engine = ReferenceEngine(system)
    generator = np.random.default_rng(5)
    spans = [variable.maximum - variable.minimum for variable in system.outputs]
    num_flips = 0
    for start in spread_inputs(system, 4):
        for flip in flips(system, start, value):
            if flip.first is None or flip.last is None or flip.side == 0:
                continue
            num_flips += 1
            index = system.outputs.index(flip.output)
            column = system.inputs.index(flip.input)

            def output(at: float, start=start, column=column, index=index) -> float:
                return float(engine.compute([*start[:column], at, *start[column + 1 :]])[index])

            tolerance = 1e-12 * spans[index]
            assert output(flip.last) == pytest.approx(flip.output_at_last, abs=tolerance)
            assert output(flip.first) == pytest.approx(flip.output_at_first, abs=tolerance)
            assert (output(flip.last) - value) * flip.side >= -2 * tolerance
            assert (output(flip.first) - value) * flip.side <= 0.0
            for at in start[column] + (flip.last - start[column]) * generator.random(3):
                assert (output(at) - value) * flip.side >= -2 * tolerance
    assert num_flips >= 3


def test_an_explanation_leads_with_what_matters() -> None:
    explanation = explain(FORCE_X, {"velocity_body_x": 0.05, "distance": 80.0})
    lines = explanation.text().splitlines()
    assert lines[0] == "force_x at distance = 80 m, velocity_body_x = 0.05 m/s"
    assert lines[1].startswith("  force_x = ")
    for start in spread_inputs(FORCE_X, 3):
        sizes = [abs(move.share) for move in explain(FORCE_X, start).outputs[0].moves]
        assert sizes == sorted(sizes, reverse=True)
    strongest = explanation.outputs[0].moves[0]
    heads = next(number for number, line in enumerate(lines) if line.split() == list(COLUMNS))
    assert f"{strongest.rule}. If distance is" in lines[heads + 1]
    assert "more rules fire, each with" in explanation.text()
    assert len(explanation.text(everything=True).splitlines()) > len(lines) + 5
    assert isinstance(explanation, Explanation)
    assert re.search(r" +\| +".join(COLUMNS), explanation._repr_markdown_())


def test_an_explanation_is_plain_json() -> None:
    plain = json.loads(json.dumps(explain(ramp_system(), [0.2]).plain(), allow_nan=False))
    assert plain["inputs"] == {"x": 0.2}
    output = plain["outputs"][0]
    assert [rule["rule"] for rule in output["rules"]] == [1, 2]
    assert [flip["way"] for flip in output["flips"]] == ["up", "down"]
    assert output["flips"][1]["change"] is None


def test_where_rules_cancel_shares_are_amounts_alone() -> None:
    """Of next to nothing, both would be thousands."""
    explanation = explain(ramp_system(0.0), [0.5 - 1e-5])
    assert explanation.outputs[0].value == pytest.approx(0.0, abs=1e-3)
    for sentence in explanation.conclusions(explanation.outputs[0]):
        assert re.fullmatch(r"(left|right), [+-].* N: rule \d says so", sentence)


def test_rules_that_agree_say_so_together() -> None:
    system = ramp_system()
    explanation = explain(replace(system, rules=(*system.rules, *system.rules[:1] * 2)), [0.2])
    value = ramp_output(0.2)
    (left, right) = explanation.conclusions(explanation.outputs[0])
    shares_of = {move.rule: move.share for move in explanation.outputs[0].moves}
    assert shares_of[1] == shares_of[3] == shares_of[4]
    assert sum(shares_of.values()) == pytest.approx(value - 0.5, abs=1e-12)
    whole = 3 * shares_of[1]
    # left is more than all of the way: no part of it
    assert whole / (value - 0.5) > 1.0
    assert left == f"left, {whole:.4g} N: rules 1, 3 and 4 say so together"
    assert right == f"right, +{shares_of[2]:.4g} N: rule 2 says so"
    assert all(move.needed == 0 for move in explanation.outputs[0].moves if move.rule != 2)


def test_shares_by_hand() -> None:
    """The ramp at 0, 1/2 and 1: shares -7/2, -13/4, 0 and 0, 11/4, 5/2; needed -7/2, -3, 0 and 0, 3, 5/2."""
    ranked = shares(ramp_system(), np.array([[0.0], [0.5], [1.0]]))
    assert [rule.rule for rule in ranked.rules] == [1, 2]
    assert [rule.share for rule in ranked.rules] == pytest.approx([6.75 / 12, 5.25 / 12], abs=1e-14)
    assert [rule.moved[0] for rule in ranked.rules] == pytest.approx([6.75 / 3, 5.25 / 3], abs=1e-14)
    assert [rule.needed[0] for rule in ranked.rules] == pytest.approx([6.5 / 3, 5.5 / 3], abs=1e-14)
    assert [rule.fired for rule in ranked.rules] == pytest.approx([2 / 3, 2 / 3])
    assert [rule.leading for rule in ranked.rules] == pytest.approx([2 / 3, 2 / 3])
    assert ranked.text().startswith("ramp over 3 inferences: rule 1 contributes most (56 % of all")
    assert "1. If x is low then y is left" in ranked._repr_markdown_()


def test_shares_tell_what_matters_and_count_the_rest() -> None:
    ranked = shares(compile(FORCE_Z), spread_inputs(FORCE_Z, 200))
    assert sum(rule.share for rule in ranked.rules) == pytest.approx(1.0)
    parts = [rule.share for rule in ranked.rules]
    assert parts == sorted(parts, reverse=True)
    words = ranked.text()
    assert "\n  the other " in words
    assert len(re.findall(r"\n .*\d\. If ", words)) <= 12
    assert len(re.findall(r"\n .*\d\. If ", ranked.text(everything=True))) == len(FORCE_Z.rules)
    json.dumps(ranked.plain(), allow_nan=False)


@pytest.mark.parametrize(
    ("inputs", "value", "sentence"),
    [
        ([0.1, 0.2], 0.0, "pass"),
        ([np.nan], 0.0, "NaN"),
        ({"z": 1.0}, 0.0, "no input 'z'"),
        ([[0.1]], 0.0, "pass one number for each"),
        ([0.1], np.inf, "finite"),
    ],
)
def test_what_cannot_be_explained_says_why(inputs: object, value: float, sentence: str) -> None:
    with pytest.raises(ValueError, match=sentence):
        explain(ramp_system(), inputs, value)  # type: ignore[arg-type]


def test_what_is_lost_in_rounding_is_told_as_nothing() -> None:
    system = load(SHIPPED["paper_champion"]).systems[0]
    explanation = explain(system, [200.0, 0.05])
    assert 0.0 < min(abs(move.needed) for move in explanation.outputs[0].moves if move.needed) < 1e-9
    assert re.search(r"\n +[^ ]+ N +0 N ", explanation.text())
    assert "more rules fire, each with no share" in explanation.text()
