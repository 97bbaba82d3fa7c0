"""Reduced genomes: short vectors that represent whole genomes, for searches that need few genes.

`Planes` describes each system by a gain for each input, which makes its rule table a plane, a width for
each variable's terms, and the output's reach; terms are evenly spaced. `KeptRules` keeps the rules and
tunes the rest.
"""

from dataclasses import dataclass

import numpy as np

from fis_tools.array_types import Booleans, Floats
from fis_tools.errors import MissingExtra
from fis_tools.genes.parameters import SystemEncoding
from fis_tools.model import FuzzySystem

#: a gain of one takes the output from one end to the other as its input goes from end to end
GREATEST_GAIN = 3.0


@dataclass(frozen=True)
class Planes:
    """Planar rule tables: for each system gains, widths and the reach, all in [0, 1].

    Parameters
    ----------
    encoding : SystemEncoding
        Of the whole genomes.
    """

    encoding: SystemEncoding

    @property
    def num_genes(self) -> int:
        """Length of the short vector."""
        return sum(2 * len(system.inputs) + 2 for system in self.encoding.systems)

    def gene_names(self) -> list[str]:
        """Return for each gene what it tunes."""
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
        for system, places in zip(self.encoding.systems, self.encoding.places(), strict=True):
            count = len(system.inputs)
            gains = GREATEST_GAIN * (2.0 * genes[:, at : at + count] - 1.0)
            for place, widths in enumerate(places.widths):
                genomes[:, widths] = genes[:, [at + count + place]]
            genomes[:, places.reach] = genes[:, at + 2 * count + 1]
            num_terms = len(system.outputs[0].terms)
            genomes[:, places.rules] = (plane_terms(system, gains) + 0.5) / num_terms
            at += 2 * count + 2
        return genomes

    def reduce(self, genome: Floats) -> Floats:
        """Return the short vector of planes fitted to the tables of a genome, shape (encoding.num_genes,)."""
        genes: list[float] = []
        for system, places in zip(self.encoding.systems, self.encoding.places(), strict=True):
            num_terms = len(system.outputs[0].terms)
            terms = np.minimum(np.floor(num_terms * genome[places.rules]), num_terms - 1)
            genes += list(0.5 + 0.5 * plane_gains(system, terms) / GREATEST_GAIN)
            genes += [float(genome[widths].mean()) for widths in places.widths]
            genes.append(float(genome[places.reach]))
        return np.clip(np.array(genes, dtype=np.float64), 0.0, 1.0)


@dataclass(frozen=True)
class KeptRules:
    """Whole genomes without the genes of their rules, which are those of a given genome.

    Parameters
    ----------
    encoding : SystemEncoding
        Of the whole genomes.
    genome : (encoding.num_genes,) array
        Its rules are kept.
    """

    encoding: SystemEncoding
    genome: Floats

    @property
    def num_genes(self) -> int:
        """Length of the short vector."""
        return int(self._is_tuned().sum())

    def gene_names(self) -> list[str]:
        """Return for each gene what it tunes."""
        return [
            name for name, tuned in zip(self.encoding.gene_names(), self._is_tuned(), strict=True) if tuned
        ]

    def expand(self, genes: Floats) -> Floats:
        """Return the genomes, shape (n, encoding.num_genes), of short ones of shape (n, k)."""
        genomes = np.repeat(self.genome[np.newaxis], len(genes), axis=0)
        genomes[:, self._is_tuned()] = genes
        return genomes

    def reduce(self, genome: Floats) -> Floats:
        """Return a genome without the genes of its rules."""
        return np.asarray(genome[self._is_tuned()])

    def _is_tuned(self) -> Booleans:
        is_tuned = np.ones(self.encoding.num_genes, dtype=np.bool_)
        for places in self.encoding.places():
            is_tuned[places.rules] = False
        return is_tuned


def plane_terms(system: FuzzySystem, gains: Floats) -> Floats:
    """Return the output term of each rule of planar tables with gains, shape (n, inputs), as (n, rules)."""
    last = len(system.outputs[0].terms) - 1
    return np.asarray(np.clip(np.rint(0.5 * last * (1.0 + gains @ _cells(system).T)), 0, last))


def plane_gains(system: FuzzySystem, terms: Floats) -> Floats:
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
