"""The player of fleets: all deputies beside each other, under one time, in a few cases as they flew."""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Final

import numpy as np

from pipeline.evaluation.blocks import blocks_of, number_of, values_at
from pipeline.evaluation.ranks import from_worst_to_best
from pipeline.flight.control.controller import Controller
from pipeline.flight.fly.fleet_logs import DeputyLog, fly_logged_fleet
from pipeline.player.panel import panel
from pipeline.player.runs import Carried, PlayedCases, PlayedPage, PlayedRun
from pipeline.report.case_measures import (
    FUEL,
    MOST_CASES,
    NEAREST_PAIR,
    measures_of,
    succeeds_in,
    told_columns,
)
from pipeline.report.contents import ShownFlight
from pipeline.report.evaluated_run import EvaluatedRun
from pipeline.report.scene import recorded_table
from pipeline.scenarios import evaluation_scenarios
from pipeline.settings.experiment import Experiment
from plain_files.document.html import ScriptedPanel

WHY: Final = "what flies cases in a page flies one deputy"


def player_of_fleets(run: EvaluatedRun) -> ScriptedPanel:
    """Return the player of an evaluated run's fleets, of which the telling cases open."""
    cases, rows = _cases(run)
    flown = fleets_in(run, dict(zip(rows, cases.numbers[rows].tolist(), strict=True)))
    played = deputies_of(run.experiment, run.controller, flown, run.command)
    return panel(PlayedPage("", run.experiment.name, played, cases, rows[0], [len(played)]))


def player_of_fleet(experiment: Experiment, controller: Controller, shown: ShownFlight) -> ScriptedPanel:
    """Return the player of a fleet that is no case."""
    played = deputies_of(experiment, controller, {0: shown.fleet})
    return panel(PlayedPage(shown.title, experiment.name, played, fleets=[len(played)]))


def fleets_in(run: EvaluatedRun, cases: Mapping[int, int]) -> dict[int, list[DeputyLog]]:
    """Fly the cases of some rows, and return their fleets by these rows."""
    mission, starts = run.experiment.mission, evaluation_scenarios(run.experiment, list(cases.values()))
    flown = (fly_logged_fleet(mission, run.controller, start) for start in starts)
    return dict(zip(cases, flown, strict=True))


def _cases(run: EvaluatedRun) -> tuple[PlayedCases, list[int]]:
    """Return the cases, and the rows of those that tell most: first the ranked ones, as they are recorded."""
    episodes, measures = run.episodes, measures_of(run.experiment.mission)
    rows = range(min(MOST_CASES, number_of(episodes)))
    values = {name: np.array(values_at(episodes, name, rows)) for name, *_ in measures.columns}
    number = number_of(episodes)
    ranked = from_worst_to_best(partial(blocks_of, episodes), [number // 2, 0, number - 1])
    telling = [*ranked, int(np.argmin(values[NEAREST_PAIR])), int(np.argmax(values[FUEL]))]
    numbers = np.array(values_at(episodes, "case", rows))
    columns = told_columns(measures, values)
    cases = PlayedCases(numbers, [succeeds_in(episodes, rows)], columns, measures.plots)
    return cases, [row for row in dict.fromkeys(telling) if row < MOST_CASES]


def deputies_of(
    experiment: Experiment,
    controller: Controller,
    fleets: Mapping[int, Sequence[DeputyLog]],
    command: str = "",
    name: str = "",
) -> list[tuple[PlayedRun, Carried]]:
    """Return the deputies of fleets as runs of a page, each with its flights as they were flown.

    Parameters
    ----------
    experiment : Experiment
    controller : Controller
    fleets : mapping of int to sequence of DeputyLog
        By row of the page's cases.
    command : str
        Which flies a case, ``CASE`` standing for its number.
    name : str
        Of the fleets, beside others.
    """
    mission, played = experiment.mission.of_each, []
    for index in range(experiment.mission.fleet.deputies):
        tables = {
            row: recorded_table(fleet[index].flight, controller, mission) | {"seenBy": _seen_by(fleet[index])}
            for row, fleet in fleets.items()
        }
        words = ", ".join(filter(None, [name, f"deputy {index + 1}"]))
        file_name = f"{experiment.name}-deputy-{index + 1}"
        run = PlayedRun(words, file_name, mission, controller, command=command)
        played.append((run, Carried(recorded=tables, why=WHY)))
    return played


def _seen_by(log: DeputyLog) -> str:
    """Return by a digit which deputy saw each point first; 0 where none did."""
    return "".join(map(str, log.seen_by[-1].tolist()))
