"""Audits: a clean system is left alone, and each defect is found by the finding that is made for it."""

import json
import tracemalloc
from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from fis_tools.analysis.arrays import coverage
from fis_tools.findings.audit import Finding, Severity, Thresholds, audit
from fis_tools.findings.audit.report import SCHEMA, SCHEMA_VERSION
from fis_tools.findings.audit.terms import read_names
from fis_tools.model import And, Consequent, FuzzyController, FuzzySystem, Is, Not, Or, Rule
from fis_tools.model.membership import MembershipFunction
from fis_tools.model.shapes import Gaussian, Trapezoidal, Triangular
from fis_tools.model.systems import with_variables
from fis_tools.model.variables import Term, Variable
from plain_files.document import as_json, text
from tests.fis_tools.analysis.test_analysis import even_terms
from tests.fis_tools.analysis.test_flights import log_flight
from tests.fis_tools.sample_controllers import FORCE_TERMS, GENERAL, PAPER_LIKE, table_system, terms

ERROR = Variable("error", "deg", -10.0, 10.0, even_terms(FORCE_TERMS, -10.0, 10.0))
RATE = Variable("rate", "deg/s", -2.0, 2.0, even_terms(FORCE_TERMS, -2.0, 2.0))
TORQUE = Variable("torque", "N m", -1.0, 1.0, even_terms(FORCE_TERMS, -1.0, 1.0), default=0.0)
TABLE = [FORCE_TERMS[min(4, max(0, 6 - error - rate))] for error, rate in product(range(5), range(5))]
ALTERNATING = [("NL", "PL")[sum(divmod(index, 5)) % 2] for index in range(25)]
NOTE, WARNING, SERIOUS = Severity.NOTE, Severity.WARNING, Severity.SERIOUS


def pd_of(table: Sequence[str] = TABLE) -> FuzzySystem:
    return table_system("pd", (ERROR, RATE), TORQUE, table)


#: A PD controller as textbooks print it: the more error and rate, the more torque against them.
PD = pd_of()


def changed(name: str, **functions: MembershipFunction) -> FuzzySystem:
    """The PD controller with the membership functions of some terms of one variable changed."""

    def change(variable: Variable) -> Variable:
        new = tuple(Term(term.name, functions.get(term.name, term.membership)) for term in variable.terms)
        return replace(variable, terms=new) if variable.name == name else variable

    return with_variables(PD, change)


def with_cell(index: int, term: str) -> FuzzySystem:
    return pd_of([*TABLE[:index], term, *TABLE[index + 1 :]])


def concluding(term: str, antecedent: And | Is | Not, output: str = "torque", weight: float = 1.0) -> Rule:
    return Rule(antecedent, (Consequent(output, term, weight),))


def and_also(*rules: Rule) -> FuzzySystem:
    return replace(PD, rules=(*PD.rules, *rules))


def found_in(system: FuzzySystem, kind: str, samples: np.ndarray | None = None) -> list[Finding]:
    result = audit(system, None if samples is None else {system.name: samples})
    return [finding for finding in result.findings if finding.id == kind]


def the_one(system: FuzzySystem, kind: str, samples: np.ndarray | None = None) -> Finding:
    (finding,) = found_in(system, kind, samples)
    return finding


def spread_samples() -> np.ndarray:
    return np.random.default_rng(1).uniform([-10.0, -2.0], [10.0, 2.0], (400, 2))


def test_a_textbook_controller_is_left_alone():
    result = audit(PD)
    assert result.findings == ()
    assert result.summary() == "pd: nothing found (1 system, no logs)"
    # flown everywhere, it gets notes at most: outermost rules say what their neighbours say as well
    result = audit(PD, {"pd": spread_samples()})
    assert result.at_least(Severity.WARNING) == ()
    assert {finding.id for finding in result.findings} <= {"idle-rules"}


