"""What flights are compared with: other controllers, plans of least fuel, flights without dispersions."""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.evaluation import comparison
from pipeline.evaluation.beside_optimum import summarise_times
from pipeline.evaluation.blocks import blocks_of
from pipeline.evaluation.monte_carlo import SUCCESS
from pipeline.evaluation.statistics import Columns
from pipeline.flight.cases.dispersions import mission_of_case, values_of
from pipeline.flight.control.controller import Controller, open_loop
from pipeline.flight.fly.fleet_logs import fly_logged_fleet
from pipeline.flight.goals.flights import fly_all, fly_logged
from pipeline.flight.state.log import FlightLog
from pipeline.optimum.solved import IncomparableError, solved_for
from pipeline.report.figures.comparison import ControllerMark
from pipeline.run import artifacts, tables
from pipeline.scenarios import evaluation_scenarios
from pipeline.settings.experiment import Experiment, Mission, Safety
from pipeline.settings.keys import value_at

#: starts that are drawn and flown at a time
FLOWN_AT_ONCE = 10_000


def read_comparison(folder: Path) -> list[comparison.ComparisonRow]:
    """Read the rows of the stage compare; none if it has not run.

    Raises
    ------
    pipeline.run.artifacts.ArtifactError
        If the file is there and cannot be read.
    """
    if not (folder / artifacts.COMPARISON).exists():
        return []
    summary = artifacts.read_json(folder, artifacts.COMPARISON)
    with artifacts.explained(f"{folder / artifacts.COMPARISON} is no comparison", "repeat the stage compare"):
        rows = [comparison.row_of(row) for row in summary["rows"]]
        if not any(row.source == comparison.FLOWN for row in rows):
            raise ValueError("no row tells of flights")
        comparison.format_comparison(rows)  # raises for any number that is missing
    return rows


def tables_of(rows: Sequence[comparison.ComparisonRow]) -> list[tuple[str, list[str], list[list[str]]]]:
    """Return a table for each Sun setting: the setting, headings of what is told, and lines.

    There are no tables where the rows are of several worlds.
    """
    suns = [] if comparison.worlds_of(rows) else comparison.suns_of(rows)
    return [(sun, *comparison.table_of(rows, sun)) for sun in suns]


def marks_of(rows: Sequence[comparison.ComparisonRow]) -> list[tuple[str, list[ControllerMark]]]:
    """Return the panels of the figure, with each controller under its first safety layer."""
    panels = []
    for sun in comparison.suns_of(rows):
        marks: dict[str, ControllerMark] = {}
        for row in (row for row in rows if row.sun in (sun, "")):
            name = row.controller if row.source == comparison.FLOWN else f"{row.controller} ({row.source})"
            spent, rate = (_pair(row.summary[part]) for part in ("delta_v_m_s", "inspection_rate_percent"))
            marks.setdefault(name, ControllerMark(name, spent, rate))
        panels.append((f"Sun {sun}", list(marks.values())))
    return panels


def _pair(measure: Mapping[str, Any]) -> tuple[float, float]:
    # one flight has no deviation
    return float(measure["mean"]), float(measure["standard_deviation"] or 0.0)


#: of what there are percentiles: name and decimals
METRICS = {
    "delta_v_m_s": ("Δv (m/s)", 3),
    "inspectable_rate_percent": ("rate of the points that can be inspected (%)", 2),
    "max_distance_m": ("greatest distance (m)", 1),
    "min_distance_m": ("least distance (m)", 1),
}


@dataclass(frozen=True)
class Spread:
    """Tables of percentiles and sensitivities, as words.

    Parameters
    ----------
    percentiles : sequence of rows
        Metric, percent of flights, value, interval.
    nominal : sequence of rows
        Which flights, delta-v, rate, success, outside.
    ranking : sequence of rows
        Key, rank correlations with delta-v and rate, with intervals.
    """

    percentiles: Sequence[Sequence[str]] = ()
    nominal: Sequence[Sequence[str]] = ()
    ranking: Sequence[Sequence[str]] = ()


def spread_of(folder: Path, summary: Mapping[str, Any]) -> Spread:
    """Return the tables of percentiles and sensitivities of a summary; empty if it has none.

    Raises
    ------
    pipeline.run.artifacts.ArtifactError
        If it tells something else.
    """
    fault = f"{folder / artifacts.SUMMARY} does not tell of percentiles and dispersions what it should"
    with artifacts.explained(fault, "repeat the stage evaluate", AttributeError):
        by_metric = summary.get("percentiles", {})
        percentiles = [
            [name, _share(entry["percent"]), f"{entry['value']:.{decimals}f}", _between(entry, decimals)]
            for metric, (name, decimals) in METRICS.items()
            for entry in by_metric.get(metric, ())
        ]
        if "nominal" not in summary:
            return Spread(percentiles)
        outcomes = {"as dispersed": summary, "without dispersions": summary["nominal"]}
        nominal = [[label, *_outcome(of)] for label, of in outcomes.items()]
        ranking = [
            [
                entry["key"],
                _correlation(entry["delta_v_m_s"]),
                _correlation(entry["inspectable_rate_percent"]),
            ]
            for entry in summary["sensitivity"]
        ]
        return Spread(percentiles, nominal, ranking)


