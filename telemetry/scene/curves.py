"""The plots as data: curves, titles and colours, in letters that the viewer's fonts can draw."""

import re
import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from telemetry.array_types import Floats
from telemetry.file import topics
from telemetry.file.recording import Recording

#: replaces a character without a glyph; it is in both fonts
MISSING_SIGN: Final = "□"

#: characters in both fonts of the viewer, Inter for text and JetBrains Mono for code and events: Latin,
#: Greek, Cyrillic and Vietnamese letters, punctuation, powers and indices, arrows, some mathematics
_UNKNOWN: Final = re.compile(
    "[^"
    "\n\u0020-\u007e\u00a0-\u00ac\u00ae-\u0148\u014a-\u017f"
    "\u0391-\u03a1\u03a3-\u03ce\u0401-\u040c\u040e-\u044f\u0451-\u045c\u045e\u045f\u1ea0-\u1ef9"
    "\u2010\u2013\u2014\u2018-\u201e\u2020-\u2022\u2026\u2030\u2032\u2033\u2039\u203a\u2044"
    "\u2070\u2074-\u207a\u2080-\u2089\u20ac\u2190-\u2199\u2212\u221a\u221e\u2248\u2260\u2264\u2265\u25a1"
    "]"
)


def drawable(text: str) -> str:
    """Return a text in which characters without a glyph in the viewer are empty boxes.

    Combining marks are composed first, as the file names of macOS require.
    """
    return _UNKNOWN.sub(MISSING_SIGN, unicodedata.normalize("NFC", text))


def table(rows: Sequence[tuple[str, str]]) -> str:
    """Render names and values as a Markdown table, headed by the first of them."""
    head, *others = (f"| {name} | {value} |" for name, value in rows)
    return "\n".join([head, "|---|---|", *others])


Colour = tuple[int, int, int]

#: of the x, y, z (or i, j, k) axis
AXIS_COLOURS: Final[tuple[Colour, ...]] = ((235, 87, 87), (111, 207, 151), (86, 160, 255))
SIGNAL_COLOURS: Final[tuple[Colour, ...]] = (*AXIS_COLOURS, (240, 200, 80), (190, 130, 255), (80, 210, 220))
PLAIN_COLOUR: Final[Colour] = (220, 224, 235)
LIMIT_COLOUR: Final[Colour] = (200, 70, 70)
GOAL_COLOUR: Final[Colour] = (0, 190, 130)

#: the axis covers a limit only if the curve reaches at least this share of it
_LEAST_SHARE_OF_LIMIT: Final = 0.25
#: more labels on each side of zero would be left out
_MOST_TICKS: Final = 3.0


@dataclass(frozen=True)
class Curves:
    """Lines over the same times.

    Parameters
    ----------
    name : str
        Unique within the plot.
    instants : (N,)
        Seconds or generations, as the view's timeline.
    values : (N, M)
    labels : tuple of str
        M names in the legend.
    colours : tuple of Colour
        M of them.
    in_steps : bool
        Whether a value holds until the next one.
    width : float
        In points.
    """

    name: str
    instants: Floats
    values: Floats
    labels: tuple[str, ...]
    colours: tuple[Colour, ...]
    in_steps: bool = False
    width: float = 1.6


@dataclass(frozen=True)
class Plot:
    """Curves in one view.

    Parameters
    ----------
    key : str
        Name of the view's entity.
    title : str
        With the unit.
    curves : tuple of Curves
    ends : (float, float) or None
        Range of the vertical axis; None to fit the curves.
    has_legend : bool
    rises : bool
        Whether the curves leave room for the legend on the left.
    """

    key: str
    title: str
    curves: tuple[Curves, ...]
    ends: tuple[float, float] | None = None
    has_legend: bool = True
    rises: bool = False


def mission_plots(recordings: Sequence[Recording], colours: Sequence[Colour]) -> tuple[Plot, Plot, Plot]:
    """Plot distance, inspection rate and delta-v of flights, with the limits of the first."""
    episode = recordings[0].episode
    end_s = max(float(recording[topics.MISSION].time_s[-1]) for recording in recordings)
    has_legend = len(recordings) > 1
    limits = [limit for limit in (episode.min_distance_m, episode.max_distance_m) if limit is not None]
    levels = [level(f"limit_{limit:g}", end_s, limit, LIMIT_COLOUR) for limit in limits]
    distance = (*_of_each(recordings, colours, "distance_m"), *levels)
    farthest = max(float(curve.values.max()) for curve in distance)
    rate = _of_each(recordings, colours, "inspection_rate_percent", in_steps=True)
    threshold = episode.inspection_threshold_percent
    if threshold is not None:
        rate = (*rate, level("goal", end_s, threshold, GOAL_COLOUR))
    goal = "" if threshold is None else f"; goal {threshold:g}"
    bounds = "; limits " + ", ".join(f"{limit:g}" for limit in limits) if limits else ""
    delta_v = _of_each(recordings, colours, "delta_v_m_s")
    spent = _reach(max(float(curve.values.max()) for curve in delta_v) or 1.0)
    ends, spent_ends = (-0.12 * farthest, 1.15 * farthest), (-0.12 * spent, 1.1 * spent)
    return (
        Plot("distance", f"Distance (m{bounds})", distance, ends, has_legend=False),
        Plot("rate", f"Inspected (%{goal})", rate, (-12.0, 115.0), has_legend=False),
        Plot("delta_v", "Delta-v (m/s)", delta_v, spent_ends, has_legend=has_legend, rises=True),
    )


