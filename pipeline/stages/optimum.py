"""Compute a minimum-fuel plan for each case, with the whole flight known in advance: optimum/."""

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from fis_tools.processors import num_processors
from pipeline.controllers.played import COLUMNS, read_played
from pipeline.flight.cases.starts import starts_of
from pipeline.flight.state.log import Scenario
from pipeline.flight.world.pack import inspection_points
from pipeline.optimum.plan import CasePlan, solve
from pipeline.optimum.solved import case_row, summarise, terms_of
from pipeline.run import artifacts, engine, tables, writing
from pipeline.run.progress import Progress
from pipeline.scenarios import EVALUATION, evaluation_scenarios, given_start, starts_in
from pipeline.settings.experiment import Experiment

CaseRow = dict[str, Any]


def run(experiment: Experiment, folder: Path) -> None:
    """Solve the missing cases, of the evaluation or of the given start, and write each once it is solved."""
    is_given = experiment.optimum.cases == "start"
    scenarios = [given_start(experiment)] if is_given else evaluation_scenarios(experiment)
    rows = kept_rows(folder, scenarios)
    if rows:
        sys.stderr.write(
            f"  {len(rows)} of {len(scenarios)} cases are there already; to solve them anew, delete "
            f"{folder / artifacts.OPTIMUM_CASES}\n"
        )
    left = [case for case in range(len(scenarios)) if case not in rows]
    workers = experiment.optimum.workers or num_processors()
    tasks = [(experiment, case, scenarios[case]) for case in left]
    with (
        engine.open_pool(experiment.engine, workers, threads=workers) as pool,
        Progress("solved", len(scenarios), len(rows)) as progress,
    ):
        for index, plan in pool.run(_solve, tasks):
            case = left[index]
            rows[case] = _keep(experiment, folder, case, scenarios[case], plan)
            write_cases(folder, rows)
            progress.show(len(rows), _row_in_words(rows[case]))
    _finish(experiment, folder, rows)


def plan_path(folder: Path, case: int) -> Path:
    """Return the path of a case's plan."""
    return folder / artifacts.OPTIMUM_PLANS / f"case-{case:04d}.csv"


def kept_rows(folder: Path, scenarios: list[Scenario]) -> dict[int, CaseRow]:
    """Return the rows of cases that were solved before from this run's starts, and whose plan exists."""
    if not (folder / artifacts.OPTIMUM_CASES).exists():
        return {}
    columns = tables.read_parquet(folder, artifacts.OPTIMUM_CASES)
    starts, solved = starts_of(scenarios), starts_of(starts_in(columns))
    rows = {}
    for row, case in enumerate(columns["case"].tolist()):
        if case < len(starts) and plan_path(folder, case).exists() and solved[row] == starts[case]:
            rows[case] = {name: column[row].item() for name, column in columns.items()}
    return rows


def _solve(experiment: Experiment, case: int, scenario: Scenario) -> CasePlan:
    """Solve a case; its random numbers depend only on the seed, the case and the restart."""
    seed = np.random.SeedSequence(experiment.seed, spawn_key=(EVALUATION, case))
    return solve(experiment.mission, scenario, experiment.optimum, seed)


def _keep(experiment: Experiment, folder: Path, case: int, scenario: Scenario, plan: CasePlan) -> CaseRow:
    """Write a plan as the table of forces that ``controller=open_loop`` flies, and return its row."""
    forces, period = plan.flight.forces, experiment.mission.control_period_s
    last = int(np.flatnonzero(np.any(forces != 0.0, axis=1)).max(initial=0))
    table = [[k * period, *force] for k, force in enumerate(forces[: last + 1].tolist())]
    tables.write_csv(plan_path(folder, case), COLUMNS, table)
    num_points = len(inspection_points(experiment.mission))
    return case_row(case, scenario, plan, num_points)


def write_cases(folder: Path, rows: Mapping[int, CaseRow]) -> None:
    """Write the table of cases, in order."""
    ordered = [rows[case] for case in sorted(rows)]
    columns = {name: np.array([row[name] for row in ordered]) for name in ordered[0]}
    tables.write_parquet(folder / artifacts.OPTIMUM_CASES, columns)


def _row_in_words(row: CaseRow) -> str:
    """Return how solving a case ended, for the line on the terminal."""
    if not row["is_feasible"]:
        return (
            f"case {row['case']} has no plan: {row['inspected_count']} of {row['points_asked']} points, "
            f"{row['outside_m']:.1f} m outside"
        )
    return (
        f"case {row['case']}: {row['delta_v_m_s']:.4f} m/s, found by {row['restarts_agreeing']} of "
        f"{row['restarts']} restarts, at least {row['delta_v_bound_m_s']:.4f} m/s"
    )


def _finish(experiment: Experiment, folder: Path, rows: Mapping[int, CaseRow]) -> None:
    """Write all forces as one small table, and the summary."""
    fired = []
    for case in sorted(rows):
        forces = np.asarray(read_played(plan_path(folder, case), experiment.mission).plan)
        for k in np.flatnonzero(np.any(forces != 0.0, axis=1)).tolist():
            fired.append([case, k * experiment.mission.control_period_s, *forces[k].tolist()])
    tables.write_csv(folder / artifacts.OPTIMUM_FORCES, ("case", *COLUMNS), fired)
    summary = {
        "sun": experiment.sun.mode,
        "seed": experiment.seed,
        "attitude": experiment.mission.attitude.mode,
        "points_asked": max(row["points_asked"] for row in rows.values()),
        "mission": terms_of(experiment.mission),
        **summarise([rows[case] for case in sorted(rows)]),
    }
    writing.write_json(folder / artifacts.OPTIMUM_SUMMARY, summary)
    line = f"  {summary['num_feasible']} of {len(rows)} cases solved"
    if "delta_v_m_s" in summary:
        spent, bound = summary["delta_v_m_s"], summary["delta_v_bound_m_s"]
        line += (
            f": delta-v {spent['mean']:.4f} m/s on average, {spent['max']:.4f} at most; "
            f"no plan does with less than {bound['mean']:.4f} on average"
        )
    sys.stderr.write(line + "\n")
