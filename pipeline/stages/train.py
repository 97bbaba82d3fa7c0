"""Evolve the controller's numbers: logbook, history, checkpoint and champion."""

import shlex
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fis_tools import serialize
from fis_tools.model import FuzzyController
from fis_tools.parameters import Bounds, Encoding
from pipeline import artifacts, controller_source, tables
from pipeline.champion_flights import ChampionFlights
from pipeline.checkpoint import Generation
from pipeline.compile_notice import announce_compilation
from pipeline.controllers import Controller, ControllerError, law_of, with_constants
from pipeline.evolution import Evaluate, evolve_rounds
from pipeline.objectives import fitness_parts
from pipeline.progress import TrainingProgress
from pipeline.scenarios import training_scenarios
from pipeline.settings import Experiment
from pipeline.simulation import fly_population, is_by_the_reference, pack_world, stack_starts

Floats = NDArray[np.float64]

PARTS = ("delta_v_m_s", "points", "outside", "outside_m", "short")


def run(experiment: Experiment, folder: Path) -> None:
    """Train from the configured controller's structure; its numbers are in the first population."""
    template = controller_source.load(experiment.controller, experiment.mission)
    if template.fuzzy is None:
        raise ControllerError(
            f"controller {template.name!r} has no fuzzy system to train; choose a fuzzy one"
        )
    if is_by_the_reference(experiment.mission):
        raise ControllerError(
            "guidance.engine is sklearn, which flies one flight at a time; "
            "train with guidance.engine=compiled"
        )
    encoding = encoding_of(experiment, template)
    announce_compilation()
    sys.stderr.write(f"  to watch it: python -m telemetry training {shlex.quote(str(folder))} --follow\n")
    kept: list[Generation] = []
    flights = ChampionFlights(experiment, template, encoding)
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
                lambda round_index: fitness_of_round(experiment, template, encoding, round_index),
                encoding.num_genes,
                experiment.optimizer,
                experiment.seed,
                initial=encoding.encode(template.systems)[np.newaxis],
                checkpoint=folder / artifacts.CHECKPOINT,
                resume=experiment.resume,
                on_generation=keep,
            )
        except artifacts.WriteError as error:
            if not kept:
                raise
            raise _stopped(error, folder, experiment, template.fuzzy, encoding, kept) from error
    write_champion(
        folder, experiment, template.fuzzy, encoding, result.history, interrupted=result.interrupted
    )
    if result.interrupted:
        raise KeyboardInterrupt


def _stopped(
    error: artifacts.WriteError,
    folder: Path,
    experiment: Experiment,
    template: FuzzyController,
    encoding: Encoding,
    history: Sequence[Generation],
) -> artifacts.WriteError:
    """Keep the champion of a training that the disk has stopped; say where it is and how to go on."""
    place = artifacts.CHAMPION
    try:
        write_champion(folder, experiment, template, encoding, history, interrupted=True)
    except artifacts.WriteError:
        # the checkpoint of the last generation that found room stands
        place = artifacts.CHECKPOINT
    return artifacts.WriteError(
        f"{error}. The training stopped after {len(history)} generations and its champion is kept in "
        f"{folder / place}. To go on: python -m pipeline resume={folder}"
    )


def encoding_of(experiment: Experiment, template: Controller) -> Encoding:
    """Return which gene tunes what."""
    encoding = experiment.optimizer.encoding
    low, high = encoding.standard_deviation_fraction
    shortest, longest = encoding.output_range_n
    return Encoding(
        template.systems,
        Bounds(
            mean_window=encoding.mean_window,
            standard_deviation=(low, high),
            output_reach=(shortest, longest),
        ),
    )


def fitness_of_round(
    experiment: Experiment, template: Controller, encoding: Encoding, round_index: int
) -> Evaluate:
    """Return the function that flies genomes from a round's starts and judges them."""
    mission, optimizer = experiment.mission, experiment.optimizer
    penalty = optimizer.penalty.of_round(round_index)
    world, law = pack_world(mission), law_of(template, mission.num_controls)
    starts, sun_angles = stack_starts(
        training_scenarios(experiment.starts, experiment.sun, experiment.seed, round_index)
    )

    def evaluate(genomes: Floats) -> Mapping[str, Floats]:
        numbers = with_constants(encoding.pack(genomes), template)
        outcomes = fly_population(world, law, numbers, starts, sun_angles, optimizer.workers)
        return fitness_parts(outcomes, penalty, world.num_points, mission.inspection_threshold_percent)

    return evaluate


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
    template: FuzzyController,
    encoding: Encoding,
    history: Sequence[Generation],
    *,
    interrupted: bool,
) -> None:
    """Write the last champion as a controller file that says where it comes from."""
    last = history[-1]
    provenance = {
        "experiment": experiment.name,
        "seed": str(experiment.seed),
        "config_hash": artifacts.config_hash(artifacts.read_config(folder)),
        "product_version": artifacts.product_version(),
        "git_revision": artifacts.git_revision() or "none",
        "training_fitness": repr(last.best),
        "generations": str(len(history)),
        "interrupted": str(interrupted).lower(),
    }
    champion = replace(
        template,
        name=f"{template.name}_{experiment.name}",
        systems=encoding.decode(last.champion),
        provenance=tuple(sorted(provenance.items())),
    )
    artifacts.write_atomically(folder / artifacts.CHAMPION, serialize.dump_json(champion) + "\n")
