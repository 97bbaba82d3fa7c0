"""Genes that stretch ranges with their terms: what stays as it was drawn."""

from dataclasses import replace

import numpy as np
import pytest

from fis_tools.analysis.measures import measure
from fis_tools.engines.packing import pack
from fis_tools.genes.reduction import READABLE_GAIN, Stretches
from fis_tools.model import (
    FuzzySystem,
    Gaussian,
    Sigmoid,
    Term,
    Triangular,
    Variable,
    rule_table,
    table_rules,
)


def parted(name: str, reach: float, terms: int) -> Variable:
    """A range in triangles that hold every value by a half at least."""
    step = 2.0 * reach / (terms - 1)
    peaks = [step * place - reach for place in range(terms)]
    shapes = [Term(f"t{i}", Triangular(at - step, at, at + step)) for i, at in enumerate(peaks)]
    return Variable(name, "m", -reach, reach, tuple(shapes))


def drawn() -> FuzzySystem:
    inputs = (parted("a", 2.0, 3), parted("b", 50.0, 3))
    output = replace(parted("c", 0.3, 5), default=0.0)
    words = [f"t{place}" for place in (0, 1, 2, 1, 2, 3, 2, 3, 4)]
    return FuzzySystem("drawn", inputs, (output,), table_rules(inputs, output, words))


def test_the_middle_of_the_box_is_the_controller_as_drawn() -> None:
    stretches = Stretches((drawn(),), (0.5, 2.0), True)
    genome = stretches.encode((drawn(),))
    np.testing.assert_allclose(genome[2:], 0.5)
    (again,) = stretches.decode(genome)
    np.testing.assert_array_equal(rule_table(again), rule_table(drawn()))
    for before, after in zip(
        (*drawn().inputs, *drawn().outputs), (*again.inputs, *again.outputs), strict=True
    ):
        assert after.maximum == pytest.approx(before.maximum)


def test_whatever_the_genes_every_rule_means_what_it_says() -> None:
    stretches = Stretches((drawn(),), (0.1, 10.0), True, 2)
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
    stretches = Stretches((drawn(), drawn()), (0.5, 2.0), False, 2)
    genomes = np.random.default_rng(6).random((4, stretches.num_genes))
    population = stretches.pack(genomes)
    for row, genome in enumerate(genomes):
        alone = pack(*stretches.decode(genome))
        np.testing.assert_array_equal(population.values[row], alone.values[0])
        np.testing.assert_array_equal(population.rules[row], alone.rules[0])
        for system in stretches.decode(genome):
            np.testing.assert_array_equal(rule_table(system), rule_table(drawn()))


def test_gains_lay_tables_out_and_are_found_again() -> None:
    stretches = Stretches((drawn(),), (0.5, 2.0), True)
    genome = np.full(5, 0.5)
    genome[:2] = 0.5 + 0.5 * np.array([1.0, -0.5]) / READABLE_GAIN
    (system,) = stretches.decode(genome)
    np.testing.assert_array_equal(rule_table(system).reshape(3, 3), [[1, 0, 0], [3, 2, 1], [4, 4, 3]])
    np.testing.assert_allclose(stretches.encode((system,)), genome, atol=0.1)


def test_shapes_stretch_by_what_their_numbers_are() -> None:
    bell, slope = Gaussian(1.0, 0.5), Sigmoid(1.0, 4.0)
    variable = Variable("a", "m", -2.0, 2.0, (Term("bell", bell), Term("slope", slope)))
    output = parted("c", 1.0, 3)
    system = FuzzySystem("s", (variable,), (output,), table_rules((variable,), output, ["t0", "t2"]))
    (wide,) = Stretches((system,), (0.5, 2.0), False).decode(np.array([1.0, 0.5]))
    assert wide.inputs[0].terms[0].membership == Gaussian(2.0, 1.0)
    assert wide.inputs[0].terms[1].membership == Sigmoid(2.0, 2.0)
    x = np.linspace(-2.0, 2.0, 9)
    for before, after in zip(variable.terms, wide.inputs[0].terms, strict=True):
        np.testing.assert_allclose(after.membership.at(2.0 * x), before.membership.at(x), rtol=1e-12)


def test_ranges_that_are_not_symmetric_are_refused() -> None:
    one_sided = replace(drawn(), inputs=(replace(drawn().inputs[0], minimum=0.0), drawn().inputs[1]))
    with pytest.raises(ValueError, match="make it symmetric about zero"):
        Stretches((one_sided,), (0.5, 2.0), True)
