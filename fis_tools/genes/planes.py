"""Planar rule tables as genes.

Each system is described by a gain for each input, which makes its rule table a plane, a width for each
variable's terms, and the output's reach; terms are evenly spaced.
"""

from dataclasses import dataclass

import numpy as np

from fis_tools.array_types import Floats, Integers
from fis_tools.errors import MissingExtra
from fis_tools.genes.parameters import Genes, SystemEncoding, chosen_terms
from fis_tools.model import FuzzySystem

#: a gain of one takes the output from one end to the other as its input goes from end to end
GREATEST_GAIN = 3.0


@dataclass(frozen=True)
class Planes(Genes):
    """Planar rule tables: for each system gains, widths and the reach, all in [0, 1].

    Parameters
    ----------
    encoding : SystemEncoding
        Of the whole genomes.
    """

    encoding: SystemEncoding

    def gene_names(self) -> list[str]:
        """Return the name of what each gene tunes."""
        names = []
        for system in self.encoding.systems:
            inputs, output = [v.name for v in system.inputs], system.outputs[0].name
            names += [f"{system.name}.{name}.gain" for name in inputs]
            names += [f"{system.name}.{name}.width" for name in (*inputs, output)]
            names.append(f"{system.name}.{output}.reach")
        return names

    def expand(self, genes: Floats) -> Floats:
        """Return the genomes, shape (n, encoding.num_genes), of short ones of shape (n, k)."""
        genomes = np.full((len(genes), self.encoding.num_genes), 0.5)
        at = 0
        for system, slices in zip(self.encoding.systems, self.encoding.gene_slices(), strict=True):
            count = len(system.inputs)
            gains = GREATEST_GAIN * (2.0 * genes[:, at : at + count] - 1.0)
            for index, widths in enumerate(slices.widths):
                genomes[:, widths] = genes[:, [at + count + index]]
            genomes[:, slices.reach] = genes[:, at + 2 * count + 1]
            num_terms = len(system.outputs[0].terms)
            genomes[:, slices.rules] = (plane_terms(system, gains) + 0.5) / num_terms
            at += 2 * count + 2
        return genomes

    def reduce(self, genome: Floats) -> Floats:
        """Return the short vector of planes fitted to the tables of a genome, shape (encoding.num_genes,)."""
        genes: list[float] = []
        for system, slices in zip(self.encoding.systems, self.encoding.gene_slices(), strict=True):
            terms = chosen_terms(genome[slices.rules], system.outputs[0])
            genes += list(0.5 + 0.5 * plane_gains(system, terms) / GREATEST_GAIN)
            genes += [float(genome[widths].mean()) for widths in slices.widths]
            genes.append(float(genome[slices.reach]))
        return np.clip(np.array(genes, dtype=np.float64), 0.0, 1.0)


def plane_terms(system: FuzzySystem, gains: Floats) -> Integers:
    """Return the output term of each rule of planar tables with gains, shape (n, inputs), as (n, rules)."""
    last = len(system.outputs[0].terms) - 1
    chosen = np.clip(np.rint(0.5 * last * (1.0 + gains @ _cells(system).T)), 0, last)
    return np.asarray(chosen, dtype=np.int64)


def plane_gains(system: FuzzySystem, terms: Integers) -> Floats:
    """Return the gains, shape (inputs,), that best fit the output terms of a table, shape (rules,).

    This works even if much of the plane is clipped at the ends.
    """
    try:
        from scipy.optimize import least_squares  # noqa: PLC0415 - large, and used only here
    except ModuleNotFoundError as error:
        raise MissingExtra("fitting planes to rule tables", "scipy", "scipy") from error

    cells, levels = _cells(system), 2.0 * terms / (len(system.outputs[0].terms) - 1) - 1.0

    def misfit(gains: Floats) -> Floats:
        return np.asarray(np.clip(cells @ gains, -1.0, 1.0) - levels)

    return np.asarray(least_squares(misfit, np.linalg.lstsq(cells, levels, rcond=None)[0]).x)


def _cells(system: FuzzySystem) -> Floats:
    """Return the position of each rule's terms in their ranges, from -1 to 1, shape (rules, inputs)."""
    axes = [np.linspace(-1.0, 1.0, len(variable.terms)) for variable in system.inputs]
    return np.stack([grid.ravel() for grid in np.meshgrid(*axes, indexing="ij")], axis=1)
