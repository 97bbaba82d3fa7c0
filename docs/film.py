"""The flight on the first page as an animation of twenty seconds.

`flown` flies `COMMAND`, and `film` draws its recording: the deputy's path about the chief, the points it
has inspected, its force on each axis, and the rule that pushes most.
"""

import io
import subprocess
import sys
import textwrap
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from numpy.typing import NDArray
from PIL import Image

import telemetry
from fis_tools.formats.serialize import load
from fis_tools.words.text import sentence
from pipeline.report.figures.style import GREEN, GRID, INK, MUTED, ORANGE, PAPER, VERMILION, style
from telemetry.file.reader import Recording

Floats = NDArray[np.float64]

PROJECT = Path(__file__).resolve().parents[1]
CONTROLLER = "champion_27"
FILE = PROJECT / "conf" / "controller" / f"{CONTROLLER}.yaml"
COMMAND = ("+experiment=fly", f"controller={CONTROLLER}")
FRAMES, FRAME_MS = 100, 200
SIZE_INCHES, DPI = (12.0, 8.0), 60
#: from where the scene is seen, in Hill axes, and what is up there
EYE, UP = (-0.45, -0.3, 1.0), (1.0, 0.0, 0.0)
AXES = {"up and down": 0, "ahead and back": 1, "across the orbit": 2}
DIRECTIONS = (("down", "up"), ("back", "ahead"), ("to the south", "to the north"))
#: states of points in a recording
SEEN, LIT = 3, 1


def flown(folder: Path) -> Recording:
    """Fly `COMMAND` into a folder and return the recording."""
    words = [sys.executable, "-m", "pipeline", *COMMAND, f"hydra.run.dir={folder / 'run'}"]
    subprocess.run(words, cwd=PROJECT, check=True, stdout=subprocess.DEVNULL)  # noqa: S603
    return telemetry.read(folder / "run" / "episodes" / "start.mcap")


def film(recording: Recording, output: Path) -> None:
    """Write a flight as an animation."""
    end = recording.topics["/mission"].time_s[-1]
    frames = []
    for time_s in np.linspace(0.0, end, FRAMES):
        frame = io.BytesIO()
        draw(recording, time_s).savefig(frame, dpi=DPI)
        frames.append(Image.open(frame).convert("RGB"))
    frames[0].save(
        output, save_all=True, append_images=frames[1:], duration=FRAME_MS, loop=0, quality=55, method=4
    )


def draw(recording: Recording, time_s: float) -> Figure:
    """Draw one moment of a flight.

    Parameters
    ----------
    recording : Recording
    time_s : float
        Since the start.
    """
    with style():
        figure = Figure(figsize=SIZE_INCHES, facecolor=PAPER)
        _scene(figure.add_axes((0.0, 0.2, 0.56, 0.8)), recording, time_s)
        for place, (name, axis) in enumerate(AXES.items()):
            panel = figure.add_axes((0.64, 0.77 - 0.22 * place, 0.34, 0.15))
            _force(panel, recording, axis, time_s)
            panel.set_title(name, fontsize=19)
            if place == len(AXES) - 1:
                panel.set_xlabel("minutes", fontsize=19)
        figure.text(0.02, 0.17, _headline(recording, time_s), fontsize=25, weight="bold", va="top")
        figure.text(0.02, 0.11, _reason(recording, time_s), fontsize=20, va="top", color=INK)
    return figure


def _at(recording: Recording, topic: str, time_s: float) -> int:
    """Return the last message of a topic at a time, -1 if it has none yet."""
    return int(np.searchsorted(recording.topics[topic].time_s, time_s, side="right")) - 1


def _flat(position: NDArray[Any]) -> tuple[Floats, Floats]:
    """Project Hill coordinates, (..., 3), onto the picture: to the right and up, and towards the eye."""
    ahead = np.array(EYE) / np.linalg.norm(EYE)
    right = np.cross(UP, ahead)
    right /= np.linalg.norm(right)
    on_picture = np.stack([right, np.cross(ahead, right)])
    return position @ on_picture.T, position @ ahead


