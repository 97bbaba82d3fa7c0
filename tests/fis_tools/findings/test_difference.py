"""Differences of controllers whose changes are known: terms, rules, outputs; in words, as data, as a page."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest

from fis_tools.analysis.arrays import spread_inputs
from fis_tools.engines.inference import infer
from fis_tools.findings.difference import Difference, SystemDifference, difference
from fis_tools.findings.difference.pictures import changed_surfaces
from fis_tools.model import Gaussian, Term, Triangular, Variable
from fis_tools.model.expressions import And, Is
from fis_tools.model.rule_tables import table_rules
from fis_tools.model.systems import Consequent, FuzzySystem, Rule
from plain_files.document import text
from tests.fis_tools import step_by_step
from tests.fis_tools.sample_controllers import FORCE_X, FORCE_Z, GENERAL, PAPER_LIKE, ROOM, terms, with_input
from tests.policies import Page, check_policy

NEAR = FORCE_X.inputs[0].terms[1]


def _with_near(**changes: object) -> FuzzySystem:
    """The force system with its second term of the first input changed."""
    first, _, *others = FORCE_X.inputs[0].terms
    return with_input(FORCE_X, terms=(first, replace(NEAR, **changes), *others))


_FIRST = replace(FORCE_X.rules[0], consequents=FORCE_X.rules[-1].consequents)
ONE_CELL = replace(FORCE_X, rules=(_FIRST, *FORCE_X.rules[1:]))


def _only(changes: Difference) -> SystemDifference:
    (system,) = changes.systems
    return system


def test_a_controller_differs_in_nothing_from_itself():
    for controller in (PAPER_LIKE, GENERAL):
        changes = difference(controller, controller)
        assert changes.is_empty
        assert all(change.largest == 0.0 for system in changes.systems for change in system.outputs)
        assert "Nothing changed." in changes.text()
        assert "Nothing changed." in changes.html()


@pytest.mark.parametrize(
    ("change", "fact"),
    [
        ({"attributes": (("force_axes", "hill"),)}, ("force_axes", "body", "hill")),
        ({"provenance": PAPER_LIKE.provenance[:1]}, ("provenance paper", "AAS 25-727", "none")),
        ({"purpose": "It inspects."}, ("purpose", "none", "It inspects.")),
        ({"name": "other"}, ("name", "paper-like", "other")),
        ({"systems": PAPER_LIKE.systems[::-1]}, ("order of systems", "force_x, force_z", "force_z, force_x")),
    ],
)
def test_what_a_controller_says_besides_its_systems_is_compared(change, fact):
    changes = difference(PAPER_LIKE, replace(PAPER_LIKE, **change))
    assert [(fact.what, fact.before, fact.after) for fact in changes.facts] == [fact]
    assert not changes.is_empty


def test_a_moved_term_is_told_in_units_and_as_a_share():
    result = difference(FORCE_X, _with_near(membership=Gaussian(58.0, 25.0)))
    changes = _only(result)
    (variable,) = changes.variables
    (term,) = variable.terms
    assert (variable.kind, variable.present.name, variable.facts) == ("input", "distance", ())
    assert term.moved == pytest.approx(8.0)
    assert term.share == pytest.approx(8.0 / 200.0)
    assert not changes.rules
    assert changes.outputs[0].largest > 0.0
    assert re.search(r"near +mean 50 → 58 +moved by 8 m \(4 %\)", result.text())


def test_the_likeness_of_two_shifted_triangles_is_known():
    def system(peak):
        x = Variable("x", "", 0.0, 10.0, terms(a=Triangular(peak - 1.0, peak, peak + 1.0)), num_points=1001)
        y = Variable("y", "", 0.0, 1.0, terms(b=Triangular(0.0, 0.5, 1.0)), default=0.0)
        return FuzzySystem("s", (x,), (y,), (Rule(Is("x", "a"), (Consequent("y", "b"),)),))

    (term,) = _only(difference(system(4.0), system(4.5))).variables[0].terms
    # half a base of 1: triangles shifted by 0.5 share a triangle of base 1.5 and height 0.75
    shared = 0.5 * 1.5 * 0.75
    assert term.similarity == pytest.approx(shared / (2.0 - shared), abs=1e-6)
    assert term.moved == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"unit": "km"}, ("unit", "m", "km")),
        ({"maximum": 250.0}, ("range", "0 to 200", "0 to 250")),
        ({"num_points": 201}, ("points", "101, even", "201, even")),
        ({"points": (0, 50, 200), "num_points": 3}, ("points", "101, even", "3 of its own: 0, 50, 200")),
        ({"description": "How far."}, ("description", "From the chief.", "How far.")),
    ],
)
def test_what_a_variable_says_of_itself_is_compared(change, sentence):
    (variable,) = _only(difference(FORCE_X, with_input(FORCE_X, **change))).variables
    assert [(fact.what, fact.before, fact.after) for fact in variable.facts] == [sentence]


def test_digits_that_nobody_reads_are_told_only_alone():
    def text_with(mean, standard_deviation):
        return difference(FORCE_X, _with_near(membership=Gaussian(mean, standard_deviation))).text()

    assert re.search(rf"mean 50.0 → {50.0 + 1e-9!r} +stays", text_with(50.0 + 1e-9, 25.0))
    assert "near  standard deviation" in text_with(50.0 + 1e-9, 26.0)


def test_only_a_table_has_points_for_what_did_not_change():
    changes = difference(FORCE_X, ONE_CELL)
    assert re.search(r"\n +very near +PL → ZE +·", changes.text())
    narrow = text.write(changes.document(), 20)
    assert re.search(r"\n +very near +away fast +PL → ZE\n", narrow)
    assert "·" not in narrow


def test_operators_defaults_and_the_order_of_inputs_are_compared():
    output = replace(FORCE_X.outputs[0], default=0.01)
    changed = replace(FORCE_X, and_operator="product", defuzzifier="bisector", outputs=(output,))
    changes = _only(difference(FORCE_X, replace(changed, inputs=FORCE_X.inputs[::-1])))
    assert [fact.what for fact in changes.facts] == ["and operator", "defuzzifier", "order of inputs"]
    assert [fact.what for fact in changes.variables[0].facts] == ["default"]


def test_the_order_of_inputs_and_of_statements_changes_no_output():
    rules = [replace(rule, antecedent=And(rule.antecedent.operands[::-1])) for rule in FORCE_X.rules[::-1]]
    changes = _only(difference(FORCE_X, replace(FORCE_X, inputs=FORCE_X.inputs[::-1], rules=tuple(rules))))
    assert not changes.rules
    assert not changes.variables
    assert changes.outputs[0].largest < 1e-12
    text_of = difference(FORCE_X, replace(FORCE_X, rules=tuple(rules))).text()
    assert "Only the order of rules" in text_of
    assert "Nothing changed." not in text_of


def test_a_renamed_term_takes_its_rules_along():
    inputs = _with_near(name="close by").inputs
    table = [rule.consequents[0].term for rule in FORCE_X.rules]
    changed = replace(FORCE_X, inputs=inputs, rules=table_rules(inputs, FORCE_X.outputs[0], table))
    result = difference(FORCE_X, changed)
    (term,) = _only(result).variables[0].terms
    assert term.similarity == 1.0
    assert not _only(result).rules
    assert _only(result).outputs[0].largest == 0.0
    assert "near → close by" in result.text()


def test_terms_that_are_not_alike_are_added_and_removed():
    output = FORCE_X.outputs[0]
    more = replace(output, terms=(*output.terms, Term("none", Triangular(0.0, 0.001, 0.002))))
    with_more = replace(FORCE_X, outputs=(more,))
    (term,) = _only(difference(FORCE_X, with_more)).variables[0].terms
    assert term.before is None
    removed = difference(with_more, FORCE_X)
    assert _only(removed).variables[0].terms[0].after is None
    assert "removed" in removed.text()


@pytest.mark.slow
def test_changed_cells_of_a_table_are_told():
    rules = list(FORCE_Z.rules)
    rules[7] = replace(rules[7], consequents=(Consequent("force_z", "NL"),))
    changes = difference(FORCE_Z, replace(FORCE_Z, rules=tuple(rules)))
    (change,) = _only(changes).rules
    assert change.number == 8
    assert change.before == FORCE_Z.rules[7]
    assert "1 of 45 rules changed" in changes.text()
    assert f"{FORCE_Z.rules[7].consequents[0].term} → NL" in changes.text()
    assert changes.text().count("Where eta_u is") == 1
    assert changes.html().count('<td class="changed">') == 1


def test_rules_are_added_removed_and_weighted():
    first, second = ROOM.rules
    low, opened = second.consequents
    weighted = replace(second, consequents=(replace(low, weight=0.5), opened))
    extra = Rule(Is("wind", "calm"), (Consequent("vent", "open"),))
    changes = difference(ROOM, replace(ROOM, rules=(weighted, extra)))
    states = [(c.before is not None, c.after is not None, c.number) for c in _only(changes).rules]
    assert states == [(True, True, 1), (False, True, 2), (True, False, 1)]
    assert "heat is low (weight 0.5)" in changes.text()
    assert re.search(rf"\n +1\. +\[{first.label}\] .*  none\n", changes.text())
    unlabelled = replace(ROOM, rules=(replace(first, label=""), second))
    assert len(_only(difference(ROOM, unlabelled)).rules) == 1


def test_outputs_moved_by_a_constant_move_by_it_everywhere():
    output = FORCE_X.outputs[0]
    higher = tuple(Term(t.name, replace(t.membership, mean=t.membership.mean + 0.02)) for t in output.terms)
    moved = replace(output, minimum=output.minimum + 0.02, maximum=output.maximum + 0.02, terms=higher)
    (change,) = _only(difference(FORCE_X, replace(FORCE_X, outputs=(moved,)))).outputs
    assert change.mean == pytest.approx(0.02, abs=1e-12)
    assert change.largest_share == pytest.approx(0.02 / 0.2, abs=1e-11)
    assert change.after - change.before == pytest.approx(0.02, abs=1e-12)


def test_outputs_are_compared_along_flights_too():
    changed = replace(FORCE_X, and_operator="product")
    samples = spread_inputs(FORCE_X, 50)
    ranges, flights = _only(difference(FORCE_X, changed, {"force_x": samples})).outputs
    sizes = np.abs(step_by_step.evaluate(changed, samples) - step_by_step.evaluate(FORCE_X, samples))[:, 0]
    assert (ranges.where, flights.where, flights.num_samples) == ("the ranges", "the flights", 50)
    assert flights.mean == pytest.approx(sizes.mean(), abs=1e-14)
    assert flights.largest == pytest.approx(sizes.max(), abs=1e-14)
    worst = [flights.inputs[variable.name] for variable in FORCE_X.inputs]
    np.testing.assert_array_equal(worst, samples[np.argmax(sizes)])


def test_systems_and_variables_come_and_go():
    less = replace(PAPER_LIKE, systems=PAPER_LIKE.systems[:1])
    assert [s.after is None for s in difference(PAPER_LIKE, less).systems] == [False, True]
    assert "force_z\n  Removed; it had 45 rules" in difference(PAPER_LIKE, less).text()
    assert "force_z\n  Added; 45 rules" in difference(less, PAPER_LIKE).text()
    changes = _only(difference(FORCE_Z, FORCE_X))
    come_or_gone = {(c.present.name, c.before is None) for c in changes.variables}
    assert come_or_gone >= {("eta_u", False), ("force_x", True)}
    assert changes.outputs == ()


@pytest.mark.slow
def test_the_page_is_whole_by_itself_and_trusts_no_name():
    nasty = Term("<script>&", Triangular(0.0, 1.0, 2.0))
    changed = with_input(FORCE_X, terms=(*FORCE_X.inputs[0].terms, nasty))
    after = replace(PAPER_LIKE, name="<b>&", systems=(changed, PAPER_LIKE.systems[1]))
    page = difference(PAPER_LIKE, after).html()
    check_policy(page)
    markup = Page(page)
    loading = [value for name in ("src", "srcset", "href") for value in markup.values(name)]
    assert all(value.startswith("data:image/png;base64,") for value in loading)
    assert "<script>" not in page
    assert "&lt;script&gt;&amp;" in page
    assert "<picture>" in difference(PAPER_LIKE, after)._repr_html_()


@pytest.mark.slow
def test_the_command_prints_writes_and_checks(tmp_path, paper, saved, run):
    old, new = paper, saved(replace(PAPER_LIKE, systems=(ONE_CELL, PAPER_LIKE.systems[1])), "new.yaml")
    assert "PL → ZE" in run("diff", old, new).out
    run("diff", old, new, "--exit-code", code=1)
    run("diff", old, old, "--exit-code")
    run("diff", old, new, "--system", "force_z", "--exit-code")
    data = json.loads(run("diff", old, new, "--json").out)
    assert (data["schema"], data["schema_version"]) == ("fuzzy-difference", 1)
    assert [system["state"] for system in data["systems"]] == ["changed", "same"]
    assert data["systems"][0]["rules"][0]["state"] == "changed"
    run("diff", old, new, "-o", tmp_path / "diff.html")
    assert (tmp_path / "diff.html").read_text(encoding="utf-8").startswith("<!DOCTYPE html>")


def test_surfaces_are_those_of_both_over_the_ranges_of_both():
    wider = with_input(FORCE_X, maximum=300.0)
    after = replace(wider, inputs=wider.inputs[::-1], rules=FORCE_X.rules[::-1])
    old, new, change = changed_surfaces(FORCE_X, after, "force_x")
    assert (old.x_variable.name, old.y_variable.name) == ("distance", "velocity_body_x")
    assert (old.x[0], old.x[-1]) == (0.0, 300.0)
    for row, column in ((0, 0), (30, 10), (7, 60), (60, 41)):
        distance, velocity = old.x[column], old.y[row]
        was = infer(FORCE_X, np.array([distance, velocity])).values[0]
        now = infer(after, np.array([velocity, distance])).values[0]
        assert old.values[row, column] == pytest.approx(was, abs=1e-12)
        assert new.values[row, column] == pytest.approx(now, abs=1e-12)
        assert change.values[row, column] == pytest.approx(now - was, abs=1e-12)


@pytest.mark.slow
def test_the_page_pictures_surfaces_of_what_moved_alone():
    moved = difference(FORCE_X, ONE_CELL).html()
    assert moved.count('src="data:image/png;base64,') == 1
    assert 'alt="force_x, before, after and the difference"' in moved
    distance = FORCE_X.inputs[0]
    conclusion = FORCE_X.rules[0].consequents
    rules = tuple(Rule(Is("distance", term.name), conclusion) for term in distance.terms)
    gone = replace(FORCE_X, inputs=(distance,), rules=rules)
    assert "<img" not in difference(FORCE_X, with_input(FORCE_X, description="Far.")).html()
    assert "<img" not in difference(FORCE_X, gone).html()
    assert "<img" not in difference(gone, replace(gone, rules=gone.rules[:2])).html()
