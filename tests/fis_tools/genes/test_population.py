"""The compiled kernel over batches and populations: every answer stands for itself."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from fis_tools.engines.kernel import LANES, evaluate, firing_strengths
from fis_tools.engines.packing import NotCompilable, Packed, pack
from fis_tools.formats import serialize
from fis_tools.genes.parameters import Bounds, SystemEncoding
from fis_tools.model import FuzzySystem, Gaussian, Not, Sampled, Term, Triangular, Variable, table_rules
from fis_tools.model.validate import InvalidSystem, problems
from tests.fis_tools.engines.random_systems import full_table_system, inputs_for
from tests.fis_tools.reference_engine import ReferenceEngine
from tests.places import PROJECT

PAPER = serialize.load(PROJECT / "conf" / "controller" / "paper.yaml").systems

#: of the range: inside, on a grid point, at and beyond the ends
PLACES = np.array([0.0, 0.13, 0.25, 0.5, 0.77, 1.0, -3.0, 4.0])


def sparse_system(default: float | None) -> FuzzySystem:
    """Triangles with gaps between them: nothing fires from 0.25 to 0.4, from 0.6 to 0.75."""
    terms = (
        Term("low", Triangular(0.0, 0.0, 0.25)),
        Term("middle", Triangular(0.4, 0.5, 0.6)),
        Term("high", Triangular(0.75, 1.0, 1.0)),
    )
    inputs = tuple(Variable(name, "", 0.0, 1.0, terms, num_points=21) for name in "ab")
    shapes = (Gaussian(-1.0, 0.2), Gaussian(0.0, 0.2), Gaussian(1.0, 0.2))
    output_terms = tuple(
        Term(name, shape) for name, shape in zip(("left", "none", "right"), shapes, strict=True)
    )
    output = Variable("y", "", -1.0, 1.0, output_terms, num_points=21, default=default)
    return FuzzySystem(
        "sparse", inputs, (output,), table_rules(inputs, output, ["left", "none", "right"] * 3)
    )


def test_where_no_rule_fires_the_declared_default_is_given_whatever_came_before() -> None:
    system = sparse_system(0.625)
    engine = ReferenceEngine(system)
    generator = np.random.default_rng(1)
    silent, fired = generator.uniform(0.26, 0.39, (40, 2)), generator.uniform(0.0, 0.24, (40, 2))
    silent[::3, 0], fired[::4, 1] = 0.1, 0.95  # one silent input is enough
    rows = np.where((np.arange(40) % 3 == 0)[:, np.newaxis], fired, silent)
    outputs = evaluate(pack(system), rows)
    is_silent = np.arange(40) % 3 != 0
    np.testing.assert_array_equal(outputs[is_silent], 0.625)
    expected = np.array([engine.compute(row)[0] for row in rows[~is_silent]])
    assert np.abs(expected - 0.625).min() > 0.05
    np.testing.assert_allclose(outputs[~is_silent], expected, rtol=0, atol=2e-12)


def test_an_output_without_a_default_is_refused() -> None:
    with pytest.raises(InvalidSystem, match="output 'y' has no default; declare default"):
        pack(sparse_system(None))


def with_output(system: FuzzySystem, **changes: Any) -> FuzzySystem:
    """The same system with another output of the same terms' names."""
    return replace(system, outputs=(replace(system.outputs[0], **changes),))


SPARSE = sparse_system(0.0)
NEGATED = replace(SPARSE.rules[0], antecedent=Not(SPARSE.rules[0].antecedent))
TWO_PEAKS = (Term("left", Sampled((0.0, 1.0, 0.5, 1.0, 0.0))), *SPARSE.outputs[0].terms[1:])
MANY = Variable(
    "a", "", 0.0, 1.0, tuple(Term(f"t{i}", Gaussian(i / 16, 0.1)) for i in range(17)), num_points=5
)
FOUR = tuple(replace(MANY, name=name, terms=MANY.terms[:1]) for name in "abcd")


@pytest.mark.parametrize(
    ("system", "fact"),
    [
        (replace(SPARSE, rules=(NEGATED,)), "its rules are not plain conjunctions"),
        (replace(SPARSE, defuzzifier="mom"), "only minimum, maximum and centroid are covered"),
        (replace(SPARSE, and_operator="product"), "only minimum, maximum and centroid are covered"),
        (with_output(SPARSE, defuzzifier="som"), "only minimum, maximum and centroid are covered"),
        (with_output(SPARSE, accumulation="bounded_sum"), "only minimum, maximum and centroid are covered"),
        (
            replace(SPARSE, rules=tuple(replace(rule, and_operator="product") for rule in SPARSE.rules)),
            "its rules are not plain conjunctions .* without operators of their own",
        ),
        (with_output(SPARSE, num_points=5, terms=TWO_PEAKS), "output term 'left' has more than one peak"),
        (
            with_output(SPARSE, points=(-1.0, 0.5, 1.0), num_points=3),
            "the universe of 'y' is not evenly spaced",
        ),
        (
            replace(SPARSE, inputs=FOUR, rules=table_rules(FOUR, SPARSE.outputs[0], ["left"])),
            "it has 4 inputs, 1 to 3 are covered",
        ),
        (
            replace(SPARSE, inputs=(MANY,), rules=table_rules((MANY,), SPARSE.outputs[0], ["left"] * 17)),
            "'a' has 17 terms, at most 16 are covered",
        ),
    ],
)
def test_what_the_kernel_does_not_cover_is_refused_with_the_way_out(system: FuzzySystem, fact: str) -> None:
    assert problems(system) == []
    with pytest.raises(
        NotCompilable, match=f"'sparse' cannot be compiled: {fact}.*; evaluate it with fis_tools"
    ):
        pack(system)


