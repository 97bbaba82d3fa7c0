"""Flights around the chief: in space, on planes of Hill axes, and their distance over time."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib import colors
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d import Axes3D
from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection
from numpy.typing import NDArray

from pipeline.array_types import Floats
from pipeline.report.figures.style import CENTRED, DOTS, MOST_POINTS, MUTED, PALETTE, PAPER, SMALL_PRINT
from pipeline.settings.experiment import Mission

HILL_AXES = ("radial i", "along-track j", "cross-track k")
#: up to this many flights have colours of their own
MOST_TOLD_APART = len(PALETTE)


@dataclass(frozen=True)
class Tracks:
    """Flights around the chief.

    Parameters
    ----------
    positions_m : (n, K+1, 3) array
        Hill axes.
    colours : sequence of str
        One a flight.
    legend : mapping of str to str
        What a colour means, to the colour; empty where each start bears the number of its flight.
    """

    positions_m: NDArray[np.floating]
    colours: Sequence[str]
    legend: Mapping[str, str]


def trajectories(tracks: Tracks, mission: Mission) -> Figure:
    """Draw flights around the chief: in space, on two planes of Hill axes, and their distance over time."""
    figure = Figure(figsize=(9.6, 8.0))
    space = figure.add_axes((-0.02, 0.225, 0.66, 0.792), projection="3d", computed_zorder=False)
    assert isinstance(space, Axes3D)  # noqa: S101 - as asked for
    planes = [figure.add_axes((0.705, 0.655, 0.275, 0.33)), figure.add_axes((0.705, 0.265, 0.275, 0.33))]
    distance = figure.add_axes((0.075, 0.06, 0.91, 0.145))
    look = _Look(mission, tracks)
    _draw_space(space, look)
    for ax, axes in zip(planes, PLANES, strict=True):
        _draw_plane(ax, look, axes)
    _draw_distance(distance, look)
    if tracks.legend:
        handles = [Line2D([], [], color=colour, linewidth=2.5) for colour in tracks.legend.values()]
        figure.legend(handles, list(tracks.legend), loc="upper left", bbox_to_anchor=(0.0, 0.995))
    else:
        _number_starts(space, planes, look)
    return figure


def trajectories_apart(groups: Mapping[str, Tracks], mission: Mission) -> Figure:
    """Draw groups of flights side by side on equal scales: in space, in the orbit plane, and their distance.

    Parameters
    ----------
    groups : mapping of str to Tracks
        By their titles, at least one.
    mission : Mission
    """
    figure = Figure(figsize=(9.6, 8.0))
    share = 0.945 / len(groups)
    reach = max(float(np.abs(tracks.positions_m).max()) for tracks in groups.values())
    for column, (title, tracks) in enumerate(groups.items()):
        left, look = 0.07 + share * column, _Look(mission, tracks, reach)
        space = figure.add_axes((left - 0.03, 0.57, share, 0.39), projection="3d", computed_zorder=False)
        assert isinstance(space, Axes3D)  # noqa: S101 - as asked for
        _draw_space(space, look)
        space.set(xticklabels=[], yticklabels=[], zticklabels=[])
        space.set(xlabel="radial", ylabel="along-track", zlabel="cross-track")
        for axis in (space.xaxis, space.yaxis, space.zaxis):
            axis.labelpad = -12
        plane = figure.add_axes((left, 0.265, share - 0.07, 0.3))
        _draw_plane(plane, look, PLANES[0])
        distance = figure.add_axes((left, 0.06, share - 0.07, 0.145))
        _draw_distance(distance, look)
        space.text2D(0.5, 1.0, title, transform=space.transAxes, ha="center", fontweight="bold")
        if column:
            for ax in (plane, distance):
                ax.set_ylabel("")
    return figure


#: (across, up) of the pictures in the orbit's plane, the radial axis up, and across it
PLANES = ((1, 0), (1, 2))
#: from where space is looked at
ELEVATION_DEG, AZIMUTH_DEG = 24.0, -52.0
CHIEF_COLOUR = "#9aa3ad"


class _Look:
    """How flights are drawn: the fewer, the stronger; what leaves the picture's frame is left out."""

    def __init__(self, mission: Mission, tracks: Tracks, farthest_m: float | None = None) -> None:
        self.mission = mission
        self.colours = np.array(colors.to_rgba_array(list(tracks.colours)))
        positions = np.asarray(tracks.positions_m, dtype=np.float64)
        num_flights = len(positions)
        farthest_m = float(np.abs(positions).max()) if farthest_m is None else farthest_m
        reach = min(max(1.04 * farthest_m, 20.0), 1.1 * mission.deputy.max_distance_m)
        self.frame = float(np.ceil(reach / 10.0 - 1e-9) * 10.0)
        self.distances = np.linalg.norm(positions, axis=-1)
        self.positions = np.where(
            (np.abs(positions) > self.frame).any(axis=-1, keepdims=True), np.nan, positions
        )
        self.is_crowded = num_flights > MOST_POINTS
        is_few = num_flights <= MOST_TOLD_APART
        self.widths = np.full(num_flights, 1.3 if is_few else 0.5 if self.is_crowded else 0.9)
        self.colours[:, 3] = 1.0 if is_few else np.clip(60.0 / num_flights, 0.15, 0.7)


