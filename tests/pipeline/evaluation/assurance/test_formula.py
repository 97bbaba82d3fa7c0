"""Formulas: their text form, and by how much flights satisfy them."""

import copy
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from pipeline.command_line.choices import options
from pipeline.command_line.config import compose_experiment
from pipeline.evaluation.assurance import formula as stl
from pipeline.evaluation.assurance import requirements, robustness
from pipeline.evaluation.assurance.requirements import METHODS, Question, RequirementError, parse_requirements
from pipeline.settings.experiment import Mission
from pipeline.settings.places import conf_folder, requirements_path

UNITS = {"distance": "m", "speed": "m/s", "inspection_rate": "%", "points": ""}
NEAR = stl.Predicate((("distance", -1.0),), 60.0, True, "m")


A, B, C = (stl.Predicate((("points", 1.0),), -float(n), True, "") for n in (1, 2, 3))


@pytest.mark.parametrize(
    ("text", "formula"),
    [
        # what binds closest
        ("points > 1 or points > 2 and points > 3", stl.Disjunction(A, stl.Conjunction(B, C))),
        (
            "points > 1 -> points > 2 -> points > 3",
            stl.Disjunction(stl.Negation(A), stl.Disjunction(stl.Negation(B), C)),
        ),
        ("not points > 1 until[0:9] points > 2", stl.Until(stl.Window(0, 9), stl.Negation(A), B)),
        ("always eventually[2,5] points > 1", stl.Always(stl.Window(), stl.Eventually(stl.Window(2, 5), A))),
        # units may stand or not
        ("distance < 60", NEAR),
        ("distance < 60 m", NEAR),
        ("always[0 s: 10 s] points > 1", stl.Always(stl.Window(0, 10), A)),
        # sums come to one side
        ("0.5 * distance + 2 m >= distance - 3", stl.Predicate((("distance", -0.5),), 5.0, False, "m")),
    ],
)
def test_a_text_is_read_as_its_formula(text, formula):
    assert stl.parse(text, UNITS) == formula


def test_a_formula_without_end_is_refused():
    for text in ("(" * 9999, "not " * 9999, "points > 1 -> " * 9999):
        with pytest.raises(stl.FormulaError, match="without end"):
            stl.parse(text, UNITS)


def test_a_rate_makes_a_speed_of_a_distance():
    formula = stl.parse("speed <= 0.2 m/s + 0.002 per_s * distance", UNITS)
    assert formula.unit == "m/s"
    assert dict(formula.factors) == {"speed": -1.0, "distance": 0.002}
    with pytest.raises(stl.FormulaError, match="m/s does not go with m"):
        stl.parse("distance <= 0.002 per_s * distance", UNITS)


def test_a_formula_tells_its_quantities_and_the_unit_of_its_margin():
    formula = stl.parse("always (distance < 60 -> speed < 1) and distance > 15", UNITS)
    assert stl.quantities_of(formula) == ("distance", "speed")
    assert stl.unit_of(formula) is None
    assert stl.unit_of(stl.parse("always distance > 15", UNITS)) == "m"


@pytest.mark.parametrize(
    ("text", "column", "words"),
    [
        ("always (distnce >= 15)", 8, "no quantity distnce; did you mean distance?"),
        ("always (zzz >= 15)", 8, "there are distance, speed"),
        ("always (distance >= 15 m/s)", 20, "m/s does not go with m"),
        ("always[0 3600] distance >= 15", 9, "expected : and the window's end"),
        ("always (distance >= 15", 22, "expected )"),
        ("distance + speed > 3", 11, "m/s does not go with m"),
        ("points + distance > 3", 9, "m does not go with a pure number"),
        ("distance > 3 k", 13, "k is no unit here"),
        ("3 > 2", 0, "name a quantity"),
        ("always[5:3] distance > 1", 9, "before it begins"),
        ("always[0 m:3] distance > 1", 9, "windows are in s, not in m"),
        ("distance ? 3", 9, "'?' means nothing"),
        ("", 0, "expected a quantity or a number"),
        ("distance > 15 and", 17, "expected a quantity or a number"),
        ("distance > 15 15", 14, "expected and, or, until"),
        ("3 m * distance > 1", 0, "without a unit"),
        ("distance", 8, "expected >=, <=, > or <"),
    ],
)
def test_mistakes_are_pointed_at(text, column, words):
    with pytest.raises(stl.FormulaError) as caught:
        stl.parse(text, UNITS)
    shown, pointed = str(caught.value).split("\n")
    assert shown == text
    assert pointed.index("^") == column
    assert words in pointed


