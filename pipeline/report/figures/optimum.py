"""A controller and the minimum-fuel plans: all cases by their ratio, and two flights of one case."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter
from numpy.typing import NDArray

from pipeline.array_types import Floats
from pipeline.flight.state.log import FlightLog
from pipeline.report.figures.style import (
    BESIDE,
    BLUE,
    DOTS,
    INK,
    MUTED,
    ORANGE,
    PAPER,
    PURPLE,
    SMALL_PRINT,
    VERMILION,
    grid,
)
from pipeline.report.figures.trajectories import CHIEF_COLOUR, HILL_AXES, PLANES
from pipeline.settings.experiment import Mission

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


#: of the largest burn's circle, and of the least that is drawn, points squared
LARGEST, LEAST = 260.0, 1.5
#: burns within so long are drawn as one, s
BURNS_S = 120.0
#: how long no new point may come into sight without the broad path ending, s
PAUSE_S = 120.0
#: between marks along the paths and along the Sun's, s
MARK_S = 600.0


@dataclass(frozen=True)
class Flown:
    """A flight with its look."""

    label: str
    log: FlightLog
    colour: str
    line_style: str

    def burns(self, mission: Mission) -> tuple[NDArray[np.int64], Floats]:
        """Return the delta-v (m/s) of each two minutes with a burn, and where the largest force is."""
        forces = np.abs(self.log.force_hill_n).sum(axis=1)
        width = max(1, round(BURNS_S / mission.control_period_s))
        firsts = np.arange(0, len(forces), width)
        spent = np.add.reduceat(forces, firsts) * mission.control_period_s / mission.deputy.mass_kg
        at = np.array([first + int(forces[first : first + width].argmax()) for first in firsts])
        return at[spent > 0.0], spent[spent > 0.0]


def side_by_side(controller: FlightLog, plan: FlightLog, mission: Mission, needed: int) -> Figure:
    """Draw two flights' paths in two planes, with burns, sights and the Sun; delta-v and points over time.

    Parameters
    ----------
    controller, plan : FlightLog
        From one start.
    mission : Mission
    needed : int
        Points that make a flight a success.
    """
    flights = (Flown("controller", controller, BLUE, "-"), Flown("plan of least fuel", plan, VERMILION, "--"))
    figure = Figure(figsize=(9.6, 6.9))
    margins, between = (0.68, 0.13, 0.76, 0.25), (0.74, 0.68)
    places = grid(figure, 2, 3, margins, between, width_ratios=(1.0, 1.0, 0.95))
    axes = np.asarray(places.subplots())
    reach = max(float(np.abs(flight.log.position_m).max()) for flight in flights)
    frame = float(np.ceil(min(1.2 * reach, 1.1 * mission.deputy.max_distance_m) / 10.0) * 10.0)
    largest = max(float(flight.burns(mission)[1].max(initial=0.0)) for flight in flights) or 1.0
    for column, flight in enumerate(flights):
        for row, plane in enumerate(PLANES):
            ax = axes[row, column]
            _draw_plane(ax, flight, plane, mission, frame, largest)
            if plane == (1, 0):
                _draw_sun(ax, flight.log, mission, 0.93 * frame)
        axes[0, column].set_title(f"{flight.label}, {flight.log.delta_v_m_s[-1]:.3f} m/s")
    _draw_spent(axes[0, 2], flights, mission)
    _draw_points(axes[1, 2], flights, mission, needed)
    _add_legend(figure, largest)
    return figure


def _draw_plane(
    ax: Axes, flight: Flown, plane: tuple[int, int], mission: Mission, frame: float, largest: float
) -> None:
    path = flight.log.position_m[:, list(plane)]
    chief, deputy = mission.chief, mission.deputy
    ax.add_patch(Circle((0, 0), chief.inspection_radius_m, facecolor=CHIEF_COLOUR, edgecolor="none"))
    for radius in (deputy.min_distance_m, deputy.max_distance_m):
        ax.add_patch(Circle((0, 0), radius, fill=False, edgecolor=MUTED, linestyle=DOTS, linewidth=0.9))
    seeing = [path[first : last + 1] for first, last in _seeing(flight.log, mission)]
    ax.add_collection(LineCollection(seeing, colors=flight.colour, linewidths=6.0, alpha=0.35, zorder=2.0))
    ax.plot(*path.T, color=flight.colour, linestyle=flight.line_style, linewidth=1.1, zorder=3.0)
    fired, burns = flight.burns(mission)
    sizes = np.maximum(LARGEST * burns / largest, LEAST)
    rim: dict[str, Any] = {"facecolors": "none", "edgecolors": INK, "linewidths": 0.7}
    ax.scatter(path[fired, 0], path[fired, 1], s=sizes, zorder=4.0, **rim)
    _mark_minutes(ax, path, mission)
    ax.set(xlim=(-frame, frame), ylim=(-frame, frame), aspect="equal")
    ax.set(xlabel=f"{HILL_AXES[plane[0]]} (m)", ylabel=f"{HILL_AXES[plane[1]]} (m)")
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_major_locator(MaxNLocator(5))
    ax.grid(True)


def _seeing(log: FlightLog, mission: Mission) -> list[tuple[int, int]]:
    """Return from and up to which samples new points come into sight, pauses up to `PAUSE_S` included."""
    sees = np.flatnonzero(np.diff(log.is_inspected.sum(axis=1)) > 0)
    pieces = np.split(sees, np.flatnonzero(np.diff(sees) * mission.control_period_s > PAUSE_S) + 1)
    return [(int(piece[0]), int(piece[-1]) + 1) for piece in pieces if len(piece)]


def _marks(mission: Mission) -> NDArray[np.int64]:
    """Return the samples at which time is marked, the start among them."""
    return np.arange(0, mission.num_controls + 1, max(1, round(MARK_S / mission.control_period_s)))


def _mark_minutes(ax: Axes, path: Floats, mission: Mission) -> None:
    """Mark the start and every ten minutes of a path."""
    marks = _marks(mission)
    ax.plot(*path[0], "s", color=INK, markersize=5.0, zorder=5.0)
    ax.plot(*path[marks[1:]].T, ".", color=INK, markersize=4.5, zorder=5.0)
    for k in marks[2::2]:
        minutes = k * mission.control_period_s / 60.0
        look = {**BESIDE, "ha": "left", "fontsize": 7, "color": INK}
        ax.annotate(f"{minutes:g}", path[k], (4, 3), zorder=6.0, **look)


def _draw_sun(ax: Axes, log: FlightLog, mission: Mission, radius: float) -> None:
    """Draw how the Sun's direction turns, at some distance, with marks as along the path."""
    angle = log.sun_angle_rad
    arc = radius * np.stack([np.sin(angle), np.cos(angle)], axis=1)
    ax.plot(*arc.T, color=ORANGE, linewidth=2.0, zorder=1.5)
    ax.annotate(
        "", arc[-1], arc[-8], arrowprops={"arrowstyle": "-|>", "color": ORANGE, "linewidth": 2.0}, zorder=1.5
    )
    ax.plot(*arc[_marks(mission)].T, ".", color=ORANGE, markersize=5.0, zorder=1.6)
    ax.plot(*arc[0], "o", color=ORANGE, markersize=8.0, zorder=1.6)
    at = -11.0 * arc[0] / radius
    ax.annotate("Sun", arc[0], at, va="center", fontsize=7.5, color=MUTED, **BESIDE)


