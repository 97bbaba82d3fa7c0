"""A flight over time, how the outcomes of many flights spread, and the tube of a proof over flights."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from numpy.typing import NDArray

from pipeline.array_types import Floats
from pipeline.flight.goals.reach import flight_ends, limit_at
from pipeline.flight.state.arrays import TRACK_LEFT
from pipeline.flight.state.log import FlightLog
from pipeline.report.figures import style
from pipeline.settings.experiment import Mission
from pipeline.settings.mission import Problem

AXIS_COLOURS = (style.BLUE, style.VERMILION, style.GREEN)
AXIS_STYLES = ("-", (0, (5, 1.5)), (0, (1, 1)))


def controls(log: FlightLog, mission: Mission) -> Figure:
    """Draw the force (Hill axes) and the torque (body axes) of a flight, as applied, over time.

    The torque is drawn in two parts, for turning to the chief takes a hundred times what following it does.
    """
    figure = Figure(figsize=(9.6, 4.8))
    cells = style.grid(figure, 2, 2, (0.75, 0.13, 0.44, 0.24), (0.82, 0.66))
    force, turning, following = map(figure.add_subplot, (cells[:, 0], cells[0, 1], cells[1, 1]))
    steps = np.arange(mission.num_controls + 1) * mission.control_period_s
    _three_lines(force, steps, log.force_hill_n, ("radial", "along-track", "cross-track"))
    _limit_lines(force, mission.deputy.max_force_n, "N")
    force.set(title="Force, Hill axes", xlabel="time (s)", ylabel="force (N)")

    torques = 1e3 * log.torque_b_n_m.reshape(-1, 3)
    instants = np.arange(len(torques) + 1) * mission.attitude_period_s
    cut = _turned_at(torques, round(60.0 / mission.attitude_period_s))
    for ax, part in ((turning, slice(0, cut)), (following, slice(cut, None))):
        if len(torques[part]) == 0:
            ax.set_visible(False)
            continue
        edges = instants[part.start : part.start + len(torques[part]) + 1]
        _three_lines(ax, edges, torques[part], ("x", "y", "z"))
        _limit_lines(ax, 1e3 * mission.deputy.max_torque_n_m, "mN m")
        ax.set(xlabel="time (s)", ylabel="torque (mN m)")
        ax.set_title(f"Torque, body axes, {edges[0]:g} to {edges[-1]:g} s")
    force.legend(loc="upper right")
    turning.legend(loc="lower right", bbox_to_anchor=(1.0, 0.1))
    return figure


def _turned_at(torques: Floats, least: int) -> int:
    """Return after how many attitude periods the torque stays below a twentieth of its first maximum."""
    early = np.abs(torques[: max(1, len(torques) // 10)]).max(axis=1)
    large = np.flatnonzero(early > 0.05 * early.max())
    return min(len(torques), max(least, int(1.3 * large[-1]) if large.size else 0))


def _three_lines(ax: Axes, edges: NDArray[np.floating], values: Floats, labels: Sequence[str]) -> None:
    """Draw three components, (K, 3), each held over the interval between two edges, (K+1,)."""
    steps = np.vstack([values, values[-1]])
    for column, label, colour, dashes in zip(steps.T, labels, AXIS_COLOURS, AXIS_STYLES, strict=True):
        ax.plot(
            edges, column, drawstyle="steps-post", linewidth=1.3, label=label, color=colour, linestyle=dashes
        )
    ax.set_xlim(edges[0], edges[-1])
    ax.grid(axis="y")
    ax.margins(y=0.12)


def _limit_lines(ax: Axes, limit: float, unit: str) -> None:
    """Draw the limits, or say where they are when the values keep far from them."""
    reach = max((float(np.abs(line.get_ydata()).max()) for line in ax.lines), default=0.0)
    if reach < 0.5 * limit:
        text = f"limits ± {limit:g} {unit} off scale"
        ax.text(1.0, 1.02, text, transform=ax.transAxes, ha="right", va="bottom", **style.SMALL_PRINT)
        return
    for sign in (-1.0, 1.0):
        ax.axhline(sign * limit, color=style.MUTED, linestyle=style.DOTS, linewidth=1.0)
    words = f"limit {limit:g} {unit}"
    ax.text(0.01, limit, words, transform=ax.get_yaxis_transform(), va="bottom", **style.SMALL_PRINT)


#: of which the spread is drawn
METRICS = {
    "delta_v_m_s": "Δv (m/s)",
    "inspection_rate_percent": "inspection rate (%)",
    "mean_distance_m": "mean distance (m)",
}


@dataclass(frozen=True)
class Sample:
    """Values of flights of one kind: ``values`` maps the name of a metric to an array of shape (n,).

    If they are some of the flights, ``means`` are those of all.
    """

    label: str
    values: Mapping[str, Floats]
    paper_means: Mapping[str, float]
    means: Mapping[str, float] = field(default_factory=dict)


def distributions(samples: Sequence[Sample], num_points: int) -> Figure:
    """Draw how delta-v, inspection rate and mean distance spread: a row a sample, a column a metric.

    Small samples are drawn value by value, large ones as histograms.

    Parameters
    ----------
    samples : sequence of Sample
        At least one.
    num_points : int
        Inspection points: rates are multiples of 100/num_points.
    """
    heights = [1.1 if len(sample.values["delta_v_m_s"]) <= style.MOST_POINTS else 2.0 for sample in samples]
    figure = Figure(figsize=(9.6, sum(heights) + 0.65 * len(samples) + 0.3))
    margins, between = (0.58, 0.1, 0.44, 0.4), (0.4, 0.65)
    cells = style.grid(figure, len(samples), len(METRICS), margins, between, height_ratios=heights)
    rows = np.asarray(cells.subplots(squeeze=False, sharex="col"))
    for column, (metric, label) in enumerate(METRICS.items()):
        step = 100.0 / num_points if metric == "inspection_rate_percent" else None
        edges = _bin_edges([sample.values[metric] for sample in samples], step)
        for sample, ax in zip(samples, rows[:, column], strict=True):
            values = sample.values[metric]
            if len(values) <= style.MOST_POINTS:
                _draw_values(ax, values)
            else:
                _draw_histogram(ax, values, edges)
            _mark_means(
                ax, sample.means.get(metric, float(values.mean())), sample.paper_means.get(metric), edges
            )
        rows[-1, column].set_xlabel(label)
    for sample, ax in zip(samples, rows[:, 0], strict=True):
        ax.set_title(sample.label, pad=18)
        if len(sample.values["delta_v_m_s"]) > style.MOST_POINTS:
            ax.set_ylabel("flights")
    return figure


def _bin_edges(samples: Sequence[Floats], step: float | None) -> Floats:
    """Return the edges of bins over all samples, but not over what stands far apart in large ones.

    Parameters
    ----------
    samples : sequence of (n,) arrays
    step : float, optional
        What values are multiples of; each multiple then has a bin of its own.
    """
    flight_ends = np.array([_ends(values) for values in samples])
    low, high = float(flight_ends[:, 0].min()), float(flight_ends[:, 1].max())
    if step is not None:
        return np.asarray((np.arange(np.floor(low / step + 1e-6) - 1, round(high / step) + 2) - 0.5) * step)
    width = max(high - low, 0.02 * max(abs(high), 1.0))
    num_bins = min(45, round(2.0 * np.sqrt(max(len(values) for values in samples))))
    return np.linspace(low - 0.05 * width, high + 0.05 * width, num_bins + 1)


def _ends(values: Floats) -> tuple[float, float]:
    """Return the least and the greatest value; of large samples, at most a width of their bulk beyond it."""
    low, high = float(values.min()), float(values.max())
    if len(values) > style.MOST_POINTS:
        first, last = np.percentile(values, (1.0, 99.0))
        low, high = max(low, first - (last - first)), min(high, last + (last - first))
    return low, high


def _draw_values(ax: Axes, values: Floats) -> None:
    """Draw a box from quartile to quartile, its whiskers to the ends, and above it every value."""
    ax.boxplot(
        values, orientation="horizontal", positions=[0.0], widths=0.28, whis=(0, 100), manage_ticks=False
    )
    # equal values stand on one another
    heights = [0.32 + 0.11 * int(np.sum(np.isclose(values[:i], value))) for i, value in enumerate(values)]
    ax.plot(values, heights, "o", color=style.BLUE, markersize=4.5, alpha=0.85)
    ax.set(ylim=(-0.3, max(1.3, max(heights) + 0.2)), yticks=[])
    ax.spines["left"].set_visible(False)


def _draw_histogram(ax: Axes, values: Floats, edges: Floats) -> None:
    """Draw a histogram, and how many values lie beyond its edges on either side."""
    ax.hist(values, bins=edges.tolist(), color=style.BLUE, alpha=0.75)
    ax.grid(axis="y")
    ax.set_axisbelow(True)
    beyond = int(np.sum(values < edges[0])), int(np.sum(values > edges[-1]))
    words = {"transform": ax.transAxes, "va": "top", **style.SMALL_PRINT}
    if beyond[0]:
        ax.text(0.01, 0.97, f"← {beyond[0]} more", **words)
    if beyond[1]:
        ax.text(0.99, 0.97, f"{beyond[1]} more →", ha="right", **words)


def _mark_means(ax: Axes, mean: float, paper: float | None, edges: Floats) -> None:
    """Mark our mean, and the paper's where it is known: by a line, or an arrow where it is off the scale."""
    low, high = float(edges[0]), float(edges[-1])
    ax.set_xlim(low, high)
    ax.axvline(mean, color=style.INK, linewidth=1.6)
    words: dict[str, Any] = {"transform": ax.transAxes, "va": "bottom", "fontsize": 8}
    ax.text(0.0, 1.02, f"— mean {mean:.4g}", color=style.INK, **words)
    if paper is None:
        return
    arrow = (" →", "← ")[paper < low] if not low <= paper <= high else ""
    text = f"{arrow}paper {paper:g}" if paper < low else f"paper {paper:g}{arrow}"
    if not arrow:
        ax.axvline(paper, color=style.VERMILION, linewidth=1.4, linestyle=(0, (4, 2)))
        text = f"- - {text}"
    ax.text(1.0, 1.02, text, color=style.VERMILION, ha="right", **words)


