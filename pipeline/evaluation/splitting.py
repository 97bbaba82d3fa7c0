"""How rare an event is, by splitting: cases that come near it are continued by others that come nearer.

The event is that a margin is below zero. Between the law of all cases and the event stand levels of the
margin, each rarer by about the same factor: subset simulation (S.-K. Au and J. Beck, Probabilistic
Engineering Mechanics 16, 2001). A first population, the pilot, sets the levels and how far cases are moved;
then several others pass the levels, each by itself. In each the cases below a level begin chains of moves
that keep the law of cases there (Metropolis; of genes that are not periodic as I. Papaioannou, W. Betz,
K. Zwirglmaier and D. Straub do it, Probabilistic Engineering Mechanics 41, 2015).

As the levels are fixed beforehand, the product of the shares that pass is an unbiased estimate, whatever the
moves do (F. Cérou, P. Del Moral, T. Furon and A. Guyader, Sequential Monte Carlo for rare event estimation,
Statistics and Computing 22, 2012). So the populations are independent estimates with the same mean, and
Student's interval of it tells how far they agree. It misleads where their law is far from normal: a way into
the event that few populations find, if any, makes most of them too small, and their spread with them.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, Protocol

import numpy as np
from numpy.typing import NDArray

from pipeline.array_types import Floats
from pipeline.evaluation.statistics import students_half_width
from pipeline.run.engine import HERE, TaskPool

#: of the cases, the share that passes a level
PASSED: Final = 0.1
#: levels beyond which an event is given up: it is rarer than 1e-9, or cannot be approached
MOST_LEVELS: Final = 10
#: of all flights, the share of the pilot's cases, and how many there are at least
PILOT, LEAST_PILOT = 0.01, 200
#: populations after the pilot
POPULATIONS: Final = 12
#: the first scale of moves, and how it follows the share of moves that are taken, which is to be the last
FIRST_SCALE, GAIN, TAKEN = 0.8, 1.5, 0.5
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


@dataclass(frozen=True)
class Plan:
    """The levels that cases pass, and how far they are moved.

    Parameters
    ----------
    levels : tuple of float
        Descending; the last is 0, unless the event is given up.
    scales : tuple of float
        Of the moves below each level but the last.
    num_flights : int
        That it took.
    """

    levels: tuple[float, ...]
    scales: tuple[float, ...]
    num_flights: int


@dataclass(frozen=True)
class RareShare:
    """The share of cases in which an event occurs.

    Parameters
    ----------
    share : float, optional
        None if the event was given up.
    low, high : float
        Student's interval of the populations' mean, within 0 and 1; 0 and None if none saw the event.
    confidence_percent : float
    num_flights : int
    levels : tuple of float
        Of the margin.
    populations : tuple of float
        The estimate of each.
    """

    share: float | None
    low: float
    high: float | None
    confidence_percent: float
    num_flights: int
    levels: tuple[float, ...]
    populations: tuple[float, ...]

    @property
    def sentence(self) -> str:
        """The estimate in words, without a full stop."""
        if self.share is None:
            return f"splitting gave up after {len(self.levels)} levels and {self.num_flights:,} flights"
        if self.high is None:
            return f"no population of splitting saw the event, in {self.num_flights:,} flights"
        ends = f"{self.low:.3g} to {self.high:.3g} ({self.confidence_percent:g} %)"
        return f"{self.share:.3g} by splitting, {ends}, in {self.num_flights:,} flights"


class _Population:
    """Cases that pass one level after the other.

    Parameters
    ----------
    law : CaseLaw
    size : int
    seed : tuple of int
        Of its random numbers; the last tells populations apart.
    """

    def __init__(self, law: CaseLaw, size: int, seed: tuple[int, ...]) -> None:
        self._law, self._size = law, size
        self._generator = np.random.default_rng(np.random.SeedSequence(seed[0], spawn_key=seed[1:]))
        self._next = seed[-1] * MOST_NUMBERS
        self.num_flights, self.taken = size, 0.0
        genes, numbers = self._generator.random((size, len(law.is_periodic))), self._new_numbers(size)
        self._cases: Cases = genes, numbers, law.margins(genes, numbers)

    @property
    def margins(self) -> Floats:
        """The margins of its cases."""
        return self._cases[2]

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


def _chosen(cases: Cases, which: NDArray[np.bool_]) -> Cases:
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


def _next_level(margins: Floats) -> float | None:
    """Return a level below which about `PASSED` of some margins are, at least 0; None if none parts them."""
    ordered = np.sort(margins)
    level = float(ordered[min(math.ceil(PASSED * len(ordered)), len(ordered) - 1)])
    if level <= 0.0:
        return 0.0
    # equal margins, such as counts, are on one side of a level
    above = ordered[ordered > ordered[0]]
    return level if ordered[0] < level else max(float(above[0]), 0.0) if len(above) else None


def plan_of(law: CaseLaw, size: int, seed: tuple[int, ...]) -> Plan:
    """Return the levels and moves that a population of some size finds on its way to the event."""
    population, scale = _Population(law, size, seed), FIRST_SCALE
    levels: list[float] = []
    scales: list[float] = []
    while len(levels) < MOST_LEVELS and 0.0 not in levels:
        level = _next_level(population.margins)
        if level is None or (levels and level >= levels[-1]):
            break
        levels.append(level)
        if level > 0.0:
            population.pass_below(level)
            population.refill(level, scale)
            scales.append(scale)
            scale = min(max(scale * math.exp(GAIN * (population.taken - TAKEN)), 0.01), 1.0)
    return Plan(tuple(levels), tuple(scales), population.num_flights)


def passed(law: CaseLaw, plan: Plan, size: int, seed: tuple[int, ...]) -> tuple[float, int]:
    """Return the share of cases in which the event occurs, by one population, and its flights."""
    population, share = _Population(law, size, seed), 1.0
    for index, level in enumerate(plan.levels):
        share *= population.pass_below(level)
        if share == 0.0 or level == 0.0:
            break
        population.refill(level, plan.scales[index])
    return share, population.num_flights


def rare_share(
    law: CaseLaw,
    num_flights: int,
    confidence_percent: float,
    seed: tuple[int, ...],
    pool: TaskPool = HERE,
    on_done: Callable[[int], Any] = lambda _: None,
) -> RareShare:
    """Return the share of cases in which the event occurs, by about so many flights.

    Parameters
    ----------
    law : CaseLaw
    num_flights : int
    confidence_percent : float
    seed : tuple of int
        Of all random numbers.
    pool : TaskPool
        Where the populations pass the levels.
    on_done : callable
        Is told of how many populations are done.
    """
    plan = plan_of(law, max(LEAST_PILOT, round(PILOT * num_flights)), (*seed, 0))
    if 0.0 not in plan.levels:
        return RareShare(None, 0.0, None, confidence_percent, plan.num_flights, plan.levels, ())
    # as many cases as at first are flown once, and all but those that pass once more below each level
    rounds = 1.0 + (1.0 - PASSED) * len(plan.scales)
    size = max(10, int((num_flights - plan.num_flights) / (POPULATIONS * rounds)))
    tasks = [(law, plan, size, (*seed, number)) for number in range(1, POPULATIONS + 1)]
    results: dict[int, tuple[float, int]] = {}
    for index, result in pool.run(passed, tasks):
        results[index] = result
        on_done(len(results))
    shares = np.array([results[index][0] for index in range(POPULATIONS)])
    flown = plan.num_flights + sum(flights for _, flights in results.values())
    mean, low, high = float(shares.mean()), 0.0, None
    if mean > 0.0:
        reach = students_half_width(shares, confidence_percent)
        low, high = max(0.0, mean - reach), min(1.0, mean + reach)
    return RareShare(mean, low, high, confidence_percent, flown, plan.levels, tuple(shares.tolist()))
