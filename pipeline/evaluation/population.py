"""Cases of a rare event that are moved below a level of its margin, for `pipeline.evaluation.splitting`.

Cases below a level begin chains of moves that keep the law of cases there (Metropolis; of genes that are
not periodic as I. Papaioannou, W. Betz, K. Zwirglmaier and D. Straub do it, Probabilistic Engineering
Mechanics 41, 2015).
"""

from typing import Any, Final, Protocol

import numpy as np
from numpy.typing import NDArray

from pipeline.array_types import Floats
from pipeline.evaluation.mixture import KernelMixture

#: each move's scale is drawn between this and the double: what is smooth, and what is rough, both mix
LEAST_SCALE: Final = 0.125
#: of a turn, by a scale of 1
OF_A_TURN: Final = 0.3
#: numbers of a population's cases
MOST_NUMBERS: Final = 1 << 32

Numbers = NDArray[np.int64]
#: genes, numbers and margins of cases
Cases = tuple[Floats, Numbers, Floats]


class CaseLaw(Protocol):
    """The law of cases, and their margins.

    A case consists of genes, uniform between 0 and 1, and of a number, from which all its other random
    numbers follow.
    """

    @property
    def is_periodic(self) -> NDArray[np.bool_]:
        """Whether a gene's ends are neighbours, (num_genes,)."""

    def margins(self, genes: Floats, numbers: Numbers) -> Floats:
        """Return the margins of cases, (n,), of genes (n, num_genes) and numbers (n,)."""


class Population:
    """Cases that pass one level after the other.

    Parameters
    ----------
    law : CaseLaw
    size : int
    seed : tuple of int
        Of its random numbers; the last tells populations apart.
    proposal : KernelMixture, optional
        What its first genes are drawn by, unless they are uniform.
    """

    def __init__(
        self, law: CaseLaw, size: int, seed: tuple[int, ...], proposal: KernelMixture | None = None
    ) -> None:
        self._law, self._size, self._proposal = law, size, proposal
        self._generator = np.random.default_rng(np.random.SeedSequence(seed[0], spawn_key=seed[1:]))
        self._next = seed[-1] * MOST_NUMBERS
        self.num_flights, self.taken = size, 0.0
        numbers = self._new_numbers(size)
        if proposal is None:
            genes = self._generator.random((size, len(law.is_periodic)))
        else:
            genes = proposal.draw(size, self._generator)
        self._cases: Cases = genes, numbers, law.margins(genes, numbers)

    @property
    def margins(self) -> Floats:
        """The margins of its cases."""
        return self._cases[2]

    def weighted(self, level: float) -> tuple[Floats, Floats]:
        """Return the genes of its first cases below a level, (n, num_genes), and their weights, (n,)."""
        genes = self._cases[0][self.margins < level]
        return genes, np.ones(len(genes)) if self._proposal is None else 1.0 / self._proposal.density(genes)

    def begin_below(self, level: float) -> float:
        """Keep as many of its first cases below a level as there are, drawn by weight; return their share."""
        _, weights = self.weighted(level)
        share = float(weights.sum()) / self._size
        if share > 0.0:
            # each as often as its weight says, but for less than one (systematic resampling)
            steps = (np.arange(len(weights)) + self._generator.random()) / len(weights)
            drawn = np.searchsorted(np.cumsum(weights) / weights.sum(), steps, side="right")
            below = np.flatnonzero(self.margins < level)
            self._cases = _chosen(self._cases, below[np.minimum(drawn, len(below) - 1)])
        return share

    def each(self) -> tuple[Floats, Floats]:
        """Return the genes of its cases, (n, num_genes), and their margins, (n,), each case once."""
        _, first = np.unique(self._cases[0], axis=0, return_index=True)
        return self._cases[0][first], self.margins[first]

    def _new_numbers(self, count: int) -> Numbers:
        self._next += count
        return np.arange(self._next - count, self._next)

    def pass_below(self, level: float) -> float:
        """Keep the cases below a level alone; return their share."""
        is_below = self.margins < level
        self._cases = _chosen(self._cases, is_below)
        return float(is_below.mean())

    def refill(self, level: float, scale: float) -> None:
        """Make the cases below a level as many as at first: each begins a chain of moves that stay there.

        Chains differ in length by one at most, which of them is longer is left to chance.
        """
        length, rest = divmod(self._size, len(self.margins))
        is_longer = self._generator.permutation(len(self.margins)) < rest
        chains = self._cases
        states, num_taken, num_moves = [chains], 0, 0
        for step in range(1, length + 1):
            chains = _chosen(chains, is_longer) if step == length else chains
            if len(chains[2]):
                chains, is_taken = self._moved(chains, level, scale)
                num_taken, num_moves = num_taken + int(is_taken.sum()), num_moves + len(is_taken)
                states.append(chains)
        genes, numbers, margins = zip(*states, strict=True)
        self._cases = np.concatenate(genes), np.concatenate(numbers), np.concatenate(margins)
        self.num_flights, self.taken = self.num_flights + num_moves, num_taken / max(1, num_moves)

    def _moved(self, cases: Cases, level: float, scale: float) -> tuple[Cases, NDArray[np.bool_]]:
        """Return cases after a move of each, if it stays below a level, and whether it does.

        In half of the moves the number is another, too.
        """
        genes, numbers, margins = cases
        scales = np.minimum(2.0 * scale * (0.5 * LEAST_SCALE) ** self._generator.random((len(genes), 1)), 1.0)
        new_genes = _moved_genes(genes, scales, self._law.is_periodic, self._generator)
        is_new = self._generator.random(len(genes)) < 0.5
        new_numbers = np.where(is_new, self._new_numbers(len(genes)), numbers)
        new_margins = self._law.margins(new_genes, new_numbers)
        is_taken = new_margins < level
        taken_genes = np.where(is_taken[:, np.newaxis], new_genes, genes)
        taken = np.where(is_taken, new_numbers, numbers), np.where(is_taken, new_margins, margins)
        return (taken_genes, *taken), is_taken


def _chosen(cases: Cases, which: NDArray[Any]) -> Cases:
    return cases[0][which], cases[1][which], cases[2][which]


def _moved_genes(
    genes: Floats, scales: Floats, is_periodic: NDArray[np.bool_], generator: np.random.Generator
) -> Floats:
    """Return genes after a move that keeps their uniform law, and is as likely as the way back under it."""
    from scipy.special import ndtr, ndtri  # noqa: PLC0415 - slower to import than a thousand flights

    drawn = generator.standard_normal(genes.shape)
    normal = ndtri(np.clip(genes, 1e-300, 1.0 - 2.0**-53))
    across = ndtr(np.sqrt(1.0 - scales**2) * normal + scales * drawn)
    return np.where(is_periodic, (genes + OF_A_TURN * scales * drawn) % 1.0, across)
