"""Audits: a clean system is left alone, and each defect is found by the finding that is made for it."""

import json
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from fis_tools.__main__ import main
from fis_tools.document import as_json, text
from fis_tools.findings.audit import Finding, Severity, Thresholds, audit
from fis_tools.findings.audit.report import SCHEMA, SCHEMA_VERSION
from fis_tools.findings.audit.terms import read_names
from fis_tools.formats.serialize import dump_yaml
from fis_tools.model import (
    And,
    Consequent,
    FuzzyController,
    FuzzySystem,
    Gaussian,
    Is,
    Not,
    Or,
    Rule,
    Term,
    Trapezoidal,
    Triangular,
    Variable,
    table_rules,
)
from tests.fis_tools.analysis.test_flights import log_flight
from tests.fis_tools.analysis.test_measures import even_terms
from tests.fis_tools.sample_controllers import general_controller, paper_like_controller

NAMES = ("NL", "NS", "ZE", "PS", "PL")
ERROR = Variable("error", "deg", -10.0, 10.0, even_terms(NAMES, -10.0, 10.0))
RATE = Variable("rate", "deg/s", -2.0, 2.0, even_terms(NAMES, -2.0, 2.0))
TORQUE = Variable("torque", "N m", -1.0, 1.0, even_terms(NAMES, -1.0, 1.0), default=0.0)
TABLE = [NAMES[min(4, max(0, 6 - error - rate))] for error, rate in product(range(5), range(5))]


def controller_of(*tables: list[str]) -> FuzzySystem:
    """A PD controller as textbooks print it: the more error and rate, the more torque against them."""
    table = tables[0] if tables else TABLE
    return FuzzySystem("pd", (ERROR, RATE), (TORQUE,), table_rules((ERROR, RATE), TORQUE, table))


def with_terms(system: FuzzySystem, name: str, **changed: object) -> FuzzySystem:
    """The system with the membership functions of some terms of one variable changed."""

    def change(variable: Variable) -> Variable:
        if variable.name != name:
            return variable
        terms = (Term(t.name, changed.get(t.name, t.membership)) for t in variable.terms)  # type: ignore[arg-type]
        return replace(variable, terms=tuple(terms))

    return replace(
        system,
        inputs=tuple(change(variable) for variable in system.inputs),
        outputs=tuple(change(variable) for variable in system.outputs),
    )


def found_in(system: FuzzySystem, kind: str, samples: np.ndarray | None = None) -> list[Finding]:
    result = audit(system, None if samples is None else {system.name: samples})
    return [finding for finding in result.findings if finding.id == kind]


def the_one(system: FuzzySystem, kind: str, samples: np.ndarray | None = None) -> Finding:
    (finding,) = found_in(system, kind, samples)
    return finding


def spread_samples() -> np.ndarray:
    return np.random.default_rng(1).uniform([-10.0, -2.0], [10.0, 2.0], (400, 2))


def test_a_textbook_controller_is_left_alone():
    result = audit(controller_of())
    assert result.findings == ()
    assert result.summary() == "pd: nothing found (1 system, no logs)"


def test_a_textbook_controller_that_flies_everywhere_gets_notes_at_most():
    result = audit(controller_of(), {"pd": spread_samples()})
    assert result.at_least(Severity.WARNING) == ()
    # outermost rules say what their neighbours say as well
    assert {finding.id for finding in result.findings} <= {"idle-rules"}


def test_unused_variables_and_terms():
    idle = Variable("wind", "m/s", 0.0, 9.0, even_terms(("low", "high"), 0.0, 9.0))
    system = replace(controller_of(), inputs=(ERROR, RATE, idle))
    finding = the_one(system, "unused-variable")
    assert (finding.variable, finding.severity) == ("wind", Severity.SERIOUS)
    system = controller_of([term if term != "ZE" else "PS" for term in TABLE])
    finding = the_one(system, "unused-term")
    assert (finding.variable, finding.terms) == ("torque", ("ZE",))


def test_a_term_that_never_holds():
    system = with_terms(controller_of(), "rate", ZE=Gaussian(0.02, 0.005))
    finding = the_one(system, "term-height")
    assert (finding.variable, finding.terms) == ("rate", ("ZE",))
    assert finding.severity is Severity.WARNING
    assert finding.evidence["highest"] == pytest.approx(np.exp(-8.0))
    system = with_terms(controller_of(), "rate", ZE=Gaussian(0.02, 1e-4))
    assert the_one(system, "term-height").severity is Severity.SERIOUS


