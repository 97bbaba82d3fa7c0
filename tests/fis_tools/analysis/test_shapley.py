"""Shares of rules against every coalition enumerated, the axioms that define them, and values by hand."""

from dataclasses import replace
from itertools import combinations
from math import comb

import numpy as np
import pytest

from fis_tools.analysis import shapley, weighted_shares
from fis_tools.analysis.arrays import FIRED, spread_inputs
from fis_tools.engines import inference
from fis_tools.engines.compiler import compile
from fis_tools.formats import serialize
from fis_tools.model import FuzzySystem, Rule, Variable
from fis_tools.model.numbers import Constant
from fis_tools.model.shapes import Triangular
from tests.fis_tools import step_by_step
from tests.fis_tools.engines import random_systems, weighed_systems
from tests.fis_tools.engines.random_systems import inputs_for, random_general_system
from tests.fis_tools.sample_controllers import FORCE_X, SHIPPED, ramp_system, table_system, terms


def silenced(system: FuzzySystem, rules: set[int], output: str | None = None) -> FuzzySystem:
    """The same system, in which some rules conclude with no weight, on an output or on all."""

    def quiet(index: int, rule: Rule) -> Rule:
        if index not in rules:
            return rule
        text = (replace(c, weight=0.0) if output in (None, c.variable) else c for c in rule.consequents)
        return replace(rule, consequents=tuple(text))

    return replace(system, rules=tuple(quiet(*numbered) for numbered in enumerate(system.rules)))


def enumerated(system: FuzzySystem, row: np.ndarray, index: int) -> np.ndarray:
    """Shapley's sum over all coalitions, each inferred step by step."""
    output = system.outputs[index]
    strengths = step_by_step.firing_strengths(system, row[np.newaxis])[0]
    concludes = [any(c.variable == output.name and c.weight for c in r.consequents) for r in system.rules]
    strongest = max(
        (s for s, concludes_it in zip(strengths, concludes, strict=True) if concludes_it), default=0.0
    )
    least = min(FIRED, strongest)
    players = [i for i, s in enumerate(strengths) if concludes[i] and s >= least and s > 0.0]
    worth = {frozenset[int](): output.default}
    for size in range(1, len(players) + 1):
        for some in combinations(players, size):
            others = silenced(system, set(players) - set(some), output.name)
            worth[frozenset(some)] = inference.infer(others, row).values[index]
    values = np.zeros(len(system.rules))
    for player in players:
        for some, value in worth.items():
            if player not in some:
                weight = 1.0 / (len(players) * comb(len(players) - 1, len(some)))
                values[player] += weight * (worth[some | {player}] - value)
    return values


def test_shares_are_those_of_all_coalitions_enumerated() -> None:
    drawing, generator = np.random.default_rng(12), np.random.default_rng(3)
    several = 0
    for _ in range(24):
        system = random_general_system(drawing)
        accumulations = drawing.choice(random_systems.ACCUMULATIONS, len(system.outputs))
        pairs = zip(system.outputs, accumulations, strict=True)
        system = replace(system, outputs=tuple(replace(v, accumulation=str(a)) for v, a in pairs))
        rows = inputs_for(system, generator, 3)
        shares = shapley.shares(compile(system), rows)
        for sample, row in enumerate(rows):
            of_outputs = [enumerated(system, row, index) for index in range(len(system.outputs))]
            several += sum(np.count_nonzero(expected) > 2 for expected in of_outputs)
            step_by_step.assert_near(shares.values[sample], np.transpose(of_outputs), system, 1e-11)
        assert not shares.error.any()
    assert several > 20


def assert_adds_up(system: FuzzySystem, rows: np.ndarray) -> shapley.RuleShares:
    compiled = compile(system)
    shares = shapley.shares(compiled, rows)
    silent = np.array([output.default for output in system.outputs])
    step_by_step.assert_near(shares.values.sum(axis=1), compiled(rows) - silent, system, 1e-9)
    return shares


@pytest.mark.parametrize("name", SHIPPED)
def test_shares_add_up_for_every_controller_that_ships(name) -> None:
    for system in serialize.load(SHIPPED[name]).systems:
        assert not assert_adds_up(system, spread_inputs(system, 40)[:0]).values.size
        shares = assert_adds_up(system, spread_inputs(system, 40))
        assert not shares.error.any()
        assert np.count_nonzero(shares.values) > 40


def test_samples_of_one_structure_get_the_shares_that_each_gets_alone(monkeypatch) -> None:
    systems = [system for path in SHIPPED.values() for system in serialize.load(path).systems]
    together = [assert_adds_up(system, spread_inputs(system, 12)).values for system in systems]
    monkeypatch.setattr(shapley, "_games_by_level", lambda match: iter(()))
    for system, shares in zip(systems, together, strict=True):
        alone = assert_adds_up(system, spread_inputs(system, 12)).values
        step_by_step.assert_near(shares, alone, system)