def _draw_spent(ax: Axes, flights: Sequence[Flown], mission: Mission) -> None:
    time = np.arange(mission.num_controls + 1) * mission.control_period_s / 60.0
    for flight in flights:
        spent = flight.log.delta_v_m_s
        ax.plot(time, spent, color=flight.colour, linestyle=flight.line_style, linewidth=1.6)
        end = (time[-1], spent[-1])
        ax.annotate(f"{spent[-1]:.3f}", end, (0, 4), fontsize=8, **{**BESIDE, "ha": "right"})
    ax.set(title="Δv so far", xlabel="time (min)", ylabel="Δv (m/s)", xlim=(0.0, time[-1]))
    ax.set_ylim(0.0, 1.15 * max(float(flight.log.delta_v_m_s[-1]) for flight in flights) or 1.0)
    ax.grid(axis="y")


def _draw_points(ax: Axes, flights: Sequence[Flown], mission: Mission, needed: int) -> None:
    time = np.arange(mission.num_controls + 1) * mission.control_period_s / 60.0
    ax.axhline(needed, color=MUTED, linestyle=DOTS, linewidth=1.0)
    for flight in flights:
        counts = flight.log.is_inspected.sum(axis=1)
        ax.plot(time, counts, color=flight.colour, linestyle=flight.line_style, linewidth=1.6)
    num_points = flights[0].log.is_inspected.shape[1]
    ax.set(title="Points seen so far", xlabel="time (min)", ylabel="points", xlim=(0.0, time[-1]))
    ax.set_ylim(0.0, 1.06 * num_points)
    ax.text(0.0, needed, f" {needed}", ha="left", va="bottom", **SMALL_PRINT)
    ax.grid(axis="y")


def _add_legend(figure: Figure, largest: float) -> None:
    """Say what lines and circles are; circles by two sizes."""
    handles = [
        Line2D([], [], color=BLUE, linewidth=1.6),
        Line2D([], [], color=VERMILION, linewidth=1.6, linestyle="--"),
        Line2D([], [], color=MUTED, linewidth=6.0, alpha=0.4),
        Line2D([], [], color=INK, marker="s", markersize=5.0, linestyle="none"),
        Line2D([], [], color=INK, marker=".", markersize=5.0, linestyle="none"),
    ]
    words = ["controller", "plan", "sees new points", "start", "every 10 min"]
    for share in (1.0, 0.1):
        size = float(np.sqrt(max(LARGEST * share, LEAST)))
        circle = Line2D([], [], marker="o", markersize=size, markerfacecolor="none", linestyle="none")
        circle.set(markeredgecolor=INK, markeredgewidth=0.7)
        handles.append(circle)
        words.append(f"{share * largest:.2g} m/s in 2 min")
    figure.legend(handles, words, loc="lower center", ncols=len(words), columnspacing=1.2)
