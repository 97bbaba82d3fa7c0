"""Evolve the controller's numbers: logbook, history, checkpoint, champion, and the front if there is one."""

import shlex
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fis_tools.formats import serialize
from pipeline.controllers import source
from pipeline.flight.cases import cases_of
from pipeline.flight.controller import ControllerError, law_of
from pipeline.flight.log import Scenario
from pipeline.flight.simulation import fly_population, is_by_the_reference
from pipeline.flight.starts import hard_candidates, training_scenarios, validation_scenarios
from pipeline.flight.world import inspection_points, pack_world
from pipeline.run import artifacts, maker, tables
from pipeline.settings.experiment import Experiment, Mission
from pipeline.training.champion_flights import ChampionFlights
from pipeline.training.evolution import OBJECTIVE, Evaluate, Front, evolve_rounds
from pipeline.training.evolution.state import Generation
from pipeline.training.fitness import costs, fitness_parts, objectives
from pipeline.training.front import INCONSISTENCY, judged_front, write_front
from pipeline.training.genome import Genome, genome_of
from pipeline.training.progress import TrainingProgress
from pipeline.training.readability import inconsistency

Floats = NDArray[np.float64]

PARTS = ("delta_v_m_s", "points", "outside", "outside_m", "short")


def run(experiment: Experiment, folder: Path) -> None:
    """Train from the configured controller's structure; its numbers are in the first population."""
    template = source.load(experiment.controller, experiment.mission)
    genome = genome_of(template, experiment.optimizer.encoding)
    if is_by_the_reference(experiment.mission):
        raise ControllerError(
            "guidance.engine is sklearn, which flies one flight at a time; "
            "train with guidance.engine=compiled"
        )
    sys.stderr.write(f"  to watch it: python -m telemetry training {shlex.quote(str(folder))} --follow\n")
    kept: list[Generation] = []
    flights = ChampionFlights(experiment, genome)
    with TrainingProgress(experiment.optimizer) as progress:

        def keep(history: Sequence[Generation]) -> None:
            kept[:] = history
            # before the history, so that whoever watches it grow finds the flight of each of its champions
            if flights.add(history):
                tables.write_parquet(folder / artifacts.CHAMPION_TRAJECTORIES, flights.columns())
            write_history(folder, history)
            progress.show_generation(history[-1])

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
    provenance = _provenance(folder, experiment, result.history, result.interrupted)
    if result.front is None:
        choice = choose(experiment, genome, result.history)
    else:
        choice = _keep_front(folder, experiment, genome, result.front, result.history[-1].round, provenance)
    write_champion(folder, experiment, genome, choice, provenance)
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
        choice = choose(experiment, genome, history)
        write_champion(folder, experiment, genome, choice, _provenance(folder, experiment, history, True))
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
    return _fitness_from(experiment, genome, scenarios, round_index)


def _fitness_from(
    experiment: Experiment, genome: Genome, scenarios: list[Scenario], round_index: int
) -> Evaluate:
    """Return the function that flies genomes from some starts and judges them by the weights of a round."""
    mission, optimizer = experiment.mission, experiment.optimizer
    penalty = optimizer.penalty.of_round(round_index)
    world, law = pack_world(mission), law_of(genome.template, mission)
    cases = cases_of(mission, scenarios)
    weighed = (penalty, _limits(mission), mission.inspection_threshold_percent)

    def evaluate(genomes: Floats) -> Mapping[str, Floats]:
        outcomes = fly_population(world, law, genome.pack(genomes), cases, optimizer.workers)
        parts = fitness_parts(outcomes, *weighed)
        if optimizer.algorithm == "nsga2":
            parts |= {OBJECTIVE + name: values for name, values in objectives(outcomes, *weighed).items()}
            if optimizer.consistency:
                parts[INCONSISTENCY] = inconsistency(genome, genomes)
        return parts

    return evaluate


def _costs(
    experiment: Experiment, genome: Genome, champion: Floats, scenarios: list[Scenario], round_index: int
) -> Floats:
    """Return what each flight of a champion costs by the weights of a round, shape (scenarios,)."""
    mission, optimizer = experiment.mission, experiment.optimizer
    world, law = pack_world(mission), law_of(genome.template, mission)
    numbers = genome.pack(champion[np.newaxis])
    outcomes = fly_population(world, law, numbers, cases_of(mission, scenarios), optimizer.workers)
    penalty = optimizer.penalty.of_round(round_index)
    limits, threshold = _limits(mission), mission.inspection_threshold_percent
    return costs(outcomes, penalty, limits, threshold).reshape(-1)


def _limits(mission: Mission) -> tuple[float, float]:
    return mission.deputy.min_distance_m, mission.deputy.max_distance_m


