"""The compiled interpreter of any system against the readable inference, and both engines of `compile`."""

import numpy as np
import pytest

from fis_tools.engines import inference, interpreter
from fis_tools.engines.compiler import compile
from fis_tools.engines.program import assemble
from tests.fis_tools.engines.random_systems import full_table_system, inputs_for, random_general_system
from tests.fis_tools.reference_engine import ReferenceEngine
from tests.seeds import seeds

NUM_SYSTEMS = 100


@pytest.mark.parametrize("seed", range(NUM_SYSTEMS))
def test_any_system_agrees_bit_for_bit(seed: int) -> None:
    generator = np.random.default_rng([3, seed])
    system = random_general_system(generator) if seed % 5 else full_table_system(generator)
    rows = inputs_for(system, generator, 8)
    program = assemble(system)
    firing = interpreter.fire(program, rows)
    np.testing.assert_array_equal(firing, inference.firing_strengths(system, rows))
    with np.errstate(divide="ignore", invalid="ignore"):  # a bisector of an area with a gap
        outputs = interpreter.evaluate(program, rows)
        np.testing.assert_array_equal(outputs, interpreter.conclude(program, firing))
    # NumPy takes the mean of the highest points in another order.
    digits = [
        8e-16 * (v.maximum - v.minimum) if system.defuzzifier_of(v) == "mom" else 0.0 for v in system.outputs
    ]
    for column, expected, digit in zip(outputs.T, inference.evaluate(system, rows).T, digits, strict=True):
        np.testing.assert_allclose(column, expected, rtol=4 * digit, atol=digit)


@pytest.mark.parametrize("seed", seeds(40, 10))
def test_what_is_compiled_agrees_with_scikit_fuzzy(seed: int) -> None:
    generator = np.random.default_rng([30, seed])
    system = random_general_system(generator) if seed % 2 else full_table_system(generator, 2)
    rows = inputs_for(system, generator, 6)
    engine = ReferenceEngine(system)
    expected = np.array([engine.compute(row) for row in rows])
    ranges = np.array([variable.maximum - variable.minimum for variable in system.outputs])
    with np.errstate(divide="ignore", invalid="ignore"):
        outputs = compile(system)(rows)
    np.testing.assert_allclose(outputs / ranges, expected / ranges, rtol=0, atol=1e-12)


def test_a_batch_longer_than_a_block_and_not_a_whole_number_of_lanes(monkeypatch: pytest.MonkeyPatch) -> None:
    system = random_general_system(np.random.default_rng([3, 1]))
    monkeypatch.setattr(interpreter, "BLOCK", 40 * len(system.rules))
    rows = inputs_for(system, np.random.default_rng(0), 40 + interpreter.LANES + 3)
    program = assemble(system)
    one_by_one = [interpreter.evaluate(program, row[np.newaxis])[0] for row in rows]
    np.testing.assert_array_equal(interpreter.evaluate(program, rows), one_by_one)


def test_both_engines_agree_where_the_kernel_is_chosen() -> None:
    chosen = 0
    for seed in range(150):
        generator = np.random.default_rng([31, seed])
        system = full_table_system(generator, is_smooth=seed % 3 > 0)
        compiled = compile(system)
        if compiled.packed is not None:
            chosen += 1
            rows = inputs_for(system, generator, 40)
            output = system.outputs[0]
            difference = np.abs(compiled(rows) - interpreter.evaluate(compiled.program, rows)).max()
            assert difference <= 1e-13 * (output.maximum - output.minimum), seed
    assert chosen > 30
