"""Rounds of evolution: from fitness functions to a champion of each generation.

Smaller fitness is better. One population (`pipeline.training.evolution.generations`) or several, the islands,
evolve for a round, which has its own fitness function; the next one starts from the champion, or continues
with the population, evaluated again. All randomness comes from one seed.

Islands are populations that evolve separately and periodically send their best to the next: the island model
(Cohoon, Hegde, Martin and Richards, "Punctuated equilibria: a parallel genetic algorithm", ICGA 1987) on a
ring. An island's work between two migrations depends only on its `Leg`, so that it is the same wherever it
runs, and on however many processes. All islands together are one `State`: their populations one after the
other, and the step of each island's mutation under `STEPS`.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.array_types import Floats
from pipeline.run.engine import Each, crew
from pipeline.settings.experiment import Engine, Optimizer
from pipeline.training.evolution import generations, genetic
from pipeline.training.evolution.generations import EvaluateForRound
from pipeline.training.evolution.state import Generation, State, load, save

#: called with the history so far, after each generation or, with islands, after each migration
OnGeneration = Callable[[Sequence[Generation]], None]


@dataclass(frozen=True)
class Evolution:
    """The result of an evolution.

    Parameters
    ----------
    history : tuple of Generation
        One for each generation of each round.
    front : Front, optional
        Of the last population, if there are two objectives (NSGA-II).
    interrupted : bool
        Whether it was interrupted from the keyboard.
    """

    history: tuple[Generation, ...]
    front: genetic.Front | None
    interrupted: bool


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


#: key in a state's strategy
STEPS = "island_step_sizes"


@dataclass(frozen=True)
class Leg:
    """An island's work between two migrations; plain data.

    Parameters
    ----------
    settings : Optimizer
        Of the island: its share of the population.
    seed, number, round, generation : int
        Of the training; of the island; the round, and the generation before its first.
    generations : int
        Number of generations; zero for the first population of a round.
    champion : (num_genes,) array, optional
        Of the round before.
    seeds : (k, num_genes) array
        Genomes to start a first population with.
    genomes, fitness, parts, step_size
        The island as the last migration left it; no genomes if it is to be drawn.
    """

    settings: Optimizer
    seed: int
    number: int
    round: int
    generation: int
    generations: int
    champion: Floats | None
    seeds: Floats
    genomes: Floats
    fitness: Floats
    parts: dict[str, Floats]
    step_size: float


def travel(evaluate_for_round: EvaluateForRound, leg: Leg) -> State:
    """Evolve an island for a leg; the history of the returned state is that of the leg."""
    evaluate = evaluate_for_round(leg.round, leg.champion)
    key = (leg.round, leg.generation, leg.number)
    state = generations.unpopulated(leg.seed, key, leg.round, leg.seeds.shape[1], leg.step_size)
    before = replace(state, genomes=leg.genomes) if len(leg.genomes) else None
    if leg.generations == 0:
        generations.begin(state, evaluate, leg.seeds, leg.settings, before)
        generations.record(state)
        return state
    state.genomes, state.fitness, state.parts = leg.genomes, leg.fitness, leg.parts
    generations.record(state)
    for _ in range(leg.generations):
        generations.advance(state, evaluate, leg.settings)
        generations.record(state)
    del state.history[0]  # the generation it was sent with
    return state


class Islands:
    """All islands of a training, run like one population.

    Parameters
    ----------
    evaluate_for_round : callable
        At module level, or a partial of such a function: it may be sent to other processes.
    settings : Optimizer
    seed : int
    do_all : callable
        Runs the legs of all islands (`pipeline.run.engine.crew`).
    """

    def __init__(
        self, evaluate_for_round: EvaluateForRound, settings: Optimizer, seed: int, do_all: Each
    ) -> None:
        self._evaluate_for_round, self._seed, self._do_all = evaluate_for_round, seed, do_all
        self._whole, self._num = settings, settings.islands
        self._own = replace(settings, population_size=settings.population_size // settings.islands, islands=1)
        self._champion: Floats | None = None

    def enter(self, _round_index: int, champion: Floats | None) -> None:
        """Prepare for a round, given the champion of the one before."""
        self._champion = champion

    def begin(self, round_index: int, seeds: Floats, before: State | None) -> State:
        """Draw all islands' populations, or evaluate those of the round before again."""
        step = self._whole.step_of_round(round_index)
        state = generations.unpopulated(self._seed, (round_index,), round_index, seeds.shape[1], step)
        state.strategy = {STEPS: np.full(self._num, step)}
        if before and self._whole.next_round == "carried":
            state.genomes, state.fitness, state.parts = before.genomes, before.fitness, before.parts
        if before:
            state.evaluations, state.history = before.evaluations, before.history
        self._travel(state, seeds, 0)
        return state

    def advance(self, state: State) -> None:
        """Migrate the best of each island, then evolve all islands."""
        migrate(state, self._num, self._whole.migrants)
        left = self._whole.generations - state.generation
        self._travel(state, state.genomes[:0], min(self._whole.migrate_every, left))

    def _travel(self, state: State, seeds: Floats, num_generations: int) -> None:
        """Run a leg of every island, and combine the results."""
        legs = [self._leg(state, island, seeds, num_generations) for island in range(self._num)]
        done = dict(self._do_all(travel, [(self._evaluate_for_round, leg) for leg in legs]))
        islands: list[State] = [done[place] for place in range(self._num)]
        for rows in zip(*(island.history for island in islands), strict=True):
            offset = state.generation if num_generations else 0
            state.history.append(_together(rows, self._own.population_size, state.evaluations, offset))
        state.generation += num_generations
        state.evaluations = state.history[-1].evaluations
        state.step_size = state.history[-1].step_size
        state.genomes = np.concatenate([island.genomes for island in islands])
        state.fitness = np.concatenate([island.fitness for island in islands])
        state.parts = {name: np.concatenate([i.parts[name] for i in islands]) for name in islands[0].parts}
        state.strategy = {STEPS: np.array([island.step_size for island in islands])}

    def _leg(self, state: State, island: int, seeds: Floats, num_generations: int) -> Leg:
        size = self._own.population_size
        own = slice(island * size, (island + 1) * size)
        parts = {name: values[own] for name, values in state.parts.items()}
        step_size = float(state.strategy[STEPS][island])
        place = (self._own, self._seed, island, state.round, state.generation, num_generations)
        begun = (self._champion, seeds, state.genomes[own], state.fitness[own], parts, step_size)
        return Leg(*place, *begun)


