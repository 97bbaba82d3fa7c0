"""Generations of one population: the first of a round, and each from the one before.

Smaller fitness is better. The genetic algorithm keeps each generation's elite as it is and fills the rest
with children, and NSGA-II keeps the best of parents and children by two objectives
(`pipeline.training.evolution.genetic`); CMA-ES draws each generation anew
(`pipeline.training.evolution.cma_es`).
"""

import random
from collections.abc import Callable, Iterable, Mapping

import numpy as np

from pipeline.array_types import Floats
from pipeline.settings.experiment import Optimizer
from pipeline.training.evolution import cma_es, genetic
from pipeline.training.evolution.genetic import adapt_step_size, breed, scatter, split_population
from pipeline.training.evolution.state import Generation, State

#: genomes (n, num_genes) in [0, 1] -> arrays of shape (n,): ``fitness`` and, by any other name, its parts
Evaluate = Callable[[Floats], Mapping[str, Floats]]
#: a round's index and the champion of the one before (None in the first) -> the round's fitness function
EvaluateForRound = Callable[[int, Floats | None], Evaluate]

#: separates the random numbers of the evolution from those of scenarios with the same seed
SPAWN_KEY = 0xE70


def unpopulated(seed: int, key: tuple[int, ...], round_index: int, num_genes: int, step_size: float) -> State:
    """Return the state before the first population of a round: its random generators and no individuals.

    Parameters
    ----------
    seed : int
    key : tuple of int
        Separates its random numbers from those of other states with the same seed.
    round_index, num_genes : int
    step_size : float
    """
    generator = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(SPAWN_KEY, *key)))
    python_state = random.Random(int(generator.integers(2**63))).getstate()  # noqa: S311
    return State(
        round=round_index,
        generation=0,
        evaluations=0,
        step_size=step_size,
        genomes=np.empty((0, num_genes)),
        fitness=np.empty(0),
        parts={},
        python_state=python_state,
        generator=generator,
    )


def begin(state: State, evaluate: Evaluate, seeds: Floats, settings: Optimizer, before: State | None) -> None:
    """Make and evaluate the first population of a round.

    Parameters
    ----------
    state : State
        Of `unpopulated`.
    evaluate : callable
    seeds : (k, num_genes) array
        Genomes to start with; CMA-ES samples around the last of them.
    settings : Optimizer
    before : State, optional
        The final state of the round before.
    """
    is_carried = before is not None and settings.next_round == "carried"
    if settings.algorithm == "cma_es":
        state.strategy = before.strategy if before and is_carried else cma_es.begin(seeds[-1], settings)
        _sample_generation(state, evaluate, settings)
        return
    if before and is_carried:
        genomes = before.genomes
    elif settings.first_population == "near":
        genomes = scatter(seeds, settings, state)
    else:
        genomes = state.generator.random((settings.population_size, seeds.shape[1]))
        genomes[: len(seeds)] = seeds
    state.genomes = genomes
    names = state.history[0].parts if state.history else None
    state.fitness, state.parts = _evaluated(evaluate, genomes, names)
    state.evaluations += len(genomes)


def advance(state: State, evaluate: Evaluate, settings: Optimizer) -> None:
    """Replace a population by the next generation."""
    state.generation += 1
    if settings.algorithm == "cma_es":
        _sample_generation(state, evaluate, settings)
        return
    if settings.algorithm == "nsga2":
        _select_generation(state, evaluate, settings)
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


def record(state: State) -> None:
    """Add the present generation to the history."""
    # the centre of a distribution is better than its luckiest sample
    best = 0 if state.strategy else int(np.argmin(state.fitness))
    state.history.append(
        Generation(
            round=state.round,
            generation=state.generation,
            evaluations=state.evaluations,
            best=float(state.fitness[best]),
            mean=float(np.mean(state.fitness)),
            std=float(np.std(state.fitness, ddof=1)),
            step_size=state.step_size,
            parts={name: float(values[best]) for name, values in state.parts.items()},
            champion=state.genomes[best].copy(),
        )
    )


def _select_generation(state: State, evaluate: Evaluate, settings: Optimizer) -> None:
    """Evaluate as many children as there are parents, and keep the best of both by their objectives."""
    children = genetic.breed_front(state, settings)
    fitness, parts = _evaluated_once(evaluate, children, state)
    fitness = np.concatenate((state.fitness, fitness))
    parts = {name: np.concatenate((old, parts[name])) for name, old in state.parts.items()}
    kept = genetic.survivors(genetic.objectives_of(parts), fitness, settings.population_size)
    state.genomes = np.concatenate((state.genomes, children))[kept]
    state.fitness, state.parts = fitness[kept], {name: values[kept] for name, values in parts.items()}
    state.evaluations += len(children)


def _sample_generation(state: State, evaluate: Evaluate, settings: Optimizer) -> None:
    """Draw a population from the strategy, evaluate it, and update the strategy."""
    state.step_size = float(state.strategy["sigma"])
    drawn = cma_es.sample(state, settings)
    state.genomes = np.clip(drawn, 0.0, 1.0)
    names = state.history[0].parts if state.history else None
    state.fitness, state.parts = _evaluated(evaluate, state.genomes, names)
    state.evaluations += len(drawn)
    cma_es.learn(state, settings, drawn, state.fitness)


def _evaluated_once(evaluate: Evaluate, genomes: Floats, state: State) -> tuple[Floats, dict[str, Floats]]:
    """Evaluate the new individuals of a generation: neither in the population nor repeated.

    A parent drawn for both sides of a crossover has a child equal to it.
    """
    known = np.concatenate((state.genomes, genomes))
    _, first, place = np.unique(known, axis=0, return_index=True, return_inverse=True)
    source = first[place.reshape(-1)][len(state.genomes) :]
    is_new = source == np.arange(len(state.genomes), len(known))
    none = np.empty(0), dict.fromkeys(state.parts, np.empty(0))
    fitness, parts = _evaluated(evaluate, genomes[is_new], state.parts) if is_new.any() else none
    # index of each individual's result among those evaluated, the population first
    at = np.concatenate((np.arange(len(state.genomes)), len(state.genomes) + np.cumsum(is_new) - 1))[source]
    return (
        np.concatenate((state.fitness, fitness))[at],
        {name: np.concatenate((values, parts[name]))[at] for name, values in state.parts.items()},
    )


def _evaluated(
    evaluate: Evaluate, genomes: Floats, names: Iterable[str] | None
) -> tuple[Floats, dict[str, Floats]]:
    """Call the fitness function and check its result; `names` are the parts of earlier generations."""
    columns = {
        name: np.asarray(values, dtype=np.float64) for name, values in evaluate(genomes.copy()).items()
    }
    for name, values in columns.items():
        if values.shape != (len(genomes),):
            raise ValueError(
                f"the fitness function returned {name!r} of shape {values.shape} for {len(genomes)} genomes; "
                f"it must return one number for each, shape ({len(genomes)},)"
            )
    if "fitness" not in columns or not np.all(np.isfinite(columns["fitness"])):
        raise ValueError("the fitness function must return 'fitness', a finite number for each genome")
    fitness = columns.pop("fitness")
    if names is not None and set(names) != set(columns):
        raise ValueError(f"the fitness function returned the parts {sorted(columns)} after {sorted(names)}")
    return fitness, columns