IDLE = Variable("wind", "m/s", 0.0, 9.0, even_terms(("low", "high"), 0.0, 9.0))
MANY = Variable("x", "", 0.0, 1.0, even_terms(tuple(f"x{i}" for i in range(12)), 0.0, 1.0))
TWELVE = table_system("many", (MANY,), TORQUE, ["ZE"] * 12)
THREE = tuple(replace(RATE, name=name) for name in "abc")
SUMS = [FORCE_TERMS[min(4, max(0, 8 - sum(cell)))] for cell in product(range(5), repeat=3)]
BIG = table_system("big", THREE, TORQUE, SUMS)
SWAPPED = changed("rate", NS=RATE.terms[2].membership, ZE=RATE.terms[1].membership)
SHUFFLED = replace(PD, inputs=(ERROR, replace(RATE, terms=(RATE.terms[1], RATE.terms[0], *RATE.terms[2:]))))
ALIKE = changed("rate", NS=Triangular(-2.0, -1.0, 0.6), ZE=Triangular(-2.0, -0.8, 0.6))
BELOW_ITS_NAME = changed("error", NS=Triangular(-5.0, 0.4, 5.0), ZE=Triangular(-5.0, 0.5, 5.0))
LOW, LOWEST = (changed("rate", ZE=Gaussian(0.02, width)) for width in (0.005, 1e-4))
GAP = changed("error", NS=Triangular(-5.2, -5.0, -4.8))
AGAIN = And((Is("rate", "NL"), Is("error", "NL")))
ON_ZERO = And((Is("error", "ZE"), Is("rate", "ZE")))
OVER_A_ROW = and_also(concluding("ZE", Is("error", "ZE")))
AGAINST = and_also(concluding("NL", Not(Not(AGAIN))))
FOURTH = concluding("PS", PD.rules[3].antecedent, weight=0.0)
WEIGHTLESS = replace(PD, rules=(*PD.rules[:3], FOURTH, *PD.rules[4:]))
WIDER = replace(TORQUE, minimum=-3.0, maximum=3.0, num_points=301)


@pytest.mark.parametrize(
    ("kind", "system", "severity", "about", "words"),
    [
        ("unused-variable", replace(PD, inputs=(ERROR, RATE, IDLE)), SERIOUS, ("wind",), ""),
        ("unused-term", pd_of([t.replace("ZE", "PS") for t in TABLE]), NOTE, ("torque", "ZE"), ""),
        ("term-height", LOW, WARNING, ("rate", "ZE"), ""),
        ("term-height", LOWEST, SERIOUS, ("rate", "ZE"), ""),
        ("coverage", GAP, SERIOUS, ("error",), "has 2 gaps, from"),
        ("look-alike-terms", ALIKE, WARNING, ("rate", "NS", "ZE"), "mean nearly the same"),
        ("name-order", SWAPPED, SERIOUS, ("rate", "NS", "ZE"), "lies at 0 deg/s, above ZE at -1 deg/s"),
        ("term-order", SWAPPED, WARNING, ("rate", "NS", "ZE"), ""),
        ("term-order", SHUFFLED, WARNING, ("rate", "NS", "NL"), ""),
        ("name-sign", BELOW_ITS_NAME, SERIOUS, ("error", "NS"), ""),
        ("duplicate-rules", and_also(concluding("PL", AGAIN)), WARNING, (1, 26), ""),
        ("contradicting-rules", AGAINST, SERIOUS, (1, 26), "other torque is NL"),
        ("no-weight", WEIGHTLESS, WARNING, (4,), "PS with weight 0"),
        # of the five rules where error is ZE, one says ZE as well
        ("overlapping-rules", OVER_A_ROW, WARNING, (26, 11, 12, 14, 15), ""),
        ("output-reach", replace(PD, outputs=(WIDER,)), WARNING, ("torque",), ""),
        ("output-reach", pd_of(["ZE"] * 25), SERIOUS, ("torque",), "is 0 N m at 19881 points"),
    ],
)
def test_a_defect_is_found_by_the_finding_that_is_made_for_it(kind, system, severity, about, words):
    finding = the_one(system, kind)
    assert finding.severity is severity
    assert tuple(filter(None, (finding.variable, *finding.terms, *finding.rules))) == about
    assert words in finding.sentence


