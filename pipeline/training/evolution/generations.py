"""Generations of one population: the first of a round, and each from the one before.

Smaller fitness is better. The genetic algorithm keeps each generation's elite as it is and fills the rest
with children, first by crossover, then by mutation, whose parents are chosen in tournaments; NSGA-II keeps
the best of parents and children by several objectives (`pipeline.training.evolution.front`); CMA-ES draws
each generation anew. First rounds of the genetic algorithm may be CMA-ES's, among the few genes of planes.

Operators are in `pipeline.training.evolution.operators`, rates those of Choi, Kim and Leeghim (AAS 25-727).

CMA-ES (Hansen and Ostermeier, Evolutionary Computation 9, 2001), DEAP's `deap.cma`, samples around a centre
that moves towards the better ones. Genes are sampled unbounded; the nearest point of [0, 1] is evaluated, and
its distance is added to the fitness that the strategy sees, so that it does not drift away from the box.
The normal numbers are ours, as DEAP would draw them from NumPy's global generator.
"""

import random
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from deap import cma

from pipeline.array_types import Floats
from pipeline.settings.training import CmaEs, GeneticAlgorithm, Nsga2, Optimizer
from pipeline.training.evolution import front
from pipeline.training.evolution.operators import (
    Individual,
    adapt_step_size,
    adaptive_feasible_mutation,
    local_mutation,
    scattered_crossover,
    select_parents,
)
from pipeline.training.evolution.state import EvolutionState, Generation, drawing


class Split(NamedTuple):
    """Number of individuals of a generation from each source."""

    elite: int
    crossover: int
    mutants: int


def split_population(settings: GeneticAlgorithm) -> Split:
    """Convert rates into numbers of individuals.

    With `split` = ``whole`` the crossover rate applies to the whole population (of 200 at 0.1 and 0.8: 20,
    160, 20), with ``rest`` to all but the elite (20, 144, 36). Mutants make up the rest.
    """
    size = settings.population_size
    elite = max(1, round(settings.elitism_rate * size))
    counted = size if settings.split == "whole" else size - elite
    crossover = min(size - elite, round(settings.crossover_rate * counted))
    return Split(elite, crossover, size - elite - crossover)


def breed(state: EvolutionState, settings: GeneticAlgorithm) -> Floats:
    """Return a generation's children, first by crossover, then mutants; shape (children, num_genes).

    With the local mutation, crossover children mutate as well: parents near one another differ little.
    """
    split = split_population(settings)
    num_crossed = 2 * split.crossover
    is_local = settings.mutation == "local"
    with drawing(state) as generator:
        population = [
            Individual(genes, fitness)
            for genes, fitness in zip(state.genomes.tolist(), state.fitness.tolist(), strict=True)
        ]
        parents = select_parents(population, num_crossed + split.mutants, settings.tournament_size, generator)
        pairs = zip(parents[:num_crossed:2], parents[1:num_crossed:2], strict=True)
        children: Sequence[Sequence[float]] = [
            scattered_crossover(first, second, generator) for first, second in pairs
        ]
        if is_local:
            children = [
                local_mutation(child, state.step_size, generator)
                for child in [*children, *parents[num_crossed:]]
            ]
    mutants = [
        adaptive_feasible_mutation(np.array(parent), state.step_size, state.generator)
        for parent in (() if is_local else parents[num_crossed:])
    ]
    return np.array([*children, *mutants]).reshape(-1, state.genomes.shape[1])


def scatter(seeds: Floats, settings: Optimizer, state: EvolutionState) -> Floats:
    """Return a first population of the seeds and their local mutants, shape (population_size, num_genes)."""
    with drawing(state) as generator:
        mutants = [
            local_mutation(seeds[index % len(seeds)].tolist(), settings.initial_step, generator)
            for index in range(settings.population_size - len(seeds))
        ]
    return np.concatenate((seeds, np.array(mutants).reshape(-1, seeds.shape[1])))


#: genomes (n, num_genes) in [0, 1] -> arrays of shape (n,): ``fitness`` and, by any other name, its parts
Evaluate = Callable[[Floats], Mapping[str, Floats]]
#: a round's index and the champion of the one before (None in the first) -> the round's fitness function
EvaluateForRound = Callable[[int, Floats | None], Evaluate]