def test_a_gap_between_terms():
    system = with_terms(controller_of(), "error", NS=Triangular(-6.0, -5.0, -4.0))
    finding = the_one(system, "coverage")
    assert (finding.variable, finding.severity) == ("error", Severity.WARNING)
    # NL falls to 0 at -5 and ZE rises from there: (-5 - x) / 5 = x + 6, and as much on the other side
    assert finding.evidence["least"] == pytest.approx(1 / 6, abs=1e-12)
    # NL falls to 0.2 at -6, and NS rises to it at -5.8; ZE as much on the other side
    ends = (finding.evidence["from"], finding.evidence["to"])
    assert ends in (pytest.approx((-6.0, -5.8)), pytest.approx((-4.2, -4.0)))
    system = with_terms(controller_of(), "error", NS=Triangular(-5.2, -5.0, -4.8))
    assert the_one(system, "coverage").severity is Severity.SERIOUS
    assert "error has a gap from" in finding.sentence
    wide = the_one(with_terms(controller_of(), "error", NS=Triangular(-9.0, -9.0, -8.0)), "coverage")
    assert (wide.evidence["from"], wide.evidence["to"]) == (pytest.approx(-6.0), pytest.approx(-4.0))
    open_end = the_one(with_terms(controller_of(), "error", PL=Triangular(4.0, 5.0, 6.0)), "coverage")
    assert open_end.evidence["to"] == 10.0


def test_a_gap_that_other_rules_fill_is_a_note():
    terms = (Term("rancid", Trapezoidal(0, 0, 1, 3)), Term("delicious", Trapezoidal(7, 9, 10, 10)))
    food = Variable("food", "", 0.0, 10.0, terms)
    service = Variable("service", "", 0.0, 10.0, even_terms(("poor", "good", "excellent"), 0.0, 10.0))
    tip = Variable(
        "tip", "%", 0.0, 30.0, even_terms(("cheap", "average", "generous"), 0.0, 30.0), default=0.0
    )
    rules = (
        Rule(Or((Is("service", "poor"), Is("food", "rancid"))), (Consequent("tip", "cheap"),)),
        Rule(Is("service", "good"), (Consequent("tip", "average"),)),
        Rule(Or((Is("service", "excellent"), Is("food", "delicious"))), (Consequent("tip", "generous"),)),
    )
    result = audit(FuzzySystem("tipper", (service, food), (tip,), rules))
    assert [(f.id, f.severity, f.variable) for f in result.findings] == [("coverage", Severity.NOTE, "food")]


def test_a_missing_rule_leaves_a_hole():
    system = controller_of()
    system = replace(system, rules=system.rules[:12] + system.rules[13:])
    finding = the_one(system, "completeness")
    assert finding.severity is Severity.SERIOUS
    assert finding.evidence["at"] == pytest.approx([0.0, 0.0], abs=1e-9)
    assert "error = 0 deg, rate = 0 deg/s: the output is the default, torque = 0 N m" in finding.sentence


def test_terms_that_look_alike_overlap_or_lie_inside():
    system = with_terms(
        controller_of(), "rate", NS=Triangular(-2.0, -1.0, 0.6), ZE=Triangular(-2.0, -0.8, 0.6)
    )
    finding = the_one(system, "look-alike-terms")
    assert (finding.variable, finding.terms) == ("rate", ("NS", "ZE"))
    assert finding.evidence["similarity"] > 0.7
    system = with_terms(controller_of(), "rate", NS=Trapezoidal(-2.0, -1.5, 2.0, 2.0))
    inside = found_in(system, "term-inside-another")
    assert ("rate", ("NS", "ZE")) in [(finding.variable, finding.terms) for finding in inside]
    system = with_terms(
        controller_of(), "rate", NS=Triangular(-2.0, -1.0, 1.5), PS=Triangular(-1.5, 1.0, 2.0)
    )
    system = with_terms(system, "rate", NS=Triangular(-2, -0.15, 0.9), PS=Triangular(-0.9, 0.15, 2))
    assert ("NS", "PS") in [finding.terms for finding in found_in(system, "overlapping-terms")]


def test_terms_out_of_order_and_names_that_contradict():
    swapped = with_terms(controller_of(), "rate", NS=RATE.terms[2].membership, ZE=RATE.terms[1].membership)
    finding = the_one(swapped, "name-order")
    assert (finding.severity, finding.variable, finding.terms) == (Severity.SERIOUS, "rate", ("NS", "ZE"))
    assert "NS of rate lies at 0 deg/s, above ZE at -1 deg/s" in finding.sentence
    assert the_one(swapped, "term-order").terms == ("NS", "ZE")
    shuffled = replace(RATE, terms=(RATE.terms[1], RATE.terms[0], *RATE.terms[2:]))
    system = replace(controller_of(), inputs=(ERROR, shuffled))
    assert the_one(system, "term-order").terms == ("NS", "NL")
    assert found_in(system, "name-order") == []


