"""The player of pages: the cases of a run, or of several runs on the cases that they share."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain, product
from pathlib import Path
from typing import Any

import numpy as np

from fis_tools.errors import ControllerFileError
from pipeline.controllers.source import named
from pipeline.evaluation.blocks import number_of, values_at
from pipeline.evaluation.contenders import guarded, labelled, under
from pipeline.evaluation.monte_carlo import episode_columns
from pipeline.evaluation.statistics import Columns
from pipeline.flight.cases.dispersions import mission_of_case
from pipeline.flight.control.controller import Controller, ControllerError
from pipeline.flight.fly.fleet_logs import fly_logged_fleet
from pipeline.flight.goals.flights import fly_all, fly_logged
from pipeline.flight.goals.reach import ReachOutcomes
from pipeline.flight.state.log import FlightLog, Scenario
from pipeline.player.flown import flown_in_page, tells_reasons
from pipeline.player.motion import motion_data
from pipeline.player.panel import panel
from pipeline.player.runs import Carried, CaseColumn, CasePlot, PlayedCases, PlayedPage, PlayedRun
from pipeline.recording.reflight import start_of
from pipeline.report.case_measures import (
    FUEL,
    MOST_CASES,
    NEAREST_PAIR,
    has_columns,
    measures_of,
    succeeds_in,
    told_columns,
)
from pipeline.report.contents import Contents
from pipeline.report.evaluated_run import EvaluatedRun
from pipeline.report.played_fleets import deputies_of, fleets_in, player_of_fleet, player_of_fleets
from pipeline.report.scene import recorded_table, told_reasons
from pipeline.run import typed
from pipeline.scenarios import evaluation_scenarios
from pipeline.settings.experiment import Experiment, Mission
from plain_files.document.html import ScriptedPanel
from telemetry.file.reader import read

#: runs beside each other at most, and of a comparison of fleets at least
MOST_RUNS, FEWEST_FLEETS = 8, 2


def player_of_run(contents: Contents) -> ScriptedPanel | None:
    """Return the player of a run's flights; None without one.

    It has the cases of the evaluation; without one, the first flight that is shown.
    """
    experiment, controller = contents.experiment, contents.controller
    if controller is None:
        return None
    episodes = contents.evaluation.episodes if contents.evaluation else None
    if episodes is None or not has_columns(episodes, experiment.mission):
        if not contents.shown:
            return None
        shown = contents.shown[0]
        if experiment.mission.has_fleet:
            return player_of_fleet(experiment, controller, shown) if shown.fleet else None
        return player_of_flight(experiment, controller, shown.log, shown.title, shown.scenario)
    run = EvaluatedRun(experiment.name, experiment, controller, episodes, typed.fly(typed.RUN, "case=CASE"))
    if experiment.mission.has_fleet:
        return player_of_fleets(run)
    rows = range(min(MOST_CASES, number_of(episodes)))
    return panel(_page([run], [rows], experiment.name))


def player_of_comparison(contents: Contents) -> ScriptedPanel | str:
    """Return the player of the flights of a comparison, side by side, or in words why there is none.

    They are those of the first world, under the run's Sun if it is among those compared, else the last.
    """
    experiment, flights = contents.experiment, contents.compared
    if flights is None:
        return "the comparison's flights were not kept"
    world, sun = compared_in(experiment)
    try:
        runs = list(_contenders(under(experiment, world, sun), flights, world))
    except (ControllerError, ControllerFileError) as error:
        return f"a controller of the comparison is not there any more ({error})"
    if not all(rows for _, rows in runs):
        return "the comparison's flights are not those of its configuration"
    return player_of_runs([run for run, _ in runs], [rows for _, rows in runs], experiment.name)


def compared_in(experiment: Experiment) -> tuple[str, str]:
    """Return the world and the Sun of the flights of a comparison that a page plays."""
    suns, mode = experiment.compare.suns, experiment.sun.mode
    return [*experiment.compare.worlds, ""][0], mode if mode in suns else suns[-1]


def shown_of(experiment: Experiment) -> Sequence[tuple[str, str]]:
    """Return the controllers and safety layers of a comparison for which its page has room.

    Where there are too many, they are the first controllers under the first layer alone.
    """
    compare, deputies = experiment.compare, experiment.mission.fleet.deputies
    most = max(MOST_RUNS // deputies, FEWEST_FLEETS)
    every = list(product(compare.controllers, compare.safety))
    if len(every) <= most:
        return every
    return [(name, compare.safety[0]) for name in compare.controllers[:most]]


def _contenders(there: Experiment, flights: Columns, world: str) -> Iterator[tuple[EvaluatedRun, list[int]]]:
    """Yield each controller under each safety layer as a run, with its rows in the flights."""
    compare = there.compare
    of_lot = (flights["world"] == world) & (flights["sun"] == there.sun.mode)
    for name, layer in shown_of(there):
        mission = guarded(there.mission, layer)
        controller = named(name, mission)
        label = labelled(name, compare.controllers, controller)
        rows = np.flatnonzero(of_lot & (flights["controller"] == label) & (flights["safety"] == layer))
        is_runs = not world and mission == there.mission
        command = typed.fly(typed.RUN, "case=CASE", f"controller={name}") if is_runs else ""
        words = label if layer == "none" else f"{label}, safety layer"
        yield (
            EvaluatedRun(words, replace(there, mission=mission), controller, flights, command),
            rows.tolist(),
        )


def player_of_flight(
    experiment: Experiment, controller: Controller, log: FlightLog, title: str, start: Scenario
) -> ScriptedPanel:
    """Return the player of a flight that is no case."""
    mission, start = mission_of_case(experiment.mission, start), replace(start, settings=None)
    run = PlayedRun(experiment.name, experiment.name, mission, controller, [start])
    recorded = {0: recorded_table(log, controller, mission)}
    return panel(PlayedPage(title, experiment.name, [(run, Carried(recorded=recorded))]))


def player_of_runs(
    runs: Sequence[EvaluatedRun], rows: Sequence[Iterable[int]], file_name: str
) -> ScriptedPanel | str:
    """Return the player of several runs side by side, or in words why there is none.

    Parameters
    ----------
    runs : sequence of EvaluatedRun
    rows : sequence of (n,) int
        Of each run's episodes, the cases that all share, in one order.
    file_name : str
        By which an address names the page.
    """
    measured = {name for name, *_ in measures_of(runs[0].experiment.mission).columns[:2]}
    if not all(
        has_columns(run.episodes, run.experiment.mission) and measured <= set(run.episodes) for run in runs
    ):
        return "the evaluations do not tell what is plotted"
    if len(runs) == 1 and runs[0].experiment.mission.has_fleet:
        return player_of_fleets(runs[0])
    shared = [list(each)[:MOST_CASES] for each in rows]
    return panel(_page(list(runs)[:MOST_RUNS], shared[:MOST_RUNS], file_name))


def player_of_starts(
    experiment: Experiment, mission: Mission, controller: Controller, starts: Sequence[Scenario]
) -> ScriptedPanel:
    """Fly some starts by a controller, and return their player."""
    starts = list(starts)[:MOST_CASES]
    outcomes = fly_all(mission, controller, starts, experiment.monte_carlo.workers)
    episodes = episode_columns(mission, starts, outcomes)
    measures = measures_of(mission)
    columns = told_columns(measures, {name: np.asarray(episodes[name]) for name, *_ in measures.columns})
    numbers = np.arange(len(starts))
    cases = PlayedCases(numbers, [succeeds_in(episodes, numbers.tolist())], columns, measures.plots)
    order = np.argsort(columns[0].values, kind="stable")
    first = int(order[len(order) // 2])
    telling = [first, int(order[-1]), int(measures.worst(columns[1].values))]
    run = PlayedRun(experiment.name, experiment.name, mission, controller, starts, telling)
    return panel(PlayedPage("", experiment.name, [(run, carried_of(run))], cases, first))


def player_of_worst(
    experiment: Experiment, controller: Controller, folder: Path, requirements: Sequence[Mapping[str, Any]]
) -> ScriptedPanel | None:
    """Return the player of each requirement's worst known flight, a counterexample where it fails.

    Parameters
    ----------
    experiment : Experiment
    controller : Controller
    folder : Path
        Of the run, which has recordings of the flights.
    requirements : sequence of mapping
        As the stage assure writes them.
    """
    flown = [each for each in requirements if each.get("worst")]
    if not flown:
        return None
    starts = [_start_of_worst(folder, each["worst"]) for each in flown]
    words = [
        f"{each['id']} {each['title']}: {each['worst']['found_by']}, margin {each['worst']['margin']:.3g} "
        f"{each['worst']['unit']}".rstrip()
        for each in flown
    ]
    is_met = np.array([each["worst"]["margin"] >= 0.0 for each in flown])
    outcome = ("meets it", "meets the requirement", "fails the requirement")
    cases = PlayedCases(np.arange(1, len(flown) + 1), [is_met], words=words, outcome=outcome)
    if experiment.mission.has_fleet:
        fleets = [fly_logged_fleet(experiment.mission, controller, start) for start in starts]
        deputies = deputies_of(experiment, controller, dict(enumerate(fleets)))
        return panel(PlayedPage("", "worst", deputies, cases, fleets=[len(deputies)]))
    run = PlayedRun(
        experiment.name, experiment.name, experiment.mission, controller, starts, range(len(starts))
    )
    return panel(PlayedPage("", "worst", [(run, carried_of(run))], cases))


def _start_of_worst(folder: Path, worst: Mapping[str, Any]) -> Scenario:
    """Return the start of a recorded flight, or the starts of a fleet from the recordings of its deputies."""
    names = worst.get("recordings", [worst["recording"]])
    first, *others = (start_of(read(folder / name, ())) for name in names)
    return replace(first, others=tuple(others))


def _page(runs: Sequence[EvaluatedRun], rows: Sequence[Sequence[int]], file_name: str) -> PlayedPage:
    is_alone, measures = len(runs) == 1, measures_of(runs[0].experiment.mission)
    measured = measures.columns if is_alone else measures.columns[:2]
    values = [
        {name: np.array(values_at(run.episodes, name, of_run)) for name, *_ in measured}
        for run, of_run in zip(runs, rows, strict=True)
    ]
    numbers = np.array(values_at(runs[0].episodes, "case", rows[0]))
    succeeds = [succeeds_in(run.episodes, of_run) for run, of_run in zip(runs, rows, strict=True)]
    columns, plots = (
        (told_columns(measures, values[0]), measures.plots) if is_alone else _paired(runs, values)
    )
    cases = PlayedCases(numbers, succeeds, columns, plots)
    order = np.argsort(values[-1][FUEL] - (0.0 if is_alone else values[0][FUEL]), kind="stable")
    first = int(order[len(order) // 2])
    telling = [
        first,
        int(order[-1]),
        int(order[0]),
        *(int(measures.worst(each[measures.columns[1][0]])) for each in values),
    ]
    for run, of_run in zip(runs, rows, strict=True):
        if run.experiment.mission.has_fleet:
            telling.append(int(np.argmin(values_at(run.episodes, NEAREST_PAIR, of_run))))
    played = [_played(run, of_run, telling) for run, of_run in zip(runs, rows, strict=True)]
    return PlayedPage("", file_name, [*chain(*played)], cases, first, [*map(len, played)])


def _paired(
    runs: Sequence[EvaluatedRun], values: Sequence[Mapping[str, Any]]
) -> tuple[list[CaseColumn], list[CasePlot]]:
    """Return the first two measures of each run as columns, and plots of each run against the first."""
    columns, plots = [], []
    measures, *others = (measures_of(run.experiment.mission) for run in runs)
    labels = [{name: label for name, label, _ in each.columns} for each in (measures, *others)]
    letters = [chr(ord("A") + index) for index in range(len(values))]
    is_pair = len(values) == 2  # the table of more has room for their fuel
    for name, label, decimals in measures.columns[:2]:
        for letter, of_run, words_of in zip(letters, values, labels, strict=True):
            is_told = name == FUEL or is_pair
            words = f"{name}_{letter}", f"{letter}: {words_of.get(name, label)}", decimals
            columns.append(CaseColumn(*words, of_run[name], is_told))
    for letter, of_run in zip(letters[1:], values[1:], strict=True):
        more = of_run[FUEL] - values[0][FUEL]
        columns.append(CaseColumn(f"more_{letter}", f"{letter} − A: Δv, m/s", 3, more, is_pair))
        for (name, *_), title in zip(measures.columns, measures.titles, strict=False):
            both = f"{name}_A", f"{name}_{letter}"
            plots.append(CasePlot(f"{title.split()[0]}-{letter}", f"{letter} beside A: {title}", both, True))
        plots.append(CasePlot(f"more-{letter}", f"How much more {letter} burns", (f"more_{letter}",)))
    return columns, plots


def _played(
    run: EvaluatedRun, rows: Sequence[int], telling: Sequence[int]
) -> list[tuple[PlayedRun, Carried]]:
    """Return a run as a page plays it, or the deputies of its fleets, of which the telling rows open."""
    experiment, controller, mission = run.experiment, run.controller, run.experiment.mission
    cases = [int(case) for case in values_at(run.episodes, "case", rows)]
    if mission.has_fleet:
        flown = fleets_in(run, {row: cases[row] for row in telling})
        return deputies_of(experiment, controller, flown, run.command, run.name)
    starts = evaluation_scenarios(experiment, cases)
    alone = PlayedRun(run.name, experiment.name, mission, controller, starts, telling, run.command)
    ends_s = values_at(run.episodes, "end_s", rows) if mission.problem.kind == "reach" else []
    return [(alone, carried_of(alone, ends_s))]


def carried_of(run: PlayedRun, ends_s: Sequence[float] = ()) -> Carried:
    """Return what a page carries of a run's flights: those that a module flies, else a few as recorded.

    Parameters
    ----------
    run : PlayedRun
    ends_s : sequence of float
        When flights to a goal end, s, where that is known.
    """
    mission, controller = run.mission, run.controller
    rows = list(dict.fromkeys(run.rows))
    flown = flown_in_page(run)
    if isinstance(flown, str):
        recorded = {row: _recorded(run, row) for row in rows}
        return Carried(recorded=recorded, why=flown)
    others = [] if flown.rows is None else [row for row in rows if row not in flown.rows]
    carried = Carried(
        flown.content,
        recorded={row: _recorded(run, row) for row in others},
        why="" if flown.rows is None else "what was drawn or chosen for it takes too much room",
        ends=_ends(run, ends_s),
    )
    if tells_reasons(mission, controller):
        return carried
    carried_rows = rows if flown.rows is None else flown.rows
    reasons = {row: told_reasons(_logged(run, row), controller, mission) for row in carried_rows}
    return replace(carried, reasons=reasons)


def _ends(run: PlayedRun, ends_s: Sequence[float]) -> list[int]:
    """Return the samples at which flights to a goal end, by row; none of other flights."""
    mission = run.mission
    if mission.problem.kind != "reach":
        return []
    if not ends_s:
        flown = fly_all(mission, run.controller, list(run.starts))
        ends_s = flown.end_s.tolist() if isinstance(flown, ReachOutcomes) else []
    return [round(end_s / mission.control_period_s) for end_s in ends_s]


def _logged(run: PlayedRun, row: int) -> FlightLog:
    return fly_logged(run.mission, run.controller, run.starts[row])


def _recorded(run: PlayedRun, row: int) -> dict[str, Any]:
    """Return a row's flight as it was logged, with free motion of its own where it has drawn an orbit."""
    mission = mission_of_case(run.mission, run.starts[row])
    moving = {} if mission.orbit == run.mission.orbit else motion_data(mission)
    return recorded_table(_logged(run, row), run.controller, mission) | moving
