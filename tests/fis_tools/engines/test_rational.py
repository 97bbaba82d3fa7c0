"""What flies against scikit-fuzzy's own steps in rational arithmetic, which rounds nothing."""

from bisect import bisect_right
from fractions import Fraction

import numpy as np
import pytest

from fis_tools.formats import serialize
from fis_tools.model import And, FuzzySystem, Is, Variable
from tests.fis_tools.engines.test_kernel_parity import by_kernel
from tests.fis_tools.sample_controllers import SHIPPED


def rationals(values) -> list[Fraction]:
    return [Fraction(float(value)) for value in values]


def at(points: list[Fraction], heights: list[Fraction], x: Fraction) -> Fraction:
    """The height at x of the line through points, which are ascending."""
    k = min(max(bisect_right(points, x) - 1, 0), len(points) - 2)
    share = min(max((x - points[k]) / (points[k + 1] - points[k]), Fraction(0)), Fraction(1))
    return heights[k] + (heights[k + 1] - heights[k]) * share


def sets(variable: Variable) -> tuple[list[Fraction], dict[str, list[Fraction]]]:
    """The points of a variable's universe, and each term's memberships there."""
    rows = dict(zip((term.name for term in variable.terms), variable.memberships, strict=True))
    return rationals(variable.universe), {name: rationals(row) for name, row in rows.items()}


def centroid(system: FuzzySystem, row: np.ndarray) -> Fraction | None:
    """The centroid of the terms cut at their rules' strengths; None where nothing fires."""
    degrees = {}
    for variable, x in zip(system.inputs, rationals(row), strict=True):
        points, terms = sets(variable)
        degrees |= {Is(variable.name, name): at(points, heights, x) for name, heights in terms.items()}
    points, terms = sets(system.outputs[0])
    cuts = dict.fromkeys(terms, Fraction(0))
    for rule in system.rules:
        parts = rule.antecedent.operands if isinstance(rule.antecedent, And) else (rule.antecedent,)
        strength = min(degrees[part] for part in parts)
        for consequent in rule.consequents:
            cuts[consequent.term] = max(cuts[consequent.term], strength * Fraction(consequent.weight))
    corners = set(points)
    for name, cut in cuts.items():
        for a, b, low, high in zip(points, points[1:], terms[name], terms[name][1:], strict=False):
            if (low - cut) * (high - cut) < 0:
                corners.add(a + (cut - low) / (high - low) * (b - a))
    along = sorted(corners)
    heights = [max(min(cut, at(points, terms[name], x)) for name, cut in cuts.items()) for x in along]
    area = moment = Fraction(0)
    for a, b, low, high in zip(along, along[1:], heights, heights[1:], strict=False):
        area += (low + high) * (b - a) / 2
        moment += (b - a) * (a * (2 * low + high) + b * (low + 2 * high)) / 6
    return moment / area if area else None


@pytest.mark.parametrize("name", sorted(name for name in SHIPPED if "champion" in name))
def test_a_force_is_right_to_its_last_digits(name):
    generator, num_compared = np.random.default_rng(61), 0
    for system in serialize.load(SHIPPED[name]).systems:
        assert system.outputs[0].unit == "N"
        rows = np.column_stack([generator.uniform(each.minimum, each.maximum, 6) for each in system.inputs])
        for row, force in zip(rows, by_kernel(system, rows)[:, 0], strict=True):
            if (expected := centroid(system, row)) is not None:
                error = float(abs(Fraction(float(force)) - expected))
                assert error <= (1e-15 if abs(force) < 0.5 else 2e-15), (row, force, error)
                num_compared += 1
    assert num_compared > 6
