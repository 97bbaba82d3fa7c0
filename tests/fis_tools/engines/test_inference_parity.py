"""The readable inference against scikit-fuzzy's own ``compute()``, to the last bit."""

import numpy as np
import pytest

from fis_tools.engines import inference
from fis_tools.engines.inference import infer
from fis_tools.model import Constant, Formula, Linear, Ramp
from fis_tools.model.shape import SHAPES
from fis_tools.model.validate import problems
from tests.fis_tools.engines.random_systems import (
    ACCUMULATIONS,
    AND_OPERATORS,
    DEFUZZIFIERS,
    OR_OPERATORS,
    full_table_system,
    inputs_for,
    random_general_system,
)
from tests.fis_tools.reference_engine import ReferenceEngine
from tests.seeds import seeds

NUM_SYSTEMS = 100


@pytest.mark.parametrize("seed", range(12))
def test_full_tables_agree_bit_for_bit(seed: int) -> None:
    generator = np.random.default_rng([1, seed])
    system = full_table_system(generator, num_inputs=2 + (seed == 0))
    assert problems(system) == []
    engine = ReferenceEngine(system)
    for inputs in inputs_for(system, generator, 8):
        np.testing.assert_array_equal(infer(system, inputs).values, engine.compute(inputs))


@pytest.mark.parametrize("seed", seeds(NUM_SYSTEMS, 25))
def test_general_systems_agree_bit_for_bit(seed: int) -> None:
    generator = np.random.default_rng([3, seed])
    system = random_general_system(generator)
    assert problems(system) == []
    engine = ReferenceEngine(system)
    rows = inputs_for(system, generator, 8)
    expected = np.array([engine.compute(inputs) for inputs in rows])
    np.testing.assert_array_equal(np.array([infer(system, inputs).values for inputs in rows]), expected)
    np.testing.assert_array_equal(inference.evaluate(system, rows), expected)


def test_the_general_systems_above_cover_what_they_should() -> None:
    generators = [np.random.default_rng([3, seed]) for seed in range(NUM_SYSTEMS)]
    systems = [random_general_system(generator) for generator in generators]
    rules = [(system, rule) for system in systems for rule in system.rules]
    outputs = [(system, output) for system in systems for output in system.outputs]
    shapes = {type(t.membership) for s in systems for v in (*s.inputs, *s.outputs) for t in v.terms}
    assert {system.and_operator_of(rule) for system, rule in rules} == set(AND_OPERATORS)
    assert {system.or_operator_of(rule) for system, rule in rules} == set(OR_OPERATORS)
    assert {system.defuzzifier_of(output) for system, output in outputs} == set(DEFUZZIFIERS)
    assert {output.accumulation for _, output in outputs} == set(ACCUMULATIONS)
    assert shapes == set(SHAPES.values()) - {
        Constant,
        Formula,
        Linear,
        Ramp,
    }  # those of outputs that are weighed
    defaults = computed = 0
    for system, generator in zip(systems, generators, strict=True):
        for inputs in inputs_for(system, generator, 8):
            for output in infer(system, inputs).outputs:
                defaults += output.is_default
                computed += not output.is_default
    assert defaults > 50
    assert computed > 500
