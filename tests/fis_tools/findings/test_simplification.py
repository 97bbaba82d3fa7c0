"""Simplifications: within their budget by scikit-fuzzy's account, and finding what is there to be found."""

import json
from dataclasses import replace

import numpy as np
import pytest

from fis_tools.analysis.arrays import spread_inputs
from fis_tools.engines.compiler import compile
from fis_tools.engines.packing import pack
from fis_tools.findings.simplification import Budget, SimplifiedSystem, simplify
from fis_tools.findings.simplification.draft import Merger, merged, rounded, units, without_input
from fis_tools.findings.simplification.report import SPREAD, Bench
from fis_tools.formats.serialize import dump_yaml, load, loads
from fis_tools.model import And, Consequent, FuzzyController, FuzzySystem, Is, Or, Rule, Term, Variable
from fis_tools.model.shapes import Gaussian, Trapezoidal, Triangular
from fis_tools.model.systems import with_semantics
from fis_tools.model.validate import controller_problems
from tests.fis_tools import sample_controllers
from tests.fis_tools.analysis.test_flights import log_flight
from tests.fis_tools.control_systems import by_scikit_fuzzy
from tests.fis_tools.sample_controllers import FORCE_X, PAPER_LIKE, ROOM, SHIPPED, terms
from tests.fis_tools.step_by_step import ends

FOREIGN = sorted(sample_controllers.EXAMPLES.glob("*.f*"))
EXACTLY = Budget(0.0, 0.0)


def flown(system: FuzzySystem, num_samples: int = 120) -> np.ndarray:
    """Inputs of something like a flight: a spiral into the middle of the ranges."""
    low, high = ends(system)
    time = np.linspace(0.0, 1.0, num_samples)[:, np.newaxis]
    phase = np.arange(len(low))
    spiral: np.ndarray = 0.5 * (low + high) + 0.45 * (high - low) * (1 - time) * np.cos(12 * time + phase)
    return spiral


def departures(result: SimplifiedSystem, samples: np.ndarray) -> np.ndarray:
    """How far scikit-fuzzy's outputs part, as shares of the ranges, (n, num_outputs)."""
    before, after = (by_scikit_fuzzy(system, samples) for system in (result.original, result.simplified))
    spans = [variable.maximum - variable.minimum for variable in result.original.outputs]
    parted: np.ndarray = np.abs(after - before) / spans
    return parted


def with_dead_rule() -> FuzzySystem:
    """The force system with a term whose rules cannot fire, and one that no rule uses."""
    distance, velocity = FORCE_X.inputs
    never = Term("never", Trapezoidal(300.0, 310.0, 320.0, 330.0))
    spare = Term("spare", Triangular(0.0, 100.0, 200.0))
    distance = replace(distance, terms=(*distance.terms, never, spare))
    antecedent = And((Is("distance", "never"), Is("velocity_body_x", velocity.terms[0].name)))
    rule = Rule(antecedent, (Consequent("force_x", "PL"),))
    return replace(FORCE_X, inputs=(distance, velocity), rules=(rule, *FORCE_X.rules))


def with_look_alike() -> FuzzySystem:
    """The force system with the middle distance cut into two terms that mean nearly the same."""
    distance, velocity = FORCE_X.inputs
    middle = distance.terms[2].membership
    twin = Term("medium", replace(middle, mean=middle.mean + 1.0))
    distance = replace(distance, terms=(*distance.terms[:3], twin, *distance.terms[3:]))
    twins = tuple(
        replace(rule, antecedent=And((Is("distance", "medium"), *rule.antecedent.operands[1:])))
        for rule in FORCE_X.rules[10:15]
    )
    return replace(FORCE_X, inputs=(distance, velocity), rules=(*FORCE_X.rules, *twins))


