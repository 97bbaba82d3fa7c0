"""Rounds of evolution: from fitness functions to a champion of each generation.

Smaller fitness is better. One population (`pipeline.training.evolution.generations`) or several, the islands,
evolve for a round, which has its own fitness function; the next one starts from the champion, or continues
with the population, evaluated again. All randomness comes from one seed.

Islands are populations that evolve separately and periodically send their best to the next: the island model
(Cohoon, Hegde, Martin and Richards, "Punctuated equilibria: a parallel genetic algorithm", ICGA 1987) on a
ring. All islands together are one `State`: their populations one after the other, and the step of each
island's mutation under `STEPS`.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.array_types import Floats
from pipeline.settings.experiment import Optimizer
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


class _Islands(_OnePopulation):
    """A round of all islands, run like one population."""

    def __init__(self, evaluate_for_round: EvaluateForRound, settings: Optimizer, seed: int) -> None:
        super().__init__(evaluate_for_round, settings, seed)
        self._num = settings.islands
        self._own = replace(settings, population_size=settings.population_size // settings.islands, islands=1)

    def begin(self, round_index: int, seeds: Floats, before: State | None) -> State:
        """Draw all islands' populations, or evaluate those of the round before again."""
        step = self._settings.step_of_round(round_index)
        state = generations.unpopulated(self._seed, (round_index,), round_index, seeds.shape[1], step)
        state.strategy = {STEPS: np.full(self._num, step)}
        if before and self._settings.next_round == "carried":
            state.genomes, state.fitness, state.parts = before.genomes, before.fitness, before.parts
        if before:
            state.evaluations, state.history = before.evaluations, before.history
        self._gather(state, [self._begun(state, island, seeds) for island in range(self._num)])
        return state

    def advance(self, state: State) -> None:
        """Migrate the best of each island, then evolve all islands until the next migration."""
        migrate(state, self._num, self._settings.migrants)
        left = self._settings.generations - state.generation
        num_generations = min(self._settings.migrate_every, left)
        self._gather(state, [self._evolved(state, island, num_generations) for island in range(self._num)])

    def _begun(self, state: State, island: int, seeds: Floats) -> State:
        own = self._island(state, island)
        generations.begin(own, self._evaluate, seeds, self._own, own if len(own.genomes) else None)
        generations.record(own)
        return own

    def _evolved(self, state: State, island: int, num_generations: int) -> State:
        """Return an island after some generations; its history is of these."""
        own = self._island(state, island)
        generations.record(own)  # by which the first is judged, and then dropped
        for _ in range(num_generations):
            generations.advance(own, self._evaluate, self._own)
            generations.record(own)
        del own.history[0]
        return own

    def _island(self, state: State, island: int) -> State:
        """Return an island as the last migration left it, with randomness of its own."""
        size = self._own.population_size
        rows = slice(island * size, (island + 1) * size)
        key = (state.round, state.generation, island)
        step, num_genes = float(state.strategy[STEPS][island]), state.genomes.shape[1]
        own = generations.unpopulated(self._seed, key, state.round, num_genes, step)
        own.genomes, own.fitness = state.genomes[rows], state.fitness[rows]
        own.parts = {name: values[rows] for name, values in state.parts.items()}
        return own

    def _gather(self, state: State, islands: Sequence[State]) -> None:
        """Put the islands' populations together, and their histories, which are of the same generations."""
        for rows in zip(*(island.history for island in islands), strict=True):
            size = self._own.population_size
            state.history.append(_together(rows, size, state.evaluations, state.generation))
        last = state.history[-1]
        state.generation, state.evaluations = last.generation, last.evaluations
        state.step_size = last.step_size
        state.genomes = np.concatenate([island.genomes for island in islands])
        state.fitness = np.concatenate([island.fitness for island in islands])
        state.parts = {name: np.concatenate([i.parts[name] for i in islands]) for name in islands[0].parts}
        state.strategy = {STEPS: np.array([island.step_size for island in islands])}


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

    Returns
    -------
    Evolution
        After an interrupt from the keyboard: the champion so far.

    Raises
    ------
    CheckpointError
        If the checkpoint is damaged or belongs to other settings.
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

    kind = _Islands if settings.islands > 1 else _OnePopulation
    way = kind(evaluate_for_round, settings, seed)
    interrupted = False
    try:
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
