"""A short part of ``python -m benchmarks agree``, and that it finds mistakes in each form."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fis_tools.analysis import weighted_shares
from fis_tools.analysis.bounds import Answer
from fis_tools.engines.compiler import compile
from fis_tools.formats import serialize
from fis_tools.model import ALL_SEMANTICS, operators
from fis_tools.model.membership import SHAPES
from fis_tools.model.systems import used_terms
from tests.fis_tools.agreement import claims, compared, drawn, forms
from tests.fis_tools.agreement.shrunk import shrunk

SEED = 20
ONCE_DIFFERENT = Path(__file__).with_name("once_different")


def cases(count: int, num_rows: int = 12) -> list[forms.Case]:
    made = []
    for number in range(count):
        generator = np.random.default_rng([SEED, number])
        system = drawn.system(generator, f"drawn {number}")
        made.append((system, drawn.points(system, generator, num_rows)))
    return made


def test_all_forms_of_inference_agree(tmp_path):
    assert list(map(str, compared.differences(cases(25), tmp_path))) == []


@pytest.mark.parametrize("path", sorted(ONCE_DIFFERENT.glob("*.yaml")), ids=lambda path: path.stem)
def test_what_once_differed_agrees(tmp_path, path):
    controller = serialize.load(path)
    row = [float(word) for word in dict(controller.attributes)["inputs"].split()]
    cases = [(controller.systems[0], np.array([row]))]
    assert list(map(str, compared.differences(cases, tmp_path))) == []


def test_the_kernel_of_flights_is_drawn():
    assert sum(compile(system).packed is not None for system, _ in cases(100, 1)) > 3


def test_everything_registered_is_drawn():
    systems = [system for system, _ in cases(500, 1)]
    rules = [rule for system in systems for rule in system.rules]
    assert {system.semantics for system in systems} == set(ALL_SEMANTICS)
    shapes = {type(term.membership) for s in systems for v in s.variables for term in v.terms}
    assert shapes == set(SHAPES.values())
    assert {rule.and_operator for rule in rules} >= set(operators.AND_OPERATORS)
    assert {rule.or_operator for rule in rules} >= set(operators.OR_OPERATORS)
    outputs = [(system, output) for system in systems for output in system.outputs]
    assert {s.defuzzifier_of(o) for s, o in outputs} == {*drawn._set_defuzzifiers(), *operators.WEIGHING}
    assert {o.aggregation for _, o in outputs} == set(operators.AGGREGATIONS)
    assert {o.accumulation for _, o in outputs} == set(operators.ACCUMULATIONS)
    assert {len(system.inputs) for system in systems} == {1, 2, 3, 4, 5, 6}
    text = "".join(str(rule.antecedent) for rule in rules)
    assert all(f"hedge='{hedge}'" in text for hedge in operators.HEDGES)


@pytest.mark.parametrize("form", forms.FORMS)
def test_a_form_that_is_wrong_is_found_and_shrunk(tmp_path, monkeypatch, form):
    """An answer that is off by a millionth of the range at inputs above the middle of the first one."""
    right = forms.FORMS[form]

    def wrong(cases, folder):
        answers = right(cases, folder)
        for (system, rows), given in zip(cases, answers, strict=True):
            if given is not None:
                middle = 0.5 * (system.inputs[0].minimum + system.inputs[0].maximum)
                given[rows[:, 0] > middle, 0] += 1e-6 * system.outputs[0].span
        return answers

    monkeypatch.setitem(forms.FORMS, form, wrong)
    differing = compared.differences(cases(6), tmp_path, (form,))
    assert differing

    def fails(system, row):
        return bool(compared.differences([(system, row[np.newaxis])], tmp_path, (form,)))

    first = next(d for d in differing if len(d.system.rules) > 1)
    small, row = shrunk(first.system, first.row, fails, most=25)
    assert fails(small, row)
    assert len(used_terms(small.rules)) < len(used_terms(first.system.rules))


def test_a_bound_that_is_broken_is_found(tmp_path, monkeypatch):
    bound = claims.interval.bound

    def narrow(program, low, high):
        least, greatest, variation = bound(program, low, high)
        return least, least + 0.7 * (greatest - least), variation

    monkeypatch.setattr(claims.interval, "bound", narrow)
    assert compared.differences(cases(6), tmp_path, ("bounds",))


def test_shares_that_do_not_add_up_are_found(tmp_path, monkeypatch):
    shares = claims.shapley.shares

    def fewer(compiled, rows):
        result = shares(compiled, rows)
        return result._replace(values=0.9 * result.values)

    monkeypatch.setattr(claims.shapley, "shares", fewer)
    assert compared.differences(cases(6), tmp_path, ("explain",))


def test_shares_that_are_those_of_other_rules_are_found(tmp_path, monkeypatch):
    of_rules = claims.shapley.shares

    def exchanged(compiled, rows):
        result = of_rules(compiled, rows)
        return result._replace(values=result.values[:, ::-1])

    monkeypatch.setattr(claims.shapley, "shares", exchanged)
    made = cases(12)
    assert not compared.differences(made, tmp_path, ("explain",))
    assert compared.differences(made, tmp_path, ("shares",))


def test_a_contribution_that_is_another_rules_is_found(tmp_path, monkeypatch):
    of_rules = claims.contribution.contributions
    monkeypatch.setattr(
        claims.contribution, "contributions", lambda compiled, rows: of_rules(compiled, rows)[:, ::-1]
    )
    assert compared.differences(cases(6), tmp_path, ("contributions",))


def test_a_weakest_firing_that_is_too_high_is_found(tmp_path, monkeypatch):
    measured = claims.completeness

    def higher(system):
        result = measured(system)
        return replace(result, least=result.least + 0.1, is_exact=True)

    monkeypatch.setattr(claims, "completeness", higher)
    assert compared.differences(cases(6), tmp_path, ("weakest",))


def test_shares_in_averages_of_many_rules_are_enumerated(tmp_path, monkeypatch):
    """More rules than those of which the product itself enumerates the coalitions."""
    counts, of_averages = [], weighted_shares._of_averages

    def counted(weights, *others):
        counts.append(weights.shape[1])
        return of_averages(weights, *others)

    monkeypatch.setattr(weighted_shares, "_of_averages", counted)
    large = [
        (s, rows) for s, rows in cases(400) if len(s.rules) >= drawn.MANY_RULES[0] and s.weighs(s.outputs[0])
    ]
    assert compared.differences(large, tmp_path, ("shares",)) == []
    assert any(weighted_shares.MOST_ENUMERATED < count <= claims.MOST_AVERAGED for count in counts)


def test_a_no_to_what_is_attained_is_found(tmp_path, monkeypatch):
    def never(system, question, **options):
        return Answer(question, "", "no", 1)

    monkeypatch.setattr(claims, "ask", never)
    assert compared.differences(cases(6), tmp_path, ("no",))


@pytest.mark.parametrize("claim", ["surface", "diff"])
def test_a_surface_or_a_change_that_is_off_is_found(tmp_path, monkeypatch, claim):
    evaluate = claims.arrays.evaluate
    monkeypatch.setattr(claims.arrays, "evaluate", lambda *words: evaluate(*words) + 1e-3)
    compared_outputs = claims.comparison._change

    def moved(before, output, where, inputs, values):
        return compared_outputs(before, output, where, inputs, values + 1e-3)

    monkeypatch.setattr(claims.comparison, "_change", moved)
    assert compared.differences(cases(6), tmp_path, (claim,))


def test_an_error_of_the_definition_is_a_difference(tmp_path, monkeypatch):
    right = compared.infer

    def wrong(system, row):
        if row[0] > system.inputs[0].maximum:
            raise ZeroDivisionError
        return right(system, row)

    monkeypatch.setattr(compared, "infer", wrong)
    made = cases(6)
    beyond = {system.name for system, rows in made if any(row[0] > system.inputs[0].maximum for row in rows)}
    differing = compared.differences(made, tmp_path, (compared.DEFINITION,))
    assert beyond
    assert {difference.system.name for difference in differing} == beyond
