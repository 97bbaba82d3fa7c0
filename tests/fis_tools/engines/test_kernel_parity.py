"""The compiled kernel against scikit-fuzzy's own ``compute()``."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from fis_tools.engines import inference, interpreter
from fis_tools.engines.compiler import compile
from fis_tools.engines.inference import infer
from fis_tools.engines.kernel import evaluate, firing_strengths
from fis_tools.engines.packing import pack
from fis_tools.engines.program import assemble
from fis_tools.formats import serialize
from fis_tools.model import (
    Constant,
    Formula,
    FuzzySystem,
    Gaussian,
    Linear,
    Ramp,
    Term,
    Variable,
    table_rules,
)
from fis_tools.model.shape import SHAPES
from fis_tools.model.validate import problems
from tests.fis_tools import step_by_step
from tests.fis_tools.engines.random_systems import (
    ACCUMULATIONS,
    AND_OPERATORS,
    DEFUZZIFIERS,
    OR_OPERATORS,
    full_table_system,
    inputs_for,
    random_general_system,
    sparse_system,
)
from tests.fis_tools.reference_engine import ReferenceEngine
from tests.places import PROJECT
from tests.seeds import seeds

#: Of the output range's width.
TOLERANCE = 1e-12
SHIPPED = PROJECT / "conf" / "controller"


def _width(system: FuzzySystem) -> float:
    return system.outputs[0].maximum - system.outputs[0].minimum


@pytest.mark.parametrize("seed", range(12))
def test_two_inputs_agree_with_scikit_fuzzy(seed: int) -> None:
    generator = np.random.default_rng([11, seed])
    system = full_table_system(generator, num_inputs=2, is_smooth=True)
    engine = ReferenceEngine(system)
    inputs = inputs_for(system, generator, 12)
    expected = np.array([engine.compute(row)[0] for row in inputs])
    np.testing.assert_allclose(
        evaluate(pack(system), inputs), expected, rtol=0, atol=TOLERANCE * _width(system)
    )


def test_three_inputs_agree_with_scikit_fuzzy() -> None:
    generator = np.random.default_rng(12)
    system = full_table_system(generator, num_inputs=3, is_smooth=True)
    engine = ReferenceEngine(system)
    inputs = inputs_for(system, generator, 10)
    expected = np.array([engine.compute(row)[0] for row in inputs])
    np.testing.assert_allclose(
        evaluate(pack(system), inputs), expected, rtol=0, atol=TOLERANCE * _width(system)
    )


@pytest.mark.parametrize("seed", range(6))
def test_sparse_rule_bases_agree_with_scikit_fuzzy(seed: int) -> None:
    generator = np.random.default_rng([14, seed])
    system = sparse_system(generator)
    engine = ReferenceEngine(system)
    inputs = inputs_for(system, generator, 10)
    expected = np.array([engine.compute(row)[0] for row in inputs])
    packed = pack(system)
    np.testing.assert_allclose(evaluate(packed, inputs), expected, rtol=0, atol=TOLERANCE * _width(system))
    np.testing.assert_allclose(
        firing_strengths(packed, inputs), step_by_step.firing_strengths(system, inputs), rtol=0, atol=1e-13
    )


def test_many_more_agree_with_the_inference_that_equals_scikit_fuzzy() -> None:
    for seed in range(60):
        generator = np.random.default_rng([13, seed])
        system = full_table_system(generator, is_smooth=True)
        inputs = inputs_for(system, generator, 20)
        packed = pack(system)
        np.testing.assert_allclose(
            evaluate(packed, inputs),
            step_by_step.evaluate(system, inputs)[:, 0],
            rtol=0,
            atol=TOLERANCE * _width(system),
        )
        np.testing.assert_allclose(
            firing_strengths(packed, inputs),
            step_by_step.firing_strengths(system, inputs),
            rtol=0,
            atol=TOLERANCE,
        )


@pytest.mark.slow
def test_terms_narrower_than_the_grid_agree_wherever_something_fires() -> None:
    """With next to no area left, scikit-fuzzy's own rounding decides: no engine can agree there."""
    num_compared = 0
    for seed in range(60):
        generator = np.random.default_rng([14, seed])
        system = full_table_system(generator)
        inputs = np.stack([generator.uniform(v.minimum, v.maximum, 20) for v in system.inputs], axis=1)
        results = [inference.infer(system, row).outputs[0] for row in inputs]
        areas = np.array([np.trapezoid(result.aggregated, result.universe) for result in results])
        compared = areas >= 1e-4 * _width(system)
        num_compared += int(compared.sum())
        np.testing.assert_allclose(
            evaluate(pack(system), inputs)[compared],
            np.array([result.value for result in results])[compared],
            rtol=0,
            atol=TOLERANCE * _width(system),
        )
    assert num_compared > 500


