"""How a training went, generation by generation, and the front that it came to."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MaxNLocator
from numpy.typing import NDArray

from pipeline.array_types import Floats
from pipeline.report.figures.style import BESIDE, BLUE, DOTS, MUTED, ORANGE, PAPER, PURPLE, VERMILION

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
    words = f"{num_needed} make a success"
    place: dict[str, Any] = {"transform": points.get_yaxis_transform(), "ha": "right", "va": "top"}
    points.text(0.99, num_needed, words, color=MUTED, fontsize=8, **place)
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


def _power_of_ten(value: float, _place: int | None = None) -> str:
    """Write 1000 as 10³."""
    exponent = round(float(np.log10(value)))
    return "10" + str(exponent).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))


Columns = Mapping[str, NDArray[Any]]

#: names stand no nearer to each other than this share of the picture's width and height
NAMES_APART = 0.05


def front_of_training(columns: Columns, threshold_percent: float) -> Figure:
    """Draw inspection rate, and how flights end, over delta-v, on the validation starts.

    Parameters
    ----------
    columns : mapping of (n,) arrays
        Of ``train/front.parquet``.
    threshold_percent : float
        Inspection rate that makes a flight a success.
    """
    figure = Figure(figsize=(9.6, 6.4), layout="constrained")
    rate, ends = figure.subplots(2, 1, sharex=True, height_ratios=(2.2, 1.0))
    _draw_rate(rate, columns)
    rate.axhline(threshold_percent, color=MUTED, linestyle=DOTS, linewidth=1.0, zorder=0.5)
    _draw_ends(ends, columns, threshold_percent)
    for ax in (rate, ends):
        ax.grid()
    return figure


def _draw_rate(ax: Axes, columns: Columns) -> None:
    spent, rate = columns["validation_delta_v_m_s"], columns["validation_inspection_rate_percent"]
    champion = columns["champion"].astype(np.bool_)
    stands = columns["stands"].astype(np.bool_) & ~champion
    others = ~stands & ~champion
    look: dict[str, Any] = {"linestyle": "none", "marker": "o", "color": BLUE}
    ax.plot(spent[stands], rate[stands], markersize=5.5, label="controller of the front", **look)
    if "rule_consistency" in columns:
        # over the circles
        colours = columns["rule_consistency"][stands]
        told = ax.scatter(spent[stands], rate[stands], 42.0, colours, zorder=2.5, vmin=0.0, vmax=1.0)
        ax.figure.colorbar(told, ax=ax, label="mean rule consistency")
    if others.any():
        open_look = {**look, "markersize": 5.0, "markerfacecolor": PAPER}
        ax.plot(spent[others], rate[others], label="dominated on these starts", **open_look)
    words = f"champion: {spent[champion][0]:.3f} m/s, {rate[champion][0]:.2f} %"
    star: dict[str, Any] = {"linestyle": "none", "marker": "*", "color": VERMILION, "zorder": 3.0}
    ax.plot(spent[champion], rate[champion], markersize=14.0, label=words, **star)
    ax.margins(x=0.05, y=0.12)
    _name_some(ax, spent, rate, np.flatnonzero(champion | stands), columns["controller"])
    ax.set(title="Points inspected", ylabel="inspection rate (%)")
    ax.legend(loc="best")


def _name_some(
    ax: Axes, spent: NDArray[Any], rate: NDArray[Any], rows: NDArray[np.int_], numbers: NDArray[Any]
) -> None:
    """Write the numbers of controllers below a front, where nothing else is, as many as can be read."""
    places = np.column_stack([_scaled(spent, ax.get_xlim()), _scaled(rate, ax.get_ylim())])
    named: list[int] = []
    for row in rows:
        if all(np.max(np.abs(places[row] - places[other])) >= NAMES_APART for other in named):
            named.append(int(row))
            at, name = (spent[row], rate[row]), f"{int(numbers[row]):02d}"
            ax.annotate(name, at, (9, -11), fontsize=7.5, color=MUTED, **BESIDE)


def _scaled(values: NDArray[Any], limits: tuple[float, float]) -> NDArray[Any]:
    return np.asarray((values - limits[0]) / (limits[1] - limits[0]))


def _draw_ends(ax: Axes, columns: Columns, threshold_percent: float) -> None:
    spent = columns["validation_delta_v_m_s"]
    kinds = (
        ("validation_success_percent", f"at least {threshold_percent:g} % inspected", BLUE, "o"),
        ("validation_outside_percent", "outside the distance limits", PURPLE, "X"),
    )
    for name, label, colour, marker in kinds:
        ax.plot(spent, columns[name], marker, markersize=4.5, color=colour, label=label)
    ax.set(title="How flights end", xlabel="mean Δv (m/s)", ylabel="flights (%)", ylim=(-4.0, 104.0))
    ax.yaxis.set_major_locator(MaxNLocator(5))
    ax.legend(loc="best")
