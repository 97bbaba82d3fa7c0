"""Differences of controllers whose changes are known: terms, rules, outputs; in words, as data, as a page."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest

from fis_tools.__main__ import main
from fis_tools.analysis.arrays import spread_inputs
from fis_tools.document import text
from fis_tools.engines.inference import infer
from fis_tools.findings.difference import Difference, SystemDifference, difference
from fis_tools.findings.difference.pictures import changed_surfaces
from fis_tools.formats.serialize import dump_yaml
from fis_tools.model import (
    And,
    Consequent,
    FuzzyController,
    FuzzySystem,
    Gaussian,
    Is,
    Rule,
    Term,
    Triangular,
    Variable,
    table_rules,
)
from tests.fis_tools import step_by_step
from tests.fis_tools.sample_controllers import (
    force_x_system,
    force_z_system,
    general_controller,
    paper_like_controller,
)
from tests.policies import Page, check_policy


def _with_input(system: FuzzySystem, place: int, variable: Variable) -> FuzzySystem:
    inputs = list(system.inputs)
    inputs[place] = variable
    return replace(system, inputs=tuple(inputs))


def _with_term(variable: Variable, place: int, term: Term) -> Variable:
    terms = list(variable.terms)
    terms[place] = term
    return replace(variable, terms=tuple(terms))


def _only(found: Difference) -> SystemDifference:
    (system,) = found.systems
    return system


def test_a_controller_differs_in_nothing_from_itself():
    for controller in (paper_like_controller(), general_controller()):
        found = difference(controller, controller)
        assert found.is_empty
        assert all(change.largest == 0.0 for system in found.systems for change in system.outputs)
        assert "Nothing changed." in found.text()
        assert "Nothing changed." in found.html()


def test_where_a_controller_comes_from_is_no_difference():
    controller = paper_like_controller()
    assert difference(controller, replace(controller, provenance=())).is_empty
    found = difference(controller, replace(controller, attributes=(("force_axes", "hill"),)))
    assert [(fact.what, fact.before, fact.after) for fact in found.facts] == [("force_axes", "body", "hill")]
    assert not found.is_empty


def test_a_moved_term_is_told_in_units_and_as_a_share():
    system = force_x_system()
    near = system.inputs[0].terms[1]
    assert isinstance(near.membership, Gaussian)
    moved = Term(near.name, Gaussian(near.membership.mean + 8.0, near.membership.standard_deviation))
    found = _only(difference(system, _with_input(system, 0, _with_term(system.inputs[0], 1, moved))))
    (variable,) = found.variables
    (term,) = variable.terms
    assert (variable.kind, variable.present.name, variable.facts) == ("input", "distance", ())
    assert term.moved == pytest.approx(8.0)
    assert term.share == pytest.approx(8.0 / 200.0)
    assert not found.rules
    assert found.outputs[0].largest > 0.0
    told = difference(system, _with_input(system, 0, _with_term(system.inputs[0], 1, moved))).text()
    assert re.search(r"near +mean 50 → 58 +moved by 8 m \(4 %\)", told)


def test_the_likeness_of_two_shifted_triangles_is_known():
    def system(peak):
        terms = (Term("a", Triangular(peak - 1.0, peak, peak + 1.0)),)
        x = Variable("x", "", 0.0, 10.0, terms, num_points=1001)
        y = Variable("y", "", 0.0, 1.0, (Term("b", Triangular(0.0, 0.5, 1.0)),), default=0.0)
        return FuzzySystem("s", (x,), (y,), (Rule(Is("x", "a"), (Consequent("y", "b"),)),))

    (term,) = _only(difference(system(4.0), system(4.5))).variables[0].terms
    # half a base of 1: triangles shifted by 0.5 share a triangle of base 1.5 and height 0.75
    shared = 0.5 * 1.5 * 0.75
    assert term.similarity == pytest.approx(shared / (2.0 - shared), abs=1e-6)
    assert term.moved == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("change", "facts"),
    [
        ({"unit": "km"}, [("unit", "m", "km")]),
        ({"maximum": 250.0}, [("range", "0 to 200", "0 to 250")]),
        ({"num_points": 201}, [("points", "101, even", "201, even")]),
        (
            {"points": (0.0, 50.0, 200.0), "num_points": 3},
            [("points", "101, even", "3 of its own: 0, 50, 200")],
        ),
        ({"description": "How far."}, [("description", "From the chief.", "How far.")]),
    ],
)
def test_what_a_variable_says_of_itself_is_compared(change, facts):
    system = force_x_system()
    changed = _with_input(system, 0, replace(system.inputs[0], **change))  # type: ignore[arg-type]
    (variable,) = _only(difference(system, changed)).variables
    assert [(fact.what, fact.before, fact.after) for fact in variable.facts] == facts


def test_digits_that_nobody_reads_are_told_only_alone():
    system = force_x_system()
    near = system.inputs[0].terms[1]
    assert isinstance(near.membership, Gaussian)

    def told(mean, standard_deviation):
        term = Term(near.name, Gaussian(mean, standard_deviation))
        return difference(system, _with_input(system, 0, _with_term(system.inputs[0], 1, term))).text()

    mean, width = near.membership.mean, near.membership.standard_deviation
    assert re.search(rf"mean {mean!r} → {mean + 1e-9!r} +stays", told(mean + 1e-9, width))
    assert "near  standard deviation" in told(mean + 1e-9, width + 1.0)


def test_only_a_table_has_points_for_what_did_not_change():
    system = force_x_system()
    rules = list(system.rules)
    rules[0] = replace(rules[0], consequents=rules[-1].consequents)
    found = difference(system, replace(system, rules=tuple(rules)))
    assert re.search(r"\n +very near +PL → ZE +·", found.text())
    narrow = text.write(found.document(), 20)
    assert re.search(r"\n +very near +away fast +PL → ZE\n", narrow)
    assert "·" not in narrow


def test_operators_defaults_and_the_order_of_inputs_are_compared():
    system = force_x_system()
    changed = replace(
        system,
        and_operator="product",
        defuzzifier="bisector",
        outputs=(replace(system.outputs[0], default=0.01),),
        inputs=system.inputs[::-1],
    )
    found = _only(difference(system, changed))
    assert [fact.what for fact in found.facts] == ["and operator", "defuzzifier", "order of inputs"]
    assert [fact.what for fact in found.variables[0].facts] == ["default"]


def test_the_order_of_inputs_and_of_statements_changes_no_output():
    system = force_x_system()
    rules = tuple(
        replace(rule, antecedent=And(rule.antecedent.operands[::-1]))
        for rule in system.rules[::-1]
        if isinstance(rule.antecedent, And)
    )
    found = _only(difference(system, replace(system, inputs=system.inputs[::-1], rules=rules)))
    assert not found.rules
    assert not found.variables
    assert found.outputs[0].largest < 1e-12


def test_a_renamed_term_takes_its_rules_along():
    system = force_x_system()
    near = system.inputs[0].terms[1]
    variable = _with_term(system.inputs[0], 1, Term("close by", near.membership))
    table = [rule.consequents[0].term for rule in system.rules]
    inputs = (variable, system.inputs[1])
    changed = replace(system, inputs=inputs, rules=table_rules(inputs, system.outputs[0], table))
    found = _only(difference(system, changed))
    (term,) = found.variables[0].terms
    assert term.similarity == 1.0
    assert not found.rules
    assert found.outputs[0].largest == 0.0
    assert "near → close by" in difference(system, changed).text()


def test_terms_that_are_not_alike_are_added_and_removed():
    system = force_x_system()
    variable = replace(
        system.outputs[0], terms=(*system.outputs[0].terms, Term("none", Triangular(0.0, 0.001, 0.002)))
    )
    found = _only(difference(system, replace(system, outputs=(variable,))))
    (term,) = found.variables[0].terms
    assert term.before is None
    (term,) = _only(difference(replace(system, outputs=(variable,)), system)).variables[0].terms
    assert term.after is None
    assert "removed" in difference(replace(system, outputs=(variable,)), system).text()


@pytest.mark.slow
def test_changed_cells_of_a_table_are_told():
    system = force_z_system()
    rules = list(system.rules)
    rules[7] = replace(rules[7], consequents=(Consequent("force_z", "NL"),))
    found = difference(system, replace(system, rules=tuple(rules)))
    (change,) = _only(found).rules
    assert change.number == 8
    assert change.before == system.rules[7]
    assert "1 of 45 rules changed" in found.text()
    assert f"{system.rules[7].consequents[0].term} → NL" in found.text()
    assert found.text().count("Where eta_u is") == 1
    assert '<td class="changed">' in found.html()
    assert found.html().count('<td class="changed">') == 1


def test_rules_are_added_removed_and_weighted():
    (system,) = general_controller().systems
    first, second = system.rules
    weighted = replace(
        second, consequents=(replace(second.consequents[0], weight=0.5), second.consequents[1])
    )
    extra = Rule(Is("wind", "calm"), (Consequent("vent", "open"),))
    found = _only(difference(system, replace(system, rules=(weighted, extra))))
    states = [(c.before is not None, c.after is not None, c.number) for c in found.rules]
    assert states == [(True, True, 1), (False, True, 2), (True, False, 1)]
    told = difference(system, replace(system, rules=(weighted, extra))).text()
    assert "heat is low (weight 0.5)" in told
    assert re.search(rf"\n +1 +\[{first.label}\] .*  none\n", told)
    assert (
        len(_only(difference(system, replace(system, rules=(replace(first, label=""), second)))).rules) == 1
    )


def test_outputs_moved_by_a_constant_move_by_it_everywhere():
    system = force_x_system()
    output = system.outputs[0]

    def shifted(shape):
        assert isinstance(shape, Gaussian)
        return Gaussian(shape.mean + 0.02, shape.standard_deviation)

    moved = replace(
        output,
        minimum=output.minimum + 0.02,
        maximum=output.maximum + 0.02,
        terms=tuple(Term(term.name, shifted(term.membership)) for term in output.terms),
    )
    (change,) = _only(difference(system, replace(system, outputs=(moved,)))).outputs
    assert change.mean == pytest.approx(0.02, abs=1e-12)
    assert change.largest_share == pytest.approx(0.02 / 0.2, abs=1e-11)
    assert change.after - change.before == pytest.approx(0.02, abs=1e-12)


def test_outputs_are_compared_along_flights_too():
    system = force_x_system()
    changed = replace(system, and_operator="product")
    samples = spread_inputs(system, 50)
    ranges, flights = _only(difference(system, changed, {"force_x": samples})).outputs
    sizes = np.abs(step_by_step.evaluate(changed, samples) - step_by_step.evaluate(system, samples))[:, 0]
    assert (ranges.where, flights.where, flights.num_samples) == ("the ranges", "the flights", 50)
    assert flights.mean == pytest.approx(sizes.mean(), abs=1e-14)
    assert flights.largest == pytest.approx(sizes.max(), abs=1e-14)
    worst = [flights.inputs[variable.name] for variable in system.inputs]
    np.testing.assert_array_equal(worst, samples[np.argmax(sizes)])


def test_systems_and_variables_come_and_go():
    controller = paper_like_controller()
    less = replace(controller, systems=controller.systems[:1])
    assert [s.after is None for s in difference(controller, less).systems] == [False, True]
    assert "force_z\n  Removed; it had 45 rules" in difference(controller, less).text()
    assert "force_z\n  Added; 45 rules" in difference(less, controller).text()
    found = _only(difference(force_z_system(), force_x_system()))
    assert {(c.present.name, c.before is None) for c in found.variables} >= {
        ("eta_u", False),
        ("force_x", True),
    }
    assert found.outputs == ()


@pytest.mark.slow
def test_the_page_is_whole_by_itself_and_trusts_no_name():
    controller = paper_like_controller()
    system = controller.systems[0]
    nasty = Term("<script>&", Triangular(0.0, 1.0, 2.0))
    changed = _with_input(system, 0, replace(system.inputs[0], terms=(*system.inputs[0].terms, nasty)))
    after = replace(controller, name="<b>&", systems=(changed, controller.systems[1]))
    page = difference(controller, after).html()
    check_policy(page)
    found = Page(page)
    loading = [value for name in ("src", "srcset", "href") for value in found.values(name)]
    assert all(value.startswith("data:image/png;base64,") for value in loading)
    assert "<script>" not in page
    assert "&lt;script&gt;&amp;" in page
    assert "<picture>" in difference(controller, after)._repr_html_()


@pytest.fixture
def paths(tmp_path):
    controller = paper_like_controller()
    system = controller.systems[0]
    rules = (replace(system.rules[0], consequents=(Consequent("force_x", "ZE"),)), *system.rules[1:])
    changed = replace(controller, systems=(replace(system, rules=rules), controller.systems[1]))
    old, new = tmp_path / "old.yaml", tmp_path / "new.yaml"
    old.write_text(dump_yaml(controller), encoding="utf-8")
    new.write_text(dump_yaml(changed), encoding="utf-8")
    return old, new


@pytest.mark.slow
def test_the_command_prints_writes_and_checks(tmp_path, paths, capsys):
    old, new = map(str, paths)
    assert main(["diff", old, new]) == 0
    assert "PL → ZE" in capsys.readouterr().out
    assert main(["diff", old, new, "--exit-code"]) == 1
    assert main(["diff", old, old, "--exit-code"]) == 0
    assert main(["diff", old, new, "--system", "force_z", "--exit-code"]) == 0
    capsys.readouterr()
    assert main(["diff", old, new, "--json"]) == 0
    data = json.loads(capsys.readouterr().out)
    assert (data["schema"], data["schema_version"]) == ("fuzzy-difference", 1)
    assert [system["state"] for system in data["systems"]] == ["changed", "same"]
    assert data["systems"][0]["rules"][0]["state"] == "changed"
    assert main(["diff", old, new, "-o", str(tmp_path / "diff.html")]) == 0
    assert (tmp_path / "diff.html").read_text(encoding="utf-8").startswith("<!DOCTYPE html>")


def test_mistakes_end_in_one_sentence(tmp_path, paths, capsys):
    old, new = map(str, paths)
    less = tmp_path / "less.yaml"
    controller = FuzzyController("less", paper_like_controller().systems[1:])
    less.write_text(dump_yaml(controller), encoding="utf-8")
    for words, sentence in (
        ([old, "missing.yaml"], "cannot be read"),
        ([old, new, "--system", "force_y"], "did you mean 'force_"),
        ([old, str(less), "--system", "force_x"], "'less' has no system 'force_x'"),
    ):
        assert main(["diff", *words]) == 2
        assert sentence in capsys.readouterr().err


def test_surfaces_are_those_of_both_over_the_ranges_of_both():
    before = force_x_system()
    wider = replace(before.inputs[0], maximum=300.0)
    after = replace(before, inputs=(before.inputs[1], wider), rules=before.rules[::-1])
    old, new, change = changed_surfaces(before, after, "force_x")
    assert (old.x_variable.name, old.y_variable.name) == ("distance", "velocity_body_x")
    assert (old.x[0], old.x[-1]) == (0.0, 300.0)
    for row, column in ((0, 0), (30, 10), (7, 60), (60, 41)):
        distance, velocity = old.x[column], old.y[row]
        was = infer(before, np.array([distance, velocity])).values[0]
        now = infer(after, np.array([velocity, distance])).values[0]
        assert old.values[row, column] == pytest.approx(was, abs=1e-12)
        assert new.values[row, column] == pytest.approx(now, abs=1e-12)
        assert change.values[row, column] == pytest.approx(now - was, abs=1e-12)


def test_the_page_pictures_surfaces_of_what_moved_alone():
    system = force_x_system()
    rules = list(system.rules)
    rules[0] = replace(rules[0], consequents=rules[-1].consequents)
    moved = difference(system, replace(system, rules=tuple(rules))).html()
    assert moved.count('src="data:image/png;base64,') == 1
    assert 'alt="force_x, before, after and the difference"' in moved
    told_only = replace(system, inputs=(replace(system.inputs[0], description="Far."), system.inputs[1]))
    assert "<img" not in difference(system, told_only).html()
    gone = replace(
        system,
        inputs=system.inputs[:1],
        rules=tuple(
            Rule(Is("distance", t.name), system.rules[0].consequents) for t in system.inputs[0].terms
        ),
    )
    assert "<img" not in difference(system, gone).html()
    assert "<img" not in difference(gone, replace(gone, rules=gone.rules[:2])).html()
