"""Controllers and runs side by side: what they spend and reach, in one world, in several and in a sweep.

A controller also beside the minimum-fuel plans: all cases by their ratio.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from fis_tools.render.theme import readable_on
from pipeline.array_types import Booleans, Floats
from pipeline.evaluation.comparison import FLOWN, ComparisonRow, broken_worlds, place_of
from pipeline.evaluation.monte_carlo import SUCCESS
from pipeline.evaluation.statistics import Columns, succeeds
from pipeline.report.figures import style

#: colour, marker and its face; markers tell controllers apart without colours, and are open the second time
MARKS = tuple(
    (colour, marker, face or colour)
    for face in ("", style.PAPER)
    for colour, marker in zip((*style.PALETTE, style.MUTED), "os^DvPX*h", strict=True)
)
#: up to here the scale of delta-v is linear, beyond it logarithmic, m/s
LINEAR = 0.1
TICKS = (0.0, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0)
#: rates are drawn by the share of points missed, on a logarithmic scale from this share on, %
LEAST_MISSED = 0.3
RATE_TICKS = (99.5, 99.0, 98.0, 95.0, 90.0, 80.0, 50.0, 0.0)


@dataclass(frozen=True)
class ControllerMark:
    """A controller: mean and standard deviation of delta-v (m/s) and of the inspection rate (%)."""

    name: str
    delta_v: tuple[float, float]
    rate: tuple[float, float]


def compared(
    panels: Sequence[tuple[str, Sequence[ControllerMark]]],
    threshold: float,
    limits: tuple[tuple[float, float], tuple[float, float]] | None = None,
) -> Figure:
    """Draw delta-v against inspection rate, a panel a Sun setting, with the spread of flights as thin lines.

    Parameters
    ----------
    panels : sequence of (title, marks)
    threshold : float
        Rate that makes a success, %.
    limits : pair of pairs of float, optional
        Of delta-v (m/s), and of the share missed (%) from below to above; by default what holds all marks.
    """
    figure = Figure(figsize=(9.6, 4.6))
    cells = style.grid(figure, 1, len(panels), (0.6, 0.1, 0.45, 0.25), (0.15, 0.0))
    axes = cells.subplots(sharex=True, sharey=True, squeeze=False)[0]
    names = list(dict.fromkeys(mark.name for _, marks in panels for mark in marks))
    styles = {name: MARKS[index % len(MARKS)] for index, name in enumerate(names)}
    for ax, (title, marks) in zip(axes, panels, strict=True):
        _draw_marks(ax, marks, styles, threshold)
        ax.set(title=title, xlabel="Δv (m/s)")
    axes[0].set(ylabel="inspection rate (%)")
    if limits is None:
        every = [mark for _, marks in panels for mark in marks]
        most = max(mark.delta_v[0] + mark.delta_v[1] for mark in every)
        # at least what may be missed, whose line is drawn
        greatest = max(100.0 - threshold, *(100.0 - mark.rate[0] + mark.rate[1] for mark in every))
        limits = (-0.01, 1.15 * max(most, LINEAR)), (min(1.2 * greatest, 100.0), 0.88 * LEAST_MISSED)
    axes[0].set(xlim=limits[0], ylim=limits[1])
    for ax, (_, marks) in zip(axes, panels, strict=True):
        _name_marks(ax, marks, figure.dpi)
    return figure


def _draw_marks(
    ax: Axes, marks: Sequence[ControllerMark], styles: dict[str, tuple[str, str, str]], threshold: float
) -> None:
    """Draw each controller's delta-v and inspection rate with their intervals, on logarithmic axes."""
    ax.axhline(100.0 - threshold, color=style.MUTED, linewidth=0.9, linestyle=style.DOTS)
    for mark in marks:
        colour, marker, face = styles[mark.name]
        (delta_v, across), (rate, up) = mark.delta_v, mark.rate
        missed = max(100.0 - rate, LEAST_MISSED)
        spread: dict[str, Any] = {"color": colour, "linewidth": 0.9, "alpha": 0.35, "zorder": 1}
        ax.plot([max(delta_v - across, 0.0), delta_v + across], [missed, missed], **spread)
        ax.plot([delta_v, delta_v], [max(missed - up, LEAST_MISSED), min(missed + up, 100.0)], **spread)
        edge, width = (style.INK, 0.6) if face == colour else (colour, 1.4)
        (dot,) = ax.plot(delta_v, missed, marker, color=colour, markersize=7.0, label=mark.name)
        dot.set(markerfacecolor=face, markeredgecolor=edge, markeredgewidth=width)
    ax.set_xscale("symlog", linthresh=LINEAR, linscale=0.6)
    ax.set_xticks(TICKS)
    ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    ax.xaxis.set_minor_formatter(NullFormatter())
    ax.set_yscale("log")
    ax.set_yticks([100.0 - rate for rate in RATE_TICKS])
    ax.yaxis.set_major_formatter(FuncFormatter(lambda missed, _: f"{100.0 - missed:g}"))
    ax.yaxis.set_minor_formatter(NullFormatter())
    ax.grid()
    ax.set_axisbelow(True)