def _draw_space(ax: Axes3D, look: _Look) -> None:
    """Draw the flights around the chief in three dimensions: far pieces behind it, near ones before it."""
    ax.view_init(elev=ELEVATION_DEG, azim=AZIMUTH_DEG)
    elevation, azimuth = np.radians(ELEVATION_DEG), np.radians(AZIMUTH_DEG)
    towards_eye = np.array(
        [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)]
    )
    is_near = look.positions @ towards_eye > 0.0
    for is_drawn, order in ((~is_near, 2.0), (is_near, 4.0)):
        pieces, owners = _pieces(look.positions, is_drawn)
        if pieces:
            lines = Line3DCollection(
                pieces, colors=look.colours[owners], linewidths=look.widths[owners], zorder=order
            )
            lines.set_rasterized(look.is_crowded)
            ax.add_collection3d(lines)
    if not look.is_crowded:
        starts = look.positions[:, 0]
        ax.scatter(*starts.T, s=28, c=look.colours, zorder=5.0, depthshade=False)
    _draw_chief(ax, look.mission.chief.inspection_radius_m, towards_eye)
    limits = (-look.frame, look.frame)
    ax.set(xlim=limits, ylim=limits, zlim=limits)
    ax.set(xlabel=f"{HILL_AXES[0]} (m)", ylabel=f"{HILL_AXES[1]} (m)", zlabel=f"{HILL_AXES[2]} (m)")
    ax.set_box_aspect((1, 1, 1), zoom=0.95)
    for axis in (ax.xaxis, ax.yaxis, ax.zaxis):
        axis.set_pane_color((0.5, 0.5, 0.5, 0.05))
        axis.line.set_color(MUTED)
        axis.set_major_locator(MaxNLocator(5))


def _pieces(positions: Floats, is_drawn: NDArray[np.bool_]) -> tuple[list[Floats], list[int]]:
    """Cut tracks where they turn away, each piece up to the first point of the next; say whose each is."""
    pieces, owners = [], []
    for owner, (track, flags) in enumerate(zip(positions, is_drawn, strict=True)):
        is_there = np.isfinite(track[:, 0])
        edges = np.flatnonzero(np.diff(np.concatenate([[0], (flags & is_there).astype(np.int8), [0]])))
        for first, last in edges.reshape(-1, 2):
            piece = track[first : last + 1][is_there[first : last + 1]]
            if len(piece) > 1:
                pieces.append(piece)
                owners.append(owner)
    return pieces, owners


def _draw_chief(ax: Axes3D, radius: float, towards_eye: Floats) -> None:
    """Draw the chief's sphere, lit from the viewer's side."""
    azimuth, polar = np.meshgrid(np.linspace(0.0, 2.0 * np.pi, 49), np.linspace(0.0, np.pi, 25))
    normals = np.stack([np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)])
    light = towards_eye + np.array([0.0, 0.0, 0.5])
    brightness = 0.5 + 0.5 * np.clip(np.tensordot(light / np.linalg.norm(light), normals, 1), 0.0, 1.0)
    # as `Axes3D.plot_surface` does, which looks at each of the 1,152 pieces and their colours by itself
    colours = brightness[:-1, :-1].reshape(-1, 1) * np.array(colors.to_rgb("#c3cad2"))
    points = radius * np.moveaxis(normals, 0, -1)
    corners = points[:-1, :-1], points[:-1, 1:], points[1:, 1:], points[1:, :-1]
    pieces = np.stack(corners, axis=2).reshape(-1, 4, 3)
    sphere = Poly3DCollection(
        pieces, facecolors=colours, edgecolors=colours, zorder=3.0, linewidth=0, antialiased=False
    )
    sphere.set_rasterized(True)
    ax.add_collection3d(sphere)


