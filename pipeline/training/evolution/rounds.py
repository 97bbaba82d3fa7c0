"""Rounds of evolution: populations from their fitness, a champion from each generation.

Smaller fitness is better. The genetic algorithm keeps each generation's elite as it is and fills the rest
with children (`pipeline.training.evolution.genetic`); CMA-ES draws each generation anew
(`pipeline.training.evolution.cma_es`); NSGA-II keeps the best of parents and children by two objectives
(`pipeline.training.evolution.nsga2`). A round has a fitness function of its own; the next one starts afresh
from the champion, or goes on with the population as it is, judged anew.

Everything random comes from one seed.
"""

import random
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from deap import tools
from numpy.typing import NDArray

from pipeline.settings.experiment import Optimizer
from pipeline.training.evolution import cma_es, nsga2
from pipeline.training.evolution.checkpoint import load, save
from pipeline.training.evolution.genetic import breed, scatter, split_population
from pipeline.training.evolution.mutation import adapt_step_size
from pipeline.training.evolution.state import Generation, State

Floats = NDArray[np.float64]

#: genomes (n, num_genes) in [0, 1] -> arrays of shape (n,): ``fitness`` and, by any other name, its parts
Evaluate = Callable[[Floats], Mapping[str, Floats]]
#: a round's index and the champion of the one before (None in the first) -> the round's fitness function
EvaluateForRound = Callable[[int, Floats | None], Evaluate]
#: called after each generation with the history so far; the newest is the last
OnGeneration = Callable[[Sequence[Generation]], None]

#: keeps the draws of the evolution apart from those of scenarios made from the same seed
SPAWN_KEY = 0xE70


@dataclass(frozen=True)
class Evolution:
    """The result of an evolution.

    Parameters
    ----------
    champion : (num_genes,) array
        The best genome of the last round that was evaluated.
    fitness : float
        Its fitness in that round.
    parts : mapping of str to float
        The parts of that fitness.
    round_champions : (rounds begun, num_genes) array
        The best genome of each round.
    history : tuple of Generation
        One for each generation of each round.
    logbook : deap.tools.Logbook
        The same as rows of plain numbers.
    front : Front, optional
        Of the last population, where there are two objectives (NSGA-II).
    interrupted : bool
        Whether it was stopped from the keyboard before its end.
    """

    champion: Floats
    fitness: float
    parts: Mapping[str, float]
    round_champions: Floats
    history: tuple[Generation, ...]
    logbook: Any
    front: nsga2.Front | None
    interrupted: bool


def _evaluated(
    evaluate: Evaluate, genomes: Floats, names: Iterable[str] | None
) -> tuple[Floats, dict[str, Floats]]:
    """Call the fitness function and check what it returns; `names` are the parts of earlier generations."""
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


def _judged(evaluate: Evaluate, genomes: Floats, state: State) -> tuple[Floats, dict[str, Floats]]:
    """Call the fitness function for what is new in a generation: neither in the population nor met before.

    Parents that are drawn for both sides of a crossover have children that equal them.
    """
    known = np.concatenate((state.genomes, genomes))
    _, first, place = np.unique(known, axis=0, return_index=True, return_inverse=True)
    source = first[place.reshape(-1)][len(state.genomes) :]
    is_new = source == np.arange(len(state.genomes), len(known))
    fitness, parts = _evaluated(evaluate, genomes[is_new], state.parts)
    # where among those judged, the population first, the result of each stands
    at = np.concatenate((np.arange(len(state.genomes)), len(state.genomes) + np.cumsum(is_new) - 1))[source]
    return (
        np.concatenate((state.fitness, fitness))[at],
        {name: np.concatenate((values, parts[name]))[at] for name, values in state.parts.items()},
    )


def _record(state: State) -> None:
    """Note the present generation in the history."""
    # the centre of a distribution is better than the luckiest of its samples
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