def test_zero_stands_below_small_or_between_low_and_high():
    named = (("zero", "small", "medium", "large"), ("low", "zero", "high"))
    for names_of_terms, low in zip(named, (0.0, -3.0), strict=True):
        x = Variable("x", "", low, 3.0, even_terms(names_of_terms, low, 3.0))
        rules = tuple(Rule(Is("x", name), (Consequent("torque", "ZE"),)) for name in names_of_terms)
        system = FuzzySystem("named", (x,), (TORQUE,), rules)
        assert [f for f in audit(system).findings if f.id in {"name-order", "zero-off-zero"}] == []


def test_a_negative_term_above_zero():
    system = with_terms(
        controller_of(), "error", NS=Triangular(-5.0, 0.4, 5.0), ZE=Triangular(-5.0, 0.5, 5.0)
    )
    finding = the_one(system, "name-sign")
    assert (finding.severity, finding.terms) == (Severity.SERIOUS, ("NS",))


def test_a_zero_that_is_not_at_zero():
    system = with_terms(
        controller_of(), "error", ZE=Triangular(-2.0, 3.0, 8.0), NS=Triangular(-10.0, -2.0, 3.0)
    )
    finding = the_one(system, "zero-off-zero")
    assert (finding.severity, finding.terms) == (Severity.SERIOUS, ("ZE",))
    # 0 belongs to ZE by 2 / 5 and to NS by 3 / 5
    assert finding.evidence["membership_of_zero"] == pytest.approx(0.4, abs=0.01)
    assert "0.40 in it, but 0.60 in NS" in finding.sentence


def test_many_terms():
    many = Variable("x", "", 0.0, 1.0, even_terms(tuple(f"x{i}" for i in range(12)), 0.0, 1.0))
    rules = table_rules((many,), TORQUE, ["ZE"] * 12)
    assert the_one(FuzzySystem("many", (many,), (TORQUE,), rules), "many-terms").evidence["terms"] == 12


def test_rules_said_twice():
    system = controller_of()
    again = And((Is("rate", "NL"), Is("error", "NL")))
    doubled = replace(system, rules=(*system.rules, Rule(again, (Consequent("torque", "PL"),))))
    finding = the_one(doubled, "duplicate-rules")
    assert (finding.rules, finding.severity) == ((1, 26), Severity.WARNING)
    assert found_in(doubled, "contradicting-rules") == []
    against = replace(system, rules=(*system.rules, Rule(Not(Not(again)), (Consequent("torque", "NL"),))))
    finding = the_one(against, "contradicting-rules")
    assert (finding.rules, finding.severity) == ((1, 26), Severity.SERIOUS)
    assert "one concludes torque is PL, the other torque is NL" in finding.sentence


def test_a_conclusion_without_weight_is_found():
    system = controller_of()
    idle = replace(system.rules[3], consequents=(replace(system.rules[3].consequents[0], weight=0.0),))
    finding = the_one(replace(system, rules=(*system.rules[:3], idle, *system.rules[4:])), "no-weight")
    assert (finding.rules, finding.severity) == ((4,), Severity.WARNING)
    assert finding.sentence == "Rule 4 concludes torque is PS with weight 0, which changes nothing."


def test_a_wide_rule_over_narrower_ones():
    system = controller_of()
    wide = replace(system, rules=(*system.rules, Rule(Is("error", "ZE"), (Consequent("torque", "ZE"),))))
    finding = the_one(wide, "overlapping-rules")
    # of the five rules where error is ZE, one says ZE as well
    assert finding.rules == (26, 11, 12, 14, 15)


def test_neighbours_that_contradict():
    assert found_in(controller_of(), "contradicting-neighbours") == []
    table = list(TABLE)
    table[12] = "PL"
    findings = found_in(controller_of(table), "contradicting-neighbours")
    assert [(finding.variable, finding.rules) for finding in findings] == [
        ("error", (13, 18)),
        ("rate", (13, 14)),
    ]
    assert findings[0].severity is Severity.NOTE
    assert "from PL (rule 13) to NS (rule 14), 1.5 N m apart" in findings[1].sentence
    alternating = [("NL", "PL")[sum(divmod(place, 5)) % 2] for place in range(25)]
    findings = found_in(controller_of(alternating), "contradicting-neighbours")
    assert [finding.severity for finding in findings] == [Severity.WARNING] * 2


