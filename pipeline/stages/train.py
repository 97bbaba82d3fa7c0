"""Evolve the controller's numbers: logbook, history, checkpoint, champion."""

import sys
import time
from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from fis_tools.formats import serialize
from pipeline.controllers import source
from pipeline.evaluation.front import write_front
from pipeline.evaluation.selection import COLUMNS, FURTHER, Selection, select
from pipeline.flight.fly.tours import tour_images
from pipeline.flight.state.descriptions import with_descriptions
from pipeline.run import artifacts, manifests, tables, writing
from pipeline.run.engine import TaskPool, open_pool
from pipeline.run.runner import Unimproved
from pipeline.settings.experiment import Experiment
from pipeline.training.evolution.rounds import Evolution
from pipeline.training.evolution.state import Generation
from pipeline.training.genome import Genome, genome_of
from pipeline.training.judging import evolved
from pipeline.training.progress import Log, TrainingProgress, logged

#: the history is written at most once in this many seconds, because each writing waits for the disk; the
#: checkpoint, from which a training resumes, is written after every generation
WRITE_EVERY_S = 1.0


def run(experiment: Experiment, folder: Path) -> Unimproved | None:
    """Train the configured controller: its structure is kept, its numbers are in the first population.

    Returns
    -------
    Unimproved, optional
        Where no champion flies better than the configured controller, which is then handed back.
    """
    template = source.load(experiment.controller, experiment.mission)
    genome = genome_of(template, experiment.optimizer.encoding)
    for words in genome.clipped():
        sys.stderr.write(f"  the bounds of optimizer.encoding clip {words}\n")
    with logged(experiment, folder) as log, _open_pool(experiment, genome) as pool:
        result = _evolved(experiment, folder, genome, log, pool)
        selection = select(experiment, genome, result.history, template.fuzzy, pool, result.front)
        write_selection(folder, experiment, genome, selection, result)
        if result.interrupted:
            raise KeyboardInterrupt
    return None if selection.is_improved else _unimproved(selection)


def _open_pool(experiment: Experiment, genome: Genome) -> AbstractContextManager[TaskPool]:
    """Open what flies controllers that rehearse; others fly in thousandths of a second, and fly here."""
    settings = experiment.engine if tour_images(genome.template) else replace(experiment.engine, kind="local")
    return open_pool(settings, experiment.optimizer.workers)


def _evolved(experiment: Experiment, folder: Path, genome: Genome, log: Log, pool: TaskPool) -> Evolution:
    """Evolve; write, log and show each generation."""
    due = time.monotonic()
    with TrainingProgress(experiment.optimizer) as progress:

        def keep(history: Sequence[Generation]) -> None:
            """Write the history now and then, and show the latest generation."""
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


def write_selection(
    folder: Path, experiment: Experiment, genome: Genome, selection: Selection, result: Evolution
) -> None:
    """Write the controller that is handed back, with its provenance, and what it was compared with."""
    training_fitness = selection.chosen.candidate.training_fitness
    facts = {
        **manifests.provenance(experiment, folder),
        "generations": str(len(result.history)),
        "interrupted": str(result.interrupted).lower(),
    }
    if result.front is not None:
        write_front(folder, experiment, genome, selection, facts)
    facts |= {
        "improved": str(selection.is_improved).lower(),
        "validation_fitness": repr(selection.chosen.cost),
    }
    if training_fitness is not None:
        facts["training_fitness"] = repr(training_fitness)
    judged = [judgement.row() for judgement in selection.judged]
    tables.write_csv(folder / artifacts.VALIDATION, COLUMNS, judged)
    given = selection.given
    summary = {
        "improved": selection.is_improved,
        "num_cases": selection.chosen.num_cases,
        "confidence_percent": experiment.monte_carlo.confidence_percent,
        "chosen": selection.chosen.summary(),
        "best_champion": selection.best_champion.summary(),
        "given": None if given is None else given.summary(),
        "clipped": genome.clipped(),
    }
    writing.write_json(folder / artifacts.TRAINED, summary)
    champion = serialize.described(with_descriptions(serialize.unmarked(selection.controller)), facts)
    writing.write_atomically(folder / artifacts.CHAMPION, serialize.dump_json(champion) + "\n")


def _unimproved(selection: Selection) -> Unimproved:
    """Return the closing sentence of a training that hands back the given controller."""
    best = selection.best_champion
    further = f"; from {FURTHER * best.num_cases:,} further starts it fails more often"
    return Unimproved(
        f"not improved: the given controller is handed back. From {best.num_cases:,} validation starts "
        f"{selection.chosen.sentence}; with the best champion ({best.where}) {best.sentence}"
        f"{further if selection.best_fails_more else ''}"
    )
