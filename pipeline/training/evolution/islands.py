"""Islands: populations that evolve separately and periodically send their best to the next.

The island model (Cohoon, Hegde, Martin and Richards, "Punctuated equilibria: a parallel genetic algorithm",
ICGA 1987) on a ring. An island's work between two migrations depends only on its `Leg`, so that it is
the same wherever it runs, and on however many processes. All islands together are one `State`: their
populations one after the other, and the step of each island's mutation under `STEPS`.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.array_types import Floats
from pipeline.run.engine import Each
from pipeline.settings.experiment import Optimizer
from pipeline.training.evolution import generations
from pipeline.training.evolution.generations import EvaluateForRound
from pipeline.training.evolution.state import Generation, State

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
    """All islands of a training, run like one population (`pipeline.training.evolution.rounds`).

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
        return Leg(
            self._own,
            self._seed,
            island,
            state.round,
            state.generation,
            num_generations,
            self._champion,
            seeds,
            state.genomes[own],
            state.fitness[own],
            {name: values[own] for name, values in state.parts.items()},
            float(state.strategy[STEPS][island]),
        )


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
