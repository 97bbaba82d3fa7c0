"""Rounds of evolution: from fitness functions to a champion of each generation.

Smaller fitness is better. One population (`pipeline.training.evolution.generations`) or several
(`pipeline.training.evolution.islands`) evolve for a round, which has its own fitness function; the next
one starts from the champion, or continues with the population, evaluated again.
All randomness comes from one seed.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from deap import tools

from pipeline.array_types import Floats
from pipeline.run.engine import crew
from pipeline.settings.experiment import Engine, Optimizer
from pipeline.training.evolution import generations, nsga2
from pipeline.training.evolution.checkpoint import load, save
from pipeline.training.evolution.generations import EvaluateForRound
from pipeline.training.evolution.islands import Islands
from pipeline.training.evolution.state import Generation, State

#: called with the history so far, after each generation or, with islands, after each migration
OnGeneration = Callable[[Sequence[Generation]], None]


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
        Of the last population, if there are two objectives (NSGA-II).
    interrupted : bool
        Whether it was interrupted from the keyboard.
    """

    champion: Floats
    fitness: float
    parts: Mapping[str, float]
    round_champions: Floats
    history: tuple[Generation, ...]
    logbook: Any
    front: nsga2.Front | None
    interrupted: bool


class _Way(Protocol):
    """How a round runs: with one population, or with islands."""

    def enter(self, round_index: int, champion: Floats | None) -> None:
        """Prepare for a round, given the champion of the one before."""

    def begin(self, round_index: int, seeds: Floats, before: State | None) -> State:
        """Return the first population of a round, with its history entry."""

    def advance(self, state: State) -> None:
        """Replace a population by the next, and add it to the history."""


class _OnePopulation:
    """A round of a single population."""

    def __init__(self, evaluate_for_round: EvaluateForRound, settings: Optimizer, seed: int) -> None:
        self._evaluate_for_round, self._settings, self._seed = evaluate_for_round, settings, seed

    def enter(self, round_index: int, champion: Floats | None) -> None:
        self._evaluate = self._evaluate_for_round(round_index, champion)

    def begin(self, round_index: int, seeds: Floats, before: State | None) -> State:
        step = self._settings.step_of_round(round_index)
        state = generations.unpopulated(self._seed, (round_index,), round_index, seeds.shape[1], step)
        if before:
            state.evaluations, state.history = before.evaluations, before.history
        generations.begin(state, self._evaluate, seeds, self._settings, before)
        generations.record(state)
        return state

    def advance(self, state: State) -> None:
        generations.advance(state, self._evaluate, self._settings)
        generations.record(state)


@contextmanager
def _way(
    evaluate_for_round: EvaluateForRound, settings: Optimizer, seed: int, engine: Engine
) -> Iterator[_Way]:
    if settings.islands == 1:
        yield _OnePopulation(evaluate_for_round, settings, seed)
        return
    with crew(engine) as do_all:
        yield Islands(evaluate_for_round, settings, seed, do_all)


def _is_finished(state: State, settings: Optimizer) -> bool:
    """Return whether a round has had its generations, or none of the last `stall_generations` was better."""
    if state.generation >= settings.generations:
        return True
    patience = settings.stall_generations
    if patience is None or state.generation < patience:
        return False
    return state.history[-1].best >= state.history[-1 - patience].best


def _outcome(history: Sequence[Generation], front: nsga2.Front | None, interrupted: bool) -> Evolution:
    """Return the result of an evolution from its history."""
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
    """Return everything that must be the same for a resumed run to equal an uninterrupted one."""
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
        *(("islands", "migrate_every", "migrants") if settings.islands > 1 else ()),
    )
    return {"seed": seed, "genes": num_genes} | {f"optimizer.{n}": getattr(settings, n) for n in names}


def _champion_before(history: Sequence[Generation], round_index: int) -> Floats | None:
    """Return the champion of the previous round."""
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
    engine: Engine | None = None,
) -> Evolution:
    """Evolve for `settings.rounds` rounds.

    Parameters
    ----------
    evaluate_for_round : callable
        Takes a round's index and the champion of the round before, None in the first, and returns the round's
        fitness function; the same arguments must give the same function, or a resumed run differs from an
        uninterrupted one. A fitness function takes genomes of shape
        (n, num_genes) and returns arrays of shape (n,): ``fitness``, to be minimised, and its parts. It must
        evaluate each genome independently, as it gets only new ones of a generation: neither the elite nor a
        child equal to another, or to one of the population before, is evaluated again within a round.
    num_genes : int
        Genes of a genome.
    settings : Optimizer
        Sizes and rates.
    seed : int
        Of all randomness here.
    initial : (k, num_genes) array, optional
        Genomes that the first round's population starts with; CMA-ES starts around the last of them.
    checkpoint : Path, optional
        File for the state after every generation (.npz).
    resume : bool
        Resume from the checkpoint if there is one; the result is that of an uninterrupted run, bit for bit.
    on_generation : callable, optional
        Called after every generation with the history so far, including earlier runs', and with that of the
        checkpoint before resuming; with islands, at every migration.
    engine : Engine, optional
        Runs the islands; this process unless given.

    Returns
    -------
    Evolution
        After an interrupt from the keyboard: the champion so far.

    Raises
    ------
    CheckpointError
        If the checkpoint is damaged or belongs to other settings.
    pipeline.run.processes.EngineError
        If the engine is not available, or disappears.
    ValueError
        If initial genomes are missing where the search is local, or they or the results of the fitness
        function have the wrong shape or are not finite.
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
            # the last run may have been killed before its last generation was written
            on_generation(tuple(state.history))
    history = state.history if state else []

    def finish_generation(state: State) -> None:
        if checkpoint is not None:
            save(checkpoint, state, fingerprint)
        if on_generation is not None:
            on_generation(tuple(state.history))

    interrupted = False
    try:
        with _way(evaluate_for_round, settings, seed, engine or Engine()) as way:
            for round_index in range(state.round if state else 0, settings.rounds):
                way.enter(round_index, _champion_before(history, round_index))
                if state is None or state.round < round_index:
                    state = way.begin(round_index, seeds, state)
                    history = state.history
                    finish_generation(state)
                while not _is_finished(state, settings):
                    way.advance(state)
                    finish_generation(state)
                seeds = history[-1].champion[np.newaxis]
    except KeyboardInterrupt:
        if not history:
            raise
        interrupted = True
    front = nsga2.front_of(state) if state and settings.algorithm == "nsga2" else None
    return _outcome(history, front, interrupted)