def test_a_table_that_turns_back():
    table = list(TABLE)
    table[13] = "PS"
    findings = found_in(controller_of(table), "monotonicity-table")
    assert [(finding.variable, finding.severity) for finding in findings] == [
        ("error", Severity.WARNING),
        ("rate", Severity.WARNING),
    ]
    assert "torque falls with rate in" in findings[1].sentence
    assert "from ZE (rule 13) to PS (rule 14)" in findings[1].sentence
    alternating = [("NL", "PL")[sum(divmod(place, 5)) % 2] for place in range(25)]
    findings = found_in(controller_of(alternating), "monotonicity-table")
    assert [finding.severity for finding in findings] == [Severity.NOTE] * 2
    assert "no direction along error: torque rises in 10 steps and falls in 10" in findings[0].sentence


def test_a_surface_that_turns_back():
    assert found_in(controller_of(), "monotonicity-surface") == []
    table = list(TABLE)
    table[13] = "PL"
    findings = found_in(controller_of(table), "monotonicity-surface")
    finding = next(finding for finding in findings if finding.variable == "rate")
    assert finding.evidence["from"] < finding.evidence["to"] == pytest.approx(1.0, abs=0.1)
    assert finding.evidence["held"]["error"] == pytest.approx(0.0, abs=0.2)


def test_rules_that_are_outvoted():
    wide = {name: Trapezoidal(-2.0, -2.0, 2.0, 2.0) for name in ("NL", "PL")}
    finding = the_one(with_terms(controller_of(), "rate", **wide), "rule-consistency")
    assert 13 in finding.rules or 3 in finding.rules
    assert "the rule alone would give" in finding.sentence


def test_an_output_that_stays_in_the_middle():
    wide = replace(TORQUE, minimum=-3.0, maximum=3.0, num_points=301)
    finding = the_one(replace(controller_of(), outputs=(wide,)), "output-reach")
    assert finding.severity is Severity.WARNING
    assert finding.evidence["high"] < 1.0
    constant = the_one(controller_of(["ZE"] * 25), "output-reach")
    assert constant.severity is Severity.SERIOUS
    assert "torque is 0 N m at 19881 points over the input ranges" in constant.sentence


def test_more_rules_than_a_person_keeps_in_mind():
    inputs = tuple(replace(RATE, name=name) for name in "abc")
    table = [NAMES[min(4, max(0, 8 - sum(cell)))] for cell in product(range(5), repeat=3)]
    system = FuzzySystem("big", inputs, (TORQUE,), table_rules(inputs, TORQUE, table))
    finding = the_one(system, "complexity")
    assert finding.evidence["premises"] == 375


def test_inputs_outside_their_range():
    samples = spread_samples()
    assert found_in(controller_of(), "input-clipped", samples) == []
    samples[:40, 1] = 2.5
    finding = the_one(controller_of(), "input-clipped", samples)
    assert (finding.variable, finding.severity) == ("rate", Severity.WARNING)
    assert finding.evidence["part"] == 0.1
    assert "up to 2.5 deg/s" in finding.sentence
    samples[1:, 1] = 0.0
    assert the_one(controller_of(), "input-clipped", samples).severity is Severity.NOTE


def test_defaults_taken():
    system = replace(controller_of(), rules=controller_of().rules[20:])
    samples = np.array([[9.0, 0.0], [-9.0, 0.0], [8.0, 0.0], [9.0, 1.0]])
    finding = the_one(system, "default-taken", samples)
    assert finding.severity is Severity.SERIOUS
    assert (finding.evidence["part"], finding.evidence["first"]) == (0.25, 1)
    assert found_in(controller_of(), "default-taken", samples) == []


def test_dead_and_dominant_rules():
    centre = np.random.default_rng(0).uniform([-1.0, -0.2], [1.0, 0.2], (50, 2))
    finding = the_one(controller_of(), "dead-rules", centre)
    assert finding.severity is Severity.WARNING
    # within 1 deg and 0.2 deg/s only the nine rules of NS, ZE and PS fire
    assert set(finding.rules) == set(range(1, 26)) - {7, 8, 9, 12, 13, 14, 17, 18, 19}
    finding = the_one(controller_of(), "dominant-rule", centre)
    assert finding.rules == (13,)
    assert finding.evidence["leading"] == 1.0
    assert found_in(controller_of(), "dead-rules", spread_samples()) == []


