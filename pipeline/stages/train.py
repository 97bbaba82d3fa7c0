"""Evolve the controller's numbers: logbook, history, checkpoint and champion."""

import shlex
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fis_tools import serialize
from pipeline import artifacts, controller_source, tables
from pipeline.champion_flights import ChampionFlights
from pipeline.checkpoint import Generation
from pipeline.compile_notice import announce_compilation
from pipeline.controllers import ControllerError, law_of
from pipeline.evolution import Evaluate, evolve_rounds
from pipeline.flight import Scenario
from pipeline.genome import Genome, genome_of
from pipeline.objectives import costs, fitness_parts
from pipeline.progress import TrainingProgress
from pipeline.scenarios import hard_candidates, training_scenarios, validation_scenarios
from pipeline.settings import Experiment, Mission
from pipeline.simulation import fly_population, is_by_the_reference, pack_world, stack_starts

Floats = NDArray[np.float64]

PARTS = ("delta_v_m_s", "points", "outside", "outside_m", "short")


def run(experiment: Experiment, folder: Path) -> None:
    """Train from the configured controller's structure; its numbers are in the first population."""
    template = controller_source.load(experiment.controller, experiment.mission)
    genome = genome_of(template, experiment.optimizer.encoding)
    if is_by_the_reference(experiment.mission):
        raise ControllerError(
            "guidance.engine is sklearn, which flies one flight at a time; "
            "train with guidance.engine=compiled"
        )
    announce_compilation()
    sys.stderr.write(f"  to watch it: python -m telemetry training {shlex.quote(str(folder))} --follow\n")
    kept: list[Generation] = []
    flights = ChampionFlights(experiment, genome)
    with TrainingProgress(experiment) as progress:

        def keep(history: Sequence[Generation]) -> None:
            kept[:] = history
            # before the history, so that whoever watches it grow finds the flight of each of its champions
            if flights.add(history):
                tables.write_parquet(folder / artifacts.CHAMPION_TRAJECTORIES, flights.columns())
            write_history(folder, history)
            progress.show(history[-1])

        try:
            result = evolve_rounds(
                partial(fitness_of_round, experiment, genome),
                genome.num_genes,
                experiment.optimizer,
                experiment.seed,
                initial=genome.encode()[np.newaxis],
                checkpoint=folder / artifacts.CHECKPOINT,
                resume=experiment.resume,
                on_generation=keep,
            )
        except artifacts.WriteError as error:
            if not kept:
                raise
            raise _stopped(error, folder, experiment, genome, kept) from error
    write_champion(folder, experiment, genome, result.history, interrupted=result.interrupted)
    if result.interrupted:
        raise KeyboardInterrupt


def _stopped(
    error: artifacts.WriteError,
    folder: Path,
    experiment: Experiment,
    genome: Genome,
    history: Sequence[Generation],
) -> artifacts.WriteError:
    """Keep the champion of a training that the disk has stopped; say where it is and how to go on."""
    place = artifacts.CHAMPION
    try:
        write_champion(folder, experiment, genome, history, interrupted=True)
    except artifacts.WriteError:
        # the checkpoint of the last generation that found room stands
        place = artifacts.CHECKPOINT
    return artifacts.WriteError(
        f"{error}. The training stopped after {len(history)} generations and its champion is kept in "
        f"{folder / place}. To go on: python -m pipeline resume={folder}"
    )


def fitness_of_round(
    experiment: Experiment, genome: Genome, round_index: int, champion: Floats | None = None
) -> Evaluate:
    """Return the function that flies genomes from a round's starts and judges them.

    Parameters
    ----------
    experiment : Experiment
    genome : Genome
        What the genes are.
    round_index : int
        From 0.
    champion : (num_genes,) array, optional
        Of the round before: those of some more starts on which it does worst join the round's own.
    """
    starts = experiment.starts
    scenarios = training_scenarios(starts, experiment.sun, experiment.seed, round_index)
    if champion is not None and starts.num_hard > 0:
        candidates = hard_candidates(starts, experiment.sun, experiment.seed, round_index)
        worst = np.argsort(-_costs(experiment, genome, champion, candidates, round_index), kind="stable")
        scenarios += [candidates[index] for index in worst[: starts.num_hard]]
    mission, optimizer = experiment.mission, experiment.optimizer
    penalty = optimizer.penalty.of_round(round_index)
    world, law = pack_world(mission), law_of(genome.template, mission.num_controls)
    places, sun_angles = stack_starts(scenarios)

    def evaluate(genomes: Floats) -> Mapping[str, Floats]:
        outcomes = fly_population(world, law, genome.pack(genomes), places, sun_angles, optimizer.workers)
        return fitness_parts(
            outcomes, penalty, _limits(mission), world.num_points, mission.inspection_threshold_percent
        )

    return evaluate


