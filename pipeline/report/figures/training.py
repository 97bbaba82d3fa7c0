"""How a training went, generation by generation."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MaxNLocator
from numpy.typing import NDArray

from pipeline.array_types import Floats
from pipeline.report.figures.style import BLUE, DOTS, MUTED, ORANGE, SMALL_PRINT, VERMILION

#: columns of the logbook that are drawn
HISTORY_COLUMNS = ("round", "best", "mean", "delta_v_m_s", "points", "outside", "short")


def convergence(history: Mapping[str, NDArray[np.generic]], num_points: int, num_needed: int) -> Figure:
    """Draw how training went: fitness, and what the champion's fitness is made of, over generations.

    Parameters
    ----------
    history : mapping of str to (n,) array
        Columns of the logbook, `HISTORY_COLUMNS` among them.
    num_points, num_needed : int
        Inspection points, and how many make a success.
    """
    columns = {name: np.asarray(history[name], dtype=np.float64) for name in HISTORY_COLUMNS}
    figure = Figure(figsize=(9.6, 5.2), layout="constrained")
    (fitness, delta_v), (points, flights) = figure.subplots(2, 2, sharex=True)
    generations = np.arange(len(columns["best"]))
    _draw_fitness(fitness, generations, columns)
    delta_v.plot(generations, columns["delta_v_m_s"], color=BLUE, linewidth=1.5)
    delta_v.set(title="Champion's mean Δv", ylabel="Δv (m/s)")
    delta_v.set_ylim(bottom=0.0)
    points.plot(generations, columns["points"], color=BLUE, linewidth=1.5)
    points.axhline(num_needed, color=MUTED, linestyle=DOTS, linewidth=1.0)
    words, across = f"{num_needed} make a success", points.get_yaxis_transform()
    points.text(0.99, num_needed, words, transform=across, ha="right", va="top", **SMALL_PRINT)
    points.set(title="Champion's mean of inspected points", ylabel=f"points of {num_points}")
    _draw_failures(flights, generations, columns, num_needed)
    borders = np.flatnonzero(np.diff(columns["round"])) + 0.5
    for ax in (fitness, delta_v, points, flights):
        ax.grid(axis="y")
        ax.set_xlim(0, max(1, len(generations) - 1))
        for border in borders:
            ax.axvline(border, color=MUTED, linewidth=0.8, linestyle=(0, (1, 2)))
    for ax in (points, flights):
        ax.set_xlabel("generation, rounds one after the other" if len(borders) else "generation")
    return figure


def _draw_fitness(ax: Axes, generations: NDArray[np.integer], columns: Mapping[str, Floats]) -> None:
    """Draw the best and the mean fitness over generations."""
    ax.plot(generations, columns["mean"], color=MUTED, linewidth=0.9, label="mean of the population")
    ax.plot(generations, columns["best"], color=BLUE, linewidth=1.8, label="best")
    ax.set(title="Fitness", ylabel="fitness (m/s)")
    if columns["best"].min() > 0.0:
        ax.set_yscale("log")
        ax.yaxis.set_major_formatter(FuncFormatter(_power_of_ten))
    # beside the title: the mean jumps up with every round
    ax.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, borderaxespad=0.0)


def _draw_failures(
    ax: Axes, generations: NDArray[np.integer], columns: Mapping[str, Floats], num_needed: int
) -> None:
    """Draw how many of the champion's flights fail in each generation, and in which way."""
    kinds = (
        ("short", f"short of {num_needed} points", ORANGE, (0, (4, 1.2))),
        ("outside", "outside the distance limits", VERMILION, "-"),
    )
    for name, label, colour, dashes in kinds:
        values = columns[name]
        ax.step(generations, values, where="post", color=colour, linestyle=dashes, linewidth=1.6, label=label)
    ax.set(title="Champion's flights that fail", ylabel="flights")
    ax.set_ylim(0.0, max(1.0, 1.05 * max(float(columns[name].max()) for name, *_ in kinds)))
    ax.yaxis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=2))
    ax.legend(loc="upper right")


def _power_of_ten(value: float, _index: int | None = None) -> str:
    """Write 1000 as 10³."""
    exponent = round(float(np.log10(value)))
    return "10" + str(exponent).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