def test_what_is_no_defect_is_not_found():
    assert found_in(SHUFFLED, "name-order") == []
    assert found_in(and_also(concluding("PL", AGAIN)), "contradicting-rules") == []


@pytest.mark.parametrize(
    ("system", "kind", "evidence"),
    [
        (LOW, "term-height", {"highest": np.exp(-8.0)}),
        # NL falls to 0 at -5 and ZE rises from there: (-5 - x) / 5 = x + 6, and as much on the other side
        (changed("error", NS=Triangular(-6.0, -5.0, -4.0)), "coverage", {"least": 1 / 6}),
        (changed("error", NS=Triangular(-9.0, -9.0, -8.0)), "coverage", {"from": -6.0, "to": -4.0}),
        (changed("error", PL=Triangular(4.0, 5.0, 6.0)), "coverage", {"to": 10.0}),
        (TWELVE, "many-terms", {"terms": 12}),
        (BIG, "complexity", {"premises": 375}),
    ],
)
def test_the_numbers_behind_a_finding(system, kind, evidence):
    numbers = the_one(system, kind).evidence
    assert {name: numbers[name] for name in evidence} == pytest.approx(evidence, abs=1e-12)


def test_a_gap_between_terms():
    finding = the_one(changed("error", NS=Triangular(-6.0, -5.0, -4.0)), "coverage")
    assert finding.severity is Severity.WARNING
    # NL falls to 0.2 at -6, and NS rises to it at -5.8; ZE as much on the other side
    ends = (finding.evidence["from"], finding.evidence["to"])
    assert ends in (pytest.approx((-6.0, -5.8)), pytest.approx((-4.2, -4.0)))


def test_a_gap_that_other_rules_fill_is_a_note():
    food_terms = terms(rancid=Trapezoidal(0, 0, 1, 3), delicious=Trapezoidal(7, 9, 10, 10))
    tips = even_terms(("cheap", "average", "generous"), 0.0, 30.0)
    food = Variable("food", "", 0.0, 10.0, food_terms)
    service = Variable("service", "", 0.0, 10.0, even_terms(("poor", "good", "excellent"), 0.0, 10.0))
    tip = Variable("tip", "%", 0.0, 30.0, tips, default=0.0)
    rules = (
        concluding("cheap", Or((Is("service", "poor"), Is("food", "rancid"))), "tip"),
        concluding("average", Is("service", "good"), "tip"),
        concluding("generous", Or((Is("service", "excellent"), Is("food", "delicious"))), "tip"),
    )
    result = audit(FuzzySystem("tipper", (service, food), (tip,), rules))
    assert [(f.id, f.severity, f.variable) for f in result.findings] == [("coverage", Severity.NOTE, "food")]


def test_a_missing_rule_leaves_a_hole():
    finding = the_one(replace(PD, rules=PD.rules[:12] + PD.rules[13:]), "completeness")
    assert finding.severity is Severity.SERIOUS
    assert finding.evidence["at"] == pytest.approx([0.0, 0.0], abs=1e-9)
    assert "error = 0 deg, rate = 0 deg/s: the output is the default, torque = 0 N m" in finding.sentence


def test_terms_that_overlap_or_lie_inside():
    assert the_one(ALIKE, "look-alike-terms").evidence["similarity"] > 0.7
    inside = found_in(changed("rate", NS=Trapezoidal(-2.0, -1.5, 2.0, 2.0)), "term-inside-another")
    assert ("rate", ("NS", "ZE")) in [(finding.variable, finding.terms) for finding in inside]
    near = changed("rate", NS=Triangular(-2, -0.15, 0.9), PS=Triangular(-0.9, 0.15, 2))
    assert ("NS", "PS") in [finding.terms for finding in found_in(near, "overlapping-terms")]


def test_zero_stands_below_small_or_between_low_and_high():
    named = (("zero", "small", "medium", "large"), ("low", "zero", "high"))
    for names_of_terms, low in zip(named, (0.0, -3.0), strict=True):
        x = Variable("x", "", low, 3.0, even_terms(names_of_terms, low, 3.0))
        rules = tuple(concluding("ZE", Is("x", name)) for name in names_of_terms)
        system = FuzzySystem("named", (x,), (TORQUE,), rules)
        assert [f for f in audit(system).findings if f.id in {"name-order", "zero-off-zero"}] == []


