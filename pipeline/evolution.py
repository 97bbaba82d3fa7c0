"""A genetic algorithm: a vector of genes in [0, 1] and a fitness function in, a champion out.

Smaller fitness is better. Each generation keeps its elite as it is, fills most of the rest with one child of
each pair of parents (scattered crossover) and the remainder with mutants (adaptive feasible mutation);
parents are chosen in tournaments. These are the operators and rates of Choi, Kim and Leeghim (AAS 25-727),
defined as in MATLAB's Global Optimization Toolbox ("Genetic Algorithm Options").

Everything random comes from one seed. DEAP draws from Python's global generator: it is lent a state of ours
for each generation, and the caller gets his own back.
"""

import random
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np
from deap import base, tools
from numpy.typing import NDArray

from pipeline.checkpoint import Generation, State, load, save
from pipeline.mutation import LARGEST_STEP, adapt_step_size, adaptive_feasible_mutation
from pipeline.settings import Optimizer

Floats = NDArray[np.float64]

#: genomes (n, num_genes) in [0, 1] -> arrays of shape (n,): ``fitness`` and, by any other name, its parts
Evaluate = Callable[[Floats], Mapping[str, Floats]]
#: called after each generation with the history so far; the newest is the last
OnGeneration = Callable[[Sequence[Generation]], None]

GENE_SWAP_PROBABILITY = 0.5
#: keeps the draws of the evolution apart from those of scenarios made from the same seed
SPAWN_KEY = 0xE70


@dataclass(frozen=True)
class Evolution:
    """What came out of an evolution.

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
    interrupted : bool
        Whether it was stopped from the keyboard before its end.
    """

    champion: Floats
    fitness: float
    parts: Mapping[str, float]
    round_champions: Floats
    history: tuple[Generation, ...]
    logbook: Any
    interrupted: bool


@dataclass(frozen=True)
class Split:
    """How many individuals of a generation come from where."""

    elite: int
    crossover: int
    mutants: int


def split_population(settings: Optimizer) -> Split:
    """Turn rates into numbers of individuals.

    With `split` = ``whole`` the crossover rate counts the whole population (of 200 at 0.1 and 0.8: 20, 160,
    20), with ``rest`` all but the elite (20, 144, 36). Mutants fill up.
    """
    size = settings.population_size
    elite = max(1, round(settings.elitism_rate * size))
    counted = size if settings.split == "whole" else size - elite
    crossover = min(size - elite, round(settings.crossover_rate * counted))
    return Split(elite, crossover, size - elite - crossover)


class Fitness(base.Fitness):  # type: ignore[misc]
    """One value, to be made small."""

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
    """Make one child that takes each gene from either parent with probability 1/2."""
    child, _ = tools.cxUniform(Individual(first), Individual(second), GENE_SWAP_PROBABILITY)
    return cast(Individual, child)


@contextmanager
def _lent_global_random(state: State) -> Iterator[None]:
    """Let DEAP draw from our state of Python's global generator, and give the caller's back."""
    callers = random.getstate()
    random.setstate(state.python_state)
    try:
        yield
    finally:
        state.python_state = random.getstate()
        random.setstate(callers)


def _breed(state: State, settings: Optimizer) -> Floats:
    """Make a generation's children, of crossover first, then mutants; shape (children, num_genes)."""
    split = split_population(settings)
    num_crossed = 2 * split.crossover
    with _lent_global_random(state):
        population = [
            Individual(genes, fitness)
            for genes, fitness in zip(state.genomes.tolist(), state.fitness.tolist(), strict=True)
        ]
        parents = select_parents(population, num_crossed + split.mutants, settings.tournament_size)
        pairs = zip(parents[:num_crossed:2], parents[1:num_crossed:2], strict=True)
        children = [np.array(scattered_crossover(first, second)) for first, second in pairs]
    mutants = [
        adaptive_feasible_mutation(np.array(parent), state.step_size, state.generator)
        for parent in parents[num_crossed:]
    ]
    return np.array([*children, *mutants]).reshape(-1, state.genomes.shape[1])


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


def _record(state: State) -> None:
    """Note the present generation in the history."""
    best = int(np.argmin(state.fitness))
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
    evaluate: Evaluate, seeds: Floats, settings: Optimizer, seed: int, history: list[Generation]
) -> State:
    """Draw and evaluate the first population of the round after those in the history; it holds the seeds."""
    round_index = history[-1].round + 1 if history else 0
    generator = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(SPAWN_KEY, round_index)))
    python_state = random.Random(int(generator.integers(2**63))).getstate()  # noqa: S311
    genomes = generator.random((settings.population_size, seeds.shape[1]))
    genomes[: len(seeds)] = seeds
    fitness, parts = _evaluated(evaluate, genomes, history[0].parts if history else None)
    return State(
        round=round_index,
        generation=0,
        evaluations=(history[-1].evaluations if history else 0) + len(genomes),
        step_size=LARGEST_STEP,
        genomes=genomes,
        fitness=fitness,
        parts=parts,
        python_state=python_state,
        generator=generator,
        history=history,
    )


