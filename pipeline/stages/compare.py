"""Fly several controllers from the same starts, under several Suns and safety layers: compare/."""

import sys
import time
from collections.abc import Callable, Sequence
from concurrent.futures import CancelledError, Future, ThreadPoolExecutor
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from threading import Event, Lock

from pipeline.array_types import Floats
from pipeline.controllers.source import named
from pipeline.evaluation import comparison
from pipeline.evaluation.after import Aftermath, joined
from pipeline.evaluation.beside_optimum import beside_optimum, summarise_times
from pipeline.evaluation.contenders import guarded, labelled, under
from pipeline.evaluation.monte_carlo import episode_columns, fly_cases, fly_followed, summarise
from pipeline.evaluation.papers import is_papers_test
from pipeline.flight.control.controller import Controller, Planner, PlanningController
from pipeline.flight.state.log import Outcomes, Scenario, combined
from pipeline.optimum.solved import IncomparableError, Solved, solved_for
from pipeline.run import artifacts, tables, writing
from pipeline.run.engine import open_pool
from pipeline.run.progress import Progress
from pipeline.scenarios import evaluation_scenarios
from pipeline.settings.experiment import Experiment, Mission

Row = tuple[comparison.ComparisonRow, dict[str, comparison.Column]]

#: flights between two looks at the clock
PART = 100


def run(experiment: Experiment, folder: Path) -> None:
    """Fly all controllers, and write the table."""
    lots = [lot for world in experiment.compare.worlds or [""] for lot in _lots(experiment, world)]
    is_papers = any(is_papers_test(lot.experiment) for lot in lots)
    rows = [comparison.published_row(comparison.PAPER_TEST)] if is_papers else []
    flown: list[Row] = []
    for lot, of_lot in zip(lots, _fly(lots, experiment), strict=True):
        flown += of_lot
        rows += [row for row, _ in of_lot]
        if lot.solved is not None:
            rows.append(comparison.planned_row(lot.experiment, lot.solved))
    cells = [comparison.as_cells(row) for row in rows]
    tables.write_csv(folder / artifacts.COMPARISON_TABLE, comparison.HEADER, cells)
    tables.write_parquet(folder / artifacts.COMPARISON_EPISODES, comparison.concatenate(flown))
    cases = experiment.monte_carlo
    counted = {"num_cases": cases.num_cases, "confidence_percent": cases.confidence_percent}
    summary = {"seed": experiment.seed, **counted, "rows": [asdict(row) for row in rows]}
    writing.write_json(folder / artifacts.COMPARISON, summary)
    sys.stderr.write(_summary(experiment, rows))


@dataclass(frozen=True)
class Lot:
    """The rows of one world and Sun, which fly from the same starts."""

    experiment: Experiment
    world: str
    scenarios: list[Scenario]
    solved: Solved | None


def _lots(experiment: Experiment, world: str) -> list[Lot]:
    """Return the flights to compare in a world, a lot for each Sun setting."""
    lots = []
    for sun in experiment.compare.suns:
        there = under(experiment, world, sun)
        lots.append(Lot(there, world, evaluation_scenarios(there), None if world else _solved(there)))
    return lots


def _solved(experiment: Experiment) -> Solved | None:
    """Return the minimum-fuel plans for a Sun setting, or print why there are none."""
    try:
        return solved_for(experiment)
    except IncomparableError as reason:
        sys.stderr.write(f"  Sun {experiment.sun.mode}: not beside plans of least fuel: {reason}\n")
        return None


#: called with a number of flights that were flown, and what flew them
Note = Callable[[int, str], None]


class _Flights:
    """The flights of all rows: shows the number flown, and can be stopped."""

    def __init__(self, progress: Progress) -> None:
        self._progress, self._lock, self._flown = progress, Lock(), 0
        self.has_ended = Event()

    def note(self, count: int, label: str) -> None:
        """Add flights to those done; raise CancelledError once the comparison has ended."""
        if self.has_ended.is_set():
            raise CancelledError
        with self._lock:
            self._flown += count
            self._progress.show(self._flown, label)


def _fly(lots: Sequence[Lot], experiment: Experiment) -> list[list[Row]]:
    """Fly the controllers of all lots, here or on workers of Dask; return each lot's rows in order."""
    names, layers = experiment.compare.controllers, experiment.compare.safety
    num_flights = len(names) * len(layers) * sum(len(lot.scenarios) for lot in lots)
    with Progress("flights", num_flights, 0) as progress:
        if experiment.engine.kind == "local":
            return _fly_here(lots, names, progress)
        tasks = [(lot, name, named(name, lot.experiment.mission)) for lot in lots for name in names]
        rows: dict[int, list[Row]] = {}
        num_flown = 0
        with open_pool(experiment.engine, experiment.monte_carlo.workers) as pool:
            for index, flown in pool.run(fly_rows, tasks):
                rows[index] = flown
                num_flown += len(layers) * len(tasks[index][0].scenarios)
                progress.show(num_flown, tasks[index][1])
    in_order = iter([rows[index] for index in range(len(tasks))])
    return [[row for _ in names for row in next(in_order)] for _ in lots]