TABLE = json.loads(Path(__file__).with_name("rtamt_table.json").read_text(encoding="utf-8"))
PLAIN = {"a": "", "b": ""}


@pytest.mark.parametrize("case", TABLE["cases"], ids=lambda case: f"{case['formula']} on {case['trace']}")
def test_rtamt_agrees_at_every_sample(case):
    trace = {name: np.array([row]) for name, row in TABLE["traces"][case["trace"]].items()}
    ours = robustness._evaluate(stl.parse(case["formula"], PLAIN), trace, 1.0, robustness._margin)[0]
    np.testing.assert_allclose(ours, case["robustness"], rtol=0, atol=1e-12)


def brute_force(formula, values: np.ndarray, at: int) -> tuple[bool, set[tuple[stl.Formula, int]]]:
    """By the definitions: whether a formula holds at a sample, and which premises hold at which samples."""
    num = len(values)

    def window(bounds):
        last = num - 1 if np.isinf(bounds.last_s) else min(num - 1, at + int(bounds.last_s))
        return range(at + int(bounds.first_s), last + 1)

    match formula:
        case stl.Predicate(((_, factor),), constant):
            return bool(factor * values[at] + constant > 0.0), set()
        case stl.Negation(part):
            holds, met = brute_force(part, values, at)
            return not holds, met
        case stl.Conjunction(left, right) | stl.Disjunction(left, right):
            (first, met), (second, others) = (brute_force(part, values, at) for part in (left, right))
            met = met | others
            if isinstance(formula, stl.Disjunction) and isinstance(left, stl.Negation) and not first:
                met = met | {(left.part, at)}
            return (first or second if isinstance(formula, stl.Disjunction) else first and second), met
        case stl.Always(bounds, part) | stl.Eventually(bounds, part):
            results = [brute_force(part, values, sample) for sample in window(bounds)]
            met = set().union(*(each for _, each in results))
            holds = [each for each, _ in results]
            return (all(holds) if isinstance(formula, stl.Always) else any(holds)), met
        case _:
            pytest.fail(f"no formula: {formula}")


PREDICATES = st.builds(
    stl.Predicate,
    st.sampled_from([(("a", 1.0),), (("a", -1.0),)]),
    st.sampled_from([-1.5, -0.5, 0.5, 1.5]),
    st.just(True),
    st.just(""),
)
WINDOWS = st.sampled_from([stl.Window(), stl.Window(0, 2), stl.Window(1, 3)])
FORMULAS = st.recursive(
    PREDICATES,
    lambda parts: st.one_of(
        st.builds(stl.Negation, parts),
        st.builds(stl.Conjunction, parts, parts),
        st.builds(stl.Disjunction, parts, parts),
        st.builds(lambda left, right: stl.Disjunction(stl.Negation(left), right), parts, parts),
        st.builds(stl.Always, WINDOWS, parts),
        st.builds(stl.Eventually, WINDOWS, parts),
    ),
    max_leaves=4,
)


@given(FORMULAS, arrays(np.float64, (4, 8), elements=st.sampled_from([-2.0, -1.0, 0.0, 1.0, 2.0])))
def test_a_premise_occurs_where_it_holds_at_a_sample_that_counts(formula, values):
    occurred = robustness.premises(formula, {"a": values}, 1.0)
    for flight, row in enumerate(values):
        _, met = brute_force(formula, row, 0)
        assert {premise for premise, occurs in occurred.items() if occurs[flight]} == {
            each for each, _ in met
        }


@given(FORMULAS)
def test_what_is_rendered_is_read_as_the_same_formula(formula):
    assert stl.parse(stl.render(formula, PLAIN), PLAIN) == formula


