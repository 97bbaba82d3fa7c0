"""What a replay draws, as arrays and text; independent of the viewer."""

from collections.abc import Sequence
from dataclasses import dataclass
from textwrap import wrap
from typing import Final

import numpy as np
from numpy.typing import NDArray

from telemetry.array_types import Bytes, Floats, Integers
from telemetry.file import topics
from telemetry.file.metadata import FisDescription
from telemetry.file.reader import Recording, TopicColumns
from telemetry.scene.curves import drawable

#: size of the heat map in pixels; a 2D view keeps the aspect ratio
MAP_WIDTH: Final = 1000
MAP_HEIGHT: Final = 640
#: space for the names of the systems, left of the map, and of their leading rules, right of it
MAP_NAME_WIDTH: Final = 260
MAP_GAP: Final = 14

#: cones of wider fields of view are not drawn
WIDEST_CONE_RAD: Final = np.radians(75.0)

COLOURS_IN_WORDS: Final = "Grey dark, yellow lit, pink in view but dark, green inspected"
#: characters that the panel of events has room for in a line
EVENT_WIDTH: Final = 62
NO_INFERENCE: Final = "*No inference: the deputy coasts, or the flight is over.*"

#: rules listed at each time, for each fuzzy system
NUM_RULES_IN_WORDS: Final = 2
_LEAST_STRENGTH_IN_WORDS: Final = 0.005


@dataclass(frozen=True)
class ActivationMap:
    """The firing strengths of all rules of all fuzzy systems over time, as one picture.

    Parameters
    ----------
    image : (MAP_HEIGHT, MAP_WIDTH) uint8
        255 where a rule fires fully; one band of rows per system, its first rule on top, gaps between bands.
    band_names : tuple of str
        The systems, from top to bottom.
    band_middles : tuple of float
        In pixels from the top.
    start_s, end_s : float
        Simulation time at the left and the right edge.
    strongest : (N, bands) int
        Index of the strongest rule of each system at each sample; -1 where no force was fired.
    strongest_middles : (N, bands) float
        Middles of those rules' rows, in pixels from the top.
    """

    image: Bytes
    band_names: tuple[str, ...]
    band_middles: tuple[float, ...]
    start_s: float
    end_s: float
    strongest: Integers
    strongest_middles: Floats

    def cursors(self, time_s: Floats) -> NDArray[np.float32]:
        """Draw a vertical line across the picture at each time, in pixels, shape (N, 2, 2)."""
        lines = np.zeros((len(time_s), 2, 2), dtype=np.float32)
        lines[:, :, 0] = self._across(time_s)[:, None]
        lines[:, 1, 1] = self.image.shape[0]
        return lines

    def markers(self, time_s: Floats) -> tuple[NDArray[np.float32], list[str], list[int]]:
        """Mark the strongest rule of each system at each sample.

        Returns
        -------
        points : (M, 2)
            In pixels, sample by sample.
        labels : list of str
            One per point, to be written beside the map.
        lengths : list of int
            Number of points of each sample; 0 without an inference.
        """
        is_inferred = self.strongest >= 0
        across = np.broadcast_to(self._across(time_s)[:, None], is_inferred.shape)
        points = np.column_stack((across[is_inferred], self.strongest_middles[is_inferred]))
        labels = [f"rule {rule + 1}" for rule in self.strongest[is_inferred].tolist()]
        return points.astype(np.float32), labels, is_inferred.sum(axis=1).tolist()

    def _across(self, time_s: Floats) -> Floats:
        fraction = (time_s - self.start_s) / max(self.end_s - self.start_s, 1e-9)
        across: Floats = np.clip(fraction, 0.0, 1.0) * self.image.shape[1]
        return across


def sample_times(recording: Recording) -> Floats:
    """Return the times of all messages, ascending."""
    return np.unique(np.concatenate([topic.time_s for topic in recording.topics.values()]))


