"""Interval type-2 systems: values of pyit2fls, closed forms, engines beside one another, refusals."""

from dataclasses import replace

import numpy as np
import pytest

from fis_tools.analysis.bounds import output_ranges
from fis_tools.array_types import Floats
from fis_tools.edit.shown import variable
from fis_tools.edit.touches import term_touched
from fis_tools.engines.compiler import compile
from fis_tools.engines.intervals import extreme_mean
from fis_tools.errors import Mistake
from fis_tools.findings.audit import audit
from fis_tools.findings.difference import difference
from fis_tools.findings.explanation import explain
from fis_tools.formats import serialize
from fis_tools.formats.c import source
from fis_tools.model import (
    And,
    Between,
    Consequent,
    Constant,
    FuzzyController,
    FuzzySystem,
    Gaussian,
    Is,
    Not,
    Rule,
    Term,
    Triangular,
    Variable,
)
from fis_tools.model.intervals import with_bounds
from fis_tools.model.validate import InvalidSystem, validate
from fis_tools.words.text import summary
from tests.fis_tools import step_by_step


def uncertain(mean: float, least: float, most: float) -> Between:
    return Between(Gaussian(mean, least), Gaussian(mean, most))


def tipper(**methods: str) -> FuzzySystem:
    """The tipper's rules, each joined by `and`, with deviations from 1.2 to 1.8 and from 1.5 to 2.5."""
    service, food = (
        Variable(name, "", 0.0, 10.0, tuple(Term(f"{x}", uncertain(x, 1.2, 1.8)) for x in (0.0, 5.0, 10.0)))
        for name in ("service", "food")
    )
    terms = tuple(Term(f"{x}", uncertain(x, 1.5, 2.5)) for x in (5.0, 15.0, 25.0))
    tip = Variable("tip", "", 0.0, 30.0, terms, default=15.0)
    rules = (
        Rule(And((Is("service", "0.0"), Is("food", "0.0"))), (Consequent("tip", "5.0"),)),
        Rule(Is("service", "5.0"), (Consequent("tip", "15.0"),)),
        Rule(And((Is("service", "10.0"), Is("food", "10.0"))), (Consequent("tip", "25.0"),)),
    )
    return FuzzySystem("tipper", (service, food), (tip,), rules, semantics="matlab", **methods)  # type: ignore[arg-type]


def constants() -> FuzzySystem:
    system = tipper()
    numbers = tuple(Term(term.name, Constant(float(term.name))) for term in system.outputs[0].terms)
    tip = replace(
        system.outputs[0], terms=numbers, defuzzifier="weighted_average", aggregation="unbounded_sum"
    )
    return replace(system, outputs=(tip,))


ROWS = np.array([[2.0, 1.0], [4.0, 5.0], [7.0, 8.0], [5.0, 9.5]])


def near(system: FuzzySystem, expected: list[float], tolerance: float = 5e-8) -> None:
    compiled = compile(system)
    answers = compiled(ROWS)
    np.testing.assert_allclose(answers[:, 0], expected, atol=tolerance)
    np.testing.assert_array_equal([compiled.prepare()(*row) for row in ROWS], answers)
    step_by_step.assert_near(step_by_step.evaluate(system, ROWS), answers, system)


def test_values_are_those_of_pyit2fls():
    """pyit2fls 0.9.0, IT2Mamdani with algorithms KM and NT, 101 points; EIASC gives KM's values to 1e-14."""
    near(tipper(), [8.241330339209096, 14.850330545389205, 17.970847574932336, 15.16315806167362], 1e-12)
    expected = [8.349243463622297, 14.840480978112234, 18.039961764920122, 15.176453390784477]
    near(tipper(type_reduction="nie-tan"), expected, 1e-12)


def test_rules_that_conclude_numbers_are_reduced_like_pyit2fls():
    """KM_algorithm and NT_algorithm of the strengths of the three rules, with 5, 15 and 25."""
    near(constants(), [7.876651161884459, 14.880997780277855, 17.876121727474075, 15.10421092486131], 1e-12)
    expected = [7.710557691514177, 14.890420893268296, 17.70989479621468, 15.105272969415816]
    near(replace(constants(), type_reduction="nie-tan"), expected, 1e-12)