CASES = {
    "force_x": FORCE_X,
    "dead": with_dead_rule(),
    "alike": with_look_alike(),
    "room": ROOM,
    # as scikit-fuzzy means them
    **{path.name: with_semantics(load(path).systems[0], "scikit-fuzzy") for path in FOREIGN},
}


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("budget", [Budget(), Budget(0.2, 0.04, flights_only=True)], ids=["small", "large"])
def test_scikit_fuzzy_finds_the_change_as_told_and_within_the_budget(name, budget):
    system = CASES[name]
    samples = flown(system, 60)
    result = simplify(system, {system.name: samples}, budget).systems[0]
    parted = departures(result, samples)
    reported = result.changes["flights"]
    np.testing.assert_allclose(parted.max(axis=0), reported.largest, rtol=0, atol=1e-12)
    np.testing.assert_allclose(parted.mean(axis=0), reported.mean, rtol=0, atol=1e-12)
    assert parted.max() <= budget.max_change + 1e-12
    assert parted.mean(axis=0).max() <= budget.mean_change + 1e-12
    assert controller_problems(FuzzyController("c", (result.simplified,))) == []
    for step in result.steps:
        assert step.changes["flights"].cost(budget) <= 1.0


@pytest.mark.slow
def test_the_budget_holds_over_the_ranges_unless_it_is_for_flights_only():
    box = spread_inputs(FORCE_X)[::64]
    budget = Budget(0.15, 0.02)
    for samples in ({}, {FORCE_X.name: flown(FORCE_X)}):
        result = simplify(FORCE_X, samples, budget).systems[0]
        assert len(result.simplified.rules) < len(FORCE_X.rules)
        assert departures(result, box).max() <= 0.15 + 1e-12
        assert result.changes["ranges"].largest[0] <= 0.15
    few = {FORCE_X.name: flown(FORCE_X)[:20]}
    (alone,) = simplify(FORCE_X, few, replace(budget, flights_only=True)).systems
    assert alone.changes["ranges"].largest[0] > 0.15
    assert len(alone.simplified.rules) < len(result.simplified.rules)


@pytest.mark.slow
def test_dead_rules_and_unused_terms_go_for_nothing():
    result = simplify(with_dead_rule(), budget=EXACTLY).systems[0]
    assert result.steps[0].sentence == "drop spare of distance, which no rule uses"
    dropped = [number for step in result.steps for number in step.rules]
    assert 1 in dropped
    names = [term.name for term in result.simplified.inputs[0].terms]
    assert "spare" not in names
    assert "never" not in names
    assert "never of distance goes with it" in " ".join(step.sentence for step in result.steps)
    np.testing.assert_allclose(
        departures(result, spread_inputs(result.original, 100)), 0.0, rtol=0, atol=1e-12
    )


@pytest.mark.slow
def test_nothing_that_changes_anything_goes_for_nothing():
    """Each rule of the force system decides somewhere, and each digit counts."""
    result = simplify(PAPER_LIKE, budget=EXACTLY)
    assert [len(s.simplified.rules) for s in result.systems] == [25, 45]
    for system in result.systems:
        assert system.changes["ranges"].largest[0] <= 1e-12


@pytest.fixture(scope="module")
def merged_once():
    return simplify(with_look_alike(), budget=Budget(0.03, 0.005)).systems[0]


@pytest.mark.slow
def test_look_alike_terms_become_one(merged_once):
    result = merged_once
    merges = [step for step in result.steps if step.kind == "merge"]
    assert len(merges) == 1
    assert "medium" in merges[0].sentence
    assert "middle" in merges[0].sentence
    assert sum(len(step.rules) for step in result.steps) == 5
    assert len(result.simplified.rules) == 25
    assert len(result.simplified.inputs[0].terms) == 5
    likeness = Budget(0.03, 0.005, look_alike=0.99)
    steps = simplify(with_look_alike(), budget=likeness).systems[0].steps
    assert all(step.kind != "merge" for step in steps)


