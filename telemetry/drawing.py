"""What a replay draws, as arrays and words: nothing here knows the viewer."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from telemetry import topics
from telemetry.metadata import FisDescription
from telemetry.reader import Recording

Floats = NDArray[np.float64]

#: the heat map's size in pixels; a 2D view keeps the ratio
MAP_WIDTH: Final = 1440
MAP_HEIGHT: Final = 450
#: room for the names of the systems, to the left of the map
MAP_NAME_WIDTH: Final = 220
MAP_GAP: Final = 9

COLOURS_IN_WORDS: Final = "Points: grey dark · yellow lit · pink in view but dark · green inspected"
NO_INFERENCE: Final = "*No inference: the deputy coasts, or the flight is over.*"

#: rules shown in words at each instant, for each fuzzy system
NUM_RULES_IN_WORDS: Final = 3
_LEAST_STRENGTH_IN_WORDS: Final = 0.005


@dataclass(frozen=True)
class ActivationMap:
    """The firing strengths of all rules of all fuzzy systems over time, as one picture.

    Parameters
    ----------
    image : (MAP_HEIGHT, MAP_WIDTH) uint8
        255 where a rule fires fully; one band of rows a system, its first rule on top, gaps between bands.
    band_names : tuple of str
        The systems, from top to bottom.
    band_middles : tuple of float
        In pixels from the top.
    start_s, end_s : float
        Simulation time at the left and the right edge.
    """

    image: NDArray[np.uint8]
    band_names: tuple[str, ...]
    band_middles: tuple[float, ...]
    start_s: float
    end_s: float

    def cursors(self, time_s: Floats) -> NDArray[np.float32]:
        """Draw an upright line across the picture at each time, in pixels, shape (N, 2, 2)."""
        fraction = (time_s - self.start_s) / max(self.end_s - self.start_s, 1e-9)
        height, width = self.image.shape
        lines = np.zeros((len(time_s), 2, 2), dtype=np.float32)
        lines[:, :, 0] = (np.clip(fraction, 0.0, 1.0) * width)[:, None]
        lines[:, 1, 1] = height
        return lines


def sample_times(recording: Recording) -> Floats:
    """Return every instant at which anything was recorded, ascending."""
    return np.unique(np.concatenate([topic.time_s for topic in recording.topics.values()]))


def activation_map(recording: Recording, sample_time_s: Floats) -> ActivationMap | None:
    """Draw when which rule fired; None where no fuzzy system decided anything.

    Parameters
    ----------
    recording : Recording
    sample_time_s : (N,)
        The samples of the flight, one column of the picture each; dark where nothing was inferred.
    """
    names = tuple(n for n in recording.fis_names if len(recording[topics.fis_topic(n)]))
    if not names:
        return None
    bands = []
    height = (MAP_HEIGHT - MAP_GAP * (len(names) - 1)) // len(names)
    columns = np.minimum(np.arange(MAP_WIDTH) * len(sample_time_s) // MAP_WIDTH, len(sample_time_s) - 1)
    for name in names:
        topic = recording[topics.fis_topic(name)]
        strengths = topic["firing_strengths"]
        over_samples = np.zeros((len(sample_time_s), strengths.shape[1]))
        over_samples[np.searchsorted(sample_time_s, topic.time_s)] = strengths
        rows = np.arange(height) * strengths.shape[1] // height
        bands.append(np.round(255.0 * np.clip(over_samples[columns][:, rows].T, 0.0, 1.0)))
    image = np.zeros((MAP_HEIGHT, MAP_WIDTH), dtype=np.uint8)
    tops = [index * (height + MAP_GAP) for index in range(len(names))]
    for top, band in zip(tops, bands, strict=True):
        image[top : top + height] = band
    middles = tuple(top + height / 2 for top in tops)
    return ActivationMap(image, names, middles, float(sample_time_s[0]), float(sample_time_s[-1]))


def inference_in_words(recording: Recording, sample_time_s: Floats) -> list[str]:
    """Say for each sample what the fuzzy systems were told, what they answered, and by which rules.

    Returns
    -------
    list of str
        One Markdown text a sample.
    """
    texts = [[NO_INFERENCE] for _ in sample_time_s]
    for name in recording.fis_names:
        topic = recording[topics.fis_topic(name)]
        description = recording.fis_description(name)
        indices = np.searchsorted(sample_time_s, topic.time_s)
        columns = (topic["inputs"], topic["firing_strengths"], topic["output_n"])
        for index, inputs, strengths, output in zip(indices, *columns, strict=True):
            if texts[index] == [NO_INFERENCE]:
                texts[index] = []
            texts[index].append(_one_inference(description, inputs, strengths, float(output)))
    return ["\n\n".join([COLOURS_IN_WORDS, *text]) for text in texts]


def _one_inference(description: FisDescription, inputs: Floats, strengths: Floats, output: float) -> str:
    told = " · ".join(
        f"{name} {value:.3f} {unit}".rstrip()
        for name, unit, value in zip(description.input_names, description.input_units, inputs, strict=True)
    )
    lines = [f"**{description.output_name} = {output:+.4f} {description.output_unit}** · {told}"]
    strongest = np.argsort(-strengths, kind="stable")[:NUM_RULES_IN_WORDS]
    lines += [
        f"- `{strengths[rule]:.2f}` rule {rule + 1}: {description.rules[rule]}"
        for rule in strongest
        if strengths[rule] >= _LEAST_STRENGTH_IN_WORDS
    ]
    return "\n".join(lines)


def flight_in_words(recording: Recording) -> str:
    """Say what the flight was and how it went, as Markdown."""
    episode = recording.episode
    mission = recording[topics.MISSION]
    distance = mission["distance_m"].astype(np.float64)
    facts = [
        ("scenario", episode.scenario_id),
        ("seed", episode.seed),
        ("version", episode.product_version),
        ("points inspected", f"{mission['inspected_count'][-1]} of {mission['inspected_mask'].shape[1]}"),
        ("inspection rate", f"{mission['inspection_rate_percent'][-1]:.2f} %"),
        ("delta-v", f"{mission['delta_v_m_s'][-1]:.3f} m/s"),
        ("distance", f"{distance.min():.1f} to {distance.max():.1f} m"),
        ("duration", f"{mission.time_s[-1]:.0f} s"),
    ]
    if topics.RECOVERY_METADATA in recording.metadata:
        facts.append(("rescued", "the flight was cut; this is what came back"))
    rows = "\n".join(f"| {name} | {value} |" for name, value in facts if value is not None)
    return f"{COLOURS_IN_WORDS}\n\n| flight | {recording.path.stem} |\n|---|---|\n{rows}\n"


def view_cone(boresight: Sequence[float], half_angle_rad: float, num_rays: int = 24) -> list[Floats]:
    """Draw a field of view of unit depth along its axis: rays from the apex, and the rim.

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
