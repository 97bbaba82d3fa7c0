"""Force and torque of a flight over time."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from pipeline.array_types import Floats
from pipeline.flight.state.log import FlightLog
from pipeline.report.figures.style import BLUE, DOTS, GREEN, MUTED, VERMILION, grid
from pipeline.settings.experiment import Mission

AXIS_COLOURS = (BLUE, VERMILION, GREEN)
AXIS_STYLES = ("-", (0, (5, 1.5)), (0, (1, 1)))


def controls(log: FlightLog, mission: Mission) -> Figure:
    """Draw the force (Hill axes) and the torque (body axes) of a flight, as applied, over time.

    The torque is drawn in two parts, for turning to the chief takes a hundred times what following it does.
    """
    figure = Figure(figsize=(9.6, 4.8))
    places = grid(figure, 2, 2, (0.75, 0.13, 0.44, 0.24), (0.82, 0.66))
    force, turning, following = map(figure.add_subplot, (places[:, 0], places[0, 1], places[1, 1]))
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
    for column, label in enumerate(labels):
        held = np.append(values[:, column], values[-1, column])
        colour, line_style = AXIS_COLOURS[column], AXIS_STYLES[column]
        ax.plot(
            edges,
            held,
            drawstyle="steps-post",
            color=colour,
            linestyle=line_style,
            linewidth=1.3,
            label=label,
        )
    ax.set_xlim(edges[0], edges[-1])
    ax.grid(axis="y")
    ax.margins(y=0.12)


def _limit_lines(ax: Axes, limit: float, unit: str) -> None:
    """Draw the limits, or say where they are when the values keep far from them."""
    reach = max((float(np.abs(line.get_ydata()).max()) for line in ax.lines), default=0.0)
    if reach < 0.5 * limit:
        text = f"limits ± {limit:g} {unit} off scale"
        ax.text(1.0, 1.02, text, transform=ax.transAxes, ha="right", va="bottom", color=MUTED, fontsize=8)
        return
    for sign in (-1.0, 1.0):
        ax.axhline(sign * limit, color=MUTED, linestyle=DOTS, linewidth=1.0)
    ax.text(
        0.01,
        limit,
        f"limit {limit:g} {unit}",
        transform=ax.get_yaxis_transform(),
        va="bottom",
        color=MUTED,
        fontsize=8,
    )