def _scene(axes: Axes, recording: Recording, time_s: float) -> None:
    """Draw the chief with its points, the path flown and to come, the Sun, and the push."""
    now = _at(recording, "/deputy/state", time_s)
    path, depth = _flat(recording.topics["/deputy/state"].columns["position_m"])
    axes.set_aspect("equal")
    axes.axis("off")
    low, high = path.min(axis=0) - 12.0, path.max(axis=0) + 20.0
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    axes.plot(*path.T, color=GRID, lw=2.5, zorder=1)
    behind = depth < 0.0
    for index in range(now):
        axes.plot(
            *path[index : index + 2].T,
            color=INK,
            lw=3.5,
            zorder=1 if behind[index] else 6,
            solid_capstyle="round",
        )
    points = recording.topics["/chief/points"].columns
    where, towards = _flat(points["position_m"][now])
    state = points["state"][now]
    radius = float(np.max(np.linalg.norm(points["position_m"][now], axis=-1)))
    axes.add_patch(Circle((0.0, 0.0), radius, facecolor=GRID, edgecolor=GRID, zorder=3))
    front = towards >= 0.0
    colours = np.where(state == SEEN, GREEN, np.where(state == LIT, ORANGE, MUTED))
    axes.scatter(where[front, 0], where[front, 1], c=colours[front], s=42, zorder=4)
    sun_angle = recording.topics["/mission"].columns["sun_angle_rad"][now]
    (sun, _) = _flat(np.array([np.cos(sun_angle), np.sin(sun_angle), 0.0]))
    _arrow(axes, sun * radius * 1.3, sun * radius * 3.2, ORANGE, "Sun")
    force = _force_at(recording, time_s)
    if np.any(force):
        pushed, _ = _flat(force / np.linalg.norm(force))
        _arrow(axes, path[now], path[now] + 40.0 * pushed, VERMILION, "push")
    axes.scatter(path[now, 0], path[now, 1], s=150, color=INK, zorder=8)
    away = -sun * 1.5 * radius / np.linalg.norm(sun)
    beside = "right" if away[0] < 0.0 else "left"
    axes.text(away[0], away[1], "chief", color=MUTED, fontsize=20, ha=beside, va="center")
    side = "left" if path[now, 0] < 0.5 * (low[0] + high[0]) else "right"
    axes.text(path[now, 0], path[now, 1] + 6.0, "deputy", fontsize=20, ha=side, va="bottom", zorder=9)
    for place, (word, colour) in enumerate((("inspected", GREEN), ("lit", ORANGE), ("dark", MUTED))):
        height = 0.97 - 0.055 * place
        axes.scatter(0.03, height, s=90, color=colour, transform=axes.transAxes)
        axes.text(0.06, height, word, fontsize=19, va="center", transform=axes.transAxes)


def _arrow(axes: Axes, start: Floats, end: Floats, colour: str, word: str) -> None:
    arrow = {"arrowstyle": "-|>", "color": colour, "lw": 4, "mutation_scale": 28}
    axes.annotate("", (end[0], end[1]), (start[0], start[1]), arrowprops=arrow, zorder=7)
    axes.annotate(
        word, (end[0], end[1]), color=colour, fontsize=20, weight="bold", ha="left", va="bottom", zorder=9
    )


def _force(axes: Axes, recording: Recording, axis: int, time_s: float) -> None:
    """Draw the force on one axis over the whole flight, what has been flown in full colour."""
    control = recording.topics["/deputy/control"]
    force: Floats = 1e3 * np.asarray(control.columns["force_hill_n"], np.float64)[:, axis]
    minutes = control.time_s / 60.0
    flown = control.time_s <= time_s
    axes.vlines(minutes, 0.0, force, color=GRID, lw=3)
    axes.vlines(minutes[flown], 0.0, force[flown], color=VERMILION, lw=3)
    axes.axvline(time_s / 60.0, color=INK, lw=2)
    axes.axhline(0.0, color=MUTED, lw=1)
    limit = 1.1e3 * float(np.abs(np.asarray(control.columns["force_hill_n"], np.float64)).max())
    axes.set_ylim(-limit, limit)
    axes.set_xlim(0.0, 60.0)
    axes.set_xticks([0, 20, 40, 60], ["0", "20", "40", "60"] if axis == 2 else [])
    axes.set_yticks([-30, 0, 30], ["-30", "0", "30 mN"])
    axes.tick_params(labelsize=17)


def _force_at(recording: Recording, time_s: float) -> Floats:
    now = _at(recording, "/deputy/control", time_s)
    force: Floats = recording.topics["/deputy/control"].columns["force_hill_n"][now]
    return force


def _headline(recording: Recording, time_s: float) -> str:
    """Return the minute, the points and the push in words."""
    mission = recording.topics["/mission"].columns
    now = _at(recording, "/mission", time_s)
    points = f"{mission['inspected_count'][now]} of {mission['inspected_mask'].shape[1]} points"
    done = f"{points} inspected, {mission['delta_v_m_s'][now]:.2f} m/s burnt"
    return f"{time_s / 60.0:.0f} min: {done}"


def _reason(recording: Recording, time_s: float) -> str:
    """Return the push in words, with the rule that asks for most of it."""
    force = _force_at(recording, time_s)
    axis = int(np.argmax(np.abs(force)))
    if not force[axis]:
        reasons = recording.topics["/deputy/control"].columns["reason"]
        decided = reasons[: _at(recording, "/deputy/control", time_s) + 1]
        decided = decided[np.any(decided != "waiting", axis=1)]
        is_coasting = len(decided) and "coasting" in decided[-1]
        return "no push: " + ("coasting to the end" if is_coasting else "no rule asks for enough")
    name = recording.fis_names[axis]
    shares = recording.topics[f"/fis/{name}"].columns["shares_n"][_at(recording, f"/fis/{name}", time_s)]
    rule = int(np.argmax(shares * np.sign(force[axis])))
    (system,) = (one for one in load(FILE).systems if one.name == name)
    push = f"push {DIRECTIONS[axis][int(force[axis] > 0)]}, {1e3 * abs(force[axis]):.0f} mN:"
    return "\n".join(textwrap.wrap(f"{push} {sentence(system.rules[rule])}", 76))