@dataclass(frozen=True)
class Choice:
    """The champion of a training, and what it was chosen by.

    Parameters
    ----------
    champion : (num_genes,) array
    fitness : float
        In training.
    validation_fitness : float, optional
        On the validation starts, by the weights of the last round; None where it was not chosen there.
    rounds : tuple of (int, float, float)
        Index of each round, and what its champion's fitness is, by the weights of the last round, on the
        starts that it trained on and on the validation starts; empty where they were not compared.
    """

    champion: Floats
    fitness: float
    validation_fitness: float | None = None
    rounds: tuple[tuple[int, float, float], ...] = ()


def choose(experiment: Experiment, genome: Genome, history: Sequence[Generation]) -> Choice:
    """Choose the best of the rounds' champions on starts that no training has flown."""
    num_cases = experiment.optimizer.validation_cases
    if num_cases == 0:
        return Choice(history[-1].champion, history[-1].best)
    scenarios = validation_scenarios(experiment.starts, experiment.sun, experiment.seed, num_cases)
    last_of_round = list({generation.round: generation for generation in history}.values())
    rounds = []
    for index, generation in enumerate(last_of_round):
        own = training_scenarios(experiment.starts, experiment.sun, experiment.seed, generation.round)
        training, validation = (
            float(_costs(experiment, genome, generation.champion, starts, history[-1].round).mean())
            for starts in (own, scenarios)
        )
        rounds.append((index, training, validation))
    best, _, validation = min(rounds, key=lambda row: row[2])
    return Choice(last_of_round[best].champion, last_of_round[best].best, validation, tuple(rounds))


def _keep_front(
    folder: Path,
    experiment: Experiment,
    genome: Genome,
    front: Front,
    round_index: int,
    provenance: Mapping[str, str],
) -> Choice:
    """Fly a front from the validation starts and write it; its best there is the champion."""
    num_cases = experiment.optimizer.validation_cases
    sys.stderr.write(f"  flying the front's {len(front.genomes)} controllers from {num_cases} more starts\n")
    scenarios = validation_scenarios(experiment.starts, experiment.sun, experiment.seed, num_cases)
    validation = _fitness_from(experiment, genome, scenarios, round_index)(front.genomes)
    num_points = len(inspection_points(experiment.mission))
    columns, genomes = judged_front(front, validation, num_points, num_cases)
    controllers = [replace(genome.decode(g), name=_name(experiment, genome)) for g in genomes]
    write_front(folder, columns, genomes, controllers, provenance)
    best = int(np.argmax(columns["champion"]))
    training, there = (columns[f"{starts}_fitness_m_s"][best] for starts in ("training", "validation"))
    return Choice(genomes[best], float(training), float(there))


def write_history(folder: Path, history: Sequence[Generation]) -> None:
    """Write the logbook and, with the champions' genomes, the history; both anew, whole."""
    rows = [g.row() | {name: g.parts[name] for name in PARTS} for g in history]
    tables.write_csv(folder / artifacts.LOGBOOK, list(rows[0]), [list(row.values()) for row in rows])
    columns = {name: [row[name] for row in rows] for name in rows[0]}
    tables.write_parquet(
        folder / artifacts.HISTORY, {**columns, "genome": np.stack([g.champion for g in history])}
    )


def write_champion(
    folder: Path, experiment: Experiment, genome: Genome, choice: Choice, provenance: Mapping[str, str]
) -> None:
    """Write the champion as a controller file that says where it comes from."""
    told = {"training_fitness": repr(choice.fitness), **provenance}
    if choice.validation_fitness is not None:
        told["validation_fitness"] = repr(choice.validation_fitness)
    if choice.rounds:
        tables.write_csv(folder / artifacts.VALIDATION, ["round", "training", "validation"], choice.rounds)
    champion = replace(
        genome.decode(choice.champion),
        name=_name(experiment, genome),
        provenance=tuple(sorted(told.items())),
    )
    artifacts.write_atomically(folder / artifacts.CHAMPION, serialize.dump_json(champion) + "\n")


def _name(experiment: Experiment, genome: Genome) -> str:
    return f"{genome.template.name}_{experiment.name}"


def _provenance(
    folder: Path, experiment: Experiment, history: Sequence[Generation], interrupted: bool
) -> dict[str, str]:
    """Say where the controllers of a training come from."""
    return {
        "experiment": experiment.name,
        "seed": str(experiment.seed),
        "config_hash": artifacts.config_hash(artifacts.read_config(folder)),
        "product_version": maker.product_version(),
        "git_revision": maker.git_revision() or "none",
        "generations": str(len(history)),
        "interrupted": str(interrupted).lower(),
    }
