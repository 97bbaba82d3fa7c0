"""The content of a report: a run's files, read, and the flights of its pictures, flown again."""

import csv
import re
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.controllers.source import controller_of_run
from pipeline.evaluation.blocks import blocks_of, number_of, values_at
from pipeline.evaluation.comparison import PAPER_TEST, PAPER_TRAINING, PUBLISHED, ComparisonRow, Reported
from pipeline.evaluation.monte_carlo import SUCCESS, fly_cases, fly_fleets, summarise
from pipeline.evaluation.papers import is_papers_test, is_papers_training
from pipeline.evaluation.ranks import from_worst_to_best
from pipeline.evaluation.statistics import Columns, Fraction, Statistic
from pipeline.flight.control.controller import Controller
from pipeline.flight.fly.fleet_logs import DeputyLog, fly_logged_fleet
from pipeline.flight.goals.flights import fly_logged
from pipeline.flight.state.log import FlightLog, Scenario
from pipeline.report import comparisons
from pipeline.report.figures.training import HISTORY_COLUMNS
from pipeline.run import artifacts, configuration, manifests, tables
from pipeline.scenarios import evaluation_scenarios, start_shown, training_scenarios
from pipeline.settings.experiment import Experiment
from pipeline.settings.keys import value_at
from pipeline.settings.start_table import POSITION, TRAINING
from plain_files.file_access import open_regular, open_text, read_bytes

#: of a row of starts that are read
MOST_BYTES = 1000
#: what a summary says of each metric and of each share of flights
SUMMARY_PARTS: Mapping[str, type] = {
    **dict.fromkeys(("delta_v_m_s", "inspection_rate_percent", "mean_distance_m"), Statistic),
    **dict.fromkeys(("success", "violated", SUCCESS), Fraction),
}
#: parts that a single flight has not
SPREAD = ("standard_deviation", "low", "high")


@dataclass(frozen=True)
class FlightSet:
    """Many flights of one controller.

    Parameters
    ----------
    episodes : mapping of str to (n,) array, optional
        The columns of ``evaluate/episodes.parquet``.
    tracks_m : (n, K+1, 3) array, optional
        Positions, Hill axes.
    summary : mapping
        What ``evaluate/summary.json`` holds.
    deputies : mapping of str to (n D,) array, optional
        Of fleets, the columns of ``evaluate/deputies.parquet``.
    """

    episodes: Columns | None
    tracks_m: NDArray[np.floating] | None
    summary: Mapping[str, Any]
    deputies: Columns | None = None

    @property
    def is_of_fleets(self) -> bool:
        """Whether several deputies flew each case."""
        return self.episodes is not None and "nearest_pair_m" in self.episodes


@dataclass(frozen=True)
class ShownFlight:
    """A flight that is shown in detail; of a fleet, the log is that of its first deputy."""

    name: str
    title: str
    scenario: Scenario
    log: FlightLog
    fleet: Sequence[DeputyLog] = ()

    @property
    def is_alone(self) -> bool:
        """Whether the flight was requested by a start or a case, and is not one of many."""
        return self.name == "start" or self.name.startswith("case-")

    @property
    def parts(self) -> Sequence["ShownFlight"]:
        """The flights of the deputies of a fleet; of one deputy, this flight."""
        if not self.fleet:
            return [self]
        return [
            ShownFlight(f"{self.name}-deputy-{number}", f"{self.title}, deputy {number}", start, log.flight)
            for number, (start, log) in enumerate(zip(self.scenario.fleet, self.fleet, strict=True), 1)
        ]