def test_a_zero_that_is_not_at_zero():
    system = changed("error", ZE=Triangular(-2.0, 3.0, 8.0), NS=Triangular(-10.0, -2.0, 3.0))
    finding = the_one(system, "zero-off-zero")
    assert (finding.severity, finding.terms) == (Severity.SERIOUS, ("ZE",))
    # 0 belongs to ZE by 2 / 5 and to NS by 3 / 5
    assert finding.evidence["membership_of_zero"] == pytest.approx(0.4, abs=0.01)
    assert "0.40 in it, but 0.60 in NS" in finding.sentence


def test_neighbours_that_contradict():
    findings = found_in(with_cell(12, "PL"), "contradicting-neighbours")
    assert [(f.variable, f.rules) for f in findings] == [("error", (13, 18)), ("rate", (13, 14))]
    assert findings[0].severity is Severity.NOTE
    assert "from PL (rule 13) to NS (rule 14), 1.5 N m apart" in findings[1].sentence
    findings = found_in(pd_of(ALTERNATING), "contradicting-neighbours")
    assert [finding.severity for finding in findings] == [Severity.WARNING] * 2


def test_a_table_that_turns_back():
    findings = found_in(with_cell(13, "PS"), "monotonicity-table")
    assert [(f.variable, f.severity) for f in findings] == [("error", WARNING), ("rate", WARNING)]
    assert "torque falls with rate in" in findings[1].sentence
    assert "from ZE (rule 13) to PS (rule 14)" in findings[1].sentence
    findings = found_in(pd_of(ALTERNATING), "monotonicity-table")
    assert [finding.severity for finding in findings] == [Severity.NOTE] * 2
    assert "no direction along error: torque rises in 10 steps and falls in 10" in findings[0].sentence


def test_a_surface_that_turns_back():
    findings = found_in(with_cell(13, "PL"), "monotonicity-surface")
    finding = next(finding for finding in findings if finding.variable == "rate")
    assert finding.evidence["from"] < finding.evidence["to"] == pytest.approx(1.0, abs=0.1)
    assert finding.evidence["held"]["error"] == pytest.approx(0.0, abs=0.2)


def test_rules_that_are_outvoted():
    wide = dict.fromkeys(("NL", "PL"), Trapezoidal(-2.0, -2.0, 2.0, 2.0))
    finding = the_one(changed("rate", **wide), "rule-consistency")
    assert 13 in finding.rules or 3 in finding.rules
    assert "the rule alone would give" in finding.sentence


def test_inputs_outside_their_range():
    samples = spread_samples()
    samples[:40, 1] = 2.5
    finding = the_one(PD, "input-clipped", samples)
    assert (finding.variable, finding.severity) == ("rate", Severity.WARNING)
    assert finding.evidence["part"] == 0.1
    assert "up to 2.5 deg/s" in finding.sentence
    samples[1:, 1] = 0.0
    assert the_one(PD, "input-clipped", samples).severity is Severity.NOTE


def test_defaults_taken():
    samples = np.array([[9.0, 0.0], [-9.0, 0.0], [8.0, 0.0], [9.0, 1.0]])
    finding = the_one(replace(PD, rules=PD.rules[20:]), "default-taken", samples)
    assert finding.severity is Severity.SERIOUS
    assert (finding.evidence["part"], finding.evidence["first"]) == (0.25, 1)


def test_dead_and_dominant_rules():
    centre = np.random.default_rng(0).uniform([-1.0, -0.2], [1.0, 0.2], (50, 2))
    finding = the_one(PD, "dead-rules", centre)
    assert finding.severity is Severity.WARNING
    # within 1 deg and 0.2 deg/s only the nine rules of NS, ZE and PS fire
    assert set(finding.rules) == set(range(1, 26)) - {7, 8, 9, 12, 13, 14, 17, 18, 19}
    finding = the_one(PD, "dominant-rule", centre)
    assert finding.rules == (13,)
    assert finding.evidence["leading"] == 1.0


