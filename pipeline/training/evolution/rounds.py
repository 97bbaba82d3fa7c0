"""Rounds of evolution: from fitness functions to a champion of each generation.

Smaller fitness is better. A population (`pipeline.training.evolution.generations`) evolves for a round, which
has its own fitness function; the next one starts from the champion, or continues with the population,
evaluated again. All randomness comes from one seed.
"""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.array_types import Floats
from pipeline.settings.experiment import Optimizer
from pipeline.training.evolution import generations
from pipeline.training.evolution.front import Front, front_of
from pipeline.training.evolution.generations import EvaluateForRound, Subspace
from pipeline.training.evolution.state import EvolutionState, Generation, load, save

#: called with the history so far, after each generation
OnGeneration = Callable[[Sequence[Generation]], None]


@dataclass(frozen=True)
class Evolution:
    """The result of an evolution.

    Parameters
    ----------
    history : tuple of Generation
        One for each generation of each round.
    interrupted : bool
        Whether it was interrupted from the keyboard.
    front : Front, optional
        Of the last population, where there are several objectives (NSGA-II).
    """

    history: tuple[Generation, ...]
    interrupted: bool
    front: Front | None = None


def _is_finished(state: EvolutionState, settings: Optimizer) -> bool:
    """Return whether a round is over: all generations done, or no gain in the last `stall_generations`."""
    if state.generation >= settings.generations:
        return True
    patience = settings.stall_generations
    if patience is None or state.generation < patience:
        return False
    return state.history[-1].best >= state.history[-1 - patience].best


#: settings with which a training may go on when they are others than those that it began with
FREE = (
    *("generations", "stall_generations", "rounds", "encoding", "penalty", "workers"),
    *("validation_cases", "success_goal_percent"),
)


def _fingerprint(settings: Optimizer, seed: int, num_genes: int) -> dict[str, Any]:
    """Return the settings that a resumed run must share to equal an uninterrupted one."""
    values = {
        field.name: getattr(settings, field.name) for field in fields(settings) if field.name not in FREE
    }
    planes = asdict(values.pop("planes"))
    # checkpoints of earlier versions do not tell of planes
    if settings.num_planes_rounds:
        values |= {f"planes.{name}": value for name, value in planes.items()}
    return {"seed": seed, "genes": num_genes} | {f"optimizer.{name}": value for name, value in values.items()}


def evolve_rounds(
    evaluate_for_round: EvaluateForRound,
    num_genes: int,
    settings: Optimizer,
    seed: int,
    *,
    initial: Floats | None = None,
    planes: Subspace | None = None,
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
    planes : Subspace, optional
        Of the genomes whose rule tables are planes, where the settings have rounds that seek them.
    checkpoint : Path, optional
        File for the state after every generation (.npz).
    resume : bool
        Resume from the checkpoint if there is one; the result is that of an uninterrupted run, bit for bit.
    on_generation : callable, optional
        Called after every generation with the history so far, including earlier runs', and with that of the
        checkpoint before resuming.

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
    state: EvolutionState | None = None
    if resume and checkpoint is not None and checkpoint.exists():
        state = load(checkpoint, fingerprint)
        if on_generation is not None:
            # the last run may have been killed before its last generation was written
            on_generation(tuple(state.history))
    history = state.history if state else []

    def finish_generation(state: EvolutionState) -> None:
        generations.record(state)
        if checkpoint is not None:
            save(checkpoint, state, fingerprint)
        if on_generation is not None:
            on_generation(tuple(state.history))

    interrupted = False
    try:
        for round_index in range(state.round if state else 0, settings.rounds):
            earlier = [generation.champion for generation in history if generation.round < round_index]
            evaluate = evaluate_for_round(round_index, earlier[-1] if earlier else None)
            of_round = settings.of_round(round_index)
            within = planes if round_index < settings.num_planes_rounds else None
            if state is None or state.round < round_index:
                state = generations.begin(evaluate, seeds, of_round, seed, round_index, state, within)
                history = state.history
                finish_generation(state)
            while not _is_finished(state, of_round):
                generations.advance(state, evaluate, of_round, within)
                finish_generation(state)
            seeds = history[-1].champion[np.newaxis]
    except KeyboardInterrupt:
        if not history:
            raise
        interrupted = True
    front = front_of(state) if state and settings.algorithm == "nsga2" else None
    return Evolution(tuple(history), interrupted, front)
