"""Fly several controllers from the same starts, under several Suns and safety layers: compare/."""

import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any, cast

import numpy as np

from pipeline.controllers.planned.planner import remembering
from pipeline.controllers.source import named
from pipeline.evaluation import published
from pipeline.evaluation.comparison import (
    FLOWN,
    HEADER,
    Column,
    ComparisonRow,
    as_cells,
    as_mapping,
    in_words,
    joined,
    planned_row,
    published_row,
    rules_of,
)
from pipeline.evaluation.monte_carlo import episode_columns, fly_cases, summarise
from pipeline.evaluation.worlds import worlds_in_words
from pipeline.flight.controller import Controller
from pipeline.flight.log import Outcomes, Scenario
from pipeline.flight.simulation import fly_all
from pipeline.flight.starts import evaluation_scenarios
from pipeline.flight.world import inspection_points
from pipeline.optimum.account import beside_optimum, summarise_times
from pipeline.optimum.solved import IncomparableError, Solved, solved_for
from pipeline.run import artifacts, tables
from pipeline.run.progress import Progress
from pipeline.settings.experiment import UNGUARDED, Experiment, Mission
from pipeline.settings.worlds import in_world

#: flights between two looks at the clock
PART = 100


def run(experiment: Experiment, folder: Path) -> None:
    """Fly all, and write the table."""
    reported = published.TEST
    rows = [published_row("the paper", reported.num_cases, reported.means, reported.standard_deviations)]
    flown: list[tuple[ComparisonRow, dict[str, Column]]] = []
    worlds = list(experiment.compare.worlds) or [""]
    for world, sun in product(worlds, experiment.compare.suns):
        there = in_world(experiment, world)
        under = replace(there, sun=replace(there.sun, mode=cast(Any, sun)))
        scenarios = evaluation_scenarios(under.monte_carlo, under.sun, under.seed)
        solved = None if world else _solved(under)
        for name in experiment.compare.controllers:
            controller = remembering(named(name, under.mission))
            for layer in experiment.compare.safety:
                row, episodes = _row(under, name, controller, layer, scenarios, solved, world)
                flown.append((row, episodes))
                rows.append(row)
        if solved is not None:
            rows.append(_planned(under, solved))
    tables.write_csv(folder / artifacts.COMPARISON_TABLE, HEADER, [as_cells(row) for row in rows])
    tables.write_parquet(folder / artifacts.COMPARISON_EPISODES, joined(flown))
    summary = {
        "seed": experiment.seed,
        "num_cases": experiment.monte_carlo.num_cases,
        "confidence_percent": experiment.monte_carlo.confidence_percent,
        "rows": [as_mapping(row) for row in rows],
    }
    artifacts.write_json(folder / artifacts.COMPARISON, summary)
    sys.stderr.write(_told(experiment, rows))


def _solved(experiment: Experiment) -> Solved | None:
    """Return the minimum-fuel plans for a Sun setting, or print why there are none."""
    try:
        return solved_for(experiment)
    except IncomparableError as reason:
        sys.stderr.write(f"  Sun {experiment.sun.mode}: not beside plans of least fuel: {reason}\n")
        return None


def _row(
    experiment: Experiment,
    name: str,
    controller: Controller,
    layer: str,
    scenarios: list[Scenario],
    solved: Solved | None,
    world: str,
) -> tuple[ComparisonRow, dict[str, Column]]:
    """Fly one controller under one layer."""
    mission, workers = guarded(experiment.mission, layer), experiment.monte_carlo.workers
    label = f"{name}, {world}{', ' if world else ''}Sun {experiment.sun.mode}, safety {layer}"
    episodes = _fly(mission, controller, scenarios, workers, label)
    times = None
    if solved is not None:
        beside, _ = fly_cases(mission, controller, solved.scenarios, workers)
        times = summarise_times(beside_optimum(beside, solved.cases, solved.harder))
    summary = summarise(episodes, experiment.monte_carlo.confidence_percent)
    row = ComparisonRow(
        label_of(name, experiment.compare.controllers),
        FLOWN,
        experiment.sun.mode,
        layer,
        len(scenarios),
        rules_of(controller),
        summary,
        times,
        world,
    )
    return row, episodes


def label_of(name: str, names: Sequence[str]) -> str:
    """Return what a controller is called in the table: its file's name, where that is no other's too."""
    stem = Path(name).stem
    return stem if [Path(other).stem for other in names].count(stem) == 1 else name


def guarded(mission: Mission, layer: str) -> Mission:
    """Return a mission under a safety layer; the filter has the mission's own numbers."""
    return replace(mission, safety=UNGUARDED if layer == "none" else replace(mission.safety, kind="filter"))


def _fly(
    mission: Mission, controller: Controller, scenarios: list[Scenario], workers: int | None, label: str
) -> dict[str, Column]:
    """Fly all starts part by part, with a line now and then and one at the end."""
    started = time.perf_counter()
    parts: list[Outcomes] = []
    with Progress(f"{label}:", len(scenarios), 0) as progress:
        for first in range(0, len(scenarios), PART):
            parts.append(fly_all(mission, controller, scenarios[first : first + PART], workers))
            if (done := first + PART) < len(scenarios):
                progress.show(done)
    outcomes = Outcomes(
        **{name: np.concatenate([vars(part)[name] for part in parts]) for name in vars(parts[0])}
    )
    episodes = episode_columns(mission, scenarios, outcomes)
    spent, seconds = episodes["delta_v_m_s"].mean(), time.perf_counter() - started
    sys.stderr.write(f"  {label}: {len(scenarios)} cases in {seconds:.1f} s, {spent:.3f} m/s\n")
    return episodes


def _planned(experiment: Experiment, solved: Solved) -> ComparisonRow:
    mission = experiment.mission
    return planned_row(
        solved,
        experiment.sun.mode,
        len(inspection_points(mission)),
        mission.inspection_threshold_percent,
        experiment.monte_carlo.confidence_percent,
    )


def _told(experiment: Experiment, rows: list[ComparisonRow]) -> str:
    """Write the table and what its columns mean."""
    threshold = experiment.mission.inspection_threshold_percent
    confidence = experiment.monte_carlo.confidence_percent
    deputy = experiment.mission.deputy
    table = worlds_in_words(rows) if experiment.compare.worlds else in_words(rows)
    return (
        f"\n{table}\n\n"
        f"  {experiment.monte_carlo.num_cases} cases of seed {experiment.seed}; mean ± standard deviation; "
        f"shares with {confidence:g} % Wilson intervals; successful: at least {threshold:g} % of the points; "
        f"outside: {deputy.min_distance_m:g} to {deputy.max_distance_m:g} m left.\n"
        f"  *published ({published.SOURCE}), its Sun and its distance limits not stated; the optimum knows "
        "the whole flight beforehand, and is of other cases.\n"
    )