def test_rules_that_fire_and_change_nothing():
    near = np.array([[0.0, 0.0], [1.0, 0.1], [-1.0, 0.2]])
    finding = the_one(and_also(concluding("ZE", ON_ZERO)), "idle-rules", near)
    assert {13, 26} <= set(finding.rules)


def test_a_system_that_never_decided():
    controller = FuzzyController("two", (PD, replace(PD, name="other")))
    result = audit(controller, {"pd": spread_samples(), "other": np.empty((0, 2))})
    assert [f.system for f in result.findings if f.id == "never-asked"] == ["other"]
    assert [system.num_samples for system in result.systems] == [400, 0]


def test_thresholds_decide():
    strict = audit(PD, thresholds=Thresholds(coverage=0.6, rules=10))
    assert {finding.id for finding in strict.findings} == {"coverage", "complexity"}


def test_samples_that_do_not_fit_are_refused():
    with pytest.raises(ValueError, match="did you mean 'pd'"):
        audit(PD, {"pdd": spread_samples()})
    with pytest.raises(ValueError, match="2 numbers each"):
        audit(PD, {"pd": np.zeros((3, 4))})


@pytest.mark.parametrize(
    ("words", "ranks"),
    [
        (("NL", "NM", "ZE", "PS", "PVL"), [-3, -2, 0, 1, 3.5]),
        (("negative_large", "negative small", "zero", "PositiveSmall"), [-3, -1, 0, 1]),
        (("very low", "low", "medium", "high", "very high"), [-1.5, -1, 0, 1, 1.5]),
        (("cold", "mild", "hot"), [-1, 0, 1]),
        (("zero", "low", "high"), [0, -1, 1]),
        (("N", "M", "F"), [None, None, None]),
        (("mf1", "mf2", "mf3"), [None, None, None]),
        (("stop", "near"), [None, None]),
    ],
)
def test_names_are_read(words, ranks):
    assert [None if reading is None else reading.rank for reading in read_names(list(words))] == ranks


def test_an_audit_is_told_as_text_and_as_data():
    system = changed("error", NS=Triangular(-5.2, -5.0, -4.8))
    result = audit(system, {"pd": spread_samples()})
    text_of = text.write(result.document(), 90)
    assert text_of.startswith("pd: ")
    assert text_of.index("SERIOUS") < text_of.index("NOTE") < text_of.index("MEASURES")
    assert all(len(line) <= 90 for line in text_of.splitlines())
    assert "error has 2 gaps" in text_of
    held = json.loads(as_json(SCHEMA, SCHEMA_VERSION, result.plain()))
    assert (held["schema"], held["schema_version"]) == ("fuzzy-audit", 2)
    assert sum(held["summary"].values()) == len(held["findings"])
    severities = [Severity[finding["severity"].upper()] for finding in held["findings"]]
    assert severities == sorted(severities, reverse=True)
    assert held["systems"][0]["measures"]["completeness"]["exact"] is True
    assert "error has 2 gaps" in result._repr_markdown_()


def test_every_kind_of_system_is_audited():
    result = audit(GENERAL, {"room": np.array([[10.0, 3.0], [35.0, 20.0]])})
    json.dumps(result.plain(), allow_nan=False)
    assert {finding.system for finding in result.findings} == {"room"}


def test_the_command_prints_and_sets_the_exit_status(tmp_path, paper, run):
    flight = log_flight(tmp_path / "a.mcap", PAPER_LIKE, num_samples=12)
    for words, code, words_expected in (
        ([paper], 0, "no logs"),
        ([flight], 0, "24 logged inferences"),
        ([paper, "--flights", flight, "--fail-on", "note"], 1, "input-clipped"),
        ([paper, "--system", "force_x", "--thresholds", "coverage=1", "--fail-on", "warning"], 1, ""),
        ([paper, "--fail-on", "serious", "--json"], 0, '"controller": "paper-like"'),
    ):
        printed = run("audit", *words, code=code).out
        assert words_expected in printed
    assert json.loads(printed)["controller"] == "paper-like"


