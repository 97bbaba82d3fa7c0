"""The compiled kernel against scikit-fuzzy's own ``compute()``."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from fis_tools.engines import interpreter
from fis_tools.engines.compiler import compile
from fis_tools.engines.inference import infer
from fis_tools.engines.kernel import evaluate
from fis_tools.engines.packing import pack
from fis_tools.engines.program import assemble
from fis_tools.formats import serialize
from fis_tools.model import Consequent, FuzzySystem, Gaussian, Is, Rule, Term, Triangular, Variable
from fis_tools.model.membership import SHAPES
from fis_tools.model.validate import problems
from tests.fis_tools import step_by_step
from tests.fis_tools.control_systems import ReferenceEngine, by_scikit_fuzzy
from tests.fis_tools.engines import random_systems
from tests.fis_tools.engines.random_systems import full_table_system, inputs_for, random_general_system
from tests.fis_tools.sample_controllers import SHIPPED, gapped_system
from tests.seeds import seeds


def by_kernel(system: FuzzySystem, rows: np.ndarray) -> np.ndarray:
    return evaluate(pack(system), rows)[:, np.newaxis]


def test_tables_and_rules_that_lack_statements_agree_with_the_inference_that_equals_scikit_fuzzy() -> None:
    for seed in range(60):
        generator = np.random.default_rng([13, seed])
        make = random_systems.sparse_system if seed % 4 == 1 else partial(full_table_system, is_smooth=True)
        system = make(generator)
        rows = inputs_for(system, generator, 20)
        step_by_step.assert_near(by_kernel(system, rows), step_by_step.evaluate(system, rows), system)


@pytest.mark.slow
def test_terms_narrower_than_the_grid_agree_wherever_something_fires() -> None:
    """With next to no area left, scikit-fuzzy's own rounding decides: no engine can agree there."""
    num_compared = 0
    for seed in range(60):
        generator = np.random.default_rng([14, seed])
        system = full_table_system(generator)
        rows = np.stack([generator.uniform(v.minimum, v.maximum, 20) for v in system.inputs], axis=1)
        results = [infer(system, row).outputs[0] for row in rows]
        areas = np.array([np.trapezoid(result.aggregated, result.universe) for result in results])
        compared = areas >= 1e-4 * (system.outputs[0].maximum - system.outputs[0].minimum)
        num_compared += int(compared.sum())
        expected = np.array([[result.value] for result in results])
        step_by_step.assert_near(by_kernel(system, rows)[compared], expected[compared], system)
    assert num_compared > 500


@pytest.mark.parametrize("defuzzifier", ["centroid", "bisector", "mom", "som", "lom"])
def test_no_rule_fires_gives_the_default_in_every_engine_and_never_a_stale_output(defuzzifier: str) -> None:
    system = replace(gapped_system(0.125), defuzzifier=defuzzifier)  # type: ignore[arg-type]
    engine = ReferenceEngine(system)
    nothing, something = np.array([0.3, 0.3]), np.array([0.0, 0.0])
    fired = engine.compute(something)[0]
    assert fired < -0.5
    # the second visit to each input is answered from scikit-fuzzy's cache
    for inputs, expected in ((nothing, 0.125), (something, fired), (nothing, 0.125), (something, fired)):
        assert engine.compute(inputs)[0] == expected
        assert infer(system, inputs).values[0] == expected
    if defuzzifier == "centroid":
        batch = np.array([nothing, something, nothing, [0.3, 0.0], [0.0, 0.3]])
        outputs = evaluate(pack(system), batch)
        np.testing.assert_array_equal(outputs[[0, 2, 3, 4]], 0.125)
        np.testing.assert_allclose(outputs[1], fired, rtol=0, atol=2e-12)  # of a range of 2


@pytest.mark.slow
@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_controllers_agree_with_scikit_fuzzy(name: str) -> None:
    for system in serialize.load(SHIPPED[name]).systems:
        rows = inputs_for(system, np.random.default_rng(17), 6)
        step_by_step.assert_near(by_kernel(system, rows), by_scikit_fuzzy(system, rows), system)


NUM_SYSTEMS = 100


def drawn(seed: int) -> tuple[FuzzySystem, np.ndarray]:
    generator = np.random.default_rng([3, seed])
    system = random_general_system(generator) if seed % 5 else full_table_system(generator)
    return system, inputs_for(system, generator, 8)


