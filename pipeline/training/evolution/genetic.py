"""The genetic algorithm's children: first by crossover, then by mutation; parents are chosen in tournaments.

The operators and rates of Choi, Kim and Leeghim (AAS 25-727), defined as in MATLAB's Global Optimization
Toolbox ("Genetic Algorithm Options"). Instead of its adaptive feasible mutation a local one may be chosen,
which moves few genes a little: for the search near a controller that is already good.
DEAP draws from Python's global generator, which other code uses too: for each generation that is replaced by
one of ours.
"""

import math
import random
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import cast

import numpy as np
from deap import base, tools
from deap.tools import crossover, mutation, selection

from pipeline.array_types import Floats
from pipeline.settings.experiment import Optimizer
from pipeline.training.evolution.state import State

GENE_SWAP_PROBABILITY = 0.5

#: DEAP's modules that draw random numbers
DRAWING = (crossover, mutation, selection)

#: a local mutant moves each gene with one of these probabilities, by one of these multiples of the step: most
#: steps are fine, some are bold
LOCAL_SHARES = (0.01, 0.03, 0.1)
LOCAL_STEPS = (0.3, 1.0, 2.0)


@dataclass(frozen=True)
class Split:
    """Number of individuals of a generation from each source."""

    elite: int
    crossover: int
    mutants: int


def split_population(settings: Optimizer) -> Split:
    """Convert rates into numbers of individuals.

    With `split` = ``whole`` the crossover rate applies to the whole population (of 200 at 0.1 and 0.8: 20,
    160, 20), with ``rest`` to all but the elite (20, 144, 36). Mutants make up the rest.
    """
    size = settings.population_size
    elite = max(1, round(settings.elitism_rate * size))
    counted = size if settings.split == "whole" else size - elite
    crossover = min(size - elite, round(settings.crossover_rate * counted))
    return Split(elite, crossover, size - elite - crossover)


class Fitness(base.Fitness):  # type: ignore[misc]
    """One value, to be minimised."""

    weights = (-1.0,)


class Individual(list[float]):
    """A genome with its fitness; a list, because DEAP's operators corrupt views of arrays."""

    def __init__(self, genes: Sequence[float], fitness: float | None = None) -> None:
        super().__init__(genes)
        self.fitness = Fitness() if fitness is None else Fitness((fitness,))


def select_parents(
    population: Sequence[Individual], num_parents: int, tournament_size: int
) -> list[Individual]:
    """Choose parents, each the best of `tournament_size` drawn with replacement."""
    return cast(list[Individual], tools.selTournament(population, num_parents, tournament_size))


def scattered_crossover(first: Individual, second: Individual) -> Individual:
    """Return a child that takes each gene from either parent with probability 1/2."""
    child, _ = tools.cxUniform(Individual(first), Individual(second), GENE_SWAP_PROBABILITY)
    return cast(Individual, child)


def local_mutation(genome: Sequence[float], step_size: float) -> Individual:
    """Move few genes by normal steps, clipped to [0, 1]."""
    generator = mutation.random  # as DEAP draws
    share, scale = generator.choice(LOCAL_SHARES), generator.choice(LOCAL_STEPS)
    (mutant,) = tools.mutGaussian(Individual(genome), 0.0, scale * step_size, share)
    return Individual([min(1.0, max(0.0, gene)) for gene in mutant])


@contextmanager
def lent_random(state: State) -> Iterator[None]:
    """Let DEAP draw from our state instead of Python's global generator."""
    own = random.Random()  # noqa: S311
    own.setstate(state.python_state)
    before = [module.random for module in DRAWING]
    for module in DRAWING:
        module.random = own
    try:
        yield
    finally:
        state.python_state = own.getstate()
        for module, theirs in zip(DRAWING, before, strict=True):
            module.random = theirs


def breed(state: State, settings: Optimizer) -> Floats:
    """Return a generation's children, first by crossover, then mutants; shape (children, num_genes).

    With the local mutation, crossover children mutate as well: parents near one another differ little.
    """
    split = split_population(settings)
    num_crossed = 2 * split.crossover
    is_local = settings.mutation == "local"
    with lent_random(state):
        population = [
            Individual(genes, fitness)
            for genes, fitness in zip(state.genomes.tolist(), state.fitness.tolist(), strict=True)
        ]
        parents = select_parents(population, num_crossed + split.mutants, settings.tournament_size)
        pairs = zip(parents[:num_crossed:2], parents[1:num_crossed:2], strict=True)
        children: Sequence[Sequence[float]] = [scattered_crossover(first, second) for first, second in pairs]
        if is_local:
            children = [
                local_mutation(child, state.step_size) for child in [*children, *parents[num_crossed:]]
            ]
    mutants = [
        adaptive_feasible_mutation(np.array(parent), state.step_size, state.generator)
        for parent in (() if is_local else parents[num_crossed:])
    ]
    return np.array([*children, *mutants]).reshape(-1, state.genomes.shape[1])


def scatter(seeds: Floats, settings: Optimizer, state: State) -> Floats:
    """Return a first population of the seeds and their local mutants, shape (population_size, num_genes)."""
    with lent_random(state):
        mutants = [
            local_mutation(seeds[index % len(seeds)].tolist(), settings.initial_step)
            for index in range(settings.population_size - len(seeds))
        ]
    return np.concatenate((seeds, np.array(mutants).reshape(-1, seeds.shape[1])))


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
