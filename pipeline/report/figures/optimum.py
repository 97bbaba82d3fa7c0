"""A controller and the minimum-fuel plans: all cases by their ratio, and two flights of one case."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from numpy.typing import NDArray

from pipeline.report.figures.style import (
    BESIDE,
    BLUE,
    DOTS,
    INK,
    MUTED,
    ORANGE,
    PAPER,
    PURPLE,
    grid,
)

Columns = Mapping[str, NDArray[Any]]

#: how a controller's flight ended: words, colour, marker
ENDS = {
    "success": (BLUE, "o"),
    "too few points": (ORANGE, "v"),
    "outside the distance limits": (PURPLE, "X"),
}
#: from so many cases on their numbers are too small to be read
MOST_NUMBERED = 64


def beside_optimum(columns: Columns, needed: int) -> Figure:
    """Draw delta-v and points of a controller over those of the plans, ordered by their ratio.

    Parameters
    ----------
    columns : mapping of (n,) arrays
        Of ``evaluate/optimum.parquet``.
    needed : int
        Points that make a flight a success.
    """
    figure = Figure(figsize=(9.6, 5.2))
    rows = grid(figure, 2, 1, (0.65, 0.12, 0.43, 0.28), (0.0, 0.16), height_ratios=(3.0, 1.2))
    spent, points = np.asarray(rows.subplots(sharex=True))
    order = np.argsort(columns["times_optimum"], kind="stable")
    sorted_columns = {name: column[order] for name, column in columns.items()}
    _draw_spent_by_case(spent, sorted_columns)
    _draw_points_by_case(points, sorted_columns, needed)
    places = np.arange(len(order))
    points.set(xlim=(-0.8, len(order) - 0.2), xlabel="case, the ratio rising from left to right")
    if len(order) <= MOST_NUMBERED:
        numbers = [str(case) for case in sorted_columns["case"]]
        points.set_xticks(places, numbers, fontsize=6.5, rotation=90 if len(order) > 25 else 0)
    else:
        points.set_xticks([])
    return figure


def _draw_spent_by_case(ax: Axes, columns: Columns) -> None:
    ours, least, times = (columns[name] for name in ("delta_v_m_s", "optimum_delta_v_m_s", "times_optimum"))
    places = np.arange(len(ours))
    ax.vlines(
        places, np.minimum(ours, least), np.maximum(ours, least), color=MUTED, linewidth=0.9, zorder=1.0
    )
    ax.plot(places, least, "o", markersize=4.5, color=INK, markerfacecolor=PAPER, label="plan of least fuel")
    for label, (is_so, colour, marker) in _ended(columns).items():
        ax.plot(
            places[is_so], ours[is_so], marker, markersize=5.0, color=colour, label=f"controller, {label}"
        )
    if ours.min() > 0.0:
        ax.set_yscale("log")
        ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        ax.yaxis.set_minor_formatter(NullFormatter())
        ax.margins(y=0.12)
    median = int(np.argsort(times, kind="stable")[len(times) // 2])
    for place in {0, median, len(times) - 1}:
        # over the neighbours, which it reaches across
        beside = slice(max(place - 1, 0), place + 2)
        at = (place, max(ours[beside].max(), least[beside].max()))
        ax.annotate(f"{times[place]:.3g}×", at, (0, 6), fontsize=8.5, fontweight="bold", **BESIDE)
    ax.set(ylabel="Δv (m/s)")
    ax.grid(axis="y")
    ax.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=4, borderaxespad=0.2, handletextpad=0.3)


def _ended(columns: Columns) -> dict[str, tuple[NDArray[np.bool_], str, str]]:
    """Return which flights ended how, with colour and marker; only ends that occur."""
    success, violated = (columns[name].astype(np.bool_) for name in ("success", "violated"))
    flags = (success & ~violated, ~success & ~violated, violated)
    return {
        label: (is_so, *look) for (label, look), is_so in zip(ENDS.items(), flags, strict=True) if is_so.any()
    }


def _draw_points_by_case(ax: Axes, columns: Columns, needed: int) -> None:
    places = np.arange(len(columns["case"]))
    ax.axhline(needed, color=MUTED, linestyle=DOTS, linewidth=1.0)
    plans = columns["optimum_inspected_count"]
    ax.plot(places, plans, "o", markersize=4.5, color=INK, markerfacecolor=PAPER)
    for is_so, colour, marker in _ended(columns).values():
        ax.plot(places[is_so], columns["inspected_count"][is_so], marker, markersize=4.0, color=colour)
    ax.set(ylabel="points")
    ax.margins(y=0.15)
    ax.grid(axis="y")
