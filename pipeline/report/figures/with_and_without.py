"""A flight with the safety layer and without: where it led, and what was changed."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from pipeline.array_types import Floats
from pipeline.flight.state.log import FlightLog
from pipeline.report.figures.style import BLUE, DOTS, GRID, MUTED, ORANGE, VERMILION
from pipeline.settings.experiment import Mission

#: the path is shown for so many control periods about its nearest (or farthest) sample
MOST_SHOWN = 150


def with_and_without(guarded: FlightLog, unguarded: FlightLog, mission: Mission) -> Figure:
    """Draw one case flown twice: the path where the layer acted, the distance over time, and its changes.

    Parameters
    ----------
    guarded, unguarded : FlightLog
        From the same start by the same controller, with the layer on and off.
    mission : Mission
        With the layer on.
    """
    figure = Figure(figsize=(9.6, 5.2), layout="constrained")
    grid = figure.add_gridspec(2, 2, width_ratios=(1.0, 1.25), height_ratios=(1.6, 1.0))
    path, distance, change = (figure.add_subplot(place) for place in (grid[:, 0], grid[0, 1], grid[1, 1]))
    _draw_path(path, guarded, unguarded, mission)
    _draw_distance(distance, guarded, unguarded, mission)
    _draw_change(change, guarded, mission)
    return figure


def _draw_path(ax: Axes, guarded: FlightLog, unguarded: FlightLog, mission: Mission) -> None:
    """Draw both paths in the plane in which the unguarded one passes its worst."""
    worst = _worst(unguarded, mission)
    basis = _plane(unguarded, worst)
    shown = slice(max(0, worst - MOST_SHOWN // 2), worst + MOST_SHOWN // 2 + 1)
    for log, colour, label in ((unguarded, ORANGE, "without"), (guarded, BLUE, "with the layer")):
        flat = log.position_m[shown] @ basis.T
        ax.plot(flat[:, 0], flat[:, 1], color=colour, linewidth=1.4, label=label)
    ax.set_aspect("equal", adjustable="datalim")
    ax.autoscale_view()
    chief = Circle((0.0, 0.0), mission.chief.inspection_radius_m, facecolor=GRID, edgecolor=MUTED)
    ax.add_patch(chief)
    for radius in (mission.deputy.min_distance_m, mission.deputy.max_distance_m):
        ax.add_patch(Circle((0.0, 0.0), radius, fill=False, edgecolor=VERMILION, linestyle=DOTS, zorder=1.5))
    ax.set(title="Path about the worst sample, in its plane", xlabel="outward at that sample (m)")
    ax.set_ylabel("onward (m)")
    ax.legend(loc="best")


def _worst(log: FlightLog, mission: Mission) -> int:
    """Return the sample farthest outside the limits, or nearest to them."""
    distances = np.linalg.norm(log.position_m, axis=1)
    low, high = mission.deputy.min_distance_m, mission.deputy.max_distance_m
    return int(np.argmax(np.maximum(low - distances, distances - high)))


def _plane(log: FlightLog, sample: int) -> Floats:
    """Return two unit vectors, shape (2, 3): from the chief to the deputy, and onward across that."""
    first = log.position_m[sample] / np.linalg.norm(log.position_m[sample])
    onward = log.velocity_m_s[sample] - (log.velocity_m_s[sample] @ first) * first
    return np.stack([first, onward / max(float(np.linalg.norm(onward)), 1e-12)])


def _draw_distance(ax: Axes, guarded: FlightLog, unguarded: FlightLog, mission: Mission) -> None:
    times = np.arange(mission.num_controls + 1) * mission.control_period_s
    for log, colour in ((unguarded, ORANGE), (guarded, BLUE)):
        ax.plot(times, np.linalg.norm(log.position_m, axis=1), color=colour, linewidth=1.4)
    for limit in (mission.deputy.min_distance_m, mission.deputy.max_distance_m):
        ax.axhline(limit, color=VERMILION, linestyle=DOTS, linewidth=1.0)
    ax.set(title="Distance", ylabel="distance (m)", xlim=(0.0, mission.duration_s))
    ax.grid(axis="y")


def _draw_change(ax: Axes, guarded: FlightLog, mission: Mission) -> None:
    """Draw the delta-v of the layer's changes, period by period, and what they add up to."""
    per_force = mission.control_period_s / mission.deputy.mass_kg
    spent = 1e3 * np.abs(guarded.safety_force_hill_n).sum(axis=1) * per_force
    times = np.arange(mission.num_controls) * mission.control_period_s
    ax.vlines(times[spent > 0], 0.0, spent[spent > 0], color=BLUE, linewidth=1.4)
    title = f"Change of the force by the layer: {np.count_nonzero(spent)} periods, {spent.sum():.1f} mm/s"
    ax.set(title=title, xlabel="time (s)", ylabel="mm/s a period")
    ax.set(xlim=(0.0, mission.duration_s), ylim=(0.0, None))
    ax.grid(axis="y")
