"""Shares of rules against every coalition enumerated, the axioms that define them, and values by hand."""

from dataclasses import replace
from itertools import combinations
from math import comb

import numpy as np
import pytest

from fis_tools.analysis import shapley
from fis_tools.analysis.arrays import FIRED, spread_inputs
from fis_tools.engines import inference
from fis_tools.engines.compiler import compile
from fis_tools.formats import serialize
from fis_tools.model import FuzzySystem, Rule
from fis_tools.model.operators import ACCUMULATIONS
from tests.fis_tools import step_by_step
from tests.fis_tools.engines.random_systems import inputs_for, random_general_system
from tests.fis_tools.sample_controllers import FORCE_X, SHIPPED, ramp_system


def silenced(system: FuzzySystem, rules: set[int], output: str | None = None) -> FuzzySystem:
    """The same system, in which some rules conclude with no weight, on an output or on all."""

    def quiet(place: int, rule: Rule) -> Rule:
        if place not in rules:
            return rule
        told = (replace(c, weight=0.0) if output in (None, c.variable) else c for c in rule.consequents)
        return replace(rule, consequents=tuple(told))

    return replace(system, rules=tuple(quiet(*numbered) for numbered in enumerate(system.rules)))


def enumerated(system: FuzzySystem, row: np.ndarray, place: int) -> np.ndarray:
    """Shapley's sum over all coalitions, each inferred step by step."""
    output = system.outputs[place]
    strengths = step_by_step.firing_strengths(system, row[np.newaxis])[0]
    concludes = [any(c.variable == output.name and c.weight for c in r.consequents) for r in system.rules]
    strongest = max((s for s, told in zip(strengths, concludes, strict=True) if told), default=0.0)
    least = min(FIRED, strongest)
    players = [i for i, s in enumerate(strengths) if concludes[i] and s >= least and s > 0.0]
    worth = {frozenset[int](): output.default}
    for size in range(1, len(players) + 1):
        for some in combinations(players, size):
            others = silenced(system, set(players) - set(some), output.name)
            worth[frozenset(some)] = inference.infer(others, row).values[place]
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
        accumulations = drawing.choice(list(ACCUMULATIONS), len(system.outputs))
        pairs = zip(system.outputs, accumulations, strict=True)
        system = replace(system, outputs=tuple(replace(v, accumulation=str(a)) for v, a in pairs))
        rows = inputs_for(system, generator, 3)
        found = shapley.shares(compile(system), rows)
        for sample, row in enumerate(rows):
            of_outputs = [enumerated(system, row, place) for place in range(len(system.outputs))]
            several += sum(np.count_nonzero(expected) > 2 for expected in of_outputs)
            step_by_step.assert_near(found.values[sample], np.transpose(of_outputs), system, 1e-11)
        assert not found.error.any()
    assert several > 20


def assert_adds_up(system: FuzzySystem, rows: np.ndarray) -> shapley.Shares:
    compiled = compile(system)
    found = shapley.shares(compiled, rows)
    silent = np.array([output.default for output in system.outputs])
    step_by_step.assert_near(found.values.sum(axis=1), compiled(rows) - silent, system, 1e-9)
    return found


@pytest.mark.parametrize("name", SHIPPED)
def test_shares_add_up_for_every_controller_that_ships(name) -> None:
    for system in serialize.load(SHIPPED[name]).systems:
        found = assert_adds_up(system, spread_inputs(system, 40))
        assert not found.error.any()
        assert np.count_nonzero(found.values) > 40


def test_samples_of_one_structure_get_the_shares_that_each_gets_alone(monkeypatch) -> None:
    systems = [system for path in SHIPPED.values() for system in serialize.load(path).systems]
    together = [assert_adds_up(system, spread_inputs(system, 12)).values for system in systems]
    monkeypatch.setattr(shapley, "_games_by_level", lambda match: iter(()))
    for system, found in zip(systems, together, strict=True):
        alone = assert_adds_up(system, spread_inputs(system, 12)).values
        step_by_step.assert_near(found, alone, system)


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
    found = shapley.shares(compile(system), np.array([[0.04]])).values[0, :, 0]
    assert found[1] == 0.0
    assert found[0] == pytest.approx(inference.infer(system, np.array([0.04])).values[0] - 0.5, abs=1e-14)
    lone = compile(replace(system, rules=system.rules[1:]))
    assert shapley.shares(lone, np.array([[0.04]])).values.item() == pytest.approx(2.5, abs=1e-14)