def test_a_merger_keeps_the_rival_that_matters_more_and_says_nothing_twice():
    shape = FORCE_X.inputs[0].terms[0].membership
    merger = Merger("distance", "very near", "near", shape, False, 0.8)
    importance = np.ones(25)
    importance[7] = 2.0
    simpler, kept = merged(FORCE_X, merger, importance)
    assert sorted(kept) == [0, 1, 3, 4, 7, *range(10, 25)]
    very_near_and_still = And((Is("distance", "very near"), Is("velocity_body_x", "still")))
    (rule,) = (rule for rule in simpler.rules if rule.antecedent == very_near_and_still)
    assert rule.consequents == FORCE_X.rules[7].consequents
    either = Rule(Or((Is("distance", "near"), Is("distance", "very near"))), (Consequent("force_x", "PL"),))
    simpler, _ = merged(replace(FORCE_X, rules=(either,)), merger, np.ones(1))
    assert simpler.rules[0].antecedent == Is("distance", "very near")
    by_sum = replace(FORCE_X, rules=(either,), or_operator="probabilistic_sum")
    simpler, _ = merged(by_sum, merger, np.ones(1))
    assert simpler.rules[0].antecedent == Or((Is("distance", "very near"),) * 2)


def test_numbers_are_rounded_to_what_a_person_says():
    """Digits count from the range: of 200 m, two are tens; of 0.0694 N, one is hundredths."""
    shapes = terms(near=Gaussian(40.017, 20.3), end=Gaussian(200.4, 4.9))
    forces = terms(zero=Gaussian(2e-7, 0.0018), high=Gaussian(0.0694, 0.021))
    output = replace(sample_controllers.force(), minimum=-0.0694, maximum=0.0694, terms=forces)
    distance = Variable("distance", "m", 0.0, 200.4, shapes)
    rules = (Rule(Is("distance", "near"), (Consequent("force_x", "zero"),)),)
    system = FuzzySystem("s", (distance,), (output,), rules)
    two = rounded(system, dict.fromkeys(units(system), 2))
    assert (two.inputs[0].minimum, two.inputs[0].maximum) == (0.0, 200.0)
    assert [term.membership for term in two.inputs[0].terms] == [Gaussian(40.0, 20.0), Gaussian(200.0, 5.0)]
    assert (two.outputs[0].minimum, two.outputs[0].maximum) == (-0.069, 0.069)
    assert [t.membership for t in two.outputs[0].terms] == [Gaussian(0.0, 0.002), Gaussian(0.069, 0.021)]
    simpler = rounded(system, dict.fromkeys(units(system), 1))
    assert simpler.outputs[0].maximum == 0.07
    assert [t.membership for t in simpler.outputs[0].terms] == [Gaussian(0.0, 0.002), Gaussian(0.07, 0.02)]


@pytest.mark.parametrize("digits", [1, 2, 3])
@pytest.mark.parametrize("name", CASES)
def test_rounded_terms_stay_whole_and_in_order(name, digits):
    system = CASES[name]
    simpler = rounded(system, dict.fromkeys(units(system), digits))
    assert controller_problems(FuzzyController("c", (simpler,))) == []
    for before, after in zip(system.inputs, simpler.inputs, strict=True):
        shapes = [[term.membership for term in variable.terms] for variable in (before, after)]
        order, again = (np.argsort([s.mean for s in of if isinstance(s, Gaussian)]) for of in shapes)
        assert np.array_equal(order, again)


@pytest.mark.slow
def test_a_champion_stays_one_that_flies_and_is_the_same_each_time():
    champion = load(SHIPPED["paper_champion"])
    samples = {system.name: flown(system) for system in champion.systems}
    result = simplify(champion, samples)
    again = simplify(champion.systems[2], {"force_z": samples["force_z"]})
    assert again.systems[0] == result.systems[2]
    assert sum(len(s.rules) for s in result.controller.systems) < 60
    pack(*result.controller.systems)
    assert result.controller.attributes == champion.attributes
    facts = dict(result.controller.provenance)
    assert facts["simplified_from"] == "paper_champion"
    for words in (
        "5 % of an output's range at most and 1 % on",
        "along the logs and at points over",
        "(360 inferences)",
    ):
        assert words in facts["simplified_within"]
    assert facts["trained_by"] == dict(champion.provenance)["trained_by"]
    assert loads(dump_yaml(result.controller), "yaml") == result.controller
    for system, simpler in zip(champion.systems, result.controller.systems, strict=True):
        assert [v.num_points for v in simpler.inputs] == [v.num_points for v in system.inputs]


