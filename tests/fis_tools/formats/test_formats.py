"""Words, tables and CSV of controllers."""

import csv
import io
import json
import tracemalloc
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fis_tools.engines.inference import infer
from fis_tools.errors import ControllerFileError
from fis_tools.findings.audit import audit
from fis_tools.findings.simplification import simplify
from fis_tools.formats import csv as csv_format
from fis_tools.formats import serialize
from fis_tools.formats.exchange import foreign
from fis_tools.formats.notation import read_json
from fis_tools.model import And, FuzzySystem, Hedged, Is, Not, Or, Term, shapes, table_rules, validate
from fis_tools.source import named, read_controller
from fis_tools.words import text
from plain_files.document import text as plain_text
from tests.fis_tools.sample_controllers import FORCE_X, FORCE_Z, GENERAL, PAPER_LIKE, ROOM, SHIPPED

A, B, C = Is("a", "low"), Is("b", "high"), Is("c", "mid")


@pytest.mark.parametrize(
    ("expression", "words"),
    [
        (A, "a is low"),
        (Not(A), "a is not low"),
        (And((A, B)), "a is low and b is high"),
        (And((A, Or((B, C)))), "a is low and (b is high or c is mid)"),
        (Or((And((A, B)), C)), "(a is low and b is high) or c is mid"),
        (Not(Or((A, B))), "not (a is low or b is high)"),
        (And((And((A, B)), C)), "a is low and b is high and c is mid"),
        (And((Or((A,)), B)), "a is low and b is high"),
        (Not(Not(A)), "a is not not low"),
        (Not(Hedged("very", A)), "a is not very low"),
        (Hedged("somewhat", And((A, B))), "somewhat (a is low and b is high)"),
    ],
)
def test_antecedents_in_words(expression, words) -> None:
    assert text.antecedent_words(expression) == words


def test_rules_in_words() -> None:
    fifth = "If distance is very near and velocity_body_x is towards fast then force_x is NL"
    assert text.sentences(FORCE_X)[4] == fifth
    assert text.sentences(ROOM)[0] == (
        "[warm up] If temperature is cold and (wind is calm or temperature is not hot) "
        "then heat is high and vent is open (weight 0.25)"
    )


def test_ways_of_its_own_are_said_where_they_count() -> None:
    first, second = ROOM.rules
    heat, vent = ROOM.outputs
    system = replace(
        ROOM,
        rules=(replace(first, and_operator="min", or_operator="bounded_sum"), second),
        outputs=(replace(heat, defuzzifier="mom"), replace(vent, accumulation="einstein_sum")),
    )
    assert "(and: min, or: bounded_sum) then heat is high" in text.sentences(system)[0]
    assert text.sentences(system)[1] == text.sentences(ROOM)[1]
    assert text.summary(system).endswith(
        "and: product, or: probabilistic_sum, defuzzifier: bisector, heat by mom, "
        "vent accumulated by einstein_sum"
    )
    lines = text.explain(infer(system, np.array([12.0, 1.0])))
    assert "the mean of the highest points of these terms" in lines
    assert "the bisector of the area of these terms" in lines


@pytest.mark.parametrize(
    ("shape", "words"),
    [
        (shapes.Gaussian(0.0, 25.0), "Gaussian, mean 0, standard deviation 25"),
        (shapes.TwoSidedGaussian(1.0, 0.5, 2.0, 0.25), "one from 1 to 2, standard deviations 0.5 and 0.25"),
        (shapes.GeneralizedBell(2.0, 3.0, 5.0), "bell, half width 2, slope 3, centre 5"),
        (shapes.Sigmoid(4.0, -2.0), "sigmoid, inflection 4, slope -2"),
        (shapes.SigmoidDifference(2.0, 3.0, 8.0, 4.0), "slope 3, less sigmoid, inflection 8, slope 4"),
        (shapes.SigmoidProduct(2.0, 3.0, 8.0, -4.0), "slope 3, times sigmoid, inflection 8, slope -4"),
        (shapes.SShape(2.0, 6.0), "S shape from 2 up to 6"),
        (shapes.ZShape(2.0, 6.0), "Z shape from 2 down to 6"),
        (shapes.PiShape(0.0, 4.0, 6.0, 10.0), "pi shape from 0 over 4 to 6 to 10"),
    ],
)
def test_shapes_in_words(shape, words) -> None:
    assert text.shape_words(Term("t", shape)).endswith(words)


def test_rule_tables_of_one_two_and_three_inputs() -> None:
    ((title, rows),) = text.rule_tables(FORCE_X) or []
    assert title == ""
    assert rows[0] == ["distance \\ velocity_body_x", "away fast", "away", "still", "towards", "towards fast"]
    assert rows[4] == ["far", "PL", "PS", "PS", "ZE", "NS"]
    tables = text.rule_tables(FORCE_Z) or []
    assert [title for title, _ in tables] == ["eta_u is left", "eta_u is ahead", "eta_u is right"]
    assert tables[2][1][5] == ["PL", "NL", "NS", "ZE"]
    inputs = FORCE_X.inputs[1:]
    single = FuzzySystem("s", inputs, FORCE_X.outputs, table_rules(inputs, FORCE_X.outputs[0], ["ZE"] * 5))
    assert (text.rule_tables(single) or [])[0][1][1] == ["", "ZE", "ZE", "ZE", "ZE", "ZE"]
    assert text.rule_tables(ROOM) is None