@dataclass(frozen=True)
class Contents:
    """Everything that a report may contain; None or empty if the run does not have it.

    Parameters
    ----------
    experiment : Experiment
    controller : Controller, optional
    training, evaluation : FlightSet, optional
    spread : Spread
        Of the evaluation.
    training_round : int, optional
        Whose starts the training flights have, from 1, where each round has its own.
    comparison : sequence of ComparisonRow
    compared : mapping of str to (n,) array, optional
        Its flights, one entry each.
    beside : BesideOptimum
        The controller beside the minimum-fuel plans.
    pairs : sequence of Pair
        Some of these cases, to be drawn.
    without_safety : Without, optional
        What the safety layer acted in, flown without it.
    shown : sequence of ShownFlight
    logbook : mapping of str to (n,) array, optional
        One entry a generation.
    front : mapping of str to (n,) array, optional
        One entry a controller.
    manifest : mapping
        Empty where there is none.
    config_text : str
        The resolved configuration, YAML.
    command : str
        What to type for the same run; empty where it was not kept.
    recordings : mapping of str to int
        Paths in the folder, and their sizes in bytes.
    """

    experiment: Experiment
    controller: Controller | None
    training: FlightSet | None
    evaluation: FlightSet | None
    spread: comparisons.Spread
    training_round: int | None
    comparison: Sequence[ComparisonRow]
    compared: Columns | None
    beside: comparisons.BesideOptimum
    pairs: Sequence[comparisons.FlightBesidePlan]
    without_safety: comparisons.Without | None
    shown: Sequence[ShownFlight]
    logbook: Columns | None
    front: Columns | None
    manifest: Mapping[str, Any]
    config_text: str
    command: str
    recordings: Mapping[str, int]

    @property
    def sets(self) -> list[tuple[str, FlightSet, Reported | None]]:
        """The flights of training and evaluation that exist, each with the paper's results if comparable."""
        trained = PAPER_TRAINING if is_papers_training(self.experiment) else None
        tested = PAPER_TEST if is_papers_test(self.experiment) else None
        both = (("Training", self.training, trained), ("Evaluation", self.evaluation, tested))
        return [(word, flights, reported) for word, flights, reported in both if flights is not None]

    @property
    def is_beside_paper(self) -> bool:
        """Whether results of the paper stand beside some of the flights."""
        return any(reported is not None for _, _, reported in self.sets)

    @property
    def is_comparison(self) -> bool:
        """Whether the run only compares controllers."""
        return bool(self.comparison) and not self.sets and not self.shown


def gather(experiment: Experiment, folder: Path) -> Contents:
    """Read a run's files, and fly again the flights that are shown in detail.

    Parameters
    ----------
    experiment : Experiment
    folder : Path

    Raises
    ------
    pipeline.run.artifacts.ArtifactError
        If a file is there and cannot be read.
    """
    has_trained = "train" in experiment.stages or (folder / artifacts.LOGBOOK).exists()
    logbook = read_numbers(folder, artifacts.LOGBOOK, HISTORY_COLUMNS)
    is_untrained = has_trained and not (folder / artifacts.CHAMPION).exists()
    controller = None if is_untrained else controller_of_run(experiment, folder)
    evaluation = read_evaluation(folder, experiment.monte_carlo.confidence_percent)
    if evaluation and experiment.mission.has_fleet and (folder / artifacts.DEPUTIES).exists():
        evaluation = replace(evaluation, deputies=tables.Columns(folder, artifacts.DEPUTIES))
    summary, episodes = (evaluation.summary, evaluation.episodes) if evaluation else ({}, None)
    beside = comparisons.read_beside(folder, summary)
    # recorded starts of a training are named there, too
    has_starts = begins_with_training(folder)
    # the last round that the logbook tells of; the first without one
    last = int(logbook["round"][-1]) if logbook else 0
    starts = training_scenarios(experiment, last) if controller and (has_trained or has_starts) else []
    training_round = last + 1 if logbook and experiment.starts.is_redrawn else None
    manifest = manifests.read_if_any(folder)
    recordings = sorted((folder / artifacts.RECORDINGS).glob("*.mcap"))
    return Contents(
        experiment=experiment,
        controller=controller,
        training=fly_training(experiment, controller, starts) if controller and starts else None,
        training_round=training_round,
        evaluation=evaluation,
        spread=comparisons.spread_of(folder, summary),
        comparison=[
            row
            for row in comparisons.read_comparison(folder)
            if row.source != PUBLISHED or is_papers_test(experiment)  # earlier versions had it in any mission
        ],
        compared=read_compared(folder),
        beside=beside,
        pairs=comparisons.fly_pairs(experiment, controller, beside) if controller else (),
        without_safety=comparisons.fly_without(experiment, controller, episodes) if controller else None,
        shown=fly_shown(experiment, controller, starts, episodes, training_round) if controller else (),
        logbook=logbook,
        front=_read_front(folder),
        manifest=manifest,
        config_text=artifacts.text_of(folder, artifacts.CONFIG),
        command=command_of(folder, manifest),
        recordings={path.relative_to(folder).as_posix(): path.stat().st_size for path in recordings},
    )