def _costs(
    experiment: Experiment, genome: Genome, champion: Floats, scenarios: list[Scenario], round_index: int
) -> Floats:
    """Return what each flight of a champion costs by the weights of a round, shape (scenarios,)."""
    mission, optimizer = experiment.mission, experiment.optimizer
    world, law = pack_world(mission), law_of(genome.template, mission.num_controls)
    numbers = genome.pack(champion[np.newaxis])
    outcomes = fly_population(world, law, numbers, *stack_starts(scenarios), optimizer.workers)
    penalty = optimizer.penalty.of_round(round_index)
    limits, threshold = _limits(mission), mission.inspection_threshold_percent
    return costs(outcomes, penalty, limits, world.num_points, threshold).reshape(-1)


def _limits(mission: Mission) -> tuple[float, float]:
    return mission.deputy.min_distance_m, mission.deputy.max_distance_m


@dataclass(frozen=True)
class Choice:
    """The champion of a training, and what it was chosen by.

    Parameters
    ----------
    champion : Generation
        The last of its round.
    validation : tuple of float
        Fitness of each round's champion on the validation starts, by the weights of the last round; empty
        where the last champion was taken as it is.
    training : tuple of float
        The same on the starts that its own round trained on.
    """

    champion: Generation
    validation: tuple[float, ...] = ()
    training: tuple[float, ...] = ()


def choose(experiment: Experiment, genome: Genome, history: Sequence[Generation]) -> Choice:
    """Choose the best of the rounds' champions on starts that no training has flown."""
    num_cases = experiment.optimizer.validation_cases
    if num_cases == 0:
        return Choice(history[-1])
    scenarios = validation_scenarios(experiment.starts, experiment.sun, experiment.seed, num_cases)
    last_of_round = list({generation.round: generation for generation in history}.values())
    validation = [
        float(_costs(experiment, genome, g.champion, scenarios, history[-1].round).mean())
        for g in last_of_round
    ]
    training = []
    for generation in last_of_round:
        own = training_scenarios(experiment.starts, experiment.sun, experiment.seed, generation.round)
        training.append(float(_costs(experiment, genome, generation.champion, own, history[-1].round).mean()))
    return Choice(last_of_round[int(np.argmin(validation))], tuple(validation), tuple(training))


def write_history(folder: Path, history: Sequence[Generation]) -> None:
    """Write the logbook and, with the champions' genomes, the history; both anew, whole."""
    columns = {
        "round": [g.round for g in history],
        "generation": [g.generation for g in history],
        "evaluations": [g.evaluations for g in history],
        "best": [g.best for g in history],
        "mean": [g.mean for g in history],
        "std": [g.std for g in history],
        "step_size": [g.step_size for g in history],
        **{name: [g.parts[name] for g in history] for name in PARTS},
    }
    rows = list(zip(*columns.values(), strict=True))
    tables.write_csv(folder / artifacts.LOGBOOK, list(columns), rows)
    tables.write_parquet(
        folder / artifacts.HISTORY, {**columns, "genome": np.stack([g.champion for g in history])}
    )


def write_champion(
    folder: Path,
    experiment: Experiment,
    genome: Genome,
    history: Sequence[Generation],
    *,
    interrupted: bool,
) -> None:
    """Write the last champion as a controller file that says where it comes from."""
    choice = choose(experiment, genome, history)
    chosen = choice.champion
    provenance = {
        "experiment": experiment.name,
        "seed": str(experiment.seed),
        "config_hash": artifacts.config_hash(artifacts.read_config(folder)),
        "product_version": artifacts.product_version(),
        "git_revision": artifacts.git_revision() or "none",
        "training_fitness": repr(chosen.best),
        "generations": str(len(history)),
        "interrupted": str(interrupted).lower(),
    }
    if choice.validation:
        provenance["validation_fitness"] = repr(min(choice.validation))
        rows = list(zip(range(len(choice.validation)), choice.training, choice.validation, strict=True))
        tables.write_csv(folder / artifacts.VALIDATION, ["round", "training", "validation"], rows)
    champion = replace(
        genome.decode(chosen.champion),
        name=f"{genome.template.name}_{experiment.name}",
        provenance=tuple(sorted(provenance.items())),
    )
    artifacts.write_atomically(folder / artifacts.CHAMPION, serialize.dump_json(champion) + "\n")
