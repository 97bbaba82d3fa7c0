"""Controllers side by side: what they spend, and how much they inspect."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter

from pipeline.report.figures.style import DOTS, INK, MUTED, PALETTE, PAPER

#: colour, marker and its face; markers tell controllers apart without colours, and are open the second time
MARKS = tuple(
    (colour, marker, face or colour)
    for face in ("", PAPER)
    for colour, marker in zip((*PALETTE, MUTED), "os^DvPX*h", strict=True)
)
#: up to here the scale of delta-v is linear, beyond it logarithmic, m/s
LINEAR = 0.1
TICKS = (0.0, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0)


@dataclass(frozen=True)
class Mark:
    """A controller: mean and standard deviation of delta-v (m/s) and of the inspection rate (%)."""

    name: str
    delta_v: tuple[float, float]
    rate: tuple[float, float]


def compared(panels: Sequence[tuple[str, Sequence[Mark]]], threshold: float) -> Figure:
    """Draw delta-v against inspection rate, a panel a Sun setting.

    Parameters
    ----------
    panels : sequence of (title, marks)
    threshold : float
        Rate that makes a success, %.
    """
    figure = Figure(figsize=(9.6, 4.4), layout="constrained")
    axes = figure.subplots(1, len(panels), sharex=True, sharey=True, squeeze=False)[0]
    names = list(dict.fromkeys(mark.name for _, marks in panels for mark in marks))
    styles = {name: MARKS[place % len(MARKS)] for place, name in enumerate(names)}
    for ax, (title, marks) in zip(axes, panels, strict=True):
        _draw(ax, marks, styles, threshold)
        ax.set(title=title, xlabel="Δv (m/s)")
    axes[0].set(ylabel="inspection rate (%)")
    handles = {
        label: handle for ax in axes for handle, label in zip(*ax.get_legend_handles_labels(), strict=True)
    }
    figure.legend(
        [handles[name] for name in names], names, loc="outside lower center", ncols=min(len(names), 4)
    )
    return figure


def _draw(ax: Axes, marks: Sequence[Mark], styles: dict[str, tuple[str, str, str]], threshold: float) -> None:
    ax.axhline(threshold, color=MUTED, linewidth=0.9, linestyle=DOTS)
    for mark in marks:
        colour, marker, face = styles[mark.name]
        low = min(mark.delta_v[1], mark.delta_v[0])
        ax.errorbar(
            mark.delta_v[0],
            mark.rate[0],
            xerr=np.array([[low], [mark.delta_v[1]]]),
            yerr=np.array([[mark.rate[1]], [min(mark.rate[1], 100.0 - mark.rate[0])]]),
            color=colour,
            marker=marker,
            markersize=7.0,
            markerfacecolor=face,
            markeredgecolor=INK if face == colour else colour,
            markeredgewidth=0.6 if face == colour else 1.4,
            elinewidth=0.9,
            linestyle="none",
            label=mark.name,
        )
    ax.set_xscale("symlog", linthresh=LINEAR, linscale=0.6)
    ax.set_xticks(TICKS)
    ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    ax.xaxis.set_minor_formatter(NullFormatter())
    most = max(mark.delta_v[0] + mark.delta_v[1] for mark in marks)
    ax.set_xlim(-0.01, 1.15 * max(most, LINEAR))
    ax.set_ylim(top=101.0)
    ax.grid()
    ax.set_axisbelow(True)
