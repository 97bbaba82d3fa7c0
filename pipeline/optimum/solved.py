"""Cases with known minimum-fuel plans: those that ship, or those of a run of the stage optimum."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.array_types import Floats
from pipeline.flight.state.log import Scenario, points_needed
from pipeline.flight.world.pack import inspection_points
from pipeline.optimum.plan import CasePlan, num_agreeing
from pipeline.run import artifacts, tables
from pipeline.scenarios import starts_in
from pipeline.settings.experiment import SHIPPED, Experiment, Mission, SettingError
from pipeline.settings.mission import Dynamics
from pipeline.settings.start_table import POSITION, VELOCITY
from plain_files.file_access import open_text

Column = NDArray[Any]

#: groups of the mission that a minimum-fuel plan depends on
GROUPS = ("orbit", "deputy", "chief", "sensor", "light", "attitude")

#: the folders that ship, laid out like those of runs: plans for 95 points, and for more from the same starts
SHIPPED_FOLDERS = {sun: Path(__file__).parent / "shipped" / f"{sun}_sun" for sun in ("fixed", "random")}
HARDER_FOLDERS = {
    sun: [folder.with_name(f"{folder.name}_{points}") for points in (98, 99)]
    for sun, folder in SHIPPED_FOLDERS.items()
}


class IncomparableError(ValueError):
    """Why flights cannot be compared with the available plans; the text completes "not compared: …"."""


@dataclass(frozen=True)
class Solved:
    """Cases with the minimum-fuel plans found for them; only those that need fuel.

    Parameters
    ----------
    folder : Path
        Their folder.
    cases : mapping of (n,) arrays
        The columns of ``optimum/cases.parquet``.
    fired : (m, 5) array
        Case, time (s) and force (N, Hill axes) of every control period with a force.
    summary : mapping
        Content of ``optimum/summary.json``.
    harder : sequence of such columns
        Of plans for more points from the same starts, ascending; only for those that ship.
    """

    folder: Path
    cases: Mapping[str, Column]
    fired: Floats
    summary: Mapping[str, Any]
    harder: Sequence[Mapping[str, Column]] = ()

    @property
    def scenarios(self) -> list[Scenario]:
        """The starts of the cases, in order."""
        return starts_in(self.cases)

    def plan(self, row: int, mission: Mission) -> Floats:
        """Return the forces of a row's case, one per control period, N, Hill axes.

        Raises
        ------
        pipeline.run.artifacts.ArtifactError
            If the plan fires outside the flight.
        """
        fired = self.fired[self.fired[:, 0] == self.cases["case"][row]]
        forces = np.zeros((mission.num_controls, 3))
        periods = np.rint(fired[:, 1] / mission.control_period_s)
        if not np.all((periods >= 0) & (periods < mission.num_controls)):  # nor of what is no number
            raise artifacts.ArtifactError(
                f"{self.folder} has a plan that fires outside its flight; repeat the stage optimum"
            )
        forces[periods.astype(np.int64)] = fired[:, 2:]
        return forces


def terms_of(mission: Mission) -> dict[str, Any]:
    """Return the settings that a minimum-fuel plan depends on, besides its start, by dotted key.

    Settings that only a controller senses or uses are left out: guidance, coasting at the end. The share of
    the points that counts as a success matters by the number of points that it asks for.
    """
    terms = _of_groups(mission)
    for key in ("deputy.initial_position_m", "deputy.initial_velocity_m_s"):
        del terms[key]
    for key in ("attitude_period_s", "control_period_s", "duration_s"):
        terms[key] = getattr(mission, key)
    moved = asdict(mission.dynamics)
    terms["dynamics.model"] = moved.pop("model")
    if terms["dynamics.model"] != Dynamics().model:
        terms |= {f"dynamics.{key}": value for key, value in moved.items()}
    terms["after_s"] = mission.after_s
    return _plain(terms)


def _plain(terms: Mapping[str, Any]) -> dict[str, Any]:
    """Return terms as JSON stores them, so that they compare equal to those of a file."""
    return json.loads(json.dumps(terms))


def _of_groups(mission: Mission) -> dict[str, Any]:
    """Return the settings of `GROUPS` by dotted key."""
    return {
        f"{group}.{key}": value for group in GROUPS for key, value in asdict(getattr(mission, group)).items()
    }


def read_solved(folder: Path) -> Solved:
    """Read the cases of a folder that have a plan.

    Raises
    ------
    pipeline.run.artifacts.ArtifactError
        If a file is missing or cannot be read.
    """
    columns = tables.read_parquet(folder, artifacts.OPTIMUM_CASES)
    summary = artifacts.read_json(folder, artifacts.OPTIMUM_SUMMARY)
    path = artifacts.require(folder, artifacts.OPTIMUM_FORCES)
    fault = f"{folder} has no readable plans of least fuel"
    with artifacts.explained(fault, "repeat the stage optimum"), open_text(path) as stream:
        fired = np.loadtxt(stream, delimiter=",", skiprows=1, ndmin=2).reshape(-1, 5)
    is_solved = columns["is_feasible"].astype(np.bool_) & (columns["delta_v_m_s"] > 0.0)
    return Solved(folder, {name: column[is_solved] for name, column in columns.items()}, fired, summary)


def solved_for(experiment: Experiment) -> Solved:
    """Return the cases to compare an experiment's controllers with.

    Raises
    ------
    IncomparableError
        If its mission or its Sun differs from that of the plans, it is of fleets, or it names none.
    pipeline.run.artifacts.ArtifactError
        If the named plans cannot be read.
    """
    reference, sun = experiment.optimum.reference, experiment.sun
    if reference is None:
        raise IncomparableError("optimum.reference is null")
    for is_so, words in (
        (experiment.mission.has_fleet, "the plans are of one deputy"),
        (bool(experiment.mission.dispersions), "settings are dispersed, and the plans know none of them"),
        (experiment.monte_carlo.table is not None, "the starts are those of a file"),
    ):
        if is_so:
            raise IncomparableError(words)
    if reference == SHIPPED and sun.mode not in SHIPPED_FOLDERS:
        raise IncomparableError(f"sun.mode is {sun.mode}; plans ship for sun=fixed and sun=random")
    if reference == SHIPPED:
        harder = [read_solved(folder).cases for folder in HARDER_FOLDERS[sun.mode]]
        solved = replace(read_solved(SHIPPED_FOLDERS[sun.mode]), harder=harder)
    else:
        solved = read_solved(Path(reference))
    theirs, ours = solved.summary.get("mission"), terms_of(experiment.mission)
    their_sun, angles = solved.summary.get("sun"), solved.cases["sun_angle_rad"]
    if not isinstance(theirs, dict) or not len(solved.cases["case"]):
        raise IncomparableError(f"{solved.folder} does not say of which mission its plans are, or has none")
    # plans of earlier versions omit settings that then had no alternative to the paper's
    theirs = _plain(_of_groups(Mission()) | {"dynamics.model": Dynamics().model}) | theirs
    # plans that need not stay after their end are a mark for flights that must, but not the other way round
    theirs["after_s"] = theirs.get("after_s") or ours["after_s"]
    differing = [key for key in ours if ours[key] != theirs.get(key)]
    if differing:
        key = differing[0]
        raise IncomparableError(f"{key} is {ours[key]} here, and {theirs.get(key)} where the plans were made")
    if their_sun != sun.mode:
        raise IncomparableError(f"sun.mode is {sun.mode} here, and {their_sun} in the plans' cases")
    if sun.mode == "fixed" and not np.allclose(angles, np.radians(sun.angle_deg), rtol=0.0, atol=1e-9):
        raise IncomparableError(f"sun.angle_deg is {sun.angle_deg:g} here, and another in the plans' cases")
    low, high = sun.elevations_deg
    elevations = np.degrees(solved.cases.get("sun_elevation_rad", np.zeros(len(angles))))
    if np.any(elevations < low - 1e-9) or np.any(elevations > high + 1e-9):
        raise IncomparableError("the Sun has other elevations here than in the plans' cases")
    inspectable = solved.cases.get("inspectable_count", len(inspection_points(experiment.mission)))
    points, threshold = experiment.optimum.points, experiment.mission.inspection_threshold_percent
    if np.any(solved.cases["points_asked"] != (points or points_needed(inspectable, threshold))):
        setting = (
            f"optimum.points is {points}" if points else f"inspection_threshold_percent is {threshold:g}"
        )
        raise IncomparableError(f"{setting} here, and the plans inspect another number of points")
    return solved


def case_row(case: int, scenario: Scenario, plan: CasePlan, num_points: int) -> dict[str, Any]:
    """Return the row of a case in `optimum/cases.parquet`."""
    flight, restarts = plan.flight, plan.restart_delta_v
    settled = restarts[np.isfinite(restarts)]
    return {
        "case": case,
        **dict(zip(POSITION, scenario.position_m.tolist(), strict=True)),
        "sun_angle_rad": scenario.sun_angle_rad,
        "sun_elevation_rad": scenario.sun_elevation_rad,
        **dict(zip(VELOCITY, scenario.velocity_m_s.tolist(), strict=True)),
        "delta_v_m_s": flight.delta_v,
        "inspected_count": flight.num_inspected,
        "inspection_rate_percent": 100.0 * flight.num_inspected / num_points,
        "mean_distance_m": flight.mean_distance,
        "min_distance_m": flight.min_distance,
        "max_distance_m": flight.max_distance,
        "outside_m": flight.outside,
        "inspectable_count": plan.inspectable,
        "points_asked": plan.needed,
        "is_feasible": flight.is_feasible(plan.needed),
        "restarts": len(restarts),
        "restarts_feasible": len(settled),
        "restarts_agreeing": num_agreeing(restarts),
        "restart_median_m_s": float(np.median(settled)) if len(settled) else np.nan,
        "restart_max_m_s": float(settled[-1]) if len(settled) else np.nan,
        "delta_v_bound_m_s": plan.bound,
    }


def check_points(mission: Mission, needed: int | None) -> None:
    """Raise SettingError if more points are required than there are.

    Raises
    ------
    SettingError
    """
    num_points = len(inspection_points(mission))
    if needed is not None and needed > num_points:
        raise SettingError(
            f"optimum.points is {needed}, but the chief has {num_points} points; ask for at most as many"
        )


def summarise(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Summarise the cases; statistics cover the feasible ones."""
    feasible = [row for row in rows if row["is_feasible"]]
    summary: dict[str, Any] = {"num_cases": len(rows), "num_feasible": len(feasible)}
    if feasible:
        names = "delta_v_m_s", "delta_v_bound_m_s", "restarts_agreeing"
        spent, bounds, agreeing = (np.array([row[name] for row in feasible]) for name in names)
        deviation = float(spent.std(ddof=1)) if len(spent) > 1 else None
        middle = {"mean": float(spent.mean()), "standard_deviation": deviation}
        summary["delta_v_m_s"] = middle | {"median": float(np.median(spent)), "max": float(spent.max())}
        summary["delta_v_bound_m_s"] = {"mean": float(bounds.mean())}
        summary["cases_found_more_than_once"] = int(np.sum(agreeing > 1))
    return summary
