"""The front of a training: what its controllers spend and what they inspect."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from pipeline.report.figures.style import BLUE, DOTS, MUTED, PAPER, PURPLE, VERMILION

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
    """Write the numbers of controllers over their places, as many as can be read."""
    places = np.column_stack([_scaled(spent, ax.get_xlim()), _scaled(rate, ax.get_ylim())])
    named: list[int] = []
    for row in rows:
        if all(np.max(np.abs(places[row] - places[other])) >= NAMES_APART for other in named):
            named.append(int(row))
            ax.annotate(
                f"{int(numbers[row]):02d}",
                (spent[row], rate[row]),
                (0, 7),
                textcoords="offset points",
                ha="center",
                fontsize=7.5,
                color=MUTED,
            )


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