@pytest.mark.parametrize(("semantics", "off"), [("matlab", 0.123), ("fuzzylite", 0.5), ("fcl", 0.0005)])
def test_a_singleton_off_the_points_of_its_program_is_named(semantics, off):
    """MATLAB takes both ends of 100 intervals, fuzzylite their middles, jFuzzyLogic their left edges."""
    sides = terms(low=Triangular(0.0, 0.0, 1.0), high=Triangular(0.0, 1.0, 1.0))
    x = Variable("x", "", 0.0, 1.0, sides)
    on = {"matlab": 0.25, "fuzzylite": 0.255, "fcl": 0.0}[semantics]
    y = Variable(
        "y", "", 0.0, 1.0, terms(on=Triangular(on, on, on), off=Triangular(off, off, off)), default=0.0
    )
    rules = tuple(Rule(Is("x", a), (Consequent("y", b),)) for a, b in (("low", "on"), ("high", "off")))
    findings = audit(FuzzySystem("spikes", (x,), (y,), rules, semantics=semantics)).findings
    assert [finding.terms for finding in findings if finding.id == "term-height"] == [("off",)]


def test_what_is_left_out_of_many_inputs_and_many_terms_is_told():
    sides = terms(low=Triangular(0.0, 0.0, 1.0), high=Triangular(0.0, 1.0, 1.0))
    inputs = tuple(Variable(f"x{n}", "", 0.0, 1.0, sides, 3) for n in range(64))
    many = terms(**{f"t{n}": Triangular(n / 400.0 - 0.1, n / 400.0, n / 400.0 + 0.1) for n in range(401)})
    y = Variable("y", "", 0.0, 1.0, many, 11, default=0.0)
    rules = tuple(Rule(Is(f"x{n}", "low"), (Consequent("y", f"t{n}"),)) for n in range(64))
    findings = audit(FuzzySystem("many", inputs, (y,), rules)).findings
    kinds = {finding.id: finding.sentence for finding in findings}
    assert "with 64 inputs a table has 1.84e+19 cells" in kinds["neighbours-not-compared"]
    assert "The 401 terms of y are not compared" in kinds["terms-not-compared"]


def test_coverage_of_many_terms_is_where_their_highest_is_lowest():
    generator = np.random.default_rng(4)
    centres = np.sort(generator.uniform(0.0, 1.0, 320))
    many = terms(**{f"t{n}": Triangular(x - 0.01, x, x + 0.02) for n, x in enumerate(centres)})
    variable = Variable("x", "", 0.0, 1.0, many, 41)
    fine = np.linspace(0.0, 1.0, 40_001)
    highest = np.max([np.interp(fine, variable.universe, row) for row in variable.memberships], axis=0)
    assert coverage(variable).least == pytest.approx(highest.min(), abs=1e-3)
    assert coverage(variable).least <= highest.min()


@pytest.mark.slow
def test_many_inputs_and_many_terms_take_little_memory():
    """A grid of two points along each of 21 inputs would have two million."""
    count = 21
    sides = terms(low=Triangular(0.0, 0.0, 1.0), high=Triangular(0.0, 1.0, 1.0))
    inputs = tuple(Variable(f"x{n}", "", 0.0, 1.0, sides, 11) for n in range(count))
    many = terms(**{f"t{n}": Gaussian(n / 120.0, 0.01) for n in range(120)})
    y = Variable("y", "", 0.0, 1.0, many, 201, default=0.0)
    rules = [
        Rule(Is(f"x{n}", side), (Consequent("y", f"t{n * 4 + k}"),))
        for n in range(count)
        for k, side in enumerate(("low", "high"))
    ]
    tracemalloc.start()
    result = audit(FuzzyController("many", (FuzzySystem("many", inputs, (y,), tuple(rules)),)))
    assert tracemalloc.get_traced_memory()[1] < 400e6
    tracemalloc.stop()
    assert result.findings
