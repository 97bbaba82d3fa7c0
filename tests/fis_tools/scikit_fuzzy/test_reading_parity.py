"""What is read from scikit-fuzzy computes what scikit-fuzzy computes, to the last bit."""

from functools import cache

import numpy as np
import pytest
from skfuzzy.control import ControlSystem

from fis_tools.engines import inference
from fis_tools.engines.inference import infer
from fis_tools.model import FuzzySystem
from fis_tools.scikit_fuzzy.read import read_control_system
from tests.fis_tools.control_systems import build_control_system
from tests.fis_tools.engines.random_systems import inputs_for, random_general_system
from tests.fis_tools.scikit_fuzzy.random_control_systems import (
    compute,
    distinct_inputs,
    random_control_system,
)

pytestmark = pytest.mark.slow

NUM_SYSTEMS = 40
#: Methods that scikit-fuzzy also asks of an empty set, and then answers about the universe.
OF_MAXIMUM = ("mom", "som", "lom")


@cache
def _read(seed: int) -> tuple[ControlSystem, FuzzySystem]:
    source = random_control_system(np.random.default_rng([31, seed]))
    return source, read_control_system(source)


@pytest.mark.parametrize("seed", range(NUM_SYSTEMS))
def test_a_system_read_computes_the_same(seed: int) -> None:
    source, system = _read(seed)
    generator = np.random.default_rng([33, seed])
    assert [variable.name for variable in system.inputs] == [v.label for v in source.antecedents]
    for row in distinct_inputs(source, generator, 8):
        expected = compute(source, row)
        for output in infer(system, row).outputs:
            name = output.variable.name
            if output.is_default:
                assert name not in expected or system.defuzzifier_of(output.variable) in OF_MAXIMUM
            else:
                np.testing.assert_array_equal(output.value, expected[name], err_msg=f"{seed}: {row}")


def test_the_systems_above_differ_as_they_should() -> None:
    systems = [_read(seed)[1] for seed in range(NUM_SYSTEMS)]
    variables = [variable for system in systems for variable in (*system.inputs, *system.outputs)]
    shapes = {type(term.membership).__name__ for variable in variables for term in variable.terms}
    assert shapes >= {"Gaussian", "Triangular", "Trapezoidal", "Sigmoid", "SShape", "ZShape", "Sampled"}
    assert {variable.points is None for variable in variables} == {True, False}
    assert any(rule.has_own_operators for system in systems for rule in system.rules)
    assert any(output.defuzzifier for system in systems for output in system.outputs)
    assert any(output.accumulation != "max" for system in systems for output in system.outputs)


@pytest.mark.parametrize("seed", range(12))
def test_what_is_built_is_read_again(seed: int) -> None:
    generator = np.random.default_rng([32, seed])
    system = random_general_system(generator)
    defaults = {output.name: output.default for output in system.outputs if output.default is not None}
    read = read_control_system(build_control_system(system), system.name, defaults=defaults)
    rows = inputs_for(system, generator, 8)
    np.testing.assert_array_equal(inference.evaluate(read, rows), inference.evaluate(system, rows))
    again = read_control_system(build_control_system(read), system.name, defaults=defaults)
    assert again == read
