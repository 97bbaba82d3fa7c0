"""Short vectors and the genomes that they stand for."""

from dataclasses import replace

import numpy as np
import pytest

from fis_tools.genes.parameters import SystemEncoding
from fis_tools.genes.reduction import GREATEST_GAIN, KeptRules, Planes
from fis_tools.model import rule_table, table_rules
from tests.fis_tools.genes.test_parameters import BOUNDS, PAPER, UNEVEN

WHOLE = SystemEncoding(PAPER, BOUNDS)


def leaning(gains: tuple[float, float]) -> np.ndarray:
    """A table of five by five, laid out by hand: output terms from 0 to 4."""
    a, b = np.meshgrid(np.linspace(-1, 1, 5), np.linspace(-1, 1, 5), indexing="ij")
    return np.clip(np.rint(2 + 2 * (gains[0] * a + gains[1] * b)), 0, 4).astype(int).ravel()


@pytest.mark.parametrize("gains", [(0.0, 0.0), (1.0, 0.0), (-0.45, 0.6), (0.9, -1.6)])
def test_tables_lean_by_their_gains(gains: tuple[float, float]) -> None:
    planes = Planes(WHOLE)
    assert planes.num_genes == len(planes.gene_names()) == 18
    genes = np.full((1, 18), 0.5)
    genes[0, :2] = 0.5 + 0.5 * np.array(gains) / GREATEST_GAIN
    first, second, _ = WHOLE.decode(planes.expand(genes)[0])
    np.testing.assert_array_equal(rule_table(first), leaning(gains))
    np.testing.assert_array_equal(rule_table(second), 2)


def test_widths_and_reach_have_a_gene_each_and_means_are_even() -> None:
    planes = Planes(WHOLE)
    genes = np.random.default_rng(3).random((1, 18))
    for number, system in enumerate(WHOLE.decode(planes.expand(genes)[0])):
        own = genes[0, 6 * number : 6 * number + 6]
        for gene, variable in zip(own[2:5], (*system.inputs, *system.outputs), strict=True):
            low, high = variable.minimum, variable.maximum
            means = [term.membership.mean for term in variable.terms]
            widths = [term.membership.standard_deviation for term in variable.terms]
            np.testing.assert_allclose(means, np.linspace(low, high, 5), rtol=0, atol=1e-12 * (high - low))
            np.testing.assert_allclose(widths, (0.04 + 0.26 * gene) * (high - low), rtol=1e-12)
        assert system.outputs[0].maximum == pytest.approx(0.01 * 30.0 ** own[5])


def test_planes_are_found_again_in_their_tables() -> None:
    planes = Planes(WHOLE)
    genes = np.full(18, 0.3)
    # the ends cut much of the others off
    for system, gains in enumerate(((0.5, -0.5), (-1.4, 1.6), (0.2, 1.7))):
        genes[6 * system : 6 * system + 2] = 0.5 + 0.5 * np.array(gains) / GREATEST_GAIN
    found = planes.reduce(planes.expand(genes[np.newaxis])[0])
    np.testing.assert_allclose(found, genes, rtol=0, atol=0.04)  # tables are rounded to whole terms
    again = planes.expand(found[np.newaxis])[0]
    assert np.mean(again != planes.expand(genes[np.newaxis])[0]) < 0.1


def test_any_short_vector_is_a_controller_of_any_structure() -> None:
    encoding = SystemEncoding(UNEVEN, BOUNDS)
    planes = Planes(encoding)
    genomes = planes.expand(np.random.default_rng(4).random((20, planes.num_genes)))
    assert genomes.min() >= 0.0
    assert genomes.max() <= 1.0
    for genome in genomes:
        encoding.decode(genome)


def test_kept_rules_are_kept_and_all_else_is_tuned() -> None:
    odd = tuple(
        replace(
            system,
            rules=table_rules(system.inputs, system.outputs[0], [system.outputs[0].terms[3].name] * 25),
        )
        for system in PAPER
    )
    genome = WHOLE.encode(odd)
    kept = KeptRules(WHOLE, genome)
    assert kept.num_genes == len(kept.gene_names()) == 75
    assert not any("rule" in name for name in kept.gene_names())
    np.testing.assert_array_equal(kept.expand(kept.reduce(genome)[np.newaxis])[0], genome)
    drawn = np.random.default_rng(5).random((1, 75))
    systems = WHOLE.decode(kept.expand(drawn)[0])
    assert all((rule_table(system) == 3).all() for system in systems)
    np.testing.assert_array_equal(kept.reduce(kept.expand(drawn)[0]), drawn[0])