def test_a_description_shows_terms_tables_and_defaults() -> None:
    shown = plain_text.write(text.outline(PAPER_LIKE))
    assert "    very near  Gaussian, mean 0, standard deviation 25\n" in shown
    assert "  Output force_x (N)\n    From -0.1 to 0.1, 101 points; 0 when no rule fires.\n" in shown
    assert "    far                         PL         PS    PS     ZE       NS\n" in shown
    assert "  force_axes  body\n" in shown
    assert not any(line.endswith(" ") for line in shown.splitlines())
    general = plain_text.write(text.outline(GENERAL))
    assert "trapezoid from 0 over 0 to 10 to 20" in general
    assert "sampled at 5 points" in general
    assert "   2  If temperature is hot then heat is low (weight 0.75) and vent is open.\n" in general


def test_an_inference_is_explained_step_by_step() -> None:
    lines = text.explain(infer(FORCE_X, np.array([230.0, 0.1])))
    assert "distance = 230 m, taken as 200 m, the end of its range" in lines
    assert "very far  1.00  ████████████████████" in lines
    assert "rule 24: If distance is very far and velocity_body_x is towards then force_x is PS" in lines
    assert lines.index("rule 24:") < lines.index("rule 23:")
    value = infer(FORCE_X, np.array([230.0, 0.1])).values[0]
    assert f"force_x = {value:.6g} N, the centre of area" in lines


def test_an_inference_in_which_nothing_fires_is_explained() -> None:
    lines = text.explain(infer(replace(ROOM, rules=ROOM.rules[1:]), np.array([0.0, 16.0])))
    assert "no rule fires" in lines
    assert "      none" in lines
    assert "heat = 0.5 kW, its default" in lines


def test_csv_has_a_row_for_each_rule_and_consequent() -> None:
    rows = list(csv.DictReader(io.StringIO(csv_format.write(PAPER_LIKE))))
    assert len(rows) == 25 + 45
    row = rows[3 * 5 + 4]
    expected = {"system": "force_x", "rule": "20", "distance": "far", "velocity_body_x": "towards fast"}
    assert expected.items() <= row.items()
    assert (row["term"], row["eta_u"]) == ("NS", "")
    general = list(csv.DictReader(io.StringIO(csv_format.write(GENERAL))))
    concluded = [" ".join((row["output"], row["term"], row["weight"])) for row in general]
    assert concluded == ["heat high 1.0", "vent open 0.25", "heat low 0.75", "vent open 1.0"]
    assert [row["temperature"] for row in general] == ["", "", "hot", "hot"]


def test_csv_has_no_cell_that_a_spreadsheet_runs() -> None:
    first, *others = PAPER_LIKE.systems
    rules = (replace(first.rules[0], label='=HYPERLINK("http://x")'), *first.rules[1:])
    written = csv_format.write(replace(PAPER_LIKE, systems=(replace(first, rules=rules), *others)))
    assert next(csv.DictReader(io.StringIO(written)))["label"] == '\'=HYPERLINK("http://x")'
    rows = [["=1+1", "@SUM(A1)", "-cmd", "\t=1", "-1.5e-3", "+inf", "a=b", "", -2]]
    assert csv_format.rows_as_text(rows) == "'=1+1,'@SUM(A1),'-cmd,'\t=1,-1.5e-3,+inf,a=b,,-2\n"


def variable(name, **changes):
    terms = [{"name": "low", "mean": 0.0, "standard_deviation": 0.3}]
    return {"name": name, "unit": "", "range": [0.0, 1.0], "terms": terms, **changes}


def controller(inputs, rules):
    outputs = [variable("y", default=0.0)]
    system = {"name": "s", "inputs": inputs, "outputs": outputs, "rules": rules}
    return json.dumps({"schema": "fuzzy-controller", "schema_version": 1, "name": "c", "systems": [system]})


def terms(number):
    return [{"name": f"t{i}", "mean": i / number, "standard_deviation": 0.1} for i in range(number)]


MANY_TERMS = variable("x", terms=terms(1000), points=10_001)


def test_a_number_of_a_million_digits_with_a_letter_behind_it_takes_no_time():
    """Backtracking would take as many steps as the square of its digits, which is a day."""
    with pytest.raises(ControllerFileError, match="is not a finite number"):
        foreign.number("1" * 1_000_000 + "x", "here")


def test_the_last_of_many_keys_repeated_takes_no_time():
    text = "{" + ", ".join(f'"k{i}": 0' for i in range(200_000)) + ', "k199999": 0}'
    with pytest.raises(ControllerFileError, match="the key 'k199999' appears twice"):
        read_json(text)


