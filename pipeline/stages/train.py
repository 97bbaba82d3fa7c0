"""Evolve the controller's numbers: logbook, history, checkpoint, champion."""

import time
from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from fis_tools.formats import serialize
from pipeline.controllers import source
from pipeline.flight.fly.tours import tour_images
from pipeline.run import artifacts, configuration, maker, tables, writing
from pipeline.run.engine import TaskPool, open_pool
from pipeline.settings.experiment import Experiment
from pipeline.training.evolution.rounds import Evolution
from pipeline.training.evolution.state import Generation
from pipeline.training.genome import Genome, genome_of
from pipeline.training.judging import choose, evolved, named_after
from pipeline.training.progress import Log, TrainingProgress, logged

#: the history is written at most once in this many seconds, because each writing waits for the disk; the
#: checkpoint, from which a training resumes, is written after every generation
WRITE_EVERY_S = 1.0


def run(experiment: Experiment, folder: Path) -> None:
    """Train the configured controller: its structure is kept, its numbers are in the first population."""
    template = source.load(experiment.controller, experiment.mission)
    genome = genome_of(template, experiment.optimizer.encoding)
    with logged(experiment.logger, folder) as log, _open_pool(experiment, genome) as pool:
        result = _evolved(experiment, folder, genome, log, pool)
        write_champion(folder, experiment, genome, result, pool)
        if result.interrupted:
            raise KeyboardInterrupt


def _open_pool(experiment: Experiment, genome: Genome) -> AbstractContextManager[TaskPool]:
    """Open what flies controllers that rehearse; others fly in thousandths of a second, and fly here."""
    settings = experiment.engine if tour_images(genome.template) else replace(experiment.engine, kind="local")
    return open_pool(settings, experiment.optimizer.workers)


def _evolved(experiment: Experiment, folder: Path, genome: Genome, log: Log, pool: TaskPool) -> Evolution:
    """Evolve; write, log and show each generation."""
    due = time.monotonic()
    with TrainingProgress(experiment.optimizer) as progress:

        def keep(history: Sequence[Generation]) -> None:
            nonlocal due
            if time.monotonic() >= due:
                write_history(folder, history)
                due = time.monotonic() + WRITE_EVERY_S
            log(rows_of(history))
            progress.show_generation(history[-1])

        path = folder / artifacts.CHECKPOINT
        result = evolved(
            experiment, genome, pool, checkpoint=path, resume=experiment.resume, on_generation=keep
        )
        write_history(folder, result.history)
    return result


def rows_of(history: Sequence[Generation]) -> list[dict[str, Any]]:
    """Return the rows of the logbook."""
    return [g.row() | dict(g.parts) for g in history]


def write_history(folder: Path, history: Sequence[Generation]) -> None:
    """Write the logbook and, with the champions' genomes, the history; both are written whole."""
    rows = rows_of(history)
    tables.write_csv(folder / artifacts.LOGBOOK, list(rows[0]), [list(row.values()) for row in rows])
    columns = {name: [row[name] for row in rows] for name in rows[0]}
    tables.write_parquet(
        folder / artifacts.HISTORY, {**columns, "genome": np.stack([g.champion for g in history])}
    )


def write_champion(
    folder: Path, experiment: Experiment, genome: Genome, result: Evolution, pool: TaskPool
) -> None:
    """Choose the champion, and write it as a controller file with its provenance."""
    choice = choose(experiment, genome, result.history, pool)
    facts = {
        "training_fitness": repr(choice.fitness),
        "experiment": experiment.name,
        "seed": str(experiment.seed),
        "config_hash": configuration.config_hash(configuration.read(folder)),
        "product_version": maker.product_version(),
        "git_revision": maker.git_revision() or "none",
        "generations": str(len(result.history)),
        "interrupted": str(result.interrupted).lower(),
    }
    if choice.validation_fitness is not None:
        facts["validation_fitness"] = repr(choice.validation_fitness)
    if choice.rounds:
        tables.write_csv(folder / artifacts.VALIDATION, ["round", "training", "validation"], choice.rounds)
    champion = serialize.described(named_after(experiment, genome, choice.champion), facts)
    writing.write_atomically(folder / artifacts.CHAMPION, serialize.dump_json(champion) + "\n")