def _share(percent: float) -> str:
    """Return the share of flights below a percentile, or above it, in words."""
    return f"{percent:g} % have at most" if percent >= 50.0 else f"{100.0 - percent:g} % have at least"


def _between(interval: Mapping[str, float | None], decimals: int) -> str:
    """Return an interval in words, of which either end may be unknown."""
    low, high = (
        None if interval[end] is None else f"{interval[end]:.{decimals}f}" for end in ("low", "high")
    )
    if low is None and high is None:
        return "not told by so few"
    return f"up to {high}" if low is None else f"{low} and more" if high is None else f"{low} to {high}"


def _outcome(summary: Mapping[str, Any]) -> list[str]:
    """Return the cells of a summary: delta-v, rate, and shares of success and of leaving the limits."""
    return [
        comparison.fuel_in_words(summary),
        comparison.spread(summary["inspectable_rate_percent"], 2),
        *(f"{100 * summary[name]['fraction']:.1f} %" for name in (SUCCESS, "violated")),
    ]


def _correlation(correlation: Mapping[str, float]) -> str:
    words = f"{correlation['value']:+.2f} ({correlation['low']:+.2f} to {correlation['high']:+.2f})"
    return words.replace("-", "−")


#: of `evaluate/optimum.parquet`, the columns shown for each case
COLUMNS = (
    *("case", "sun_angle_rad", "delta_v_m_s", "optimum_delta_v_m_s", "times_optimum"),
    *("inspected_count", "optimum_inspected_count", "min_distance_m", "max_distance_m"),
    *("success", "violated"),
)


@dataclass(frozen=True)
class BesideOptimum:
    """A controller's flights beside the plans of the same cases.

    Parameters
    ----------
    columns : mapping of (n,) arrays, optional
        Those of ``evaluate/optimum.parquet``.
    summary : mapping
        Of `pipeline.evaluation.beside_optimum.summarise_times`; empty without columns.
    reason : str
        Why nothing was compared; empty where it was, or where the run did not say.
    """

    columns: Columns | None
    summary: Mapping[str, Any]
    reason: str


@dataclass(frozen=True)
class FlightBesidePlan:
    """A case flown by the controller and by its minimum-fuel plan."""

    case: int
    which: str
    times: float
    controller: FlightLog
    plan: FlightLog


def read_beside(folder: Path, summary: Mapping[str, Any]) -> BesideOptimum:
    """Read the comparison with minimum-fuel plans; without one, the reason from the summary.

    Raises
    ------
    pipeline.run.artifacts.ArtifactError
        If a file is there and cannot be read, or is of something else.
    """
    if (folder / artifacts.BESIDE_OPTIMUM).exists():
        columns = tables.read_parquet(folder, artifacts.BESIDE_OPTIMUM)
        missing = [name for name in COLUMNS if name not in columns]
        if missing or not len(columns["case"]):
            raise artifacts.ArtifactError(
                f"{folder / artifacts.BESIDE_OPTIMUM} has no {missing[0] if missing else 'cases'}; "
                "repeat the stage evaluate"
            )
        return BesideOptimum(
            columns, summarise_times(columns, float(summary.get("confidence_percent", 95.0))), ""
        )
    return BesideOptimum(None, {}, str(value_at(summary, "optimum.not_compared", "")))