#: of a name in a picture, in points: its letters, how wide one is, and how far from the marks it is tried
NAME_SIZE, LETTER = 7.0, 4.3
DISTANCES = (9.0, 16.0, 25.0, 36.0, 50.0, 66.0, 84.0, 104.0, 126.0)


def _name_marks(ax: Axes, marks: Sequence[ControllerMark], dots_per_inch: float) -> None:
    """Write each controller's name beside its mark, where it hides no mark and no other name."""
    to_points = 72.0 / dots_per_inch
    points = [(mark.delta_v[0], max(100.0 - mark.rate[0], LEAST_MISSED)) for mark in marks]
    centres = ax.transData.transform(points) * to_points
    frame = np.asarray(ax.get_window_extent().extents) * to_points
    taken = [np.concatenate([centre - 5.0, centre + 5.0]) for centre in centres]
    angles = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
    for index in np.argsort(-centres[:, 0], kind="stable"):
        centre, name = centres[index], marks[index].name
        half = np.array([0.5 * LETTER * len(name), 0.5 * NAME_SIZE + 1.0])
        best, least = np.zeros(2), np.inf
        for distance in DISTANCES:
            for angle in angles:
                direction = np.array([np.cos(angle), np.sin(angle)])
                # the name's nearest edge is at the distance
                offset = direction * distance + np.array([np.sign(np.round(direction[0], 6)) * half[0], 0.0])
                box = np.concatenate([centre + offset - half, centre + offset + half])
                cost = sum(_overlap(box, other) for other in taken) + 0.02 * distance
                cost += 1e3 * float((box[:2] < frame[:2]).any() or (box[2:] > frame[2:]).any())
                if cost < least:
                    best, least = offset, cost
        taken.append(np.concatenate([centre + best - half, centre + best + half]))
        line = {"arrowstyle": "-", "color": style.MUTED, "linewidth": 0.5, "shrinkA": 0.0, "shrinkB": 4.0}
        ax.annotate(
            name,
            points[index],
            (float(best[0]), float(best[1])),
            textcoords="offset points",
            fontsize=NAME_SIZE,
            color=style.INK,
            arrowprops=line,
            **style.CENTRED,
        )


def _overlap(box: Floats, other: Floats) -> float:
    """Return the area that two boxes share; each is left, bottom, right and top."""
    sides = np.minimum(box[2:], other[2:]) - np.maximum(box[:2], other[:2])
    return float(np.prod(np.maximum(sides, 0.0)))


#: from no success to all: the same on a dark page, which has its own `style.PAPER` and `style.BLUE`
SHADES = LinearSegmentedColormap.from_list("success", ["#ffffff", "#0070b0"])


def by_world(rows: Sequence[ComparisonRow]) -> Figure:
    """Draw a grid of the worlds and controllers of flown rows, for each Sun setting and safety layer."""
    flown = [row for row in rows if row.source == FLOWN]
    names, worlds = (list(dict.fromkeys(getattr(row, of) for row in flown)) for of in ("controller", "world"))
    kinds = list(dict.fromkeys((row.sun, row.safety) for row in flown))
    height, broken = 1.1 + 0.42 * len(worlds), broken_worlds(flown)
    figure = Figure(figsize=(9.6, 0.4 + height * len(kinds)), layout="constrained")
    for ax, kind in zip(figure.subplots(len(kinds), 1, squeeze=False)[:, 0], kinds, strict=True):
        _draw_squares(ax, [row for row in flown if (row.sun, row.safety) == kind], names, worlds, broken)
        ax.set_title("Sun {}, safety layer {}".format(*kind))
    return figure


