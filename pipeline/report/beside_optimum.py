"""A controller beside the minimum-fuel plans, for the report: cases and ratios, or why there are none."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.flight.control.controller import Controller, open_loop
from pipeline.flight.fly.simulation import fly_logged
from pipeline.flight.state.log import FlightLog
from pipeline.optimum.solved import IncomparableError, solved_for, summarise_times
from pipeline.run import artifacts, tables
from pipeline.settings.experiment import Experiment, Safety

Columns = Mapping[str, NDArray[Any]]

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
        Of `pipeline.optimum.solved.summarise_times`; empty without columns.
    reason : str
        Why nothing was compared; empty where it was, or where the run did not say.
    """

    columns: Columns | None
    summary: Mapping[str, Any]
    reason: str


@dataclass(frozen=True)
class Pair:
    """A case flown by the controller and by its minimum-fuel plan."""

    case: int
    which: str
    times: float
    controller: FlightLog
    plan: FlightLog


def read_beside(folder: Path) -> BesideOptimum:
    """Read what the stage evaluate wrote of it.

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
        return BesideOptimum(columns, summarise_times(columns), "")
    told: Any = (
        artifacts.read_json(folder, artifacts.SUMMARY) if (folder / artifacts.SUMMARY).exists() else {}
    )
    part = told.get("optimum") if isinstance(told, dict) else None
    reason = part.get("not_compared", "") if isinstance(part, dict) else ""
    return BesideOptimum(None, {}, str(reason))


def fly_pairs(experiment: Experiment, controller: Controller, beside: BesideOptimum) -> list[Pair]:
    """Fly the cases of the middle and of the greatest ratio; none where the plans are no longer at hand."""
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
    for row, which in chosen.items():
        for place in np.flatnonzero(theirs == ours[row]).tolist():
            plan = open_loop("plan", solved.plan(place, experiment.mission))
            start = solved.scenarios[place]
            flown = fly_logged(experiment.mission, controller, start)
            # a plan keeps the limits by itself
            planned = fly_logged(replace(experiment.mission, safety=Safety()), plan, start)
            times = float(beside.columns["times_optimum"][row])
            pairs.append(Pair(int(ours[row]), which, times, flown, planned))
    return pairs


def in_words(beside: BesideOptimum, threshold_percent: float) -> str:
    """Say how many times the optimum the controller burns; empty where it was not compared."""
    if beside.columns is None:
        return ""
    told, times = beside.summary, beside.summary["times_optimum"]
    fewest = int(np.min(beside.columns["optimum_inspected_count"]))
    cases = "the one solved case" if told["num_cases"] == 1 else f"{told['num_cases']} solved cases"
    return (
        f"In the mean of {cases} it burns {times['mean']:.2f} times the optimum, which is the fuel of a plan "
        f"that knows the whole flight in advance and inspects at least {fewest} points. The median is "
        f"{times['median']:.2f}, the range {times['min']:.2f} to {times['max']:.2f} (case "
        f"{times['max_case']}). A case costs it {told['delta_v_m_s']['mean']:.3f} m/s, the plan "
        f"{told['optimum_delta_v_m_s']['mean']:.3f} m/s. In {told['num_successful']} of "
        f"{told['num_cases']} it inspects at least {threshold_percent:g} % of the points within the limits."
    )


def times_tile(beside: BesideOptimum) -> list[tuple[str, str, str, str]]:
    """Return the headline number: label, number, unit, and what stands beside it; none without cases."""
    if beside.columns is None:
        return []
    times = beside.summary["times_optimum"]
    note = f"median {times['median']:.1f} of {beside.summary['num_cases']}"
    return [("times the optimum", f"{times['mean']:.1f}", "×", note)]


def optimum_rows(beside: BesideOptimum) -> list[list[str]]:
    """Return one row of words for each case, the greatest ratio first."""
    columns = beside.columns
    if columns is None:
        return []
    return [
        [
            str(int(columns["case"][row])),
            f"{math.degrees(columns['sun_angle_rad'][row]):.1f}",
            f"{columns['delta_v_m_s'][row]:.3f}",
            f"{columns['optimum_delta_v_m_s'][row]:.3f}",
            f"{columns['times_optimum'][row]:.2f}",
            str(int(columns["inspected_count"][row])),
            str(int(columns["optimum_inspected_count"][row])),
            f"{columns['min_distance_m'][row]:.1f} to {columns['max_distance_m'][row]:.1f}",
            outcome(bool(columns["success"][row]), bool(columns["violated"][row])),
        ]
        for row in np.argsort(-columns["times_optimum"], kind="stable")
    ]


def outcome(is_success: bool, is_violated: bool) -> str:
    """Say how a flight ended."""
    if is_violated:
        return "outside the limits"
    return "success" if is_success else "too few points"