def _draw_plane(ax: Axes, look: _Look, axes: tuple[int, int]) -> None:
    """Draw the flights projected onto two of Hill's axes, with the chief and the distance limits."""
    across, up = axes
    tracks = look.positions[:, :, list(axes)]
    lines = LineCollection(list(tracks), colors=look.colours, linewidths=0.8 * look.widths, zorder=2.0)
    lines.set_rasterized(look.is_crowded)
    ax.add_collection(lines)
    if not look.is_crowded:
        ax.scatter(tracks[:, 0, 0], tracks[:, 0, 1], s=12, c=look.colours, zorder=5.0)
    chief, deputy = look.mission.chief, look.mission.deputy
    ax.add_patch(
        Circle((0, 0), chief.inspection_radius_m, facecolor=CHIEF_COLOUR, edgecolor="none", zorder=3.0)
    )
    for radius in (deputy.min_distance_m, deputy.max_distance_m):
        ring = Circle((0, 0), radius, fill=False, edgecolor=MUTED, linestyle=DOTS, linewidth=0.9, zorder=4.0)
        ax.add_patch(ring)
    ax.set(xlim=(-look.frame, look.frame), ylim=(-look.frame, look.frame), aspect="equal")
    ax.set(xlabel=f"{HILL_AXES[across]} (m)", ylabel=f"{HILL_AXES[up]} (m)")
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_major_locator(MaxNLocator(5))
    ax.grid(True)


def _draw_distance(ax: Axes, look: _Look) -> None:
    """Draw the flights' distance over time, with its limits."""
    deputy = look.mission.deputy
    time = np.arange(look.distances.shape[1]) * look.mission.control_period_s
    tracks = np.stack([np.broadcast_to(time, look.distances.shape), look.distances], axis=-1)
    lines = LineCollection(list(tracks), colors=look.colours, linewidths=0.8 * look.widths)
    lines.set_rasterized(look.is_crowded)
    ax.add_collection(lines)
    for limit in (deputy.min_distance_m, deputy.max_distance_m):
        ax.axhline(limit, color=MUTED, linestyle=DOTS, linewidth=0.9)
        ax.text(time[-1], limit, f"limit {limit:g} m ", ha="right", va="bottom", **SMALL_PRINT)
    ax.set(xlim=(0.0, time[-1]), ylim=(0.0, 1.15 * deputy.max_distance_m))
    ax.set(xlabel="time (s)", ylabel="distance (m)")
    ax.grid(axis="y")


def _number_starts(space: Axes3D, planes: Sequence[Axes], look: _Look) -> None:
    """Write the number of each flight on its start; one alone needs none."""
    starts = look.positions[:, 0]
    if len(starts) == 1:
        return
    for number, start in enumerate(starts):
        disc = {"boxstyle": "circle,pad=0.2", "facecolor": look.colours[number], "edgecolor": "none"}
        words = {"color": PAPER, "fontsize": 7.5, "fontweight": "bold", "bbox": disc, **CENTRED}
        space.text(*start, str(number), zorder=6.0, **words)
    for ax, axes in zip(planes, PLANES, strict=True):
        together: dict[tuple[float, float], list[str]] = {}
        for number, start in enumerate(starts):
            across, up = np.round(start[list(axes)], 1).tolist()
            together.setdefault((across, up), []).append(str(number))
        label = {"boxstyle": "round,pad=0.15", "facecolor": PAPER, "edgecolor": MUTED, "linewidth": 0.6}
        for (across, up), numbers in together.items():
            ax.text(across, up, ", ".join(numbers), fontsize=7, bbox=label, zorder=6.0, **CENTRED)
