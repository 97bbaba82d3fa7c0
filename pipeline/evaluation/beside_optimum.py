"""Flights beside the best plans known for the same starts: how many times their fuel a controller burns."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pipeline.array_types import Floats
from pipeline.evaluation.statistics import Column, bootstrap_interval


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


def summarise_times(columns: Mapping[str, Column], confidence_percent: float) -> dict[str, Any]:
    """Summarise `beside_optimum`: fuel relative to the best plans and to proved bounds, and the successes.

    Parameters
    ----------
    columns : mapping of (n,) arrays
    confidence_percent : float
        Of the intervals of means.

    Returns
    -------
    dict
        ``times_optimum`` is over all cases, ``times_optimum_of_successful`` over those that succeed: what
        fails may be cheap for that. ``times_bound`` is relative to what every plan burns at least. Those over
        no case are None.
    """
    times, is_success = columns["times_optimum"], columns["success"] & ~columns["violated"]
    as_seen = columns.get("times_optimum_as_seen", times)  # missing in tables of earlier versions
    bounds = columns.get("optimum_bound_m_s", np.zeros(len(times)))
    is_bounded, worst = bounds > 0.0, int(np.argmax(times))
    of_bounds = columns["delta_v_m_s"][is_bounded] / bounds[is_bounded]

    def middle(ratios: Floats) -> dict[str, Any] | None:
        if not len(ratios):
            return None
        low, high = bootstrap_interval(ratios, confidence_percent) or (None, None)
        return {"mean": float(ratios.mean()), "low": low, "high": high}

    return {
        "num_cases": len(times),
        "num_successful": int(np.sum(is_success)),
        "times_optimum": {
            **(middle(times) or {}),
            "median": float(np.median(times)),
            "min": float(times.min()),
            "max": float(times[worst]),
            "max_case": int(columns["case"][worst]),
        },
        "times_optimum_as_seen": middle(as_seen),
        "times_optimum_of_successful": middle(times[is_success]),
        "times_bound": middle(of_bounds),
        "delta_v_m_s": {"mean": float(columns["delta_v_m_s"].mean())},
        "optimum_delta_v_m_s": {"mean": float(columns["optimum_delta_v_m_s"].mean())},
    }


def times_in_words(times: Mapping[str, Any] | None, decimals: int) -> str:
    """Return a mean ratio with its interval; nothing where there is none."""
    if times is None:
        return ""
    mean = f"{times['mean']:.{decimals}f}"
    # summaries of earlier versions have no intervals
    if times.get("low") is None:
        return mean
    return f"{mean} ({times['low']:.{decimals}f}–{times['high']:.{decimals}f})"