def _advance(state: State, evaluate: Evaluate, settings: Optimizer) -> None:
    """Replace a population by the next: the elite unchanged and in front, then the children."""
    if state.generation > 0:
        has_improved = state.history[-1].best < state.history[-2].best
        state.step_size = adapt_step_size(state.step_size, has_improved)
    children = _breed(state, settings)
    fitness, parts = _evaluated(evaluate, children, state.parts)
    elite = np.argsort(state.fitness, kind="stable")[: split_population(settings).elite]
    state.genomes = np.concatenate((state.genomes[elite], children))
    state.fitness = np.concatenate((state.fitness[elite], fitness))
    state.parts = {name: np.concatenate((old[elite], parts[name])) for name, old in state.parts.items()}
    state.generation += 1
    state.evaluations += len(children)


def _is_finished(state: State, settings: Optimizer) -> bool:
    """Tell whether a round has had its generations, or none of the last `stall_generations` was better."""
    if state.generation >= settings.generations:
        return True
    patience = settings.stall_generations
    if patience is None or state.generation < patience:
        return False
    return state.history[-1].best >= state.history[-1 - patience].best


def _outcome(history: Sequence[Generation], interrupted: bool) -> Evolution:
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


def _fingerprint(settings: Optimizer, seed: int, num_genes: int) -> dict[str, Any]:
    """Name everything that must be the same for a resumed run to equal an uninterrupted one."""
    names = ("population_size", "tournament_size", "crossover_rate", "elitism_rate", "split")
    return {"seed": seed, "genes": num_genes} | {f"optimizer.{n}": getattr(settings, n) for n in names}


def evolve_rounds(
    evaluate_for_round: Callable[[int], Evaluate],
    num_genes: int,
    settings: Optimizer,
    seed: int,
    *,
    initial: Floats | None = None,
    checkpoint: Path | None = None,
    resume: bool = False,
    on_generation: OnGeneration | None = None,
) -> Evolution:
    """Evolve for `settings.rounds` rounds, each a fresh population with the last round's champion in it.

    Parameters
    ----------
    evaluate_for_round : callable
        Takes a round's index and returns its fitness function; the same index must give the same function,
        or a resumed run differs from an uninterrupted one. A fitness function takes genomes of shape
        (n, num_genes) and returns arrays of shape (n,): ``fitness``, to be made small, and its parts. It sees
        a generation's new individuals only: the elite is never evaluated again.
    num_genes : int
        Genes of a genome.
    settings : Optimizer
        Sizes and rates.
    seed : int
        Of everything random here.
    initial : (k, num_genes) array, optional
        Genomes that the first round's population starts with.
    checkpoint : Path, optional
        Where to write the state after every generation (.npz).
    resume : bool
        Go on from the checkpoint where there is one; the result is that of an uninterrupted run, bit for bit.
    on_generation : callable, optional
        Called after every generation with the history so far, earlier runs' included.

    Returns
    -------
    Evolution
        After an interrupt from the keyboard: the champion so far.

    Raises
    ------
    CheckpointError
        If the checkpoint is damaged or belongs to other settings.
    ValueError
        If the initial genomes or what the fitness function returns are of the wrong shape or not finite.
    KeyboardInterrupt
        If there is no champion yet.
    """
    seeds = _checked_seeds(initial, num_genes, settings.population_size)
    fingerprint = _fingerprint(settings, seed, num_genes)
    state: State | None = None
    if resume and checkpoint is not None and checkpoint.exists():
        state = load(checkpoint, fingerprint)
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
            evaluate = evaluate_for_round(round_index)
            if state is None or state.round < round_index:
                state = _begin_round(evaluate, seeds, settings, seed, history)
                finish_generation(state)
            while not _is_finished(state, settings):
                _advance(state, evaluate, settings)
                finish_generation(state)
            seeds = history[-1].champion[np.newaxis]
    except KeyboardInterrupt:
        if not history:
            raise
        interrupted = True
    return _outcome(history, interrupted)


def evolve(
    evaluate: Evaluate,
    num_genes: int,
    settings: Optimizer,
    seed: int,
    *,
    initial: Floats | None = None,
    checkpoint: Path | None = None,
    resume: bool = False,
    on_generation: OnGeneration | None = None,
) -> Evolution:
    """Evolve with one fitness function for all rounds; see `evolve_rounds`."""
    return evolve_rounds(
        lambda _round: evaluate,
        num_genes,
        settings,
        seed,
        initial=initial,
        checkpoint=checkpoint,
        resume=resume,
        on_generation=on_generation,
    )
