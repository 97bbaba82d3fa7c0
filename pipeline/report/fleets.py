"""What a report tells of evaluated fleets: what deputies do together, and each of them."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from pipeline.evaluation.comparison import spread
from pipeline.evaluation.statistics import Columns, statistic
from pipeline.report.contents import FlightSet

#: of a fleet's summary, in words with decimals
TOGETHER: Mapping[str, tuple[str, int]] = {
    "delta_v_m_s": ("Δv of all deputies (m/s)", 3),
    "greatest_delta_v_m_s": ("Δv of the one that spends most (m/s)", 3),
    "enough_s": ("time at which enough points are seen (s)", 0),
    "nearest_pair_m": ("least distance between two (m)", 1),
}
TOGETHER_HEADINGS = ("", "mean ± standard deviation", "interval of the mean", "least", "greatest")
#: of each deputy
OF_EACH: Mapping[str, tuple[str, int]] = {
    "delta_v_m_s": ("Δv (m/s)", 3),
    "inspected_count": ("points seen first", 1),
    "mean_distance_m": ("mean distance (m)", 1),
}
EACH_HEADINGS = ("", *(words for words, _ in OF_EACH.values()), "extremes (m)", "outside the limits")


def together_rows(summary: Mapping[str, Any]) -> list[list[str]]:
    """Return a row for each quantity of fleets that a summary has."""
    measured = {name: words for name, words in TOGETHER.items() if name in summary}
    return [
        [
            words,
            spread(summary[name], decimals),
            _interval(summary[name], decimals),
            *(f"{summary[name][end]:.{decimals}f}" for end in ("minimum", "maximum")),
        ]
        for name, (words, decimals) in measured.items()
    ]


def deputy_rows(flights: FlightSet) -> list[list[str]]:
    """Return a row for each deputy over all flights of a set; none where they are not told apart."""
    if (deputies := flights.deputies) is None:
        return []
    confidence = float(flights.summary["confidence_percent"])
    numbers = np.asarray(deputies["deputy"])
    return [_deputy_row(deputies, numbers == number, confidence) for number in np.unique(numbers).tolist()]


def _deputy_row(deputies: Columns, is_of: Any, confidence: float) -> list[str]:
    column = {name: np.asarray(deputies[name])[is_of] for name in (*OF_EACH, "deputy", "violated")}
    nearest, farthest = (np.asarray(deputies[f"{end}_distance_m"])[is_of] for end in ("min", "max"))
    means = [_mean(column[name], confidence, decimals) for name, (_, decimals) in OF_EACH.items()]
    outside = f"{np.count_nonzero(column['violated']):,} of {len(nearest):,}"
    extremes = f"{nearest.min():.1f} to {farthest.max():.1f}"
    return [f"deputy\N{NO-BREAK SPACE}{column['deputy'][0]}", *means, extremes, outside]


def _mean(values: Any, confidence: float, decimals: int) -> str:
    measured = vars(statistic(values, confidence))
    interval = _interval(measured, decimals)
    return spread(measured, decimals) + (f" ({interval})" if interval else "")


def _interval(measured: Mapping[str, float | None], decimals: int) -> str:
    """Return the interval of a mean; nothing of a single flight."""
    if measured["low"] is None:
        return ""
    return f"{measured['low']:.{decimals}f} to {measured['high']:.{decimals}f}"