def draw_flight(track: Floats, num_points: int, mission: Mission, dots_per_inch: int) -> style.Illustration:
    """Draw a flight on a strip: its path in the orbit plane, its distance, and how far it came, over time.

    Parameters
    ----------
    track : (K+1, num_tracked)
        See `pipeline.flight.fly.population.fly_population`.
    num_points : int
        Of the chief.
    mission : Mission
    dots_per_inch : int
    """
    time, deputy = mission.control_period_s * np.arange(len(track)), mission.deputy
    distances = np.linalg.norm(track[:, :3], axis=1)
    is_reach = mission.problem.kind == "reach"
    with style.style():
        figure = style.Figure(figsize=(9.6, 2.7), layout="constrained")
        plane, far, progress = figure.subplots(1, 3)
        plane.plot(track[:, 1], track[:, 0], color=style.BLUE, linewidth=0.9)
        plane.plot(*track[0, 1::-1], "o", color=style.BLUE, markersize=3.5)
        frame = 1.12 * float(np.abs(track[:, :2]).max())
        for radius, line in ((mission.chief.inspection_radius_m, "-"), (deputy.min_distance_m, ":")):
            if not is_reach:
                plane.add_patch(Circle((0, 0), radius, fill=False, edgecolor=style.MUTED, linestyle=line))
        plane.set(xlim=(-frame, frame), ylim=(-frame, frame), aspect="equal")
        plane.set(xlabel="along-track (m)", ylabel="radial (m)")
        far.plot(time, distances, color=style.BLUE, linewidth=0.9)
        far.set(xlabel="time (s)", ylabel="distance (m)", xlim=(0.0, time[-1]))
        if is_reach:
            speeds = np.linalg.norm(track[:, 3:6], axis=1)
            progress.plot(time, speeds, color=style.BLUE, linewidth=0.9)
            progress.plot(time, limit_at(mission.problem, distances), color=style.VERMILION, linestyle="--")
            progress.set(ylabel="speed and its limit (m/s)", ylim=(0.0, None))
        else:
            for limit in (deputy.min_distance_m, deputy.max_distance_m):
                far.axhline(limit, color=style.MUTED, linestyle=style.DOTS, linewidth=0.9)
            progress.plot(time, 100.0 * (1.0 - track[:, TRACK_LEFT] / num_points), color=style.BLUE)
            progress.set(ylabel="points inspected (%)", ylim=(0.0, 104.0))
        far.set_ylim(0.0)
        progress.set(xlabel="time (s)", xlim=(0.0, time[-1]))
        third = "the speed below its limit" if is_reach else "the points inspected"
        caption = style.caption_of("flight_of_board", third=third)
        return style.illustrate("flight", caption, figure, dots_per_inch)


