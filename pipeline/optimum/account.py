"""What solved cases come to: a row a case, a summary, and how many times the optimum others burn."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.flight import Scenario
from pipeline.optimum.plan import CasePlan, num_agreeing
from pipeline.settings import Mission, SettingError
from pipeline.simulation import inspection_points

Column = NDArray[Any]

#: starts nearer to one another than this are the same case, m and rad
SAME_START = 1e-9
_START = ("position_x_m", "position_y_m", "position_z_m", "sun_angle_rad")


def case_row(case: int, scenario: Scenario, plan: CasePlan, needed: int, num_points: int) -> dict[str, Any]:
    """Return the row of a case in `optimum/cases.parquet`."""
    flight, restarts = plan.flight, plan.restart_delta_v
    settled = restarts[np.isfinite(restarts)]
    return {
        "case": case,
        **dict(zip(_START, [*scenario.position_m.tolist(), scenario.sun_angle_rad], strict=True)),
        "delta_v_m_s": flight.delta_v,
        "inspected_count": flight.num_inspected,
        "inspection_rate_percent": 100.0 * flight.num_inspected / num_points,
        "mean_distance_m": flight.mean_distance,
        "min_distance_m": flight.min_distance,
        "max_distance_m": flight.max_distance,
        "outside_m": flight.outside,
        "points_asked": needed,
        "is_feasible": flight.is_feasible(needed),
        "restarts": len(restarts),
        "restarts_feasible": len(settled),
        "restarts_agreeing": num_agreeing(restarts),
        "restart_median_m_s": float(np.median(settled)) if len(settled) else np.nan,
        "restart_max_m_s": float(settled[-1]) if len(settled) else np.nan,
        "delta_v_bound_m_s": plan.bound,
    }


def check_points(mission: Mission, needed: int) -> None:
    """Refuse to look for more points than there are.

    Raises
    ------
    SettingError
    """
    num_points = len(inspection_points(mission))
    if needed > num_points:
        raise SettingError(
            f"optimum.points is {needed}, but the chief has {num_points} points; ask for at most as many"
        )


def summarise(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return what the cases come to together; statistics are those of the feasible ones."""
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


def ratio_to_optimum(episodes: Mapping[str, Column], optimum: Mapping[str, Column]) -> dict[str, Column]:
    """Say case by case how many times the optimum an evaluation burns.

    Parameters
    ----------
    episodes : mapping of columns
        Of `evaluate/episodes.parquet`.
    optimum : mapping of columns
        Of `optimum/cases.parquet`.

    Returns
    -------
    dict of (m,) arrays
        ``case``, ``delta_v_m_s``, ``optimum_delta_v_m_s``, ``times_optimum``: the episodes that begin where a
        feasible case of the optimum does, whatever their numbers. NaN where the optimum needs no fuel.
    """
    solved = np.flatnonzero(np.asarray(optimum["is_feasible"], dtype=np.bool_))
    theirs = np.stack([np.asarray(optimum[name], dtype=np.float64)[solved] for name in _START], axis=1)
    ours = np.stack([np.asarray(episodes[name], dtype=np.float64) for name in _START], axis=1)
    apart = np.abs(ours[:, np.newaxis] - theirs[np.newaxis]).max(axis=2)
    rows, places = np.nonzero(apart <= SAME_START)
    spent = np.asarray(episodes["delta_v_m_s"], dtype=np.float64)[rows]
    least = np.asarray(optimum["delta_v_m_s"], dtype=np.float64)[solved[places]]
    return {
        "case": np.asarray(episodes["case"])[rows],
        "delta_v_m_s": spent,
        "optimum_delta_v_m_s": least,
        "times_optimum": np.divide(spent, least, out=np.full(len(rows), np.nan), where=least > 0.0),
    }