def _draw_squares(
    ax: Axes, rows: Sequence[ComparisonRow], names: list[str], worlds: list[str], broken: set[Any]
) -> None:
    """Draw a square a row, with the share of successful flights and the mean delta-v (m/s)."""
    for row in rows:
        x, y = names.index(row.controller), worlds.index(row.world)
        edge, width = (style.VERMILION, 1.8) if place_of(row) in broken else (style.PAPER, 1.0)
        success = float(row.summary[SUCCESS]["fraction"])
        corner = (x - 0.47, y - 0.45)
        ax.add_patch(Rectangle(corner, 0.94, 0.9, facecolor=SHADES(success), edgecolor=edge, linewidth=width))
        words = f"{100 * success:.0f} %, {row.summary['delta_v_m_s']['mean']:.2f}"
        ax.text(x, y, words, color=readable_on(SHADES(success)[:3]), fontsize=8.0, **style.CENTRED)
    ax.set_xlim(-0.5, len(names) - 0.5)
    ax.set_ylim(len(worlds) - 0.5, -0.5)
    ax.set_xticks(range(len(names)), names, fontsize=7.5)
    ax.set_yticks(range(len(worlds)), worlds)
    ax.tick_params(length=0)
    ax.spines[:].set_visible(False)


#: of names in a picture, in shares of its sides
NAMES_APART = 0.06
#: of more settings than so many, only those on the front are named
MOST_NAMED = 12


def front_of_runs(
    names: Sequence[str],
    spent: Floats,
    rates: Floats,
    is_on_front: Booleans,
    label: str = "mean inspection rate (%)",
    beaten: str = "beaten by another in both",
) -> Figure:
    """Draw a rate over mean delta-v with their intervals, a point a setting, and the front.

    Parameters
    ----------
    names : sequence of n str
    spent, rates : (n, 3) arrays
        Mean and ends of the interval, of delta-v (m/s) and of the rate (%).
    is_on_front : (n,) array of bool
    label, beaten : str
        Of the rates, and of what is not on the front.
    """
    figure = Figure(figsize=(9.6, 4.8), layout="constrained")
    ax = figure.subplots()
    across, up = (np.abs(values[:, 1:] - values[:, :1]).T for values in (spent, rates))
    order = np.argsort(spent[:, 0], kind="stable")
    looks = {False: ("o", style.MUTED, beaten), True: ("o-", style.BLUE, "on the front")}
    for kind, (line, colour, words) in looks.items():
        rows = order[is_on_front[order] == kind]
        if rows.size:
            at = spent[rows, 0], rates[rows, 0], up[:, rows], across[:, rows]
            ax.errorbar(*at, line, color=colour, markersize=5.5, elinewidth=0.8, linewidth=0.8, label=words)
    ax.set(xlabel="mean Δv (m/s)", ylabel=label)
    ax.margins(x=0.08, y=0.12)
    # the front first: of names that would overlap one is written
    first = np.argsort(~is_on_front, kind="stable")
    first = first[: len(names) if len(names) <= MOST_NAMED else np.count_nonzero(is_on_front)]
    _name_settings(ax, [names[k] for k in first], np.column_stack([spent[:, 0], rates[:, 0]])[first])
    ax.grid()
    ax.legend(loc="lower right")
    return figure


def _name_settings(ax: Axes, names: Sequence[str], means: Floats) -> None:
    """Write names above points, (n, 2), or below them, as many as can be read."""
    corner, opposite = np.transpose([ax.get_xlim(), ax.get_ylim()])
    named: dict[int, list[Floats]] = {5: [], -11: []}
    for name, mean in zip(names, means, strict=True):
        position = (mean - corner) / (opposite - corner)
        for up, others in named.items():
            if all(np.max(np.abs(position - other)) >= NAMES_APART for other in others):
                others.append(position)
                ax.annotate(name, mean, (5, up), textcoords="offset points", fontsize=7.5, color=style.INK)
                break