@pytest.mark.slow
def test_what_is_simple_stays_as_it_is(merged_once):
    """Simplified for nothing, a simplified system loses nothing more."""
    twice = simplify(merged_once.simplified, budget=EXACTLY)
    assert twice.systems[0].simplified == merged_once.simplified
    assert twice.systems[0].steps == ()
    assert "nothing can be made simpler" in twice.text()


def test_an_output_keeps_a_rule_however_large_the_budget():
    for system in (FORCE_X, ROOM):
        result = simplify(system, budget=Budget(1.0, 1.0)).systems[0].simplified
        concluded = {consequent.variable for rule in result.rules for consequent in rule.consequents}
        assert concluded == {variable.name for variable in system.outputs}


def test_an_output_that_appears_or_goes_is_beyond_any_budget():
    outputs = np.array([[1.0], [np.nan], [np.inf], [4.0]])
    bench = Bench(Budget(), {SPREAD: np.zeros((4, 1))}, {SPREAD: outputs}, np.array([2.0]))
    assert bench.change(SPREAD, outputs).largest == (0.0,)
    for row, value in ((0, np.nan), (1, 0.0), (2, -np.inf), (3, np.nan)):
        other = outputs.copy()
        other[row] = value
        assert bench.change(SPREAD, other).largest == (np.inf,)
        assert bench.cost({SPREAD: bench.change(SPREAD, other)}) == np.inf


def test_where_there_is_no_output_there_is_none_of_the_simpler_system():
    x = Variable("x", "", 0.0, 4.0, (Term("middle", Trapezoidal(1.0345, 1.5, 2.5, 2.9655)),))
    terms_of_y = (Term("some", Triangular(0.123456, 0.9, 1.7)), Term("idle", Triangular(0.0, 1.0, 2.0)))
    y = Variable("y", "", 0.0, 2.0, terms_of_y)
    rule = Rule(Is("x", "middle"), (Consequent("y", "some"),))
    system = FuzzySystem("s", (x,), (y,), (rule,), semantics="fuzzylite")
    (result,) = simplify(system).systems
    assert [term.name for term in result.simplified.outputs[0].terms] == ["some"]
    assert len(result.steps) > 1  # numbers were rounded, too
    assert result.changes[SPREAD].largest[0] <= Budget().max_change
    inputs = spread_inputs(system)
    before, after = (compile(each)(inputs) for each in (system, result.simplified))
    assert 0 < np.isnan(before).sum() < len(inputs)
    np.testing.assert_array_equal(np.isnan(after), np.isnan(before))


def test_the_steps_are_told():
    reports: list[str] = []
    result = simplify(with_dead_rule(), budget=Budget(), progress=reports.append)
    lines = result.text().splitlines()
    assert lines[0].startswith("force_x: 26 rules to ")
    assert any("on average at 4,096 points over the ranges" in line for line in lines)
    columns = "rules terms max, ranges mean, ranges step"
    heads = [" ".join(line.split()) for line in lines].index(columns)
    assert len(lines) == heads + 2 + len(result.systems[0].steps)
    assert reports[0] == f"force_x: 26 rules, {len(sample_controllers.FORCE_TERMS) * 3 + 2} terms"
    plain = json.loads(json.dumps(result.plain(), allow_nan=False))
    assert plain["systems"][0]["rules"] == [26, len(result.systems[0].simplified.rules)]
    assert "| rules | terms |" in result._repr_markdown_()