def activation_map(recording: Recording, sample_time_s: Floats) -> ActivationMap | None:
    """Draw which rule fired when, where the force that it asked for was fired; None if nothing was inferred.

    Parameters
    ----------
    recording : Recording
    sample_time_s : (N,)
        Times of the samples of the flight, from left to right; dark where no force was fired.
    """
    names = tuple(n for n in recording.fis_names if len(recording[topics.fis_topic(n)]))
    if not names:
        return None
    height = (MAP_HEIGHT - MAP_GAP * (len(names) - 1)) // len(names)
    tops = [index * (height + MAP_GAP) for index in range(len(names))]
    shape = (len(sample_time_s), len(names))
    strongest, middles = np.full(shape, -1), np.zeros(shape)
    columns = np.minimum(np.arange(MAP_WIDTH) * len(sample_time_s) // MAP_WIDTH, len(sample_time_s) - 1)
    image = np.zeros((MAP_HEIGHT, MAP_WIDTH), dtype=np.uint8)
    for band, (name, top) in enumerate(zip(names, tops, strict=True)):
        topic = recording[topics.fis_topic(name)]
        fired, fired_s = recording.fired(name)
        strengths = topic["firing_strengths"][fired]
        num_rules = strengths.shape[1]
        samples = np.searchsorted(sample_time_s, fired_s)
        over_samples = np.zeros((len(sample_time_s), num_rules))
        over_samples[samples] = strengths
        rows = np.arange(height) * num_rules // height
        image[top : top + height] = np.round(255.0 * np.clip(over_samples[columns][:, rows].T, 0.0, 1.0))
        strongest[samples, band] = np.argmax(strengths, axis=1) if len(strengths) else 0
        middles[:, band] = top + (np.maximum(strongest[:, band], 0) + 0.5) * height / num_rules
    return ActivationMap(
        image,
        tuple(map(drawable, names)),
        tuple(top + height / 2 for top in tops),
        float(sample_time_s[0]),
        float(sample_time_s[-1]),
        strongest,
        middles,
    )


def inference_in_words(recording: Recording, sample_time_s: Floats) -> list[str]:
    """Describe the inputs, outputs and leading rules of the fuzzy systems that fired at each sample.

    Returns
    -------
    list of str
        One Markdown text per sample.
    """
    samples: list[list[str]] = [[] for _ in sample_time_s]
    for name in recording.fis_names:
        topic = recording[topics.fis_topic(name)]
        description = recording.fis_description(name)
        fired, fired_s = recording.fired(name)
        columns = [topic[field][fired] for field in ("inputs", "firing_strengths", "output_n", "shares_n")]
        for index, row in zip(
            np.searchsorted(sample_time_s, fired_s), zip(*columns, strict=True), strict=True
        ):
            samples[index] += _one_inference(description, *row)
    at_rest = _rest_in_words(recording, sample_time_s)
    return [drawable("\n".join(lines)) or rest for lines, rest in zip(samples, at_rest, strict=True)]


def _rest_in_words(recording: Recording, sample_time_s: Floats) -> list[str]:
    """Say for each sample why nothing was fired, or why something was that no rule asked for."""
    control = recording[topics.DEPUTY_CONTROL]
    if not len(control) or not control["reason"].shape[1]:
        return [NO_INFERENCE] * len(sample_time_s)
    kinds = [", ".join(dict.fromkeys(row)).replace("_", " ") for row in control["reason"].tolist()]
    is_fired = np.any(control["force_hill_n"], axis=1)
    told = [
        f"*{'No rule asked for what is fired' if fires else 'Nothing is fired'}: {kind}.*"
        for kind, fires in zip(kinds, is_fired, strict=True)
    ]
    words = dict(zip(control.time_s.tolist(), told, strict=True))
    return [words.get(time_s, NO_INFERENCE) for time_s in sample_time_s.tolist()]


def _one_inference(
    description: FisDescription, inputs: Floats, strengths: Floats, output: np.float64, shares: Floats
) -> list[str]:
    sensed = " · ".join(
        f"{name} {value:.3f} {unit}".rstrip()
        for name, unit, value in zip(description.input_names, description.input_units, inputs, strict=True)
    )
    return [
        f"- **{description.output_name} = {output:+.4f} {description.output_unit}** · {sensed}",
        *(f"  - {_rule_words(description, rule, strengths, shares)}" for rule in _leading(strengths, shares)),
    ]


def _leading(strengths: Floats, shares: Floats) -> list[int]:
    """Return the rules with the largest shares; where none are recorded, the strongest."""
    size = np.abs(shares) if np.any(shares) else strengths * (strengths >= _LEAST_STRENGTH_IN_WORDS)
    order = np.argsort(-size, kind="stable")[:NUM_RULES_IN_WORDS]
    return [int(rule) for rule in order if size[rule] > 0.0]


def _rule_words(description: FisDescription, rule: int, strengths: Floats, shares: Floats) -> str:
    share = f"`{shares[rule]:+.4f} {description.output_unit}` " if np.any(shares) else ""
    holds = "holds back, " if rule + 1 in description.holding else ""
    return f"{share}{holds}rule {rule + 1} ({strengths[rule]:.2f}): {description.rules[rule]}"


@dataclass(frozen=True)
class Event:
    """An event of a flight, as text."""

    time_s: float
    level: str
    text: str


def events_in_words(recordings: Sequence[Recording], names: Sequence[str]) -> list[Event]:
    """Return the events of flights in order of time, long ones in several rows; several flights are named."""
    events = []
    for recording, name in zip(recordings, names, strict=True):
        log = recording[topics.LOG]
        whose = f"{name}: " if len(recordings) > 1 else ""
        rows = zip(log.time_s.tolist(), log["level"].tolist(), log["message"].tolist(), strict=True)
        events += [
            Event(time_s, level.upper(), line)
            for time_s, level, text in rows
            for line in _lines(drawable(f"{time_s:.0f} s: {whose}{text}"))
        ]
    return sorted(events, key=lambda event: event.time_s)


def _lines(text: str) -> list[str]:
    """Break a text into rows that the panel of events has room for: rerun shows the first line of each."""
    return wrap(text, EVENT_WIDTH, subsequent_indent="        ") or [text]


def flights_in_words(recordings: Sequence[Recording], names: Sequence[str]) -> str:
    """Summarise flights as Markdown: one flight fact by fact, several in a line each."""
    if len(recordings) == 1:
        rows = [
            f"| flight | {names[0]} |",
            "|---|---|",
            *(f"| {a} | {b} |" for a, b in _facts(recordings[0])),
        ]
        return "\n".join(rows) + f"\n\n{COLOURS_IN_WORDS}"
    rows = ["| flight | points | m/s |", "|---|---|---|"]
    for recording, name in zip(recordings, names, strict=True):
        mission = recording[topics.MISSION]
        rows.append(f"| {name} | {mission['inspected_count'][-1]} | {mission['delta_v_m_s'][-1]:.3f} |")
    return "\n".join(rows) + f"\n\nIn full: {names[0]}; overlaid: the others. {COLOURS_IN_WORDS}"


def _facts(recording: Recording) -> list[tuple[str, str]]:
    mission = recording[topics.MISSION]
    distance, num_points = mission["distance_m"].astype(np.float64), mission["inspected_mask"].shape[1]
    facts = [
        ("inspected", f"{mission['inspected_count'][-1]} of {num_points} points"),
        ("delta-v", f"{mission['delta_v_m_s'][-1]:.3f} m/s"),
        ("distance", f"{distance.min():.1f} to {distance.max():.1f} m"),
        ("duration", f"{mission.time_s[-1]:.0f} s"),
    ]
    inspectable = int(mission["inspectable_count"][-1])
    if 0 < inspectable < num_points:
        facts.insert(1, ("ever lit", f"{inspectable} points"))
    if recording.episode.scenario_id:
        facts.append(("scenario", drawable(recording.episode.scenario_id)))
    if topics.RECOVERY_METADATA in recording.metadata:
        facts.append(("rescued", "the file was truncated; this is what was recovered"))
    return facts


def sun_directions(mission: TopicColumns) -> Floats:
    """Return the unit vectors towards the Sun at the samples of a flight, shape (N, 3), Hill axes."""
    angle = mission["sun_angle_rad"].astype(np.float64)
    elevation = mission["sun_elevation_rad"].astype(np.float64)
    level = np.cos(elevation)
    return np.column_stack((level * np.cos(angle), level * np.sin(angle), np.sin(elevation)))


def view_cone(boresight: Sequence[float], half_angle_rad: float, num_rays: int = 24) -> list[Floats]:
    """Draw the cone of a field of view with unit depth: rays from the apex, and the rim.

    Parameters
    ----------
    boresight : (3,)
        Unit vector.
    half_angle_rad : float
    num_rays : int

    Returns
    -------
    list of array
        Line strips of shape (M, 3), the closed rim last.
    """
    axis = np.asarray(boresight, dtype=np.float64)
    axis = axis / np.linalg.norm(axis)
    helper = np.eye(3)[np.argmin(np.abs(axis))]
    first = np.cross(axis, helper)
    first /= np.linalg.norm(first)
    second = np.cross(axis, first)
    angle = np.linspace(0.0, 2.0 * np.pi, num_rays + 1)
    ring = np.cos(angle)[:, None] * first + np.sin(angle)[:, None] * second
    rim = axis + np.tan(half_angle_rad) * ring
    rays = [np.stack((np.zeros(3), point)) for point in rim[:-1:3]]
    return [*rays, rim]
