"""Generations of one population: the first of a round, and each from the one before.

Smaller fitness is better. The genetic algorithm keeps each generation's elite as it is and fills the rest
with children (`pipeline.training.evolution.genetic`); CMA-ES draws each generation anew.

CMA-ES (Hansen and Ostermeier, Evolutionary Computation 9, 2001), DEAP's `deap.cma`, samples around a centre
that moves towards the better ones. Genes are sampled unbounded; the nearest point of [0, 1] is evaluated, and
its distance is added to the fitness that the strategy sees, so that it does not drift away from the box.
DEAP draws from NumPy's global generator: it temporarily gets a state of ours, and the caller's is restored.
"""

import random
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np
from deap import cma

from pipeline.array_types import Floats
from pipeline.settings.experiment import Optimizer
from pipeline.training.evolution.genetic import Individual, adapt_step_size, breed, scatter, split_population
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
    return State(round_index, step_size, np.empty((0, num_genes)), python_state, generator)


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
        state.strategy = before.strategy if before and is_carried else begin_strategy(seeds[-1], settings)
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


def _sample_generation(state: State, evaluate: Evaluate, settings: Optimizer) -> None:
    """Draw a population from the strategy, evaluate it, and update the strategy."""
    state.step_size = float(state.strategy["sigma"])
    drawn = sample_strategy(state, settings)
    state.genomes = np.clip(drawn, 0.0, 1.0)
    names = state.history[0].parts if state.history else None
    state.fitness, state.parts = _evaluated(evaluate, state.genomes, names)
    state.evaluations += len(drawn)
    teach_strategy(state, settings, drawn, state.fitness)


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


#: state that `deap.cma.Strategy` carries between generations; the rest follows from it
CARRIED = ("centroid", "sigma", "C", "ps", "pc", "update_count")


def begin_strategy(centre: Floats, settings: Optimizer) -> dict[str, Floats]:
    """Return the strategy before its first sample, around a genome."""
    return _carried(
        cma.Strategy(
            centroid=centre.copy(), sigma=settings.initial_step, lambda_=settings.population_size - 1
        )
    )


def sample_strategy(state: State, settings: Optimizer) -> Floats:
    """Draw a population, unbounded, with the centre itself first; shape (population_size, num_genes)."""
    strategy = _restored(state.strategy, settings)
    with _lent_global_random(state.generator):
        drawn = strategy.generate(Individual)
    return np.vstack([strategy.centroid, *drawn])


def teach_strategy(state: State, settings: Optimizer, drawn: Floats, fitness: Floats) -> None:
    """Update the strategy of a state from the fitness of its samples, except that of the centre."""
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
    strategy = cma.Strategy(
        centroid=carried["centroid"].copy(),
        sigma=float(carried["sigma"]),
        lambda_=settings.population_size - 1,
    )
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
