"""The compiled kernel over batches and populations: every answer stands for itself."""

from dataclasses import replace

import numpy as np
import pytest

from fis_tools.analysis.measures import measure
from fis_tools.engines.kernel import LANES, evaluate
from fis_tools.engines.packing import NotCompilable, pack
from fis_tools.genes.parameters import KeptRules, SystemEncoding
from fis_tools.genes.planes import GREATEST_GAIN, Planes
from fis_tools.genes.stretches import READABLE_GAIN, Stretches
from fis_tools.model import FuzzySystem, Not, Term, Variable, rule_table, table_rules, with_semantics
from fis_tools.model.shapes import Gaussian, Sampled, Sigmoid, Triangular
from fis_tools.model.validate import InvalidSystem, problems
from tests.fis_tools.engines.random_systems import full_table_system, inputs_for
from tests.fis_tools.genes.test_parameters import BOUNDS, PAPER, UNEVEN, assert_same
from tests.fis_tools.sample_controllers import gapped_system, table_system, terms, with_input, with_output
from tests.fis_tools.step_by_step import ends

#: of the range: inside, on a grid point, at and beyond the ends
NUMBERS = np.array([0.0, 0.13, 0.25, 0.5, 0.77, 1.0, -3.0, 4.0])


def test_an_output_without_a_default_is_refused() -> None:
    with pytest.raises(InvalidSystem, match="output 'y' has no default; declare default"):
        pack(gapped_system(None))


def of_inputs(*inputs: Variable) -> FuzzySystem:
    return table_system("gapped", inputs, GAPPED.outputs[0], ["left"] * len(inputs[0].terms))


GAPPED = gapped_system(0.0)
NEGATED = replace(GAPPED.rules[0], antecedent=Not(GAPPED.rules[0].antecedent))
TWO_PEAKS = (Term("left", Sampled((0.0, 1.0, 0.5, 1.0, 0.0))), *GAPPED.outputs[0].terms[1:])
MANY = Variable("a", "", 0.0, 1.0, terms(**{f"t{i}": Gaussian(i / 16, 0.1) for i in range(17)}), num_points=5)
OWN_OPERATORS = replace(GAPPED, rules=tuple(replace(rule, and_operator="product") for rule in GAPPED.rules))
FOUR = tuple(replace(MANY, name=name, terms=MANY.terms[:1]) for name in "abcd")


@pytest.mark.parametrize(
    ("system", "fact"),
    [
        (
            with_semantics(GAPPED, "matlab"),
            "it is inferred as MATLAB does, and the kernel as scikit-fuzzy does",
        ),
        (replace(GAPPED, rules=(NEGATED,)), "its rules are not plain conjunctions"),
        (replace(GAPPED, defuzzifier="mom"), "only minimum, maximum and centroid are covered"),
        (replace(GAPPED, and_operator="product"), "only minimum, maximum and centroid are covered"),
        (with_output(GAPPED, defuzzifier="som"), "only minimum, maximum and centroid are covered"),
        (with_output(GAPPED, accumulation="bounded_sum"), "only minimum, maximum and centroid are covered"),
        (OWN_OPERATORS, "its rules are not plain conjunctions .* without operators of their own"),
        (with_output(GAPPED, num_points=5, terms=TWO_PEAKS), "output term 'left' has more than one peak"),
        (with_output(GAPPED, points=(-1.0, 0.5, 1.0), num_points=3), "the universe of 'y' is not evenly"),
        (of_inputs(*FOUR), "it has 4 inputs, 1 to 3 are covered"),
        (of_inputs(MANY), "'a' has 17 terms, at most 16 are covered"),
    ],
)
def test_what_the_kernel_does_not_cover_is_refused_with_the_way_out(system: FuzzySystem, fact: str) -> None:
    assert problems(system) == []
    sentence = f"'gapped' cannot be compiled: {fact}.*; evaluate it with fis_tools"
    with pytest.raises(NotCompilable, match=sentence):
        pack(system)


@pytest.mark.parametrize("num_rows", [1, 2, LANES - 1, LANES, LANES + 1, 2 * LANES, 2 * LANES + 1, 40])
def test_a_batch_of_any_length_is_its_rows_bit_for_bit(num_rows: int) -> None:
    generator = np.random.default_rng(num_rows)
    smooth = full_table_system(generator, 3, is_smooth=True)
    for system, rows in (
        (gapped_system(0.625), generator.choice(NUMBERS, (num_rows, 2))),
        (smooth, inputs_for(smooth, generator, num_rows)),
    ):
        packed = pack(system)
        alone = [evaluate(packed, row[np.newaxis])[0] for row in rows]
        np.testing.assert_array_equal(evaluate(packed, rows), alone)