class Subspace(NamedTuple):
    """Genomes that fewer genes describe."""

    start: Floats  # genes in [0, 1] to start from, (k,)
    expand: Callable[[Floats], Floats]  # from genes, (n, k), to whole genomes, (n, num_genes)


#: separates the random numbers of the evolution from those of scenarios with the same seed
SPAWN_KEY = 0xE70


def begin(
    evaluate: Evaluate,
    seeds: Floats,
    settings: Optimizer,
    seed: int,
    round_index: int,
    before: EvolutionState | None,
    planes: Subspace | None = None,
) -> EvolutionState:
    """Make and evaluate the first population of a round.

    Parameters
    ----------
    evaluate : callable
    seeds : (k, num_genes) array
        Genomes to start with; CMA-ES samples around the last of them.
    settings : Optimizer
        Of the round.
    seed : int
        Of the evolution; each round has random generators of its own.
    round_index : int
    before : EvolutionState, optional
        The final state of the round before.
    planes : Subspace, optional
        Where CMA-ES samples in this round.

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
    if isinstance(settings, CmaEs):
        initial = _carried(_strategy(planes.start if planes else seeds[-1], step, settings))
        state.strategy = before.strategy if before and is_carried else initial
        _sample_generation(state, evaluate, settings, planes)
        return state
    follows_planes = before is not None and bool(before.strategy)
    if before and is_carried and not follows_planes:
        genomes = before.genomes
    elif not isinstance(settings, GeneticAlgorithm) or settings.first_population == "near" or follows_planes:
        genomes = scatter(seeds, settings, state)
    else:
        genomes = state.generator.random((settings.population_size, seeds.shape[1]))
        genomes[: len(seeds)] = seeds
    _evaluate_all(state, evaluate, genomes)
    return state


def advance(
    state: EvolutionState, evaluate: Evaluate, settings: Optimizer, planes: Subspace | None = None
) -> None:
    """Replace a population by the next generation; see `begin` for the planes."""
    state.generation += 1
    if isinstance(settings, Nsga2):
        _select_generation(state, evaluate, settings)
        return
    if not isinstance(settings, GeneticAlgorithm):
        _sample_generation(state, evaluate, settings, planes)
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


def _select_generation(state: EvolutionState, evaluate: Evaluate, settings: Nsga2) -> None:
    """Evaluate as many children as there are parents, and keep the best of both by their objectives."""
    children = front.breed_for_front(state, settings)
    fitness, parts = _evaluated_once(evaluate, children, state)
    fitness = np.concatenate((state.fitness, fitness))
    parts = {name: np.concatenate((old, parts[name])) for name, old in state.parts.items()}
    kept = front.survivors(front.objectives_of(parts), fitness, settings.population_size)
    state.genomes = np.concatenate((state.genomes, children))[kept]
    state.fitness, state.parts = fitness[kept], {name: values[kept] for name, values in parts.items()}
    state.evaluations += len(children)


def _sample_generation(
    state: EvolutionState, evaluate: Evaluate, settings: Optimizer, planes: Subspace | None
) -> None:
    """Draw a population from the strategy, evaluate it, and update the strategy."""
    state.step_size = float(state.strategy["sigma"])
    drawn = sample_strategy(state, settings)
    genes = np.clip(drawn, 0.0, 1.0)
    _evaluate_all(state, evaluate, planes.expand(genes) if planes else genes)
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
    """Return a CMA-ES strategy; one individual of a generation is the centre itself."""
    return cma.Strategy(centroid=centre.copy(), sigma=step, lambda_=settings.population_size - 1)


def sample_strategy(state: EvolutionState, settings: Optimizer) -> Floats:
    """Draw a population, unbounded, with the centre itself first; shape (population_size, num_genes)."""
    strategy = _restored(state.strategy, settings)
    legacy = np.random.RandomState(int(state.generator.integers(2**32)))
    normal = legacy.standard_normal((strategy.lambda_, strategy.dim))
    return np.vstack([strategy.centroid, strategy.centroid + strategy.sigma * np.dot(normal, strategy.BD.T)])


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
    """Return the arrays of a strategy that a checkpoint holds."""
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