def fly_rows(lot: Lot, name: str, controller: Controller) -> list[Row]:
    """Fly one controller with all safety layers in this thread alone."""
    cases = replace(lot.experiment.monte_carlo, workers=1)
    alone = replace(lot, experiment=replace(lot.experiment, monte_carlo=cases))
    return _rows(alone, name, controller, lambda _count, _label: None)


def _fly_here(lots: Sequence[Lot], names: Sequence[str], progress: Progress) -> list[list[Row]]:
    """Fly the controllers of all lots on threads of this process.

    Planning controllers, half of whose time is spent in Python, keep less than two processors busy, whatever
    the number of threads: compiled ones fly at the same time.
    """
    flights, planning, others = _Flights(progress), ThreadPoolExecutor(1), ThreadPoolExecutor(1)

    def begun(lot: Lot, name: str) -> Future[list[Row]]:
        controller = named(name, lot.experiment.mission)
        plans = isinstance(controller, PlanningController) and len(controller.planner.decisions) > 1
        return (planning if plans else others).submit(_rows, lot, name, controller, flights.note)

    try:
        futures = [[begun(lot, name) for name in names] for lot in lots]
        return [[row for future in of_lot for row in future.result()] for of_lot in futures]
    finally:
        flights.has_ended.set()
        for pool in (planning, others):
            pool.shutdown(cancel_futures=True)


def _rows(lot: Lot, name: str, controller: Controller, note: Note) -> list[Row]:
    """Fly one controller with all safety layers."""
    experiment, controller, rows = lot.experiment, remembering(controller), []
    for layer in experiment.compare.safety:
        mission = guarded(experiment.mission, layer)
        label = ", ".join(filter(None, [name, lot.world, f"Sun {experiment.sun.mode}", f"safety {layer}"]))
        episodes = _fly_cases(lot, mission, controller, label, note)
        times = None
        if lot.solved is not None:
            workers = experiment.monte_carlo.workers
            beside, _ = fly_cases(mission, controller, lot.solved.scenarios, workers)
            columns = beside_optimum(beside, lot.solved.cases, lot.solved.harder)
            times = summarise_times(columns, experiment.monte_carlo.confidence_percent)
        row = comparison.ComparisonRow(
            controller=labelled(name, experiment.compare.controllers, controller),
            source=comparison.FLOWN,
            sun=experiment.sun.mode,
            safety=layer,
            num_cases=len(lot.scenarios),
            rules=sum(len(system.rules) for system in controller.systems) or None,
            summary=summarise(episodes, experiment.monte_carlo.confidence_percent),
            times=times,
            world=lot.world,
        )
        rows.append((row, episodes))
    return rows


def remembering(controller: Controller) -> Controller:
    """Return the controller with a planner, if any, that caches its plans.

    Flights from the same start with several safety layers are the same until a layer intervenes.
    """
    if not isinstance(controller, PlanningController):
        return controller
    return replace(controller, planner=_Remembering(controller.planner))


class _Remembering:
    """A planner that caches the forces of every decision."""

    def __init__(self, planner: Planner) -> None:
        self._planner = planner
        self._known: dict[tuple[object, ...], Floats] = {}

    @property
    def decisions(self) -> Sequence[int]:
        return self._planner.decisions

    def __call__(self, scenario: Scenario, decision: int, state: Floats) -> Floats:
        """Return the forces from a decision on; see `Planner`."""
        position, velocity = scenario.position_m.tobytes(), scenario.velocity_m_s.tobytes()
        sun = scenario.sun_angle_rad, scenario.sun_elevation_rad
        key = (position, velocity, *sun, scenario.noise, scenario.settings, decision, state.tobytes())
        if key not in self._known:
            self._known[key] = self._planner(scenario, decision, state)
        return self._known[key]


def _fly_cases(
    lot: Lot, mission: Mission, controller: Controller, label: str, note: Note
) -> dict[str, comparison.Column]:
    """Fly all starts part by part, with a line at the end."""
    started, scenarios = time.perf_counter(), lot.scenarios
    parts, after = list[Outcomes](), list[Aftermath | None]()
    for first in range(0, len(scenarios), PART):
        part = scenarios[first : first + PART]
        flown, follows = fly_followed(mission, controller, part, lot.experiment.monte_carlo.workers)
        parts.append(flown)
        after.append(follows)
        note(len(part), label)
    episodes = episode_columns(mission, scenarios, combined(parts), joined(after))
    spent, seconds = episodes["delta_v_m_s"].mean(), time.perf_counter() - started
    sys.stderr.write(f"  {label}: {len(scenarios)} cases in {seconds:.1f} s, {spent:.3f} m/s\n")
    return episodes


def _summary(experiment: Experiment, rows: list[comparison.ComparisonRow]) -> str:
    """Write the table and the meaning of its columns."""
    table = (
        comparison.format_worlds(rows, experiment.monte_carlo.confidence_percent)
        if experiment.compare.worlds
        else comparison.format_comparison(rows)
    )
    meaning = "".join(f"  {line}\n" for line in comparison.describe_columns(experiment))
    return f"\n{table}\n\n{meaning}"
