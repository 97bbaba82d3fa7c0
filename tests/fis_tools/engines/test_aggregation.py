"""Implications but the minimum and aggregations but the maximum: by hand, compiled, and in our own files."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from fis_tools.engines import inference
from fis_tools.engines.compiler import compile
from fis_tools.formats import serialize
from fis_tools.model import Consequent, FuzzyController, FuzzySystem, Is, Rule, Term, Triangular, Variable
from fis_tools.model.operators import AGGREGATIONS, AND_OPERATORS
from fis_tools.model.validate import problems
from tests.fis_tools.engines.random_systems import inputs_for, otherwise, random_general_system


def two_rules(implication: str, aggregation: str) -> FuzzySystem:
    """Two rules of strength 0.6 and 0.5 that conclude one triangle."""
    terms = tuple(Term(name, Triangular(left, 0.5, left + 1.0)) for name, left in (("a", -0.1), ("b", 0.0)))
    x = Variable("x", "", 0.0, 1.0, terms, num_points=11)
    y = Variable("y", "", 0.0, 4.0, (Term("t", Triangular(0.0, 2.0, 4.0)),), num_points=5, default=0.0)
    rules = tuple(
        Rule(Is("x", name), (Consequent("y", "t", weight),)) for name, weight in (("a", 0.6), ("b", 0.5))
    )
    return FuzzySystem(
        "two",
        (x,),
        (replace(y, aggregation=aggregation),),
        rules,
        implication=implication,  # type: ignore[arg-type]
    )


@pytest.mark.parametrize(
    ("implication", "aggregation", "heights"),
    [
        ("min", "max", [0.0, 0.5, 0.6, 0.5, 0.0]),
        ("product", "max", [0.0, 0.3, 0.6, 0.3, 0.0]),
        ("product", "bounded_sum", [0.0, 0.55, 1.0, 0.55, 0.0]),
        ("product", "unbounded_sum", [0.0, 0.55, 1.1, 0.55, 0.0]),
        ("min", "probabilistic_sum", [0.0, 0.75, 0.8, 0.75, 0.0]),
        ("bounded_difference", "max", [0.0, 0.1, 0.6, 0.1, 0.0]),
    ],
)
def test_rules_count_as_a_pencil_says(implication: str, aggregation: str, heights: list[float]) -> None:
    (output,) = inference.infer(two_rules(implication, aggregation), np.array([0.5])).outputs
    at_points = np.interp(np.arange(5.0), output.universe, output.aggregated)
    np.testing.assert_allclose(at_points, heights, atol=1e-15)


def test_every_pair_is_compiled_as_it_is_defined() -> None:
    generator = np.random.default_rng(315)
    for implication, aggregation in product(AND_OPERATORS, AGGREGATIONS):
        system = otherwise(random_general_system(generator), implication, aggregation)
        assert problems(system) == []
        rows = inputs_for(system, generator, 6)
        with np.errstate(all="ignore"):
            expected = inference.evaluate(system, rows)
        widths = [output.maximum - output.minimum for output in system.outputs]
        np.testing.assert_allclose(compile(system)(rows) / widths, expected / widths, rtol=0, atol=1e-12)


def test_a_file_of_our_own_keeps_them() -> None:
    controller = FuzzyController("two", (two_rules("product", "unbounded_sum"),))
    for dump, kind in ((serialize.dump_json, "json"), (serialize.dump_yaml, "yaml")):
        assert serialize.loads(dump(controller), kind) == controller  # type: ignore[arg-type]


def test_an_accumulation_besides_is_refused() -> None:
    system = two_rules("product", "max")
    both = replace(system, outputs=(replace(system.outputs[0], accumulation="bounded_sum"),))
    assert "'y' has the accumulation bounded_sum, which is for terms cut by min" in problems(both)[0]
