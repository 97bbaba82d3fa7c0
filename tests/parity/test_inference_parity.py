"""The readable inference against scikit-fuzzy's own ``compute()``, to the last bit."""

import numpy as np
import pytest
from random_systems import DEFUZZIFIERS, full_table_system, general_system, inputs_for

from fis_tools import inference
from fis_tools.inference import infer
from fis_tools.skfuzzy_build import ReferenceEngine
from fis_tools.validate import problems


@pytest.mark.parametrize("seed", range(12))
def test_full_tables_agree_bit_for_bit(seed: int) -> None:
    generator = np.random.default_rng([1, seed])
    system = full_table_system(generator, num_inputs=2)
    assert problems(system) == []
    engine = ReferenceEngine(system)
    for inputs in inputs_for(system, generator, 8):
        np.testing.assert_array_equal(infer(system, inputs).values, engine.compute(inputs))


def test_a_table_of_three_inputs_agrees_bit_for_bit() -> None:
    generator = np.random.default_rng(2)
    system = full_table_system(generator, num_inputs=3)
    engine = ReferenceEngine(system)
    for inputs in inputs_for(system, generator, 5):
        np.testing.assert_array_equal(infer(system, inputs).values, engine.compute(inputs))


@pytest.mark.parametrize("seed", range(60))
def test_general_systems_agree_bit_for_bit(seed: int) -> None:
    generator = np.random.default_rng([3, seed])
    system = general_system(generator)
    assert problems(system) == []
    engine = ReferenceEngine(system)
    rows = inputs_for(system, generator, 8)
    expected = np.array([engine.compute(inputs) for inputs in rows])
    np.testing.assert_array_equal(np.array([infer(system, inputs).values for inputs in rows]), expected)
    np.testing.assert_array_equal(inference.evaluate(system, rows), expected)


def test_the_general_systems_above_cover_what_they_should() -> None:
    generators = [np.random.default_rng([3, seed]) for seed in range(60)]
    systems = [general_system(generator) for generator in generators]
    assert {system.defuzzifier for system in systems} == set(DEFUZZIFIERS)
    assert {(system.and_operator, system.or_operator) for system in systems} == {
        (and_operator, or_operator)
        for and_operator in ("min", "product")
        for or_operator in ("max", "probabilistic_sum")
    }
    defaults = computed = 0
    for system, generator in zip(systems, generators, strict=True):
        for inputs in inputs_for(system, generator, 8):
            for output in infer(system, inputs).outputs:
                defaults += output.is_default
                computed += not output.is_default
    assert defaults > 50
    assert computed > 500