def flight_names(recordings: Sequence[Recording]) -> list[str]:
    """Name flights by their files; files of the same name also by the folder in which they differ."""
    paths = [recording.path.resolve() for recording in recordings]
    stems = [drawable(path.stem) for path in paths]
    for depth in range(min(len(path.parents) for path in paths)):
        folders = [drawable(path.parents[depth].name) for path in paths]
        names = [
            stem if stems.count(stem) == 1 else f"{folder}/{stem}"
            for stem, folder in zip(stems, folders, strict=True)
        ]
        if len(set(names)) == len(names):
            return names
    # the same file twice
    return [f"{stem} {number}" for number, stem in enumerate(stems, start=1)]


def effort_plots(recording: Recording) -> tuple[Plot, Plot]:
    """Plot the force over each control period and the torque over each attitude period."""
    episode = recording.episode
    control = recording[topics.DEPUTY_CONTROL]
    history = recording[topics.DEPUTY_ATTITUDE]
    axes = ("i radial", "j along-track", "k normal")
    force = Curves("applied", control.time_s, _floats(control["force_hill_n"]), axes, AXIS_COLOURS, True)
    instants = (history.time_s[:, None] + _floats(history["time_offset_s"])).ravel()
    torques = 1e3 * _floats(history["torque_n_m"]).reshape(-1, 3)
    torque = Curves("applied", instants, torques, ("x", "y", "z"), AXIS_COLOURS, True)
    max_torque = None if episode.max_torque_n_m is None else 1e3 * episode.max_torque_n_m
    return (
        _with_limits("force", "Force, Hill axes (N", force, episode.max_force_n),
        _with_limits("torque", "Torque, body axes (mN m", torque, max_torque),
    )


def fis_plots(recording: Recording) -> list[Plot]:
    """Plot the outputs of the fuzzy systems, then their inputs, one plot per unit."""
    outputs: list[Curves] = []
    inputs: dict[str, list[Curves]] = {}
    senses = [recording.fis_description(name).input_names for name in recording.fis_names]
    for name in recording.fis_names:
        topic = recording[topics.fis_topic(name)]
        if not len(topic):
            continue
        words = recording.fis_description(name)
        colour = (SIGNAL_COLOURS[len(outputs) % len(SIGNAL_COLOURS)],)
        answer = np.zeros((len(topic), 1))
        fired, _ = recording.fired(name)
        answer[fired, 0] = _floats(topic["output_n"])[fired]
        fired_s = topic.time_s + recording.command_age_s
        system = f"system_{len(outputs)}"
        outputs.append(Curves(system, fired_s, answer, (words.output_name,), colour, True))
        sensed = _floats(topic["inputs"])
        for index, (signal, unit) in enumerate(zip(words.input_names, words.input_units, strict=True)):
            same = inputs.setdefault(unit, [])
            colour = (SIGNAL_COLOURS[len(same) % len(SIGNAL_COLOURS)],)
            label = (
                (signal,) if sum(signal in signals for signals in senses) == 1 else (f"{signal} ({name})",)
            )
            same.append(
                Curves(f"{system}_input_{index}", topic.time_s, sensed[:, index, None], label, colour)
            )
    if not outputs:
        return []
    largest = max(float(np.abs(curves.values).max()) for curves in outputs)
    ends = (-_reach(largest), _reach(largest)) if largest else None
    plots = [Plot("fis_outputs", "Outputs that were fired (N)", tuple(outputs), ends)]
    for number, (unit, curves) in enumerate(inputs.items()):
        plots.append(Plot(f"fis_inputs_{number}", f"Inputs ({unit or 'no unit'})", tuple(curves)))
    return plots


def _of_each(
    recordings: Sequence[Recording], colours: Sequence[Colour], field: str, *, in_steps: bool = False
) -> tuple[Curves, ...]:
    """Return a curve for each recording of a field of its mission topic."""
    groups = []
    named = zip(recordings, flight_names(recordings), colours, strict=True)
    for index, (recording, name, colour) in enumerate(named):
        mission = recording[topics.MISSION]
        values = _floats(mission[field])[:, None]
        groups.append(Curves(f"flight_{index}", mission.time_s, values, (name,), (colour,), in_steps))
    return tuple(groups)


def level(name: str, end_s: float, value: float, colour: Colour) -> Curves:
    """Return a line at a value, from the start of a flight to its end."""
    label = name.replace("_", " ")
    return Curves(name, np.array([0.0, end_s]), np.full((2, 1), value), (label,), (colour,), width=1.0)


def _with_limits(key: str, title: str, curves: Curves, limit: float | None) -> Plot:
    """Return a plot with lines at a limit and its negative, unless the curve stays far below."""
    if limit is None or not curves.values.size:
        return Plot(key, f"{title})", (curves,))
    title = f"{title}; limit ±{limit:g})"
    largest = float(np.abs(curves.values).max())
    if largest < _LEAST_SHARE_OF_LIMIT * limit:
        reach = _reach(max(largest, 1e-3 * limit))
        return Plot(key, title, (curves,), (-reach, reach))
    end_s = float(curves.instants[-1])
    levels = (
        level(name, end_s, value, LIMIT_COLOUR) for name, value in (("limit", limit), ("lower_limit", -limit))
    )
    return Plot(key, title, (curves, *levels), (-1.1 * limit, 1.1 * limit))


def _reach(largest: float) -> float:
    """Return an axis's end such that several powers of ten, the viewer's only labels, lie on it."""
    power = 10.0 ** np.floor(np.log10(largest))
    return 1.08 * largest if largest <= _MOST_TICKS * power else 10.8 * power


def _floats(values: NDArray[np.generic]) -> Floats:
    return values.astype(np.float64)