def begins_with_training(folder: Path) -> bool:
    """Return whether the table of starts begins with those of a training, where they stand first."""
    if not (folder / artifacts.SCENARIOS).exists():
        return False
    path = artifacts.require(folder, artifacts.SCENARIOS)
    explained = artifacts.explained(f"{path} cannot be read", "repeat the stage scenario")
    with explained, open_regular(path) as stream:  # of a campaign, larger than what is received may be
        stream.readline(MOST_BYTES)
        return stream.readline(MOST_BYTES).startswith(TRAINING.encode())


def read_evaluation(folder: Path, confidence_percent: float) -> FlightSet | None:
    """Read the files of the stage evaluate that exist."""
    has_summary = (folder / artifacts.SUMMARY).exists()
    if not (folder / artifacts.EPISODES).exists():
        return FlightSet(None, None, read_summary(folder)) if has_summary else None
    episodes = tables.Columns(folder, artifacts.EPISODES)
    has_tracks = (folder / artifacts.TRAJECTORIES).exists()
    tracks = (
        tracks_of(tables.read_parquet(folder, artifacts.TRAJECTORIES), episodes["case"])
        if has_tracks
        else None
    )
    summary = read_summary(folder) if has_summary else _summary(episodes, confidence_percent)
    return FlightSet(episodes, tracks, summary)


def _summary(episodes: Columns, confidence_percent: float) -> dict[str, Any]:
    counted = {"num_cases": number_of(episodes), "confidence_percent": confidence_percent}
    return counted | summarise(episodes, confidence_percent)


def read_summary(folder: Path) -> dict[str, Any]:
    """Read the summary of the evaluation.

    Raises
    ------
    pipeline.run.artifacts.ArtifactError
        If it cannot be read, or lacks a number that the stage evaluate writes.
    """
    summary = artifacts.read_json(folder, artifacts.SUMMARY)
    of_parts = [f"{part}.{field.name}" for part, kind in SUMMARY_PARTS.items() for field in fields(kind)]
    of_several = [
        f"{part}.{name}" for part, kind in SUMMARY_PARTS.items() if kind is Statistic for name in SPREAD
    ]
    for name in ("num_cases", *of_parts):
        number = value_at(summary, name)
        if number is None and name in of_several and summary["num_cases"] == 1:
            continue
        if isinstance(number, bool) or not isinstance(number, int | float):
            raise artifacts.ArtifactError(
                f"{folder / artifacts.SUMMARY} has no number {name}, so it is no summary of an evaluation; "
                f"repeat the stage {artifacts.stage_of(artifacts.SUMMARY)}"
            )
    return dict(summary)


def read_compared(folder: Path) -> Columns | None:
    """Read the flights of the stage compare; None if they are not there."""
    if not (folder / artifacts.COMPARISON_EPISODES).exists():
        return None
    return tables.read_parquet(folder, artifacts.COMPARISON_EPISODES)


def tracks_of(rows: Columns, cases: NDArray[Any]) -> NDArray[np.floating]:
    """Return the positions of some cases, shape (cases, samples, 3), from a table with a row per sample.

    Raises
    ------
    pipeline.run.artifacts.ArtifactError
        If the table is of other cases.
    """
    order = np.lexsort((rows["sample"], rows["case"]))
    flown, counts = np.unique(rows["case"], return_counts=True)
    if not np.array_equal(flown, np.sort(cases)) or np.ptp(counts) != 0:
        raise artifacts.ArtifactError(
            f"{artifacts.TRAJECTORIES} and {artifacts.EPISODES} are of different flights; repeat the stage "
            f"{artifacts.stage_of(artifacts.TRAJECTORIES)}"
        )
    positions = np.stack([rows[name][order] for name in POSITION], axis=-1)
    by_case = positions.reshape(len(flown), int(counts[0]), 3)
    return np.asarray(by_case[np.searchsorted(flown, cases)])


def fly_training(experiment: Experiment, controller: Controller, starts: list[Scenario]) -> FlightSet:
    """Fly the champion from the training starts."""
    mission, workers = experiment.mission, experiment.optimizer.workers
    deputies, tracks = None, None
    if mission.has_fleet:
        episodes, deputies = fly_fleets(mission, controller, starts, workers)
    else:
        episodes, tracks = fly_cases(mission, controller, starts, workers)
    summary = _summary(episodes, experiment.monte_carlo.confidence_percent)
    return FlightSet(episodes, tracks, {**summary, "sun": experiment.sun_in_words}, deputies)