def test_sampled_shares_add_up_and_are_as_near_as_they_say(monkeypatch) -> None:
    rows = spread_inputs(FORCE_X, 30)
    exact = assert_adds_up(FORCE_X, rows)
    monkeypatch.setattr(shapley, "MOST_COALITIONS", 1)
    drawn = assert_adds_up(FORCE_X, rows)
    assert np.all(drawn.error[np.count_nonzero(exact.values[:, :, 0], axis=1) > 2] > 0)
    apart = np.abs(drawn.values - exact.values).max(axis=1)
    assert apart.max() > 0
    assert np.all(apart <= 5 * drawn.error + 1e-15)
    np.testing.assert_array_equal(drawn.values, shapley.shares(compile(FORCE_X), rows).values)


def test_a_rule_that_hardly_fires_has_no_share_unless_it_is_the_strongest() -> None:
    system = ramp_system()
    shares = shapley.shares(compile(system), np.array([[0.04]])).values[0, :, 0]
    assert shares[1] == 0.0
    assert shares[0] == pytest.approx(inference.infer(system, np.array([0.04])).values[0] - 0.5, abs=1e-14)
    lone = compile(replace(system, rules=system.rules[1:]))
    assert shapley.shares(lone, np.array([[0.04]])).values.item() == pytest.approx(2.5, abs=1e-14)


@pytest.mark.parametrize("name", weighed_systems.SYSTEMS)
def test_shares_in_a_weighted_output_are_those_of_all_coalitions_enumerated(name: str) -> None:
    system = weighed_systems.SYSTEMS[name]
    rows = weighed_systems.samples(system, 12)
    shares = shapley.shares(compile(system), rows)
    several = 0
    for sample, row in enumerate(rows):
        of_outputs = [enumerated(system, row, index) for index in range(len(system.outputs))]
        several += sum(np.count_nonzero(expected) > 1 for expected in of_outputs)
        step_by_step.assert_near(shares.values[sample], np.transpose(of_outputs), system, 1e-11)
    assert several > 2 or name == "mixed"
    assert not shares.error.any()


def test_the_share_of_a_rule_in_an_average_is_not_its_proportion() -> None:
    """Two rules with the constants 2 and 10, at 0.25: alone they give 2 and 10, together 4."""
    sides = terms(low=Triangular(-1.0, 0.0, 1.0), high=Triangular(0.0, 1.0, 2.0))
    x = Variable("x", "", 0.0, 1.0, sides)
    y = Variable(
        "y",
        "",
        0.0,
        10.0,
        terms(two=Constant(2.0), ten=Constant(10.0)),
        default=0.0,
        aggregation="unbounded_sum",
    )
    system = table_system("sugeno", (x,), y, ("two", "ten"), defuzzifier="weighted_average")
    shares = shapley.shares(compile(system), np.array([[0.25]])).values[0, :, 0]
    np.testing.assert_allclose(shares, [-2.0, 6.0], rtol=0, atol=1e-12)


def test_shares_in_an_average_of_many_rules_add_up_and_agree_with_sampled_orders() -> None:
    generator = np.random.default_rng(7)
    strengths, numbers = generator.uniform(0.05, 1.0, 40), generator.uniform(-100.0, 100.0, 40)
    weak, default = (0.03, 0.9), 1.5
    game = strengths[np.newaxis], (strengths * numbers)[np.newaxis], *(np.array([part]) for part in weak)
    (exact,) = weighted_shares._of_averages(*game, default)
    output = (strengths @ numbers + weak[1]) / (strengths.sum() + weak[0])
    assert exact.sum() == pytest.approx(output - default, abs=1e-10)

    def worth(members: np.ndarray) -> np.ndarray:
        totals = members @ strengths + weak[0]
        return np.where(members.any(axis=1), (members @ (strengths * numbers) + weak[1]) / totals, default)

    drawn, error = shapley.sampled(40, worth, 4000)
    assert np.abs(drawn - exact).max() <= 5 * error
    assert error < 0.01 * np.ptp(numbers)


def test_the_integral_gives_the_shares_that_enumeration_gives(monkeypatch: pytest.MonkeyPatch) -> None:
    generator = np.random.default_rng(3)
    for count in range(1, weighted_shares.MOST_ENUMERATED + 1):
        strengths = generator.uniform(0.05, 1.0, (6, count)) * 10.0 ** generator.uniform(-6.0, 0.0, (6, 1))
        sums, weak = strengths * generator.normal(size=(6, count)), 0.01 * generator.random((2, 6))
        weak[:, :2] = 0.0
        exact = weighted_shares._of_averages(strengths, sums, *weak, 0.25)
        with monkeypatch.context() as patch:
            patch.setattr(weighted_shares, "MOST_ENUMERATED", 0)
            integrated = weighted_shares._of_averages(strengths, sums, *weak, 0.25)
        np.testing.assert_allclose(integrated, exact, rtol=0, atol=1e-11)