def test_each_of_a_controllers_systems_is_evaluated_as_if_alone() -> None:
    systems = (PAPER[0], gapped_system(0.625), PAPER[2])
    packed = pack(*systems)
    for index, system in enumerate(systems):
        low, high = ends(system)
        rows = low + NUMBERS[:5, np.newaxis] * (high - low)
        np.testing.assert_array_equal(evaluate(packed, rows, index), evaluate(pack(system), rows))


def parted(name: str, reach: float, count: int) -> Variable:
    """A range in triangles that hold every value by a half at least."""
    step = 2.0 * reach / (count - 1)
    peaks = [step * index - reach for index in range(count)]
    shapes = [Term(f"t{i}", Triangular(at - step, at, at + step)) for i, at in enumerate(peaks)]
    return Variable(name, "m", -reach, reach, tuple(shapes))


_BOTH = (parted("a", 2.0, 3), parted("b", 50.0, 3))
_OUTPUT = replace(parted("c", 0.3, 5), default=0.0)
_WORDS = [f"t{index}" for index in (0, 1, 2, 1, 2, 3, 2, 3, 4)]
DRAWN = table_system("drawn", _BOTH, _OUTPUT, _WORDS)


def test_the_middle_of_the_box_is_the_controller_as_drawn() -> None:
    stretches = Stretches((DRAWN,), (0.5, 2.0), True)
    genome = stretches.encode((DRAWN,))
    np.testing.assert_allclose(genome[2:], 0.5)
    (again,) = stretches.decode(genome)
    np.testing.assert_array_equal(rule_table(again), rule_table(DRAWN))
    maxima = [[v.maximum for v in (*system.inputs, *system.outputs)] for system in (DRAWN, again)]
    assert maxima[1] == pytest.approx(maxima[0])


def test_whatever_the_genes_every_rule_means_what_it_says() -> None:
    stretches = Stretches((DRAWN,), (0.1, 10.0), True, 2)
    assert stretches.num_genes == len(stretches.gene_names()) == 5
    for genome in np.random.default_rng(5).random((20, 5)):
        (system,) = stretches.decode(genome)
        measures = measure(system)
        assert measures.rule_consistency.index == pytest.approx(1.0, abs=1e-9)
        assert measures.completeness.least == pytest.approx(0.5, abs=0.02)  # rounded, and between two points
        table = rule_table(system).reshape(3, 3)
        assert max(np.abs(np.diff(table, axis=axis)).max() for axis in (0, 1)) <= 2
        for variable in (*system.inputs, *system.outputs):
            assert variable.maximum == float(f"{variable.maximum:.2g}")
            for term in variable.terms:
                assert term.membership.peak == float(f"{term.membership.peak:.4g}")


def test_a_population_is_packed_as_its_controllers_are() -> None:
    stretches = Stretches((DRAWN, DRAWN), (0.5, 2.0), False, 2)
    genomes = np.random.default_rng(6).random((4, stretches.num_genes))
    population = stretches.pack(genomes)
    for row, genome in enumerate(genomes):
        assert_same(population, pack(*stretches.decode(genome)), row)
        for system in stretches.decode(genome):
            np.testing.assert_array_equal(rule_table(system), rule_table(DRAWN))


def test_gains_lay_tables_out_and_are_found_again() -> None:
    stretches = Stretches((DRAWN,), (0.5, 2.0), True)
    genome = np.full(5, 0.5)
    genome[:2] = 0.5 + 0.5 * np.array([1.0, -0.5]) / READABLE_GAIN
    (system,) = stretches.decode(genome)
    np.testing.assert_array_equal(rule_table(system).reshape(3, 3), [[1, 0, 0], [3, 2, 1], [4, 4, 3]])
    np.testing.assert_allclose(stretches.encode((system,)), genome, atol=0.1)


def test_shapes_stretch_by_what_their_numbers_are() -> None:
    bell, slope = Gaussian(1.0, 0.5), Sigmoid(1.0, 4.0)
    variable = Variable("a", "m", -2.0, 2.0, (Term("bell", bell), Term("slope", slope)))
    system = table_system("s", (variable,), parted("c", 1.0, 3), ["t0", "t2"])
    (wide,) = Stretches((system,), (0.5, 2.0), False).decode(np.array([1.0, 0.5]))
    assert wide.inputs[0].terms[0].membership == Gaussian(2.0, 1.0)
    assert wide.inputs[0].terms[1].membership == Sigmoid(2.0, 2.0)
    x = np.linspace(-2.0, 2.0, 9)
    for before, after in zip(variable.terms, wide.inputs[0].terms, strict=True):
        np.testing.assert_allclose(after.membership.at(2.0 * x), before.membership.at(x), rtol=1e-12)