def test_rules_that_fire_and_change_nothing():
    system = controller_of()
    again = Rule(And((Is("error", "ZE"), Is("rate", "ZE"))), (Consequent("torque", "ZE"),))
    near = np.array([[0.0, 0.0], [1.0, 0.1], [-1.0, 0.2]])
    finding = the_one(replace(system, rules=(*system.rules, again)), "idle-rules", near)
    assert {13, 26} <= set(finding.rules)


def test_a_system_that_never_decided():
    controller = FuzzyController("two", (controller_of(), replace(controller_of(), name="other")))
    result = audit(controller, {"pd": spread_samples(), "other": np.empty((0, 2))})
    assert [f.system for f in result.findings if f.id == "never-asked"] == ["other"]
    assert [system.num_samples for system in result.systems] == [400, 0]


def test_thresholds_decide():
    strict = audit(controller_of(), thresholds=Thresholds(coverage=0.6, rules=10))
    assert {finding.id for finding in strict.findings} == {"coverage", "complexity"}


def test_samples_that_do_not_fit_are_refused():
    with pytest.raises(ValueError, match="did you mean 'pd'"):
        audit(controller_of(), {"pdd": spread_samples()})
    with pytest.raises(ValueError, match="2 numbers each"):
        audit(controller_of(), {"pd": np.zeros((3, 4))})


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
    system = with_terms(controller_of(), "error", NS=Triangular(-5.2, -5.0, -4.8))
    result = audit(system, {"pd": spread_samples()})
    told = text.write(result.document(), 90)
    assert told.startswith("pd: ")
    assert told.index("SERIOUS") < told.index("NOTE") < told.index("MEASURES")
    assert all(len(line) <= 90 for line in told.splitlines())
    assert "error has a gap" in told
    held = json.loads(as_json(SCHEMA, SCHEMA_VERSION, result.plain()))
    assert (held["schema"], held["schema_version"]) == ("fuzzy-audit", 2)
    assert sum(held["summary"].values()) == len(held["findings"])
    severities = [Severity[finding["severity"].upper()] for finding in held["findings"]]
    assert severities == sorted(severities, reverse=True)
    assert held["systems"][0]["measures"]["completeness"]["exact"] is True
    assert "error has a gap" in result._repr_markdown_()


def test_every_kind_of_system_is_audited():
    result = audit(general_controller(), {"room": np.array([[10.0, 3.0], [35.0, 20.0]])})
    json.dumps(result.plain(), allow_nan=False)
    assert {finding.system for finding in result.findings} == {"room"}


def test_the_command_prints_and_sets_the_exit_status(tmp_path, capsys):
    controller = paper_like_controller()
    path = tmp_path / "c.yaml"
    path.write_text(dump_yaml(controller), encoding="utf-8")
    flight = log_flight(tmp_path / "a.mcap", controller, num_samples=12)
    assert main(["audit", str(path)]) == 0
    assert "no logs" in capsys.readouterr().out
    assert main(["audit", str(flight)]) == 0
    assert "24 logged inferences" in capsys.readouterr().out
    assert main(["audit", str(path), "--flights", str(flight), "--fail-on", "note"]) == 1
    assert "input-clipped" in capsys.readouterr().out
    assert main(["audit", str(path), "--fail-on", "serious", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["controller"] == "paper-like"
    words = ["audit", str(path), "--system", "force_x", "--thresholds", "coverage=1", "--fail-on", "warning"]
    assert main(words) == 1


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["--thresholds", "cover=1"], "no threshold 'cover'; did you mean 'coverage'?"),
        (["--flights", "OTHER"], "give flights of this controller"),
        (["--flights", "missing.mcap"], "cannot be opened"),
        (["--system", "force_x", "--flights", "SWAPPED"], "the controller's has distance, velocity_body_x"),
    ],
)
def test_a_mistake_gives_a_sentence(tmp_path, capsys, words, sentence):
    path = tmp_path / "c.yaml"
    path.write_text(dump_yaml(paper_like_controller()), encoding="utf-8")
    other = replace(paper_like_controller().systems[0], name="other")
    swapped = replace(paper_like_controller().systems[1], name="force_x")
    places = {
        "OTHER": log_flight(tmp_path / "other.mcap", FuzzyController("o", (other,))),
        "SWAPPED": log_flight(tmp_path / "swapped.mcap", FuzzyController("s", (swapped,))),
    }
    assert main(["audit", str(path), *(str(places.get(word, word)) for word in words)]) == 2
    assert sentence in capsys.readouterr().err