@pytest.mark.parametrize(
    ("numbers", "sentence"),
    [
        ({"max_change": -0.1}, "max_change is -0.1; give a share of the output's range from 0 to 1"),
        ({"mean_change": float("nan")}, "mean_change is nan"),
        ({"max_change": 5.0}, "max_change is 5;"),
        ({"look_alike": 0.0}, "look_alike is 0; give a likeness above 0"),
    ],
)
def test_a_nonsense_budget_is_refused(numbers, sentence):
    with pytest.raises(ValueError, match=sentence):
        Budget(**numbers)  # type: ignore[arg-type]


def test_samples_of_nobody_are_refused():
    with pytest.raises(ValueError, match="samples are given for 'force_y'; did you mean"):
        simplify(FORCE_X, {"force_y": np.zeros((1, 2))})


@pytest.mark.slow
def test_the_command_writes_a_controller_and_tells_the_steps(saved, run):
    path = saved(FuzzyController("dead", (with_dead_rule(),)))
    expected = simplify(load(path), budget=Budget(0.02, 0.004))
    output = path.parent / "new" / "simpler.yaml"
    words = ("simplify", path, "--max-change", "2%", "--mean-change", "0.004", "-o", output)
    assert run(*words).out == expected.text()
    assert load(output) == expected.controller
    plain = json.loads(run(*words[:-2], "--json").out)
    assert (plain["schema"], plain["schema_version"]) == ("fuzzy-simplification", 1)
    assert plain["budget"]["max_change"] == 0.02


@pytest.mark.slow
def test_the_command_keeps_to_flights_alone_on_demand(tmp_path, run):
    flight = log_flight(tmp_path / "flight.mcap", PAPER_LIKE)
    words = ("simplify", flight, "--system", "force_x")
    everywhere, alone = (run(*words, *more).out for more in ((), ("--flights-only",)))
    assert "along the logs and at points" in everywhere
    assert "on average, along the logs force_x: force_x departs" in " ".join(alone.split())
    rules = [int(text.split()[4].rstrip(",")) for text in (alone, everywhere)]
    assert rules[0] < rules[1] <= 25


def with_idle_input() -> FuzzySystem:
    """The force system with a third input along which its rules are the same."""
    thirds = terms(low=Gaussian(0.0, 2.0), mid=Gaussian(5.0, 2.0), high=Gaussian(10.0, 2.0))
    idle = Variable("idle", "", 0.0, 10.0, thirds)
    rules = tuple(
        replace(rule, antecedent=And((*rule.antecedent.operands, Is("idle", term.name))))
        for term in thirds
        for rule in FORCE_X.rules
    )
    return replace(FORCE_X, inputs=(*FORCE_X.inputs, idle), rules=rules)


@pytest.mark.slow
def test_an_input_along_which_rules_are_the_same_is_left_out():
    system, budget = with_idle_input(), Budget(0.2, 0.05)
    (result,) = simplify(system, budget=budget).systems
    step = result.steps[0]
    assert (step.kind, step.num_rules) == ("input", len(system.rules) // 3)
    assert step.sentence.startswith("leave out idle, as though it always were ")
    assert [variable.name for variable in result.simplified.inputs] == [v.name for v in system.inputs[:2]]
    samples = spread_inputs(system, 80)
    before, after = by_scikit_fuzzy(system, samples), by_scikit_fuzzy(result.simplified, samples[:, :2])
    assert np.abs(after - before).max() <= 1.1 * budget.max_change * 2.0 * system.outputs[0].maximum
    assert not any(step.kind == "input" for step in simplify(system, budget=EXACTLY).systems[0].steps)


def test_inputs_stay_where_rules_do_not_say_plainly_what_they_ask():
    system = with_idle_input()
    first, *others = system.rules
    assert without_input(system, "idle", "mid") is not None
    muddled = replace(first, antecedent=Or((Is("distance", "VN"), Is("idle", "low"))))
    assert without_input(replace(system, rules=(muddled, *others)), "idle", "mid") is None
    alone = replace(first, antecedent=Is("idle", "low"))
    assert without_input(replace(system, rules=(alone, *others)), "idle", "mid") is None