def _begin_round(
    evaluate: Evaluate,
    seeds: Floats,
    settings: Optimizer,
    seed: int,
    history: list[Generation],
    before: State | None,
) -> State:
    """Make and evaluate the first population of the round after those in the history."""
    round_index = history[-1].round + 1 if history else 0
    generator = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(SPAWN_KEY, round_index)))
    python_state = random.Random(int(generator.integers(2**63))).getstate()  # noqa: S311
    state = State(
        round=round_index,
        generation=0,
        evaluations=history[-1].evaluations if history else 0,
        step_size=settings.step_of_round(round_index),
        genomes=np.empty((0, seeds.shape[1])),
        fitness=np.empty(0),
        parts={},
        python_state=python_state,
        generator=generator,
        history=history,
    )
    is_carried = before is not None and settings.next_round == "carried"
    if settings.algorithm == "cma_es":
        state.strategy = before.strategy if before and is_carried else cma_es.begin(seeds[-1], settings)
        _sample_generation(state, evaluate, settings)
        return state
    if before and is_carried:
        genomes = before.genomes
    elif settings.first_population == "near":
        genomes = scatter(seeds, settings, state)
    else:
        genomes = generator.random((settings.population_size, seeds.shape[1]))
        genomes[: len(seeds)] = seeds
    state.genomes = genomes
    state.fitness, state.parts = _evaluated(evaluate, genomes, history[0].parts if history else None)
    state.evaluations += len(genomes)
    return state


def _advance(state: State, evaluate: Evaluate, settings: Optimizer) -> None:
    """Replace a population by the next."""
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
    fitness, parts = _judged(evaluate, children, state)
    # the elite unchanged and in front, then the children
    elite = np.argsort(state.fitness, kind="stable")[: split_population(settings).elite]
    state.genomes = np.concatenate((state.genomes[elite], children))
    state.fitness = np.concatenate((state.fitness[elite], fitness))
    state.parts = {name: np.concatenate((old[elite], parts[name])) for name, old in state.parts.items()}
    state.evaluations += len(children)


def _select_generation(state: State, evaluate: Evaluate, settings: Optimizer) -> None:
    """Judge as many children as there are parents, and keep the best of both by their objectives."""
    children = nsga2.breed(state, settings)
    fitness, parts = _judged(evaluate, children, state)
    fitness = np.concatenate((state.fitness, fitness))
    parts = {name: np.concatenate((old, parts[name])) for name, old in state.parts.items()}
    kept = nsga2.survivors(nsga2.objectives_of(parts), fitness, settings.population_size)
    state.genomes = np.concatenate((state.genomes, children))[kept]
    state.fitness, state.parts = fitness[kept], {name: values[kept] for name, values in parts.items()}
    state.evaluations += len(children)


def _sample_generation(state: State, evaluate: Evaluate, settings: Optimizer) -> None:
    """Draw a population from the strategy, judge it, and let the strategy learn from it."""
    state.step_size = float(state.strategy["sigma"])
    drawn = cma_es.sample(state, settings)
    state.genomes = np.clip(drawn, 0.0, 1.0)
    names = state.history[0].parts if state.history else None
    state.fitness, state.parts = _evaluated(evaluate, state.genomes, names)
    state.evaluations += len(drawn)
    cma_es.learn(state, settings, drawn, state.fitness)


def _is_finished(state: State, settings: Optimizer) -> bool:
    """Tell whether a round has had its generations, or none of the last `stall_generations` was better."""
    if state.generation >= settings.generations:
        return True
    patience = settings.stall_generations
    if patience is None or state.generation < patience:
        return False
    return state.history[-1].best >= state.history[-1 - patience].best


def _outcome(history: Sequence[Generation], front: nsga2.Front | None, interrupted: bool) -> Evolution:
    """Sum up an evolution from its history."""
    logbook = tools.Logbook()
    for generation in history:
        logbook.record(**generation.row(), **generation.parts)
    logbook.header = list(logbook[0])
    last_of_round = {generation.round: generation.champion for generation in history}
    return Evolution(
        champion=history[-1].champion,
        fitness=history[-1].best,
        parts=history[-1].parts,
        round_champions=np.array([last_of_round[index] for index in sorted(last_of_round)]),
        history=tuple(history),
        logbook=logbook,
        front=front,
        interrupted=interrupted,
    )


def _checked_seeds(initial: Floats | None, num_genes: int, population_size: int) -> Floats:
    """Return the initial genomes as an array of shape (k, num_genes)."""
    if initial is None:
        return np.empty((0, num_genes))
    seeds = np.asarray(initial, dtype=np.float64)
    is_shaped = seeds.ndim == 2 and seeds.shape[1] == num_genes and len(seeds) <= population_size
    if not is_shaped or not np.all((seeds >= 0.0) & (seeds <= 1.0)):
        raise ValueError(
            f"the initial genomes have shape {seeds.shape}; they must be at most {population_size} rows "
            f"of {num_genes} genes in [0, 1]"
        )
    return seeds