def _gapped_system() -> FuzzySystem:
    """Two terms with nothing between them: from 0.2 to 0.8 no membership is above zero."""
    terms = (Term("low", Gaussian(0.0, 0.004)), Term("high", Gaussian(1.0, 0.004)))
    inputs = (Variable("a", "", 0.0, 1.0, terms), Variable("b", "", 0.0, 1.0, terms))
    output_terms = (Term("left", Gaussian(-1.0, 0.3)), Term("right", Gaussian(1.0, 0.3)))
    output = Variable("y", "", -1.0, 1.0, output_terms, default=0.125)
    return FuzzySystem("gapped", inputs, (output,), table_rules(inputs, output, ["left", "right"] * 2))


@pytest.mark.parametrize("defuzzifier", ["centroid", "bisector", "mom", "som", "lom"])
def test_no_rule_fires_gives_the_default_in_every_engine_and_never_a_stale_output(defuzzifier: str) -> None:
    system = replace(_gapped_system(), defuzzifier=defuzzifier)  # type: ignore[arg-type]
    engine = ReferenceEngine(system)
    nothing, something = np.array([0.5, 0.5]), np.array([0.0, 0.0])
    fired = engine.compute(something)[0]
    assert fired < -0.5
    # the second visit to each input is answered from scikit-fuzzy's cache
    for inputs, expected in ((nothing, 0.125), (something, fired), (nothing, 0.125), (something, fired)):
        assert engine.compute(inputs)[0] == expected
        assert inference.infer(system, inputs).values[0] == expected
    if defuzzifier == "centroid":
        batch = np.array([nothing, something, nothing, [0.5, 0.0], [0.0, 0.5]])
        outputs = evaluate(pack(system), batch)
        np.testing.assert_array_equal(outputs[[0, 2, 3, 4]], 0.125)
        np.testing.assert_allclose(outputs[1], fired, rtol=0, atol=TOLERANCE * 2)


@pytest.mark.slow
@pytest.mark.parametrize("path", sorted(SHIPPED.glob("*.yaml")), ids=lambda path: path.stem)
def test_shipped_controllers_agree_with_scikit_fuzzy(path: Path) -> None:
    if "systems:" not in path.read_text(encoding="utf-8"):
        assert {"kind", "path"} & yaml.safe_load(path.read_text(encoding="utf-8")).keys()
        return
    for system in serialize.load(path).systems:
        engine = ReferenceEngine(system)
        inputs = inputs_for(system, np.random.default_rng(17), 6)
        expected = np.array([engine.compute(row)[0] for row in inputs])
        found = evaluate(pack(system), inputs)
        np.testing.assert_allclose(found, expected, rtol=0, atol=TOLERANCE * _width(system))


NUM_SYSTEMS = 100


@pytest.mark.parametrize("seed", range(NUM_SYSTEMS))
def test_any_system_agrees_bit_for_bit(seed: int) -> None:
    generator = np.random.default_rng([3, seed])
    system = random_general_system(generator) if seed % 5 else full_table_system(generator)
    rows = inputs_for(system, generator, 8)
    program = assemble(system)
    firing = interpreter.fire(program, rows)
    np.testing.assert_array_equal(firing, step_by_step.firing_strengths(system, rows))
    with np.errstate(divide="ignore", invalid="ignore"):  # a bisector of an area with a gap
        outputs = interpreter.evaluate(program, rows)
        np.testing.assert_array_equal(outputs, interpreter.conclude(program, firing))
    # NumPy takes the mean of the highest points in another order.
    digits = [
        8e-16 * (v.maximum - v.minimum) if system.defuzzifier_of(v) == "mom" else 0.0 for v in system.outputs
    ]
    for column, expected, digit in zip(outputs.T, step_by_step.evaluate(system, rows).T, digits, strict=True):
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
    np.testing.assert_array_equal(step_by_step.evaluate(system, rows), expected)


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