def test_ranges_that_are_not_symmetric_are_refused() -> None:
    with pytest.raises(ValueError, match="make it symmetric about zero"):
        Stretches((with_input(DRAWN, minimum=0.0),), (0.5, 2.0), True)


WHOLE = SystemEncoding(PAPER, BOUNDS)
PLANES = Planes(WHOLE)


def leaning(gains: tuple[float, float]) -> np.ndarray:
    """A table of five by five, laid out by hand: output terms from 0 to 4."""
    a, b = np.meshgrid(np.linspace(-1, 1, 5), np.linspace(-1, 1, 5), indexing="ij")
    return np.clip(np.rint(2 + 2 * (gains[0] * a + gains[1] * b)), 0, 4).astype(int).ravel()


@pytest.mark.parametrize("gains", [(0.0, 0.0), (1.0, 0.0), (-0.45, 0.6), (0.9, -1.6)])
def test_tables_lean_by_their_gains(gains: tuple[float, float]) -> None:
    assert PLANES.num_genes == len(PLANES.gene_names()) == 18
    genes = np.full((1, 18), 0.5)
    genes[0, :2] = 0.5 + 0.5 * np.array(gains) / GREATEST_GAIN
    first, second, _ = WHOLE.decode(PLANES.expand(genes)[0])
    np.testing.assert_array_equal(rule_table(first), leaning(gains))
    np.testing.assert_array_equal(rule_table(second), 2)


def test_widths_and_reach_have_a_gene_each_and_means_are_even() -> None:
    genes = np.random.default_rng(3).random((1, 18))
    for number, system in enumerate(WHOLE.decode(PLANES.expand(genes)[0])):
        block = genes[0, 6 * number : 6 * number + 6]
        for gene, variable in zip(block[2:5], (*system.inputs, *system.outputs), strict=True):
            low, high = variable.minimum, variable.maximum
            means = [term.membership.mean for term in variable.terms]
            widths = [term.membership.standard_deviation for term in variable.terms]
            np.testing.assert_allclose(means, np.linspace(low, high, 5), rtol=0, atol=1e-12 * (high - low))
            np.testing.assert_allclose(widths, (0.04 + 0.26 * gene) * (high - low), rtol=1e-12)
        assert system.outputs[0].maximum == pytest.approx(0.01 * 30.0 ** block[5])


def test_planes_are_found_again_in_their_tables() -> None:
    genes = np.full(18, 0.3)
    # the ends cut much of the others off
    for system, gains in enumerate(((0.5, -0.5), (-1.4, 1.6), (0.2, 1.7))):
        genes[6 * system : 6 * system + 2] = 0.5 + 0.5 * np.array(gains) / GREATEST_GAIN
    planes = PLANES.reduce(PLANES.expand(genes[np.newaxis])[0])
    np.testing.assert_allclose(planes, genes, rtol=0, atol=0.04)  # tables are rounded to whole terms
    again = PLANES.expand(planes[np.newaxis])[0]
    assert np.mean(again != PLANES.expand(genes[np.newaxis])[0]) < 0.1


def test_any_short_vector_is_a_controller_of_any_structure() -> None:
    encoding = SystemEncoding(UNEVEN, BOUNDS)
    planes = Planes(encoding)
    genomes = planes.expand(np.random.default_rng(4).random((20, planes.num_genes)))
    assert genomes.min() >= 0.0
    assert genomes.max() <= 1.0
    for genome in genomes:
        encoding.decode(genome)


def test_kept_rules_are_kept_and_all_else_is_tuned() -> None:
    def of_one_term(system: FuzzySystem) -> FuzzySystem:
        (output,) = system.outputs
        return replace(system, rules=table_rules(system.inputs, output, [output.terms[3].name] * 25))

    genome = WHOLE.encode(tuple(map(of_one_term, PAPER)))
    kept = KeptRules(WHOLE, genome)
    assert kept.num_genes == len(kept.gene_names()) == 75
    assert not any("rule" in name for name in kept.gene_names())
    np.testing.assert_array_equal(kept.expand(kept.reduce(genome)[np.newaxis])[0], genome)
    drawn = np.random.default_rng(5).random((1, 75))
    systems = WHOLE.decode(kept.expand(drawn)[0])
    assert all((rule_table(system) == 3).all() for system in systems)
    np.testing.assert_array_equal(kept.reduce(kept.expand(drawn)[0]), drawn[0])
