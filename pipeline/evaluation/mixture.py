"""A law to draw genes from where an event is likely, for importance sampling: kernels about cases seen there.

The kernels are products of Cauchy laws, wrapped around genes that are periodic and folded back at the ends
of others; both have closed forms (K. Mardia and P. Jupp, Directional Statistics, 2000, section 3.5). Their
heavy tails, and a share of uniform draws, bound the weights of cases that no kernel is near to. A kernel is
as wide as the distance to a near neighbour of its case (L. Breiman, W. Meisel and E. Purcell, Variable
kernel estimates of multivariate densities, Technometrics 19, 1977). Of several widths that is taken by which
one half of the cases is likeliest under the kernels of the other, times three: draws farther from the event
cost less than great weights do where kernels are thin.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Final

import numpy as np
from numpy.typing import NDArray

from pipeline.array_types import Floats

#: of all draws, the share of uniform ones
UNIFORM: Final = 0.1
#: the neighbour that a kernel reaches to, and the part of its distance: what is tried
NEIGHBOURS: Final = (3, 8, 20)
PARTS: Final = (0.05, 0.1, 0.2, 0.4, 0.8)
#: cases that tell the likeliest width
TELLING: Final = 300
#: times the likeliest width
WIDER: Final = 3.0
#: of fewer cases no kernels are made
LEAST_CASES: Final = 8
#: the least width of a kernel; spreads of genes that are told apart
LEAST_WIDTH: Final = 1e-6
#: numbers in an array of a density's parts
CHUNK: Final = 1 << 22


@dataclass(frozen=True)
class Kernels:
    """Cauchy kernels about cases, all of the same weight.

    Parameters
    ----------
    centres : ndarray, shape (n, num_genes)
        Between 0 and 1.
    widths : ndarray, shape (n, num_genes)
        Half widths at half height.
    """

    centres: Floats
    widths: Floats


@dataclass(frozen=True)
class KernelMixture:
    """A mixture of kernels and the uniform law of genes.

    Parameters
    ----------
    groups : sequence of Kernels
    weights : sequence of float
        Of each group; with `UNIFORM` they sum to 1.
    is_periodic : ndarray of bool, shape (num_genes,)
    """

    groups: Sequence[Kernels]
    weights: Sequence[float]
    is_periodic: NDArray[np.bool_]

    def draw(self, count: int, generator: np.random.Generator) -> Floats:
        """Return genes, (count, num_genes)."""
        drawn = generator.random((count, len(self.is_periodic)))
        group = generator.choice(len(self.groups) + 1, count, p=[*self.weights, 1.0 - sum(self.weights)])
        for index, kernels in enumerate(self.groups):
            chosen = np.flatnonzero(group == index)
            of_case = generator.integers(len(kernels.centres), size=len(chosen))
            away = kernels.widths[of_case] * np.tan(np.pi * (drawn[chosen] - 0.5))
            genes = kernels.centres[of_case] + away
            drawn[chosen] = np.where(self.is_periodic, genes % 1.0, 1.0 - np.abs(genes % 2.0 - 1.0))
        return drawn

    def density(self, genes: Floats) -> Floats:
        """Return the density at genes (n, num_genes), 1 for the uniform law."""
        density = np.full(len(genes), 1.0 - sum(self.weights))
        for kernels, weight in zip(self.groups, self.weights, strict=True):
            density += weight * _density(kernels, self.is_periodic, genes)
        return density


def _density(kernels: Kernels, is_periodic: NDArray[np.bool_], genes: Floats) -> Floats:
    """Return the mean density of kernels at genes (n, num_genes)."""
    rate = np.where(is_periodic, 2.0 * np.pi, np.pi)
    # of a wrapped Cauchy law, the length of the mean of unit vectors
    lengths = np.exp(-rate * kernels.widths)
    above, below, twice = 1.0 - lengths**2, 1.0 + lengths**2, 2.0 * lengths
    centres, density = rate * kernels.centres, np.empty(len(genes))
    step = max(1, CHUNK // len(centres))
    for first in range(0, len(genes), step):
        angles = rate * genes[first : first + step]
        each = np.ones((len(angles), len(centres)))
        for gene, turns in enumerate(is_periodic):
            cosines = np.cos(angles[:, gene, np.newaxis]) * np.cos(centres[:, gene])
            sines = np.sin(angles[:, gene, np.newaxis]) * np.sin(centres[:, gene])
            factor = above[:, gene] / (below[:, gene] - twice[:, gene] * (cosines + sines))
            if not turns:
                # from beyond the nearer end, as in a mirror
                factor += above[:, gene] / (below[:, gene] - twice[:, gene] * (cosines - sines))
                factor *= 0.5
            each *= factor
        density[first : first + step] = each.mean(axis=1)
    return density


def _distances(genes: Floats, is_periodic: NDArray[np.bool_], spread: Floats) -> Floats:
    """Return the distances of all pairs of genes, (n, n), in spreads of each gene."""
    squares = np.zeros((len(genes), len(genes)))
    for gene, turns in enumerate(is_periodic):
        away = np.abs(genes[:, gene, np.newaxis] - genes[:, gene])
        squares += ((np.minimum(away, 1.0 - away) if turns else away) / spread[gene]) ** 2
    return np.sqrt(squares)


def _spread(genes: Floats, is_periodic: NDArray[np.bool_]) -> Floats:
    """Return how far each gene spreads, (num_genes,): the standard deviation, on a circle about the mean."""
    turns = np.exp(2j * np.pi * genes).mean(axis=0)
    centre = np.where(is_periodic, np.angle(turns) / (2.0 * np.pi), genes.mean(axis=0))
    away = genes - centre
    away = np.where(is_periodic, (away + 0.5) % 1.0 - 0.5, away)
    return np.maximum(np.sqrt((away**2).mean(axis=0)), LEAST_WIDTH)


def fitted(genes: Floats, is_periodic: NDArray[np.bool_]) -> Kernels | None:
    """Return kernels about cases, whose order is random; None if they are too few.

    Parameters
    ----------
    genes : ndarray, shape (n, num_genes)
        Each case once.
    is_periodic : ndarray of bool, shape (num_genes,)
    """
    if len(genes) < LEAST_CASES:
        return None
    halves = genes[:TELLING:2], genes[1:TELLING:2]
    spreads = [_spread(half, is_periodic) for half in halves]
    ordered = [
        np.sort(_distances(half, is_periodic, spread), axis=1)
        for half, spread in zip(halves, spreads, strict=True)
    ]
    best, chosen = -math.inf, (NEIGHBOURS[0], PARTS[0])
    for neighbour, part in product(NEIGHBOURS, PARTS):
        if neighbour >= len(halves[1]):
            break
        kernels = [
            Kernels(half, np.maximum(part * near[:, neighbour, np.newaxis] * spread, LEAST_WIDTH))
            for half, near, spread in zip(halves, ordered, spreads, strict=True)
        ]
        likelihood = sum(
            float(np.log(UNIFORM + _density(of_half, is_periodic, other)).mean())
            for of_half, other in zip(kernels, reversed(halves), strict=True)
        )
        if likelihood > best:
            best, chosen = likelihood, (neighbour, part)
    neighbour, part = chosen
    spread = _spread(genes, is_periodic)
    near = np.sort(_distances(genes, is_periodic, spread), axis=1)[:, neighbour, np.newaxis]
    return Kernels(genes, np.maximum(WIDER * part * near * spread, LEAST_WIDTH))
