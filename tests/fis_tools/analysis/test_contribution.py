"""Contributions against systems whose rules have been silenced one by one."""

from dataclasses import replace

import numpy as np
import pytest

from fis_tools.analysis.arrays import spread_inputs
from fis_tools.analysis.contribution import contributions, importance
from fis_tools.engines import inference
from fis_tools.engines.compiler import compile
from fis_tools.model import Consequent, FuzzySystem, Is, Rule, Term, Triangular, Variable
from tests.fis_tools.sample_controllers import (
    force_x_system,
    force_z_system,
    general_controller,
    paper_like_controller,
)


def without(system: FuzzySystem, index: int) -> FuzzySystem:
    """The same system, one rule's conclusions weighted with zero."""
    rule = system.rules[index]
    silent = replace(rule, consequents=tuple(replace(c, weight=0.0) for c in rule.consequents))
    return replace(system, rules=(*system.rules[:index], silent, *system.rules[index + 1 :]))


def adding_room() -> FuzzySystem:
    room = general_controller().systems[0]
    outputs = tuple(replace(output, accumulation="bounded_sum") for output in room.outputs)
    return replace(room, outputs=outputs)


@pytest.mark.parametrize(
    "system",
    [force_x_system(), *general_controller().systems, adding_room()],
    ids=["force", "room", "adding"],
)
def test_a_contribution_is_what_silencing_the_rule_takes_away(system: FuzzySystem) -> None:
    inputs = spread_inputs(system, 20)
    found = contributions(compile(system), inputs)
    outputs = inference.evaluate(system, inputs)
    assert found.shape == (20, len(system.rules), len(system.outputs))
    for index in range(len(system.rules)):
        expected = outputs - inference.evaluate(without(system, index), inputs)
        np.testing.assert_allclose(found[:, index], expected, rtol=0, atol=1e-14)
    assert np.count_nonzero(found) > 20


def two_rules() -> FuzzySystem:
    """Low or high, as a ramp; the output's terms are far from one another, and zero is neither."""
    x = Variable(
        "x", "", 0.0, 1.0, (Term("low", Triangular(0, 0, 1)), Term("high", Triangular(0, 1, 1))), 101
    )
    terms = (Term("left", Triangular(-4.0, -3.0, -2.0)), Term("right", Triangular(2.0, 3.0, 4.0)))
    y = Variable("y", "", -5.0, 5.0, terms, 101, default=0.5)
    rules = (
        Rule(Is("x", "low"), (Consequent("y", "left"),)),
        Rule(Is("x", "high"), (Consequent("y", "right"),)),
    )
    return FuzzySystem("ramp", (x,), (y,), rules)


def test_contributions_by_hand() -> None:
    """Where one rule fires alone it moved the output away from the default; half way each holds the other."""
    found = contributions(compile(two_rules()), np.array([[0.0], [0.5], [1.0]]))[:, :, 0]
    np.testing.assert_allclose(found, [[-3.5, 0.0], [-3.0, 3.0], [0.0, 2.5]], rtol=0, atol=1e-14)


def test_importance_by_hand() -> None:
    found = importance(compile(two_rules()), np.array([[0.0], [0.5], [1.0]]))
    np.testing.assert_allclose(found, [[6.5 / 3 / 10], [5.5 / 3 / 10]], rtol=0, atol=1e-15)


def test_rules_that_say_the_same_stand_in_for_one_another() -> None:
    system = two_rules()
    doubled = replace(system, rules=(*system.rules, system.rules[0]))
    found = contributions(compile(doubled), np.array([[0.0]]))
    np.testing.assert_array_equal(found, 0.0)


def test_many_samples_come_out_as_few_do() -> None:
    system = force_z_system()
    compiled = compile(system)
    inputs = spread_inputs(system, 1500)
    whole = contributions(compiled, inputs)
    np.testing.assert_array_equal(whole[700:720], contributions(compiled, inputs[700:720]))


def test_importance_needs_samples() -> None:
    system = paper_like_controller().systems[0]
    with pytest.raises(ValueError, match="there are no samples"):
        importance(compile(system), np.empty((0, 2)))