def fly_shown(
    experiment: Experiment,
    controller: Controller,
    starts: list[Scenario],
    episodes: Columns | None,
    training_round: int | None,
) -> list[ShownFlight]:
    """Fly what is shown in detail: a training case, the given start, or the evaluation's median case."""
    chosen: list[tuple[str, str, Scenario]] = []
    if starts:
        case = experiment.report.training_case
        title = f"Training case {case}" + (f" of round {training_round}" if training_round else "")
        chosen.append((f"training-{case}", title, starts[case]))
    if experiment.telemetry.record_start:
        name, start = start_shown(experiment)
        title = "Flight from the given start" if experiment.case is None else f"Case {experiment.case}"
        chosen.append((name, title, start))
    if not chosen and episodes is not None:
        rows = from_worst_to_best(partial(blocks_of, episodes), [number_of(episodes) // 2])
        (case,) = values_at(episodes, "case", rows)
        (start,) = evaluation_scenarios(experiment, [case])
        chosen.append((f"median-case-{case}", f"Case {case}, the median of the evaluation", start))
    return [_flown(experiment, controller, *choice) for choice in chosen]


def _flown(
    experiment: Experiment, controller: Controller, name: str, title: str, scenario: Scenario
) -> ShownFlight:
    mission = experiment.mission
    if mission.has_fleet:
        fleet = fly_logged_fleet(mission, controller, scenario)
        return ShownFlight(name, title, scenario, fleet[0].flight, fleet)
    return ShownFlight(name, title, scenario, fly_logged(mission, controller, scenario))


def read_numbers(folder: Path, name: str, names: Sequence[str]) -> dict[str, NDArray[np.float64]] | None:
    """Read columns of a CSV table of the training; None where there is none, or no row in it.

    Raises
    ------
    pipeline.run.artifacts.ArtifactError
        If it cannot be read.
    """
    if not (folder / name).exists():
        return None
    path = artifacts.require(folder, name)
    with artifacts.explained(f"{path} cannot be read", "repeat the stage train", csv.Error):
        with open_text(path) as stream:
            rows = list(csv.DictReader(stream))
        columns = {name: np.array([float(row[name]) for row in rows]) for name in names}
    return columns if rows else None


def _read_front(folder: Path) -> dict[str, NDArray[np.float64]] | None:
    """Read the front of a training; None where there is none."""
    if not (folder / artifacts.FRONT).exists():
        return None
    from pipeline.evaluation.front import COLUMNS  # noqa: PLC0415 - its search takes long to import

    return read_numbers(folder, artifacts.FRONT, COLUMNS)


def command_of(folder: Path, manifest: Mapping[str, Any]) -> str:
    """Return the command that repeats the run; empty if it was not kept."""
    words = [str(word) for word in manifest.get("command", ())] or _command_kept_by_hydra(folder)
    words = [word for word in words if not word.startswith("hydra.")]
    paths = [re.fullmatch(r"controller\.path='([\w./@%+-]+)'", word) for word in words]
    if "controller=file" in words and any(paths):
        # the short form, which the command line takes as well
        words = [f"controller={path[1]}" if path else word for word, path in zip(words, paths, strict=True)]
        words.remove("controller=file")
    return f"python -m pipeline {shlex.join(words)}" if words else ""


def _command_kept_by_hydra(folder: Path) -> list[str]:
    """Return the command of a run whose manifest has none (version 1)."""
    words = [str(word) for word in _kept_by_hydra(folder / ".hydra" / "overrides.yaml")]
    sources = _kept_by_hydra(folder / ".hydra" / "hydra.yaml", "hydra.runtime.config_sources")
    paths = [source["path"] for source in sources if source.get("provider") == "command-line"]
    return ["--config-dir", str(paths[0]), *words] if paths and words else words


def _kept_by_hydra(path: Path, key: str = "") -> list[Any]:
    """Return a list from a file that Hydra wrote, empty where there is none."""
    try:
        node = value_at(configuration.parse(read_bytes(path)), key)
    except (OSError, ValueError):
        return []
    return node if isinstance(node, list) else []