def test_firing_strengths_of_triangles_by_hand() -> None:
    strengths = firing_strengths(pack(sparse_system(0.0)), np.array([[0.05, 0.9], [0.45, 0.5], [0.3, 0.5]]))
    expected = np.zeros((3, 9))
    expected[0, 2] = min(0.8, 0.6)  # a is low, b is high
    expected[1, 4] = 0.5  # both are middle
    np.testing.assert_allclose(strengths, expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize("num_rows", [1, 2, LANES - 1, LANES, LANES + 1, 2 * LANES, 2 * LANES + 1, 40])
def test_a_batch_of_any_length_is_its_rows_bit_for_bit(num_rows: int) -> None:
    system = sparse_system(0.625)
    generator = np.random.default_rng(num_rows)
    rows = generator.choice(PLACES, (num_rows, 2))
    packed = pack(system)
    alone = [evaluate(packed, row[np.newaxis])[0] for row in rows]
    np.testing.assert_array_equal(evaluate(packed, rows), alone)


@pytest.mark.parametrize("num_inputs", [2, 3])
def test_a_batch_in_any_order_is_the_same(num_inputs: int) -> None:
    generator = np.random.default_rng(num_inputs)
    system = full_table_system(generator, num_inputs, is_smooth=True)
    rows, packed = inputs_for(system, generator, LANES + 4), pack(system)
    order = generator.permutation(len(rows))
    np.testing.assert_array_equal(evaluate(packed, rows[order]), evaluate(packed, rows)[order])


def test_each_of_a_controllers_systems_is_evaluated_as_if_alone() -> None:
    systems = (PAPER[0], sparse_system(0.625), PAPER[2])
    packed = pack(*systems)
    for index, system in enumerate(systems):
        low, high = (np.array([getattr(v, end) for v in system.inputs]) for end in ("minimum", "maximum"))
        rows = low + PLACES[:5, np.newaxis] * (high - low)
        np.testing.assert_array_equal(evaluate(packed, rows, index), evaluate(pack(system), rows))
        np.testing.assert_array_equal(
            firing_strengths(packed, rows, index), firing_strengths(pack(system), rows)
        )


def test_every_controller_of_a_population_answers_as_its_decoded_systems() -> None:
    encoding = SystemEncoding(PAPER[1:2], Bounds())
    genomes = np.random.default_rng(3).random((3, encoding.num_genes))
    population = encoding.pack(genomes)
    rows = np.random.default_rng(4).uniform(-1.0, 1.0, (5, 2)) * [np.pi, 0.25]
    answers = set()
    for index, genome in enumerate(genomes):
        values, rules = population.values[index : index + 1], population.rules[index : index + 1]
        one = Packed(population.layout, values, rules, population.cells)
        outputs = evaluate(one, rows)
        np.testing.assert_array_equal(outputs, evaluate(pack(*encoding.decode(genome)), rows))
        answers.add(tuple(outputs.tolist()))
    assert len(answers) == 3


@pytest.mark.parametrize("function", [evaluate, firing_strengths])
@pytest.mark.parametrize(
    ("inputs", "message"),
    [
        (np.zeros((4, 3)), r"inputs have shape \(4, 3\); pass \(n, 2\), a row a sample"),
        (np.zeros(2), r"inputs have shape \(2,\); pass \(n, 2\)"),
        (np.array([[0.0, np.nan]]), r"inputs hold NaN or infinity; pass finite numbers"),
        (np.array([[np.inf, 0.0]]), r"inputs hold NaN or infinity"),
    ],
)
def test_inputs_that_cannot_be_inferred_are_refused(function, inputs, message) -> None:
    with pytest.raises(ValueError, match=message):
        function(pack(sparse_system(0.0)), inputs)


def test_an_empty_batch_has_no_answers() -> None:
    assert evaluate(pack(sparse_system(0.0)), np.zeros((0, 2))).shape == (0,)
    assert firing_strengths(pack(sparse_system(0.0)), np.zeros((0, 2))).shape == (0, 9)
