"""Results of solved cases: a row per case, a summary, and the ratio of other flights to the optimum."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.flight.state.log import Scenario
from pipeline.flight.world.pack import inspection_points
from pipeline.optimum.plan import CasePlan, num_agreeing
from pipeline.settings.experiment import Mission, SettingError

Column = NDArray[Any]

_POSITION = ("position_x_m", "position_y_m", "position_z_m")
_VELOCITY = ("velocity_x_m_s", "velocity_y_m_s", "velocity_z_m_s")


def case_row(case: int, scenario: Scenario, plan: CasePlan, num_points: int) -> dict[str, Any]:
    """Return the row of a case in `optimum/cases.parquet`."""
    flight, restarts = plan.flight, plan.restart_delta_v
    settled = restarts[np.isfinite(restarts)]
    return {
        "case": case,
        **dict(zip(_POSITION, scenario.position_m.tolist(), strict=True)),
        "sun_angle_rad": scenario.sun_angle_rad,
        "sun_elevation_rad": scenario.sun_elevation_rad,
        **dict(zip(_VELOCITY, scenario.velocity_m_s.tolist(), strict=True)),
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
        spent = np.array([row["delta_v_m_s"] for row in feasible])
        bounds = np.array([row["delta_v_bound_m_s"] for row in feasible])
        agreeing = np.array([row["restarts_agreeing"] for row in feasible])
        summary |= {
            "delta_v_m_s": {
                "mean": float(spent.mean()),
                "standard_deviation": float(spent.std(ddof=1)) if len(spent) > 1 else None,
                "median": float(np.median(spent)),
                "max": float(spent.max()),
            },
            "delta_v_bound_m_s": {"mean": float(bounds.mean())},
            "cases_found_more_than_once": int(np.sum(agreeing > 1)),
        }
    return summary


def beside_optimum(
    episodes: Mapping[str, Column], cases: Mapping[str, Column], harder: Sequence[Mapping[str, Column]] = ()
) -> dict[str, Column]:
    """Compare a controller's flights with the plans of the same cases.

    Parameters
    ----------
    episodes : mapping of (n,) arrays
        Of `pipeline.evaluation.monte_carlo.episode_columns`, flown from the starts of the cases, in order.
    cases : mapping of (n,) arrays
        Of `pipeline.optimum.solved.Solved`.
    harder : sequence of such columns
        The same, with plans for more points.

    Returns
    -------
    dict of (n,) arrays
        The columns of `evaluate/optimum.parquet`: those of the episodes, under the numbers of the cases,
        ``optimum_delta_v_m_s``, ``optimum_bound_m_s``, ``optimum_inspected_count``, ``times_optimum``; and
        ``optimum_as_seen_delta_v_m_s``, ``times_optimum_as_seen``, of the cheapest plan that inspects as many
        points as the flight did, or the most of all plans.
    """
    least, spent = np.asarray(cases["delta_v_m_s"], dtype=np.float64), np.asarray(episodes["delta_v_m_s"])
    as_seen, reached = least, np.asarray(cases["inspected_count"])
    for plans in harder:
        falls_short = reached < episodes["inspected_count"]
        as_seen = np.where(falls_short, plans["delta_v_m_s"], as_seen)
        reached = np.where(falls_short, plans["inspected_count"], reached)
    return {
        **episodes,
        "case": np.asarray(cases["case"]),
        "optimum_delta_v_m_s": least,
        "optimum_bound_m_s": np.asarray(cases["delta_v_bound_m_s"], dtype=np.float64),
        "optimum_inspected_count": np.asarray(cases["inspected_count"]),
        "times_optimum": spent / least,
        "optimum_as_seen_delta_v_m_s": as_seen,
        "times_optimum_as_seen": spent / as_seen,
    }


def summarise_times(columns: Mapping[str, Column]) -> dict[str, Any]:
    """Return a summary of `beside_optimum`: times the optimum, and cases that succeed inside the limits."""
    times = columns["times_optimum"]
    as_seen = columns.get("times_optimum_as_seen", times)  # missing in tables of earlier versions
    worst = int(np.argmax(times))
    return {
        "num_cases": len(times),
        "num_successful": int(np.sum(columns["success"] & ~columns["violated"])),
        "times_optimum": {
            "mean": float(times.mean()),
            "median": float(np.median(times)),
            "min": float(times.min()),
            "max": float(times[worst]),
            "max_case": int(columns["case"][worst]),
        },
        "times_optimum_as_seen": {"mean": float(as_seen.mean())},
        "delta_v_m_s": {"mean": float(columns["delta_v_m_s"].mean())},
        "optimum_delta_v_m_s": {"mean": float(columns["optimum_delta_v_m_s"].mean())},
    }