def test_the_least_mean_is_that_of_linear_programming():
    """Over all weights between bounds; the fractional programme by its vertices, for six points."""
    generator = np.random.default_rng(5)
    for _ in range(20):
        x = np.sort(generator.uniform(-1.0, 1.0, 6))
        low = generator.uniform(0.0, 0.5, 6)
        high = low + generator.uniform(0.0, 0.5, 6)
        corners = np.array(np.meshgrid(*zip(low, high, strict=True))).reshape(6, -1)
        means = (x[:, np.newaxis] * corners).sum(axis=0) / corners.sum(axis=0)
        assert extreme_mean(x, low, high, 1) == pytest.approx(means.min(), abs=1e-14)
        assert extreme_mean(x, low, high, -1) == pytest.approx(means.max(), abs=1e-14)


@pytest.mark.parametrize("system", [tipper(), constants()], ids=["sets", "numbers"])
def test_equal_bounds_are_a_type_1_system(system):
    def pinched(variable: Variable) -> Variable:
        shapes = [term.membership for term in variable.terms]
        bounds = [Between(s.upper, s.upper) if isinstance(s, Between) else s for s in shapes]
        terms = (replace(t, membership=b) for t, b in zip(variable.terms, bounds, strict=True))
        return replace(variable, terms=tuple(terms))

    def plain(variable: Variable) -> Variable:
        shapes = [term.membership for term in variable.terms]
        uppers = [s.upper if isinstance(s, Between) else s for s in shapes]
        terms = (replace(t, membership=u) for t, u in zip(variable.terms, uppers, strict=True))
        return replace(variable, terms=tuple(terms))

    pinned, type_1 = (
        replace(system, inputs=tuple(map(change, system.inputs)), outputs=tuple(map(change, system.outputs)))
        for change in (pinched, plain)
    )
    np.testing.assert_allclose(compile(pinned)(ROWS), compile(type_1)(ROWS), rtol=1e-14)


def test_a_denied_set_exchanges_its_bounds_and_where_nothing_fires_is_the_default():
    low, high = Triangular(0.0, 0.0, 1.0), Triangular(0.0, 0.0, 2.0)
    x = Variable("x", "", 0.0, 4.0, (Term("small", Between(low, high)),))
    y = Variable(
        *("y", "", 0.0, 10.0, (Term("two", Constant(2.0)), Term("six", Constant(6.0)))),
        default=9.0,
        defuzzifier="weighted_average",
        aggregation="unbounded_sum",
    )
    rules = (
        Rule(Is("x", "small"), (Consequent("y", "two"),)),
        Rule(Not(Is("x", "small")), (Consequent("y", "six"),)),
    )
    system = FuzzySystem("denied", (x,), (y,), rules, semantics="matlab")
    # at 0.5: small from 0.5 to 0.75, denied from 0.25 to 0.5
    least, greatest = (2 * 0.75 + 6 * 0.25) / 1.0, (2 * 0.5 + 6 * 0.5) / 1.0
    assert compile(system)(np.array([[0.5]]))[0, 0] == pytest.approx((least + greatest) / 2, abs=1e-15)
    silent = replace(system, rules=rules[:1], outputs=(replace(y, terms=y.terms[:1]),))
    answers = compile(silent).infer(np.array([[0.5], [3.0]]))
    assert answers.outputs.tolist() == [[2.0], [9.0]]
    assert answers.no_rule_fired.tolist() == [[False], [True]]


@pytest.mark.parametrize(
    "system",
    [tipper(), replace(constants(), type_reduction="nie-tan"), constants()],
    ids=["sets", "numbers, Nie-Tan", "numbers"],
)
def test_no_input_of_a_box_leaves_its_bounds(system):
    generator = np.random.default_rng(3)
    compiled = compile(system)
    for width in (0.05, 3.0):
        low = generator.uniform(0.0, 10.0 - width, 2)
        region = " and ".join(
            f"{v.name} in [{x!r}, {x + width!r}]" for v, x in zip(system.inputs, low.tolist(), strict=True)
        )
        (bounded,) = output_ranges(system, region)
        answers = compiled(low + width * generator.uniform(0.0, 1.0, (2000, 2)))
        assert bounded.outer.low <= answers.min()
        assert answers.max() <= bounded.outer.high
        assert bounded.outer.low >= bounded.inner.low - 0.05
        assert bounded.outer.high <= bounded.inner.high + 0.05


