"""Generations of one population: the first of a round, and each from the one before.

Smaller fitness is better. The genetic algorithm keeps each generation's elite as it is and fills the rest
with children, first by crossover, then by mutation, whose parents are chosen in tournaments; CMA-ES draws
each generation anew.

The operators and rates are those of Choi, Kim and Leeghim (AAS 25-727), defined as in MATLAB's Global
Optimization Toolbox ("Genetic Algorithm Options"). Instead of its adaptive feasible mutation a local one may
be chosen, which moves few genes a little: for the search near a controller that is already good.
DEAP draws from Python's global generator, which other code uses too: for each generation that is replaced by
one of ours.

CMA-ES (Hansen and Ostermeier, Evolutionary Computation 9, 2001), DEAP's `deap.cma`, samples around a centre
that moves towards the better ones. Genes are sampled unbounded; the nearest point of [0, 1] is evaluated, and
its distance is added to the fitness that the strategy sees, so that it does not drift away from the box.
DEAP draws from NumPy's global generator: it temporarily gets a state of ours, and the caller's is restored.
"""

import math
import random
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, NamedTuple, cast

import numpy as np
from deap import base, cma, tools
from deap.tools import crossover, mutation, selection

from pipeline.array_types import Floats
from pipeline.settings.experiment import Optimizer
from pipeline.training.evolution.state import EvolutionState, Generation

GENE_SWAP_PROBABILITY = 0.5

#: DEAP's modules that draw random numbers
DRAWING = (crossover, mutation, selection)

#: a local mutant moves each gene with one of these probabilities, by one of these multiples of the step: most
#: steps are fine, some are bold
LOCAL_SHARES = (0.01, 0.03, 0.1)
LOCAL_STEPS = (0.3, 1.0, 2.0)


class Split(NamedTuple):
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


def select_parents(population: list[Individual], num_parents: int, tournament_size: int) -> list[Individual]:
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
def lent_random(state: EvolutionState) -> Iterator[None]:
    """Let DEAP draw from our state instead of Python's global generator."""
    generator = random.Random()  # noqa: S311
    generator.setstate(state.python_state)
    before = [module.random for module in DRAWING]
    for module in DRAWING:
        module.random = generator
    try:
        yield
    finally:
        state.python_state = generator.getstate()
        for module, theirs in zip(DRAWING, before, strict=True):
            module.random = theirs


def breed(state: EvolutionState, settings: Optimizer) -> Floats:
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


def scatter(seeds: Floats, settings: Optimizer, state: EvolutionState) -> Floats:
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


#: genomes (n, num_genes) in [0, 1] -> arrays of shape (n,): ``fitness`` and, by any other name, its parts
Evaluate = Callable[[Floats], Mapping[str, Floats]]
#: a round's index and the champion of the one before (None in the first) -> the round's fitness function
EvaluateForRound = Callable[[int, Floats | None], Evaluate]

#: separates the random numbers of the evolution from those of scenarios with the same seed
SPAWN_KEY = 0xE70


def begin(
    evaluate: Evaluate,
    seeds: Floats,
    settings: Optimizer,
    seed: int,
    round_index: int,
    before: EvolutionState | None,
) -> EvolutionState:
    """Make and evaluate the first population of a round.

    Parameters
    ----------
    evaluate : callable
    seeds : (k, num_genes) array
        Genomes to start with; CMA-ES samples around the last of them.
    settings : Optimizer
    seed : int
        Of the evolution; each round has random generators of its own.
    round_index : int
    before : EvolutionState, optional
        The final state of the round before.

    Returns
    -------
    EvolutionState
        With the evaluated population.
    """
    generator = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(SPAWN_KEY, round_index)))
    python_state = random.Random(int(generator.integers(2**63))).getstate()  # noqa: S311
    nobody, step = np.empty((0, seeds.shape[1])), settings.step_of_round(round_index)
    state = EvolutionState(round_index, step, nobody, python_state, generator)
    if before:
        state.evaluations, state.history = before.evaluations, before.history
    is_carried = before is not None and settings.next_round == "carried"
    if settings.algorithm == "cma_es":
        initial = _carried(_strategy(seeds[-1], settings.initial_step, settings))
        state.strategy = before.strategy if before and is_carried else initial
        _sample_generation(state, evaluate, settings)
        return state
    if before and is_carried:
        genomes = before.genomes
    elif settings.first_population == "near":
        genomes = scatter(seeds, settings, state)
    else:
        genomes = state.generator.random((settings.population_size, seeds.shape[1]))
        genomes[: len(seeds)] = seeds
    _evaluate_all(state, evaluate, genomes)
    return state


def advance(state: EvolutionState, evaluate: Evaluate, settings: Optimizer) -> None:
    """Replace a population by the next generation."""
    state.generation += 1
    if settings.algorithm == "cma_es":
        _sample_generation(state, evaluate, settings)
        return
    if settings.mutation == "adaptive_feasible" and state.generation > 1:
        has_improved = state.history[-1].best < state.history[-2].best
        state.step_size = adapt_step_size(state.step_size, has_improved)
    children = breed(state, settings)
    fitness, parts = _evaluated_once(evaluate, children, state)
    # the elite unchanged and in front, then the children
    elite = np.argsort(state.fitness, kind="stable")[: split_population(settings).elite]
    state.genomes = np.concatenate((state.genomes[elite], children))
    state.fitness = np.concatenate((state.fitness[elite], fitness))
    state.parts = {name: np.concatenate((old[elite], parts[name])) for name, old in state.parts.items()}
    state.evaluations += len(children)