def _check_that_there_is_a_beginning(seeds: Floats, settings: Optimizer) -> None:
    is_local = settings.algorithm == "cma_es" or settings.first_population == "near"
    if is_local and not len(seeds):
        raise ValueError("this search begins near a genome, but there is no initial one; give at least one")


def _fingerprint(settings: Optimizer, seed: int, num_genes: int) -> dict[str, Any]:
    """Name everything that must be the same for a resumed run to equal an uninterrupted one."""
    names = (
        "algorithm",
        "population_size",
        "tournament_size",
        "crossover_rate",
        "elitism_rate",
        "split",
        "mutation",
        "first_population",
        "next_round",
        "initial_step",
        "cooling",
    )
    return {"seed": seed, "genes": num_genes} | {f"optimizer.{n}": getattr(settings, n) for n in names}


def _champion_before(history: Sequence[Generation], round_index: int) -> Floats | None:
    """Return the champion with which the round before a round ended."""
    earlier = [generation.champion for generation in history if generation.round < round_index]
    return earlier[-1] if earlier else None


def evolve_rounds(
    evaluate_for_round: EvaluateForRound,
    num_genes: int,
    settings: Optimizer,
    seed: int,
    *,
    initial: Floats | None = None,
    checkpoint: Path | None = None,
    resume: bool = False,
    on_generation: OnGeneration | None = None,
) -> Evolution:
    """Evolve for `settings.rounds` rounds.

    Parameters
    ----------
    evaluate_for_round : callable
        Takes a round's index and the champion of the round before, None in the first, and returns the round's
        fitness function; the same arguments must give the same function, or a resumed run differs from an
        uninterrupted one. A fitness function takes genomes of shape
        (n, num_genes) and returns arrays of shape (n,): ``fitness``, to be made small, and its parts. It must
        judge each genome for itself, for it sees what is new in a generation only: neither the elite nor a
        child that equals another, or one of the population before, is evaluated again within a round.
    num_genes : int
        Genes of a genome.
    settings : Optimizer
        Sizes and rates.
    seed : int
        Of everything random here.
    initial : (k, num_genes) array, optional
        Genomes that the first round's population starts with; CMA-ES starts around the last of them.
    checkpoint : Path, optional
        Where to write the state after every generation (.npz).
    resume : bool
        Go on from the checkpoint where there is one; the result is that of an uninterrupted run, bit for bit.
    on_generation : callable, optional
        Called after every generation with the history so far, earlier runs' included, and with that of the
        checkpoint before going on from it.

    Returns
    -------
    Evolution
        After an interrupt from the keyboard: the champion so far.

    Raises
    ------
    CheckpointError
        If the checkpoint is damaged or belongs to other settings.
    ValueError
        If initial genomes are missing where the search is local, or they or what the fitness function returns
        are of the wrong shape or not finite.
    KeyboardInterrupt
        If there is no champion yet.
    """
    seeds = _checked_seeds(initial, num_genes, settings.population_size)
    _check_that_there_is_a_beginning(seeds, settings)
    fingerprint = _fingerprint(settings, seed, num_genes)
    state: State | None = None
    if resume and checkpoint is not None and checkpoint.exists():
        state = load(checkpoint, fingerprint)
        if on_generation is not None:
            # whoever was told of the last generation may have been killed before it was written down
            on_generation(tuple(state.history))
    history = state.history if state else []

    def finish_generation(state: State) -> None:
        _record(state)
        if checkpoint is not None:
            save(checkpoint, state, fingerprint)
        if on_generation is not None:
            on_generation(tuple(state.history))

    interrupted = False
    try:
        for round_index in range(state.round if state else 0, settings.rounds):
            evaluate = evaluate_for_round(round_index, _champion_before(history, round_index))
            if state is None or state.round < round_index:
                state = _begin_round(evaluate, seeds, settings, seed, history, state)
                finish_generation(state)
            while not _is_finished(state, settings):
                _advance(state, evaluate, settings)
                finish_generation(state)
            seeds = history[-1].champion[np.newaxis]
    except KeyboardInterrupt:
        if not history:
            raise
        interrupted = True
    front = nsga2.front_of(state) if state and settings.algorithm == "nsga2" else None
    return _outcome(history, front, interrupted)
