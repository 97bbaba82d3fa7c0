"""Rule inconsistency of individuals, the third objective of a front."""

import numpy as np

from fis_tools.analysis.measures import rule_consistency
from pipeline.array_types import Floats
from pipeline.training.evolution import OBJECTIVE
from pipeline.training.genome import Genome

#: the objective that needs no flight
INCONSISTENCY = OBJECTIVE + "inconsistency"


def inconsistency(genome: Genome, genomes: Floats) -> Floats:
    """Return 1 minus the mean rule consistency of each controller, shape (n,).

    0 if every rule, where it holds most, gives the output that it would give alone
    (`fis_tools.analysis.measures.rule_consistency`).

    Parameters
    ----------
    genome : Genome
        Meaning of the genes.
    genomes : (n, num_genes) array
    """
    return np.array([1.0 - np.concatenate(_consistency(genome, genes)).mean() for genes in genomes])


def _consistency(genome: Genome, genes: Floats) -> list[Floats]:
    return [rule_consistency(system).values for system in genome.decode(genes).systems]