def migrate(state: State, num_islands: int, migrants: int) -> None:
    """Replace the worst of each island by copies of the best of the previous island on a ring."""
    if migrants == 0:
        return
    order = np.argsort(state.fitness.reshape(num_islands, -1), axis=1, kind="stable")
    first = np.arange(num_islands)[:, np.newaxis] * order.shape[1]
    best = np.roll(order[:, :migrants] + first, 1, axis=0).ravel()
    worst = (order[:, -migrants:] + first).ravel()
    for values in (state.genomes, state.fitness, *state.parts.values()):
        values[worst] = values[best]


def _together(rows: Sequence[Generation], size: int, evaluations: int, generation: int) -> Generation:
    """Return a generation of all islands from those of each, whose counts are within the leg."""
    best = min(rows, key=lambda row: row.best)
    means, deviations = (np.array([getattr(row, name) for row in rows]) for name in ("mean", "std"))
    # the sum of squares within islands and between them
    squares = (size - 1) * np.sum(deviations**2) + size * np.sum((means - means.mean()) ** 2)
    return replace(
        best,
        generation=generation + best.generation,
        evaluations=evaluations + sum(row.evaluations for row in rows),
        mean=float(means.mean()),
        std=float(np.sqrt(squares / (size * len(rows) - 1))),
    )


@contextmanager
def _way(
    evaluate_for_round: EvaluateForRound, settings: Optimizer, seed: int, engine: Engine
) -> Iterator[_OnePopulation | Islands]:
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
        Genomes in [0, 1] that the first round's population starts with. CMA-ES starts around the last of
        them, and needs one, as a first population near a genome does.
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
        If the results of the fitness function have the wrong shape or are not finite.
    KeyboardInterrupt
        If there is no champion yet.
    """
    seeds = np.empty((0, num_genes)) if initial is None else initial
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
    front = genetic.front_of(state) if state and settings.algorithm == "nsga2" else None
    return Evolution(tuple(history), front, interrupted)