def draw_tube(
    tube: Mapping[str, Floats], tracks: NDArray[np.float32], mission: Mission, dots_per_inch: int
) -> style.Illustration:
    """Draw a tube, as `prove` writes it, over flights.

    Parameters
    ----------
    tube : mapping of (n,)
        Boxes by step and axis: positions, m, and velocities plus ``shear_per_s`` times the position, m/s.
    tracks : (num_flights, num_samples, 6 or more)
        Positions and velocities, m and m/s.
    mission : Mission
    dots_per_inch : int
    """
    problem, period_s = mission.problem, mission.control_period_s
    least, most, fastest = tube_bounds(tube)
    time = period_s * np.arange(len(most))
    with style.style():
        figure = style.Figure(figsize=(8.0, 5.6), layout="constrained")
        far, fast = figure.subplots(2, 1, sharex=True)
        far.fill_between(time, least, most, color=style.BLUE, alpha=0.2, linewidth=0)
        fast.fill_between(time, 0.0, fastest, color=style.BLUE, alpha=0.2, linewidth=0)
        fast.plot(time, limit_at(problem, least), color=style.VERMILION, linestyle="--", label="limit")
        for flown in _until_goal(problem, tracks):
            for ax, values in zip((far, fast), flown, strict=True):
                ax.plot(period_s * np.arange(len(values)), values, color=style.BLUE, linewidth=0.5)
        far.set(ylabel="distance from the chief (m)", ylim=(0.0, None))
        fast.set(xlabel="time (s)", ylabel="speed (m/s)", xlim=(0.0, time[-1]), ylim=(0.0, None))
        fast.legend(loc="upper right")
        return style.illustrate("tube", style.caption_of("tube", count=len(tracks)), figure, dots_per_inch)


