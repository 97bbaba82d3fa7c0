"""The player of fleets: all deputies beside each other, under one time, in a few cases as they flew."""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Final

import numpy as np

from pipeline.evaluation.blocks import blocks_of, number_of, values_at
from pipeline.evaluation.ranks import from_worst_to_best
from pipeline.evaluation.statistics import Columns
from pipeline.flight.control.controller import Controller
from pipeline.flight.fly.fleet_logs import DeputyLog, fly_logged_fleet
from pipeline.player.panel import panel
from pipeline.player.runs import Carried, PlayedCases, PlayedPage, PlayedRun
from pipeline.report.case_measures import (
    FUEL,
    MOST_CASES,
    NEAREST_PAIR,
    has_columns,
    measures_of,
    succeeds_in,
    told_columns,
)
from pipeline.report.contents import ShownFlight
from pipeline.report.scene import recorded_table
from pipeline.run import typed
from pipeline.scenarios import evaluation_scenarios
from pipeline.settings.experiment import Experiment
from plain_files.document.html import ScriptedPanel

WHY: Final = "what flies cases in a page flies one deputy"
#: how a page calls the deputies beside each other
LETTERS: Final = "ABCDEF"


def player_of_fleets(
    experiment: Experiment, controller: Controller, episodes: Columns | None, shown: Sequence[ShownFlight]
) -> ScriptedPanel | None:
    """Return the player of a run's fleets; None where there are none.

    It has the cases of the evaluation, of which the telling ones open; without them, the first fleet that is
    shown.
    """
    if episodes is not None and has_columns(episodes, experiment.mission):
        cases, rows = _cases(experiment, episodes)
        starts = evaluation_scenarios(experiment, cases.numbers[rows].tolist())
        flown = (fly_logged_fleet(experiment.mission, controller, start) for start in starts)
        return _panel(experiment, controller, dict(zip(rows, flown, strict=True)), cases=cases)
    if not shown or not shown[0].fleet:
        return None
    return _panel(experiment, controller, {0: shown[0].fleet}, title=shown[0].title)


def _cases(experiment: Experiment, episodes: Columns) -> tuple[PlayedCases, list[int]]:
    """Return the cases, and the rows of those that tell most: first the ranked ones, as they are recorded."""
    measures, rows = measures_of(experiment.mission), range(min(MOST_CASES, number_of(episodes)))
    values = {name: np.array(values_at(episodes, name, rows)) for name, *_ in measures.columns}
    number = number_of(episodes)
    ranked = from_worst_to_best(partial(blocks_of, episodes), [number // 2, 0, number - 1])
    telling = [*ranked, int(np.argmin(values[NEAREST_PAIR])), int(np.argmax(values[FUEL]))]
    numbers = np.array(values_at(episodes, "case", rows))
    columns = told_columns(measures, values)
    cases = PlayedCases(numbers, [succeeds_in(episodes, rows)], columns, measures.plots)
    return cases, [row for row in dict.fromkeys(telling) if row < MOST_CASES]


def _panel(
    experiment: Experiment,
    controller: Controller,
    fleets: Mapping[int, Sequence[DeputyLog]],
    *,
    title: str = "",
    cases: PlayedCases | None = None,
) -> ScriptedPanel:
    mission, command = experiment.mission.of_each, typed.fly(typed.RUN, "case=CASE")
    played = []
    for row in range(experiment.mission.fleet.deputies):
        name = f"{experiment.name}-deputy-{row + 1}"
        run = PlayedRun(f"deputy {row + 1}", name, mission, controller, command=command)
        tables = {
            case: recorded_table(fleet[row].flight, controller, mission) | {"seenBy": _seen_by(fleet[row])}
            for case, fleet in fleets.items()
        }
        played.append((run, Carried(recorded=tables, why=WHY)))
    page = PlayedPage(title, experiment.name, played, cases, next(iter(fleets)), is_fleet=True)
    return panel(page)


def _seen_by(log: DeputyLog) -> str:
    """Return by a letter which deputy saw each point first; a dash where none did."""
    return "".join(f"-{LETTERS}"[deputy] for deputy in log.seen_by[-1].tolist())