#: how a controller's flight ended: words, colour, marker
ENDS = {
    "success": (style.BLUE, "o"),
    "too few points": (style.ORANGE, "v"),
    "outside the distance limits": (style.PURPLE, "X"),
}
#: how plans are marked
PLANNED: dict[str, Any] = {"markersize": 4.5, "color": style.INK, "markerfacecolor": style.PAPER}
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
    rows = style.grid(figure, 2, 1, (0.65, 0.12, 0.43, 0.28), (0.0, 0.16), height_ratios=(3.0, 1.2))
    spent, points = np.asarray(rows.subplots(sharex=True))
    order = np.argsort(columns["times_optimum"], kind="stable")
    sorted_columns = {name: column[order] for name, column in columns.items()}
    _draw_spent_by_case(spent, sorted_columns)
    _draw_points_by_case(points, sorted_columns, needed)
    is_numbered = len(order) <= MOST_NUMBERED
    points.set(xlim=(-0.8, len(order) - 0.2), xticks=[])
    points.set_xlabel("case, the ratio rising from left to right", labelpad=17.0 if is_numbered else 4.0)
    if is_numbered:
        # words alone: so many ticks take longer to draw than all else in the picture
        beneath = {"transform": points.get_xaxis_transform(), "ha": "center", "va": "top", "fontsize": 6.5}
        for column, case in enumerate(sorted_columns["case"]):
            angle = 90 if len(order) > 25 else 0
            points.text(column, -0.06, str(case), color=style.MUTED, rotation=angle, **beneath)
    return figure


def _draw_spent_by_case(ax: Axes, columns: Columns) -> None:
    """Draw delta-v of controller and plan, case by case; name the least, median and greatest ratio."""
    ours, least, times = (columns[name] for name in ("delta_v_m_s", "optimum_delta_v_m_s", "times_optimum"))
    positions = np.arange(len(ours))
    ax.vlines(
        positions,
        np.minimum(ours, least),
        np.maximum(ours, least),
        color=style.MUTED,
        linewidth=0.9,
        zorder=1.0,
    )
    ax.plot(positions, least, "o", label="plan of least fuel", **PLANNED)
    for label, (is_so, colour, marker) in _ended(columns).items():
        ax.plot(
            positions[is_so], ours[is_so], marker, markersize=5.0, color=colour, label=f"controller, {label}"
        )
    if ours.min() > 0.0:
        ax.set_yscale("log")
        ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        ax.yaxis.set_minor_formatter(NullFormatter())
        ax.margins(y=0.12)
    median = int(np.argsort(times, kind="stable")[len(times) // 2])
    for position in {0, median, len(times) - 1}:
        # over the neighbours, which it reaches across
        beside = slice(max(position - 1, 0), position + 2)
        at = (position, max(ours[beside].max(), least[beside].max()))
        ax.annotate(f"{times[position]:.3g}×", at, (0, 6), fontsize=8.5, fontweight="bold", **style.BESIDE)
    ax.set(ylabel="Δv (m/s)")
    ax.grid(axis="y")
    ax.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=4, borderaxespad=0.2, handletextpad=0.3)


def _ended(columns: Columns) -> dict[str, tuple[Booleans, str, str]]:
    """Return which flights ended how, with colour and marker; only ends that occur."""
    flags = zip(ENDS.items(), flight_endings(columns), strict=True)
    return {label: (is_so, *look) for (label, look), is_so in flags if is_so.any()}


def flight_endings(columns: Columns) -> tuple[Booleans, Booleans, Booleans]:
    """Return which flights ended in the ways of `ENDS`, in their order, each of shape (n,)."""
    succeeded, violated = succeeds(columns), np.asarray(columns["violated"], dtype=np.bool_)
    return succeeded, ~succeeded & ~violated, violated


def _draw_points_by_case(ax: Axes, columns: Columns, needed: int) -> None:
    """Draw the points inspected by controller and plan, case by case, with the number needed."""
    positions = np.arange(len(columns["case"]))
    ax.axhline(needed, color=style.MUTED, linestyle=style.DOTS, linewidth=1.0)
    plans = columns["optimum_inspected_count"]
    ax.plot(positions, plans, "o", **PLANNED)
    for is_so, colour, marker in _ended(columns).values():
        ax.plot(positions[is_so], columns["inspected_count"][is_so], marker, markersize=4.0, color=colour)
    ax.set(ylabel="points")
    ax.margins(y=0.15)
    ax.grid(axis="y")
