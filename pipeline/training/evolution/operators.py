"""Operators of the genetic algorithms: selection, crossover and mutation, whose randomness is an argument.

The operators are those of Choi, Kim and Leeghim (AAS 25-727), defined as in MATLAB's Global Optimization
Toolbox ("Genetic Algorithm Options"). Instead of its adaptive feasible mutation a local one may be chosen,
which moves few genes a little: for the search near a controller that is already good.

Those with a `random.Random` draw exactly as DEAP's `selTournament`, `cxUniform`, `mutGaussian` and
`selTournamentDCD` do from Python's global generator.
"""

import math
from collections.abc import Sequence
from random import Random
from typing import Any, cast

import numpy as np
from deap import base

from pipeline.array_types import Floats

GENE_SWAP_PROBABILITY = 0.5
#: of the first of two that are equally good and crowded
EITHER_PROBABILITY = 0.5

#: a local mutant moves each gene with one of these probabilities, by one of these multiples of the step: most
#: steps are fine, some are bold
LOCAL_SHARES = (0.01, 0.03, 0.1)
LOCAL_STEPS = (0.3, 1.0, 2.0)


class Fitness(base.Fitness):  # type: ignore[misc]
    """One value, to be minimised."""

    weights = (-1.0,)


class Individual(list[float]):
    """A genome with its fitness; a list, because DEAP's operators corrupt views of arrays."""

    def __init__(self, genes: Sequence[float], fitness: float | None = None) -> None:
        super().__init__(genes)
        self.fitness = Fitness() if fitness is None else Fitness((fitness,))


def select_parents(
    population: Sequence[Individual], num_parents: int, tournament_size: int, generator: Random
) -> list[Individual]:
    """Choose parents, each the best of `tournament_size` drawn with replacement."""
    drawn = ([generator.choice(population) for _ in range(tournament_size)] for _ in range(num_parents))
    return [max(aspirants, key=lambda individual: individual.fitness) for aspirants in drawn]


def select_uncrowded(population: Sequence[Any], generator: Random) -> list[Any]:
    """Choose parents in tournaments of two: what dominates wins, else what is less crowded, else either.

    As many as there are individuals, to a multiple of four; none more than twice.

    Parameters
    ----------
    population : sequence
        At least four; their ``fitness`` has a crowding distance.
    generator : random.Random
    """
    orders = [generator.sample(population, len(population)) for _ in range(2)]
    chosen = []
    for index in range(0, len(population) - 3, 4):
        for order in orders:
            chosen.append(_less_crowded(order[index], order[index + 1], generator))
            chosen.append(_less_crowded(order[index + 2], order[index + 3], generator))
    return chosen


def _less_crowded(first: Any, second: Any, generator: Random) -> Any:
    """Return the winner of two: the dominating, else the less crowded, else either by chance."""
    for better, worse in ((first, second), (second, first)):
        if better.fitness.dominates(worse.fitness):
            return better
    distances = first.fitness.crowding_dist, second.fitness.crowding_dist
    if distances[0] != distances[1]:
        return first if distances[0] > distances[1] else second
    return first if generator.random() <= EITHER_PROBABILITY else second


def scattered_crossover(first: Sequence[float], second: Sequence[float], generator: Random) -> Individual:
    """Return a child that takes each gene from either parent with probability 1/2."""
    pairs = zip(first, second, strict=True)
    return Individual([b if generator.random() < GENE_SWAP_PROBABILITY else a for a, b in pairs])


def local_mutation(genome: Sequence[float], step_size: float, generator: Random) -> Individual:
    """Move few genes by normal steps, clipped to [0, 1]."""
    share, scale = generator.choice(LOCAL_SHARES), generator.choice(LOCAL_STEPS)
    mutant = list(genome)
    for index in range(len(mutant)):
        if generator.random() < share:
            mutant[index] += generator.gauss(0.0, scale * step_size)
    return Individual([min(1.0, max(0.0, gene)) for gene in mutant])


LARGEST_STEP = 1.0
SMALLEST_STEP = math.sqrt(np.finfo(np.float64).eps)
STEP_FACTOR = 4.0


def adapt_step_size(step_size: float, has_improved: bool) -> float:
    """Return four times the step (at most 1) after success, else a quarter (at least sqrt(eps))."""
    if has_improved:
        return min(LARGEST_STEP, step_size * STEP_FACTOR)
    return max(SMALLEST_STEP, step_size / STEP_FACTOR)


def poll_directions(num_genes: int, step_size: float, generator: np.random.Generator) -> Floats:
    """Return a random basis of a mesh-adaptive direct search.

    A lower triangular matrix with diagonal ±1/sqrt(step) and, below it, integers of smaller magnitude, its
    rows in random order: the LTMADS basis of Audet and Dennis, "Mesh adaptive direct search
    algorithms for constrained optimization", SIAM J. Optim. 17 (2006), section 4.1.

    Returns
    -------
    (num_genes, num_genes) array
        One direction per column.
    """
    largest = round(1.0 / math.sqrt(step_size))
    basis = np.tril(generator.integers(1 - largest, largest, (num_genes, num_genes)), -1).astype(np.float64)
    np.fill_diagonal(basis, largest * generator.choice((-1.0, 1.0), num_genes))
    return basis[generator.permutation(num_genes)]


def adaptive_feasible_mutation(genome: Floats, step_size: float, generator: np.random.Generator) -> Floats:
    """Return a genome moved along a random direction that keeps it in the box [0, 1].

    The operator ``mutationadaptfeasible`` of MATLAB's toolbox, on genes scaled to [0, 1].

    Directions ± the columns of `poll_directions` are tried in random order and the first feasible one wins,
    so all feasible ones are equally likely. If none is feasible, the step of this mutant is
    shortened ("the mutation chooses a direction and step length that satisfies bounds", MATLAB's
    documentation): from a quarter on a direction along one axis always fits.

    Parameters
    ----------
    genome : (num_genes,) array
    step_size : float
        In (0, 1].
    generator : numpy Generator

    Returns
    -------
    (num_genes,) array
        A new genome, in [0, 1].
    """
    steps = poll_directions(genome.size, step_size, generator).T * step_size
    room_above = 1.0 - genome
    forward = np.all((steps <= room_above) & (steps >= -genome), axis=1)
    backward = np.all((steps <= genome) & (steps >= -room_above), axis=1)
    feasible = np.flatnonzero(np.concatenate((forward, backward)))
    if feasible.size == 0:
        return adaptive_feasible_mutation(genome, step_size / STEP_FACTOR, generator)
    sign, index = divmod(int(generator.choice(feasible)), genome.size)
    # rounding may put the sum outside the box
    return cast(Floats, np.clip(genome + (steps[index] if sign == 0 else -steps[index]), 0.0, 1.0))