def test_files_and_words_keep_interval_sets():
    for system in (tipper(type_reduction="nie-tan"), constants()):
        controller = FuzzyController("interval", (system,))
        for write, kind in ((serialize.dump_json, "json"), (serialize.dump_yaml, "yaml")):
            assert serialize.loads(write(controller), kind) == controller
    assert "interval type-2" in summary(tipper())


@pytest.mark.parametrize("system", [tipper(), constants(), tipper(type_reduction="nie-tan")])
def test_shares_of_rules_are_those_of_systems_without_the_others(system):
    """Two rules play; the third fires so faintly that it joins any of them."""
    given = np.array([[3.0, 4.0]])

    def worth(*rules: int) -> float:
        kept = replace(system, rules=tuple(system.rules[rule] for rule in (*rules, 2)))
        return float(compile(kept)(given)[0, 0])

    output = explain(system, given[0]).outputs[0]
    by_rule = {move.rule: move for move in output.moves}
    first = 0.5 * (worth(0) - 15.0 + worth(0, 1) - worth(1))
    second = 0.5 * (worth(1) - 15.0 + worth(0, 1) - worth(0))
    np.testing.assert_allclose([by_rule[1].share, by_rule[2].share], [first, second], atol=1e-12)
    np.testing.assert_allclose(by_rule[1].needed, worth(0, 1) - worth(1), atol=1e-12)
    assert by_rule[2].strength_words == "0.25 to 0.54"
    assert sum(move.share for move in output.moves) == pytest.approx(output.value - 15.0, abs=1e-12)


def test_the_editor_changes_a_bound_and_tells_by_how_much():
    """Alike by the areas of both bounds, as D. Wu and J. M. Mendel have it."""
    system = tipper()
    service = system.inputs[0]
    shown = variable(service)["terms"][0]
    assert [number["key"] for number in shown["numbers"]][::3] == ["lower mean", "upper standard_deviation"]
    assert shown["path"].endswith("Z")
    details = {"term": "0.0", "key": "upper standard_deviation", "value": "2.5"}
    changed = term_touched(system, service, "number", **details)
    assert changed.inputs[0].terms[0].membership == uncertain(0.0, 1.2, 2.5)
    (change,) = difference(system, changed).systems[0].variables[0].terms
    lower, before, after = (np.trapezoid(gaussian(service.universe, 0.0, s)) for s in (1.2, 1.8, 2.5))
    assert change.similarity == pytest.approx((lower + before) / (lower + after), abs=1e-4)
    assert "upper: standard deviation 1.8 → 2.5" in difference(system, changed).text()
    assert difference(system, changed).html()


def gaussian(x: Floats, mean: float, deviation: float) -> Floats:
    return np.exp(-0.5 * ((x - mean) / deviation) ** 2)


def test_what_is_for_type_1_refuses_interval_sets_by_name():
    system = tipper()
    controller = FuzzyController("interval", (system,))
    for refused in (
        lambda: audit(controller),
        lambda: source.write(controller),
        *(lambda name=name: serialize.writer(name)(controller) for name in serialize.FORMS),
        lambda: system.inputs[0].memberships,
    ):
        with pytest.raises(ValueError, match="type-2"):
            refused()
    with pytest.raises(Mistake, match="import --sets upper makes them type-1"):
        audit(controller)
    upper = with_bounds(system, "upper")
    assert audit(FuzzyController("upper", (upper,))).systems
    assert upper.inputs[0].terms[0].membership == Gaussian(0.0, 1.8)
    with pytest.raises(Mistake, match="type-2"):
        serialize.loads("[System]\nType='sugeno'\n[Input1]\nMF1U='a':'trimf',[0 1 2]\n", "fis")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"semantics": "fuzzylite"}, "set semantics to matlab"),
        ({"defuzzifier": "mom"}, "take centroid or weighted_average"),
        ({"type_reduction": "best"}, "type_reduction 'best' is not known"),
    ],
)
def test_systems_that_cannot_be_inferred_are_invalid(change, words):
    with pytest.raises(InvalidSystem, match=words):
        validate(replace(tipper(), **change))


def test_a_lower_set_above_the_upper_one_is_invalid():
    system = tipper()
    crossed = Term("0.0", Between(Gaussian(0.0, 1.8), Gaussian(0.0, 1.2)))
    inputs = (replace(system.inputs[0], terms=(crossed, *system.inputs[0].terms[1:])), system.inputs[1])
    with pytest.raises(InvalidSystem, match="lower membership is above"):
        validate(replace(system, inputs=inputs))