def test_rates_and_sums_are_rendered_so_that_they_are_read_again():
    for text in (
        "always[60:90] (speed <= 0.198973 m/s + 0.002054 per_s * distance) or eventually distance <= 0.2 m",
        "2 * distance - 0.5 * distance > 3 m until[0:1e-05] speed < 1e-07 m/s",
        "distance < 30 m -> speed <= 0.26 m/s",
    ):
        formula = stl.parse(text, UNITS)
        assert stl.parse(stl.render(formula, UNITS), UNITS) == formula
    assert stl.render(formula, UNITS) == "distance < 30 m -> speed <= 0.26 m/s"


def test_a_margin_has_the_unit_of_the_quantity_that_decides_it():
    formula = stl.parse("always (distance < 60 m -> speed < 1 m/s)", UNITS)
    signals = {
        "distance": np.array([[50.0, 50.0], [61.5, 70.0]]),
        "speed": np.array([[0.25, 0.75], [5.0, 5.0]]),
    }
    margins = robustness.robustness(formula, signals, 10.0)
    np.testing.assert_array_equal(margins, [0.25, 1.5])
    assert robustness.deciding_units(formula, signals, margins).tolist() == ["m/s", "m"]


@given(arrays(np.float64, (3, 9), elements=st.sampled_from([-1.0, 0.0, 1.0])))
def test_what_holds_has_a_margin_that_is_not_below_zero(values):
    for text in ("always a >= 0", "eventually[1:4] a > 0", "not (a > 0) until[0:5] a >= 1"):
        formula = stl.parse(text, PLAIN)
        margin, truth = (
            robustness.robustness(formula, {"a": values}, 1.0),
            robustness.holds(formula, {"a": values}, 1.0),
        )
        assert np.all(truth[margin > 0.0])
        assert not np.any(truth[margin < 0.0])
    zero = {"a": np.array([[0.0, 1.0]])}
    assert robustness.holds(stl.parse("always a >= 0", PLAIN), zero, 1.0)[0]
    assert not robustness.holds(stl.parse("always a > 0", PLAIN), zero, 1.0)[0]


def test_windows_are_in_seconds_whatever_the_period():
    signals = {"a": np.array([[5.0, 4.0, 3.0, 2.0]])}
    for window, least in ((stl.Window(0, 20), 3.0), (stl.Window(0, 29.9), 3.0), (stl.Window(10, 30), 2.0)):
        text = f"always[{window.first_s}:{window.last_s}] a >= 0"
        assert robustness.robustness(stl.parse(text, PLAIN), signals, 10.0)[0] == least


SHIPPED = requirements.requirements_text("inspection", Mission())


def test_what_ships_can_be_read_and_uses_every_way_of_verification_but_one():
    shipped = parse_requirements(SHIPPED, "inspection")
    assert shipped.name == "inspection"
    assert [requirement.id for requirement in shipped.requirements] == [
        f"R{number}" for number in range(1, 9)
    ]
    planar = parse_requirements(
        requirements_path("docking_planar").read_text(encoding="utf-8"), "docking_planar"
    )
    everything = (*shipped.requirements, *planar.requirements)
    used = {method for method in METHODS if requirements.verified_by_method(everything, method)}
    # what is too rare for cases, which nothing that ships claims
    assert used == set(METHODS) - {requirements.SPLITTING}
    keep_out, thrust = shipped.requirements[0], shipped.requirements[5]
    assert (keep_out.unit, keep_out.probability, keep_out.confidence) == ("m", 1.0, 0.9)
    assert thrust.formula is None
    assert thrust.questions[0] == Question("force_x > 1")