def record(state: EvolutionState) -> None:
    """Add the present generation to the history."""
    # the centre of a distribution is better than its luckiest sample
    best = 0 if state.strategy else int(np.argmin(state.fitness))
    state.history.append(
        Generation(
            round=state.round,
            generation=state.generation,
            evaluations=state.evaluations,
            step_size=state.step_size,
            best=float(state.fitness[best]),
            mean=float(np.mean(state.fitness)),
            std=float(np.std(state.fitness, ddof=1)),
            parts={name: float(values[best]) for name, values in state.parts.items()},
            champion=state.genomes[best].copy(),
        )
    )


def _sample_generation(state: EvolutionState, evaluate: Evaluate, settings: Optimizer) -> None:
    """Draw a population from the strategy, evaluate it, and update the strategy."""
    state.step_size = float(state.strategy["sigma"])
    drawn = sample_strategy(state, settings)
    _evaluate_all(state, evaluate, np.clip(drawn, 0.0, 1.0))
    teach_strategy(state, settings, drawn, state.fitness)


def _evaluate_all(state: EvolutionState, evaluate: Evaluate, genomes: Floats) -> None:
    """Evaluate a population and store it in the state."""
    state.genomes = genomes
    state.evaluations += len(genomes)
    state.fitness, state.parts = _evaluated(evaluate, genomes)


def _evaluated_once(
    evaluate: Evaluate, genomes: Floats, state: EvolutionState
) -> tuple[Floats, dict[str, Floats]]:
    """Evaluate a generation's children, each distinct one that is not in the population once.

    Children repeat where a parent is drawn for both sides of a crossover.
    """
    known = np.concatenate((state.genomes, genomes))
    _, first, inverse = np.unique(known, axis=0, return_index=True, return_inverse=True)
    source = first[inverse.reshape(-1)][len(state.genomes) :]
    is_new = source == np.arange(len(state.genomes), len(known))
    none = np.empty(0), dict.fromkeys(state.parts, np.empty(0))
    fitness, parts = _evaluated(evaluate, genomes[is_new]) if is_new.any() else none
    # index of each individual's result among those evaluated, the population first
    at = np.concatenate((np.arange(len(state.genomes)), len(state.genomes) + np.cumsum(is_new) - 1))[source]
    return (
        np.concatenate((state.fitness, fitness))[at],
        {name: np.concatenate((values, parts[name]))[at] for name, values in state.parts.items()},
    )


def _evaluated(evaluate: Evaluate, genomes: Floats) -> tuple[Floats, dict[str, Floats]]:
    """Call the fitness function; return the fitness of each genome, checked to be finite, and its parts."""
    parts = dict(evaluate(genomes.copy()))
    fitness = parts.pop("fitness")
    if not np.all(np.isfinite(fitness)):
        raise ValueError("the fitness function must return 'fitness', a finite number for each genome")
    return fitness, parts


#: state that `deap.cma.Strategy` carries between generations; the rest follows from it
CARRIED = ("centroid", "sigma", "C", "ps", "pc", "update_count")


def _strategy(centre: Floats, step: float, settings: Optimizer) -> Any:
    return cma.Strategy(centroid=centre.copy(), sigma=step, lambda_=settings.population_size - 1)


def sample_strategy(state: EvolutionState, settings: Optimizer) -> Floats:
    """Draw a population, unbounded, with the centre itself first; shape (population_size, num_genes)."""
    strategy = _restored(state.strategy, settings)
    with _lent_global_random(state.generator):
        drawn = strategy.generate(Individual)
    return np.vstack([strategy.centroid, *drawn])


def teach_strategy(state: EvolutionState, settings: Optimizer, drawn: Floats, fitness: Floats) -> None:
    """Update the strategy from the fitness of its samples, without the centre, which it did not draw."""
    strategy = _restored(state.strategy, settings)
    outside = np.sum(np.abs(drawn - np.clip(drawn, 0.0, 1.0)), axis=1)
    judged = fitness + outside * (np.ptp(fitness) + 1e-12)
    strategy.update(
        [Individual(genes.tolist(), float(value)) for genes, value in zip(drawn[1:], judged[1:], strict=True)]
    )
    state.strategy = _carried(strategy)


def _carried(strategy: Any) -> dict[str, Floats]:
    return {name: np.array(getattr(strategy, name), dtype=np.float64) for name in CARRIED}


def _restored(carried: dict[str, Floats], settings: Optimizer) -> Any:
    """Rebuild the strategy; its axes follow from its covariance, as after DEAP's update."""
    strategy = _strategy(carried["centroid"], float(carried["sigma"]), settings)
    for name in CARRIED:
        value = carried[name]
        setattr(strategy, name, float(value) if value.ndim == 0 else value.copy())
    lengths, axes = np.linalg.eigh(strategy.C)
    order = np.argsort(lengths)
    strategy.cond = lengths[order[-1]] / lengths[order[0]]
    strategy.diagD = lengths[order] ** 0.5
    strategy.B = axes[:, order]
    strategy.BD = strategy.B * strategy.diagD
    return strategy


@contextmanager
def _lent_global_random(generator: np.random.Generator) -> Iterator[None]:
    """Seed NumPy's global generator from ours, and restore the caller's afterwards."""
    callers = np.random.get_state()  # noqa: NPY002
    np.random.seed(int(generator.integers(2**32)))  # noqa: NPY002
    try:
        yield
    finally:
        np.random.set_state(callers)  # noqa: NPY002