def fly_pairs(
    experiment: Experiment, controller: Controller, beside: BesideOptimum
) -> list[FlightBesidePlan]:
    """Fly the cases with the median and the greatest ratio; none if their plans are no longer available."""
    if beside.columns is None:
        return []
    try:
        solved = solved_for(experiment)
    except (IncomparableError, artifacts.ArtifactError):
        return []
    ours, theirs = beside.columns["case"], solved.cases["case"]
    order = np.argsort(beside.columns["times_optimum"], kind="stable")
    chosen = {int(order[len(order) // 2]): "the middle", int(order[-1]): "the greatest"}
    pairs = []
    for row, rank in chosen.items():
        for index in np.flatnonzero(theirs == ours[row]).tolist():
            plan = open_loop("plan", solved.plan(index, experiment.mission))
            start = solved.scenarios[index]
            flown = fly_logged(experiment.mission, controller, start)
            # a plan keeps the limits by itself
            planned = fly_logged(replace(experiment.mission, safety=Safety()), plan, start)
            times = float(beside.columns["times_optimum"][row])
            pairs.append(FlightBesidePlan(int(ours[row]), rank, times, flown, planned))
    return pairs


def optimum_rows(beside: BesideOptimum) -> list[list[str]]:
    """Return a table row for each case, the greatest ratio first."""
    if beside.columns is None:
        return []
    spent = ("{delta_v_m_s:.3f}", "{optimum_delta_v_m_s:.3f}", "{times_optimum:.2f}")
    points = ("{inspected_count:.0f}", "{optimum_inspected_count:.0f}")
    cells = ("{case:.0f}", "{sun_deg:.1f}", *spent, *points, *ENDED)
    order = np.argsort(-beside.columns["times_optimum"], kind="stable")
    return rows_in_words(beside.columns, order.tolist(), cells)


#: of flights case by case: extremes of the distance, and how they ended
ENDED = ("{min_distance_m:.1f} to {max_distance_m:.1f}", "{outcome}")


def rows_in_words(columns: Columns, rows: Iterable[int], cells: Sequence[str]) -> list[list[str]]:
    """Return table rows of flights as text; each cell is a format of a flight's values."""
    lines = []
    for row in rows:
        values = {name: column[row] for name, column in columns.items()}
        ended = "success" if values["success"] else "too few points"
        values["outcome"] = "outside the limits" if values["violated"] else ended
        values["sun_deg"] = math.degrees(values["sun_angle_rad"])
        lines.append([cell.format(**values) for cell in cells])
    return lines


@dataclass(frozen=True)
class Without:
    """Flights in which the safety layer acted, flown again without it.

    Parameters
    ----------
    num_outside : int
        So many of them would have left the limits.
    case : int
        The one that would have been farthest outside, or nearest to it.
    deputy : int
        Of a fleet, the one that would have been; 0 of one deputy.
    guarded, unguarded : FlightLog
        That flight with the layer and without.
    """

    num_outside: int
    case: int
    deputy: int
    guarded: FlightLog
    unguarded: FlightLog


def _acted(episodes: Columns) -> Iterator[list[int]]:
    """Yield the cases in which the safety layer acted, so many at a time as are flown at once."""
    for block in blocks_of(episodes):
        cases = block["case"][block["safety_periods"] > 0].tolist()
        for first in range(0, len(cases), FLOWN_AT_ONCE):
            yield cases[first : first + FLOWN_AT_ONCE]


def fly_without(experiment: Experiment, controller: Controller, episodes: Columns | None) -> Without | None:
    """Fly the flights in which the safety layer acted without it; None if there are none.

    Parameters
    ----------
    experiment : Experiment
    controller : Controller
    episodes : mapping of (n,) arrays, optional
        The columns of ``evaluate/episodes.parquet``.
    """
    mission = experiment.mission
    # episodes of earlier versions do not tell
    if mission.safety.kind == "none" or episodes is None or "safety_periods" not in episodes:
        return None
    fleet = replace(mission.fleet, keep_apart_m=0.0)  # which the layer alone does
    unguarded = replace(mission, safety=Safety(), fleet=fleet)
    num_outside, worst, worst_case = 0, -math.inf, -1
    for part in _acted(episodes):
        scenarios = evaluation_scenarios(experiment, part)
        outcomes = fly_all(unguarded, controller, scenarios, experiment.monte_carlo.workers)
        num_outside += int(outcomes.is_violated.sum())
        least, most = (
            values_of(f"deputy.{limit}_distance_m", mission, scenarios) for limit in ("min", "max")
        )
        beyond = np.maximum(least - outcomes.min_distance_m, outcomes.max_distance_m - most)
        row = int(np.argmax(beyond))
        if beyond[row] > worst:
            worst, worst_case = float(beyond[row]), part[row]
    if worst_case < 0:
        return None
    (start,) = evaluation_scenarios(experiment, [worst_case])
    if mission.has_fleet:
        fleets = [fly_logged_fleet(world, controller, start) for world in (mission, unguarded)]
        flown = mission_of_case(mission, start)
        deputy = int(np.argmax([_beyond(flown, each.flight) for each in fleets[1]]))
        return Without(num_outside, worst_case, deputy + 1, *(each[deputy].flight for each in fleets))
    logs = (fly_logged(world, controller, start) for world in (mission, unguarded))
    return Without(num_outside, worst_case, 0, *logs)


def _beyond(mission: Mission, log: FlightLog) -> float:
    """Return how far a flight comes outside the distance limits, m; below zero inside."""
    distances, limits = np.linalg.norm(log.position_m, axis=1), mission.deputy
    return float(max(limits.min_distance_m - distances.min(), distances.max() - limits.max_distance_m))