@pytest.mark.parametrize("seed", seeds(NUM_SYSTEMS, 25))
def test_any_system_agrees_bit_for_bit(seed: int) -> None:
    system, rows = drawn(seed)
    assert problems(system) == []
    expected = by_scikit_fuzzy(system, rows)
    outputs, strengths = step_by_step.inferred(system, rows)
    np.testing.assert_array_equal(outputs, expected)
    program = assemble(system)
    firing = interpreter.fire(program, rows)
    np.testing.assert_array_equal(firing, strengths)
    with np.errstate(divide="ignore", invalid="ignore"):  # a bisector of an area with a gap
        step_by_step.assert_near(compile(system)(rows), expected, system)
        outputs = interpreter.evaluate(program, rows)
        np.testing.assert_array_equal(outputs, interpreter.conclude(program, firing))
    for variable, column, exact in zip(system.outputs, outputs.T, expected.T, strict=True):
        # NumPy takes the mean of the highest points in another order
        digit = 8e-16 * (variable.maximum - variable.minimum) * (system.defuzzifier_of(variable) == "mom")
        np.testing.assert_allclose(column, exact, rtol=4 * digit, atol=digit)


def test_a_batch_longer_than_a_block_and_not_a_whole_number_of_lanes(monkeypatch: pytest.MonkeyPatch) -> None:
    system = random_general_system(np.random.default_rng([3, 1]))
    monkeypatch.setattr(interpreter, "BLOCK", 40 * len(system.rules))
    rows = inputs_for(system, np.random.default_rng(0), 40 + interpreter.LANES + 3)
    program = assemble(system)
    one_by_one = [interpreter.evaluate(program, row[np.newaxis])[0] for row in rows]
    np.testing.assert_array_equal(interpreter.evaluate(program, rows), one_by_one)


def test_both_engines_agree_where_the_kernel_is_chosen() -> None:
    chosen = 0
    for seed in range(75):
        generator = np.random.default_rng([31, seed])
        system = full_table_system(generator, is_smooth=seed % 3 > 0)
        compiled = compile(system)
        if compiled.packed is not None:
            chosen += 1
            rows = inputs_for(system, generator, 40)
            width = system.outputs[0].maximum - system.outputs[0].minimum
            expected = interpreter.evaluate(compiled.program, rows)
            np.testing.assert_allclose(compiled(rows), expected, rtol=0, atol=1e-13 * width)
    assert chosen > 15


def test_the_systems_above_cover_what_they_should() -> None:
    systems = [drawn(seed)[0] for seed in range(NUM_SYSTEMS)]
    rules = [(system, rule) for system in systems for rule in system.rules]
    outputs = [(system, output) for system in systems for output in system.outputs]
    shapes = {type(t.membership) for s in systems for v in (*s.inputs, *s.outputs) for t in v.terms}
    assert {system.and_operator_of(rule) for system, rule in rules} == set(random_systems.AND_OPERATORS)
    assert {system.or_operator_of(rule) for system, rule in rules} == set(random_systems.OR_OPERATORS)
    assert {system.defuzzifier_of(output) for system, output in outputs} == set(random_systems.DEFUZZIFIERS)
    assert {output.accumulation for _, output in outputs} == set(random_systems.ACCUMULATIONS)
    assert shapes == set(SHAPES.values()) - set(random_systems.ELSEWHERE)
    cases = [(system, row) for system, rows in map(drawn, range(NUM_SYSTEMS)) for row in rows]
    results = [output for system, row in cases for output in infer(system, row).outputs]
    num_defaults = sum(output.is_default for output in results)
    assert num_defaults > 50
    assert len(results) - num_defaults > 500


def test_where_rules_fire_faintly_arrays_are_what_single_samples_are():
    """The kernel hands rows of a small area over; there its sums had few right digits."""
    x = Variable(
        "q", "", 0.0, 10.0, (Term("low", Gaussian(0.0, 0.5)), Term("high", Gaussian(10.0, 0.5))), 1001
    )
    tips = (Term("mild", Triangular(40.0, 50.0, 60.0)), Term("hot", Triangular(70.0, 80.0, 90.0)))
    heat = Variable("heat", "", 40.0, 90.0, tips, default=65.0)
    rules = (
        Rule(Is("q", "low"), (Consequent("heat", "mild"),)),
        Rule(Is("q", "high"), (Consequent("heat", "hot"),)),
    )
    compiled = compile(FuzzySystem("faint", (x,), (heat,), rules))
    assert compiled.packed is not None
    rows = np.linspace(0.0, 10.0, 2001)[:, np.newaxis]
    outputs, single = compiled(rows)[:, 0], compiled.prepare()
    expected = np.array([single(*row)[0] for row in rows])
    np.testing.assert_allclose(outputs, expected, rtol=0, atol=50.0 * 1e-12)
    is_faint = compiled.firing_strengths(rows).max(axis=1) < 1e-5
    assert 200 < is_faint.sum() < 2000
    np.testing.assert_array_equal(outputs[is_faint], expected[is_faint])