def changed(index: int, **values: object) -> str:
    content = copy.deepcopy(yaml.safe_load(SHIPPED))
    content["requirements"][index] |= values
    return yaml.safe_dump(content)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("a: [", "mine is no YAML"),
        ("a: [", "; correct it there"),
        ("[" * 9999, "mine is no YAML"),
        ("schema: fuzzy-controller", "must say schema: requirements"),
        ("schema: requirements\nschema_version: 1", "version 1 lacked consequence"),
        ("schema: requirements\nschema_version: 2", "must be a list of at least one"),
        (changed(0, consequence=None), "R1: consequence is missing"),
        (changed(1, severity="grave"), "R2: severity is 'grave'"),
        (changed(0, probability=0.999), "R1: accepted is missing; a share of catastrophic failures must be"),
        (changed(1, probability=None), "R2: probability is None"),
        (changed(0, id="R2"), "R2 is the id of two requirements"),
        (changed(0, id="../x"), "requirement 1: its id is '../x'; it names files"),
        (changed(0, title=" "), "R1: title is missing"),
        (changed(1, probability=1), "R2: probability is 1; it must be above 0 and below 1"),
        (changed(0, confidence=None), "R1: confidence is None"),
        (changed(0, propability=0.9), "there is no key propability; did you mean probability?"),
        (changed(0, verified_by=["cases", "serch"]), "R1: verified_by has 'serch'; did you mean search?"),
        (changed(0, verified_by="cases"), "R1: verified_by must be a list of cases, splitting, search"),
        (changed(0, formula="always (distance >= 15 kg)"), "R1, its formula:\nalways (distance >= 15 kg)\n"),
        (changed(5, bounds=[{"asks": "force_x > 1"}]), "R6: bounds must be a list of questions"),
    ],
)
def test_mistakes_name_the_requirement_and_the_cure(text, words):
    with pytest.raises(RequirementError) as caught:
        parse_requirements(text, "mine")
    assert words in str(caught.value)


def test_a_missions_own_limits_are_those_that_what_ships_judges():
    deputy = replace(Mission().deputy, min_distance_m=12.0, max_distance_m=150.5, max_force_n=0.25)
    mission = replace(Mission(), deputy=deputy, duration_s=1800.0, inspection_threshold_percent=80.0)
    shipped = requirements.load_requirements("inspection", mission)
    assert [each.formula_text for each in (*shipped[:3], *shipped[6:])] == [
        "always (distance >= 12 m)",
        "always (distance <= 150.5 m)",
        "eventually[0:1800] (inspection_rate >= 80 %)",
        "eventually always (coasting_farthest <= 150.5 m and coasting_distance >= 12 m)",
        "always[10:1800] (coasting_distance >= 12 m)",
    ]
    assert "at least 12 m" in shipped[0].text
    assert shipped[5].questions[:2] == (Question("force_x > 0.25"), Question("force_x < -0.25"))


@pytest.mark.parametrize("period_s", [4.0, 10.0, 25.0])
@pytest.mark.parametrize(("name", "index"), [("inspection", 7), ("inspection_fleet", 5)])
def test_passive_safety_is_judged_from_the_first_sample_that_follows_a_decision(name, index, period_s):
    fleet = replace(Mission().fleet, deputies=2 if name == "inspection_fleet" else 1)
    mission = replace(Mission(), control_period_s=period_s, duration_s=100.0, fleet=fleet)
    formula = requirements.load_requirements(name, mission)[index].formula
    assert formula is not None
    # a sample of each flight is below all limits
    distances = np.where(np.eye(3, mission.num_controls + 1) > 0.0, 1.0, 50.0)
    (quantity,) = stl.quantities_of(formula)
    margins = robustness.robustness(formula, {quantity: distances}, period_s)
    assert (margins >= 0.0).tolist() == [True, False, False]


@pytest.mark.parametrize("key", ["deputy.min_distance", "deputy", "coast_when_complete"])
def test_braces_hold_the_key_of_a_number(tmp_path, key):
    path = tmp_path / "mine.yaml"
    path.write_text(changed(0, formula=f"always (distance >= {{{key}}} m)"), encoding="utf-8")
    with pytest.raises(RequirementError, match=rf"{{{key}}} is no number of the mission; braces"):
        requirements.load_requirements(str(path), Mission())


def test_requirements_that_are_not_there_are_told_with_those_that_ship(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"ship \(docking, .*, inspection_rso\)"):
        requirements_path(str(tmp_path / "none.yaml"))


@pytest.mark.parametrize(
    "formula",
    [
        "always[4000:5000] distance < 1 m and always distance >= 1 m",
        "always distance >= 1 m or eventually[3601:4000] distance < 1 m",
        "not (always[0:60] (distance > 1 m -> always[3700:3800] distance > 1 m))",
        "always[3000:3600] eventually[700:800] distance > 1 m",
        "always[1:9] distance > 1 m",
        "distance > 1 m until[3700:3800] distance > 2 m",
    ],
)
def test_a_part_that_no_sample_reaches_is_refused_wherever_it_stands(formula):
    window = parse_requirements(changed(0, formula=formula), "mine").requirements
    with pytest.raises(RequirementError, match=r"R1: its part from .* says nothing about a flight of 3600 s"):
        requirements.check_formulas(window, Mission())
    requirements.check_formulas(parse_requirements(SHIPPED, "").requirements, Mission())


