"""What a report tells of an evaluation's spread: what most flights keep to, and what dispersions cost."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pipeline.evaluation.monte_carlo import SUCCESS

#: of what there are percentiles: name and decimals
METRICS = {
    "delta_v_m_s": ("Δv (m/s)", 3),
    "inspectable_rate_percent": ("rate of the points that can be inspected (%)", 2),
    "max_distance_m": ("greatest distance (m)", 1),
    "min_distance_m": ("least distance (m)", 1),
}


@dataclass(frozen=True)
class Spread:
    """Tables, in words.

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


def spread_of(summary: Mapping[str, Any]) -> Spread:
    """Return the tables of a summary; empty where it does not tell.

    Raises
    ------
    KeyError, TypeError, ValueError
        If it tells something else.
    """
    told = summary.get("percentiles", {})
    percentiles = [
        [name, _share(one["percent"]), f"{one['value']:.{places}f}", _between(one, places)]
        for metric, (name, places) in METRICS.items()
        for one in told.get(metric, ())
    ]
    if "nominal" not in summary:
        return Spread(percentiles)
    nominal = [["as dispersed", *_outcome(summary)], ["without dispersions", *_outcome(summary["nominal"])]]
    ranking = [
        [one["key"], _correlation(one["delta_v_m_s"]), _correlation(one["inspectable_rate_percent"])]
        for one in summary["sensitivity"]
    ]
    return Spread(percentiles, nominal, ranking)


def _share(percent: float) -> str:
    """Say which flights have at most a percentile, or at least."""
    return f"{percent:g} % have at most" if percent >= 50.0 else f"{100.0 - percent:g} % have at least"


def _between(told: Mapping[str, float | None], places: int) -> str:
    low, high = (None if told[end] is None else f"{told[end]:.{places}f}" for end in ("low", "high"))
    if low is None and high is None:
        return "not told by so few"
    return f"up to {high}" if low is None else f"{low} and more" if high is None else f"{low} to {high}"


def _outcome(told: Mapping[str, Any]) -> list[str]:
    delta_v, rate = told["delta_v_m_s"], told["inspectable_rate_percent"]
    return [
        f"{delta_v['mean']:.3f} ± {delta_v['standard_deviation']:.3f}",
        f"{rate['mean']:.2f} ± {rate['standard_deviation']:.2f}",
        *(f"{100 * told[name]['fraction']:.1f} %" for name in (SUCCESS, "violated")),
    ]


def _correlation(told: Mapping[str, float]) -> str:
    words = f"{told['value']:+.2f} ({told['low']:+.2f} to {told['high']:+.2f})"
    return words.replace("-", "−")