def approach(tracks: NDArray[np.float32], problem: Problem) -> Figure:
    """Draw speed over distance of flights, (n, K+1, 6 or more), m and m/s, each up to its end."""
    figure = Figure(figsize=(8.0, 4.4), layout="constrained")
    ax = figure.add_subplot()
    flights = _until_goal(problem, tracks)
    for distance, speed in flights:
        ax.plot(distance, speed, color=style.BLUE, linewidth=0.6, alpha=0.5)
    far = np.geomspace(problem.goal_radius_m, max(distance[0] for distance, _ in flights))
    ax.plot(far, limit_at(problem, far), color=style.VERMILION, linestyle="--", label="limit")
    ax.axvline(problem.goal_radius_m, color=style.INK, linestyle=style.DOTS, label="goal")
    ax.set(xlabel="distance from the chief (m)", ylabel="speed (m/s)", xscale="log", ylim=(0.0, None))
    ax.xaxis.set_major_formatter("{x:g}")
    ax.legend(loc="upper center")
    return figure


def _until_goal(problem: Problem, tracks: NDArray[np.float32]) -> list[tuple[Floats, Floats]]:
    """Return the distance, m, and the speed, m/s, of each flight up to its end."""
    distance, speed = (
        np.linalg.norm(tracks[..., first : first + 3], axis=-1).astype(np.float64) for first in (0, 3)
    )
    last, _, _ = flight_ends(problem, distance, speed)
    return [(distance[row, : end + 1], speed[row, : end + 1]) for row, end in enumerate(last)]


def tube_bounds(tube: Mapping[str, Floats]) -> tuple[Floats, Floats, Floats]:
    """Return the least and greatest distance, m, and the greatest speed, m/s, after each step."""
    step, axis = (tube[name].astype(np.int64) for name in ("step", "axis"))
    low, high, shear = tube["low_m"], tube["high_m"], tube["shear_per_s"]
    leaning = np.sort([shear * low, shear * high], axis=0)
    fast = np.maximum(np.abs(tube["least_m_s"] - leaning[1]), np.abs(tube["greatest_m_s"] - leaning[0]))
    squared = np.zeros((3, step.max() + 1, 3))
    squared[0] = np.inf
    np.minimum.at(squared[0], (step, axis), np.maximum(0.0, np.maximum(low, -high)) ** 2)
    np.maximum.at(squared[1], (step, axis), np.maximum(np.abs(low), np.abs(high)) ** 2)
    np.maximum.at(squared[2], (step, axis), fast**2)
    squared[0][np.isinf(squared[0])] = 0.0
    least, most, fastest = np.sqrt(squared.sum(axis=-1))
    return least, most, fastest