def test_of_very_many_problems_the_first_are_told():
    rule = {"if": {"is": ["x", "high"]}, "then": [{"variable": "y", "term": "lo"}]}
    with pytest.raises(ControllerFileError, match=f"and {validate.MOST_PROBLEMS - 8} more"):
        serialize.loads(controller([variable("x")], [rule] * 40_000), "json")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (controller([variable(f"x{i}") for i in range(80)], ["low"]), "has 80 entries; at most 64 are read"),
        (controller([variable("x", terms=terms(20_001))], ["low"] * 20_001), "20001 entries; at most 20000"),
        (controller([MANY_TERMS], ["low"] * 1000), "memberships, terms times points; at most"),
    ],
    ids=["inputs", "terms", "memberships"],
)
def test_systems_that_no_analysis_ends_for(text, message):
    tracemalloc.start()
    with pytest.raises(ControllerFileError, match=message):
        serialize.loads(text, "json")
    assert tracemalloc.get_traced_memory()[1] < 100e6
    tracemalloc.stop()


CHAMPION = SHIPPED["champion_27"]
SLIP = ("negative_large, negative_small, zero, ", "negative_large, negative_small, positive_large, ")


def test_every_shipped_champion_is_the_one_its_provenance_tells_of() -> None:
    champions = list(map(serialize.load, [path for name, path in SHIPPED.items() if "champion" in name]))
    assert len(champions) > 7
    for controller in champions:
        assert dict(controller.provenance)["controller_hash"] == serialize.content_hash(controller)
        assert serialize.edited(controller) is None


@pytest.mark.parametrize(
    "change",
    [
        SLIP,
        ("decision_period_s: 30.0", "decision_period_s: 40.0"),
        ("peak: 0.053, right: 0.106}", "peak: 0.052, right: 0.106}"),
    ],
)
def test_a_controller_edited_by_hand_says_so(change) -> None:
    text = CHAMPION.read_text()
    assert text.replace(*change, 1) != text
    original = dict(serialize.load(CHAMPION).provenance)["controller_hash"]
    words = f"by hand after training; fitness and figures are of hash {original}"
    controller = serialize.loads(text.replace(*change, 1), "yaml")
    assert serialize.edited(controller) == words
    again = serialize.loads(serialize.dump_json(controller), "json")
    assert serialize.edited(again) == words
    assert again.name == controller.name == "champion_27, edited"
    given, unmarked = serialize.load(CHAMPION), serialize.unmarked(again)
    assert (unmarked.name, unmarked.purpose) == (given.name, given.purpose)
    assert again.purpose.startswith("champion_27, edited. Before that, its purpose was: Pushes towards")
    (finding,) = [edited for edited in audit(controller).findings if edited.id == "edited"]
    assert finding.sentence == f"champion_27 was edited {words}."


@pytest.mark.parametrize(
    "change",
    [
        ("decision_period_s: 30.0", "decision_period_s: 30"),
        ("description: force along Hill i", "description: up or down"),
        ("name: champion_27\n", "name: other\n"),
    ],
)
def test_other_words_for_the_same_are_no_edit(change) -> None:
    text = CHAMPION.read_text()
    assert text.replace(*change) != text
    assert serialize.edited(serialize.loads(text.replace(*change), "yaml")) is None


@pytest.mark.slow
def test_what_was_simplified_is_told_apart_from_what_a_hand_did() -> None:
    trained = serialize.described(PAPER_LIKE, {"training_fitness": "0.5"})
    simpler = simplify(trained).controller
    assert serialize.content_hash(simpler) != serialize.content_hash(trained)
    again = serialize.loads(serialize.dump_json(simpler), "json")
    assert str(serialize.edited(again)).startswith("by simplify after training; ")
    assert serialize.edited(replace(again, provenance=())) is None


def test_a_slip_in_a_symmetric_table_is_found() -> None:
    def asymmetric_cells(text: str) -> list[tuple[int, ...]]:
        report = audit(serialize.loads(text, "yaml"))
        return [finding.rules for finding in report.findings if finding.id == "broken-symmetry"]

    text = CHAMPION.read_text()
    assert asymmetric_cells(text) == []
    assert asymmetric_cells(text.replace(*SLIP, 1)) == [(3, 7)]
    # the middle of an odd table is its own mirror
    middle = "negative_small, zero,           positive_small,  # aim_r"
    assert asymmetric_cells(
        text.replace(middle, middle.replace("zero,          ", "positive_small,"), 1)
    ) == [(5,)]


def test_a_project_says_where_its_controllers_are(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "mine"
    (folder / "below").mkdir(parents=True)
    (folder / "fan.yaml").write_text(CHAMPION.read_text())
    monkeypatch.chdir(folder / "below")
    with pytest.raises(ControllerFileError, match="no controller of that name"):
        read_controller("fan")
    (tmp_path / "pyproject.toml").write_text('[tool.fis_tools]\ncontrollers = ["mine"]\n')
    assert named("fan") == folder / "fan.yaml"
    assert read_controller("fan") == serialize.load(CHAMPION)
    with pytest.raises(ControllerFileError, match="did you mean 'fan'"):
        read_controller("fam")
    (folder / "fan.json").write_text(serialize.dump_json(serialize.load(CHAMPION)))
    with pytest.raises(ControllerFileError, match=r"fan may be .*fan\.json or .*fan\.yaml"):
        read_controller("fan")