@pytest.mark.parametrize(
    ("formula", "window"),
    [
        ("always[0:36000] (distance >= 15 m)", "0 to 36000"),
        ("eventually[0:3610] (inspection_rate >= 95 %)", "0 to 3610"),
        (
            "always[0:3600] distance >= 15 m and not (distance > 1 m until[0:3700] distance > 2 m)",
            "0 to 3700",
        ),
        ("always (distance > 185 m -> eventually[0:600] distance <= 185 m)", "0 to 600"),
        ("always[0:3010] (distance > 185 m -> eventually[0:600] distance <= 185 m)", "0 to 600"),
        ("distance > 1 m until (eventually[0:10] distance > 2 m)", "0 to 10"),
        ("(always[0:10] distance > 2 m) until distance > 1 m", "0 to 10"),
    ],
)
def test_a_window_that_can_end_after_the_flight_is_refused(formula, window):
    mine = parse_requirements(changed(0, formula=formula), "mine").requirements
    with pytest.raises(
        RequirementError, match=f"R1: its window from {window} s can end after a flight of 3600"
    ):
        requirements.check_formulas(mine, Mission())


@pytest.mark.parametrize(
    "formula",
    [
        "always[0:3600] (distance >= 15 m)",
        "always[0:3000] (distance > 185 m -> eventually[0:600] distance <= 185 m)",
        "always[0:1000] eventually[0:1000] always[0:1600] distance > 1 m",
        "always (distance > 1 m -> eventually distance > 2 m)",
    ],
)
def test_a_window_that_ends_with_the_flight_is_judged(formula):
    requirements.check_formulas(
        parse_requirements(changed(0, formula=formula), "mine").requirements, Mission()
    )


@pytest.mark.parametrize("confidence", [1e-7, 0.5, 0.79, 0.99991, 0.9999999, 1, 0, -0.9, "0.9"])
def test_a_confidence_that_says_nothing_or_cannot_be_had_is_refused(confidence):
    with pytest.raises(RequirementError, match=r"R2: confidence is .*; it must be from 0\.8 to 0\.9999"):
        parse_requirements(changed(1, confidence=confidence), "mine")
    for allowed in requirements.CONFIDENCES:
        assert (
            parse_requirements(changed(1, confidence=allowed), "mine").requirements[1].confidence == allowed
        )


@pytest.mark.parametrize("world", options([conf_folder()])["world"])
def test_each_world_is_asked_for_its_own_limits(world):
    experiment = compose_experiment(["+experiment=assure", f"world={world}"]).experiment
    mission = experiment.mission
    shipped = requirements.load_requirements(experiment.assurance.requirements, mission)
    requirements.check_formulas(shipped, mission)
    near, far = f">= {mission.deputy.min_distance_m} m", f"<= {mission.deputy.max_distance_m} m"
    expected = [stl.parse(f"always distance {limit}", UNITS) for limit in (near, far)]
    assert [requirement.formula for requirement in shipped[:2]] == expected
    formulas = [requirement.formula for requirement in shipped[2:] if requirement.formula]
    rates = {predicate for formula in formulas for predicate in stl.predicates(formula)}
    names = ("inspection_rate", "inspectable_rate")
    rate_limits = [-predicate.constant for predicate in rates if predicate.factors[0][0] in names]
    is_weighed = mission.chief.weights == "priority"
    assert rate_limits == ([] if is_weighed else [mission.inspection_threshold_percent])
    most = f"{mission.deputy.max_force_n:g}"
    forces = {f"force_{axis} {sign}{most}" for axis in "xyz" for sign in ("> ", "< -")}
    assert {question.ask for requirement in shipped for question in requirement.questions} == forces
    if is_weighed:
        with pytest.raises(RequirementError, match="R3: inspection_rate counts points, but"):
            requirements.check_formulas(parse_requirements(SHIPPED, "").requirements, mission)


def test_a_comparison_whose_quantities_cancel_is_refused():
    with pytest.raises(RequirementError, match="compares numbers with one another"):
        parse_requirements(changed(0, formula="always distance - distance >= 0 m"), "mine")
