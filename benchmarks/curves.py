"""What trainings come to with time: fuel and success over control periods and over processor time."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from pipeline.evaluation.monte_carlo import SUCCESS
from pipeline.report.figures.style import PALETTE, save, style

#: the horizontal axes and the vertical ones: what of a row, and its words
ACROSS: Final = (("periods", "control periods"), ("processor_s", "processor time (s)"))
UPWARDS: Final = (("delta_v_m_s", "delta-v (m/s)"), (SUCCESS, "success (%)"))
#: numbers from here on are written by powers of ten
MANY: Final = 10_000.0
#: an axis over a greater ratio than this has fewer labels
MOST_LABELLED: Final = 400.0
#: a controller without a budget that the lines are compared with
REFERENCE: Final = "champion_27"


def draw(rows: Sequence[Mapping[str, Any]], titles: Mapping[str, str], path: Path) -> None:
    """Draw the rows of `benchmarks.leaderboard`: the median of each learner and budget, and all trainings."""
    with style():
        figure = Figure(figsize=(9.0, 6.0), layout="constrained")
        panels = figure.subplots(2, 2, sharex="col", sharey="row")
        for (column, (across, words)), (line, (figure_name, label)) in (
            (x, y) for x in enumerate(ACROSS) for y in enumerate(UPWARDS)
        ):
            axes = panels[line, column]
            for colour, (name, title) in zip(PALETTE, titles.items(), strict=False):
                for budget in sorted({row["budget"] for row in rows if row["name"] == name}):
                    of_it = [row for row in rows if row["name"] == name and row["budget"] == budget]
                    _draw_course(axes, of_it, across, figure_name, colour, title)
            for row in rows:
                if row["name"] == REFERENCE:
                    axes.axhline(row["figures"][figure_name][0], color="0.5", lw=0.8, ls=":")
            axes.set_xscale("log")
            _label(axes.xaxis)
            if line == 1:
                axes.set_xlabel(words)
            if column == 0:
                axes.set_ylabel(label)
        panels[0, 0].set_yscale("log")
        _label(panels[0, 0].yaxis)
        handles = {handle.get_label(): handle for handle in panels[0, 0].get_lines()}
        shown = [title for title in titles.values() if title in handles]
        figure.legend([handles[title] for title in shown], shown, loc="outside lower center", ncols=3)
        path.write_bytes(save(figure, path.stem, 150).png)


def _label(axis: Any) -> None:
    """Label a logarithmic axis at 1, 2 and 5 times powers of ten, a long one at 1 and 3 times."""
    low, high = sorted(axis.get_view_interval())
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if high < MOST_LABELLED * low else (1.0, 3.0)))
    axis.set_major_formatter(
        FuncFormatter(lambda value, _: f"{value:,g}" if value < MANY else f"{value:.0e}")
    )
    axis.set_minor_formatter(NullFormatter())


def _draw_course(
    axes: Any, rows: Sequence[Mapping[str, Any]], across: str, name: str, colour: str, title: str
) -> None:
    """Draw the trainings of a learner within a budget, and what half of them are below at each time."""
    seeds: dict[int, list[Mapping[str, Any]]] = {}
    for row in rows:
        seeds.setdefault(row["seed"], []).append(row)
    for each in seeds.values():
        axes.plot(
            [row[across] for row in each], [row["figures"][name][0] for row in each], color=colour, alpha=0.2
        )
    times = max(map(len, seeds.values()))
    wholes = [whole for whole in seeds.values() if len(whole) == times]
    middle = [
        np.median([(whole[at][across], whole[at]["figures"][name][0]) for whole in wholes], axis=0)
        for at in range(times)
    ]
    axes.plot(*np.transpose(middle), color=colour, marker="o", ms=3.0, label=title)
