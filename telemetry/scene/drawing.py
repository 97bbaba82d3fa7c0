"""What a replay draws and describes, as arrays and text; independent of the viewer."""

from collections.abc import Sequence
from textwrap import wrap
from typing import Final

import numpy as np
from numpy.typing import NDArray

from telemetry.array_types import Bytes, Floats
from telemetry.file import topics
from telemetry.file.metadata import FisDescription
from telemetry.file.recording import Recording, TopicColumns
from telemetry.file.summary import ending
from telemetry.scene.curves import drawable, table

#: size of the heat map in pixels; a 2D view keeps the aspect ratio
MAP_WIDTH: Final = 1000
MAP_HEIGHT: Final = 640
#: space for the names of the systems, left of the map
MAP_NAME_WIDTH: Final = 260
MAP_GAP: Final = 14

#: cones of wider fields of view are not drawn
WIDEST_CONE_RAD: Final = np.radians(75.0)

COLOURS_IN_WORDS: Final = "Grey dark, yellow lit, pink in view but dark, green inspected; what pulls glows"
#: characters that the panel of events has room for in a line
EVENT_WIDTH: Final = 62
NO_INFERENCE: Final = "*No inference: the deputy coasts, or the flight is over.*"

#: rules listed at each time, for each fuzzy system
NUM_RULES_IN_WORDS: Final = 2
_LEAST_STRENGTH_IN_WORDS: Final = 0.005


def sample_times(recording: Recording) -> Floats:
    """Return the times of all messages, ascending."""
    return np.unique(np.concatenate([topic.time_s for topic in recording.topics.values()]))


def activation_map(recording: Recording, sample_time_s: Floats) -> tuple[Bytes, list[tuple[str, float]]]:
    """Draw when each rule fired, in the periods that fired its force.

    Parameters
    ----------
    recording : Recording
    sample_time_s : (N,)
        Times of the samples of the flight, from left to right; dark where no force was fired.

    Returns
    -------
    image : (MAP_HEIGHT, MAP_WIDTH) uint8
        255 where a rule fires fully; one band of rows per system, its first rule on top, gaps between bands.
    middles : list of (str, float)
        Each system that inferred, and the middle of its band, in pixels from the top.
    """
    names = [name for name in recording.fis_names if len(recording[topics.fis_topic(name)])]
    height = (MAP_HEIGHT + MAP_GAP) // max(len(names), 1) - MAP_GAP
    columns = np.minimum(np.arange(MAP_WIDTH) * len(sample_time_s) // MAP_WIDTH, len(sample_time_s) - 1)
    image = np.zeros((MAP_HEIGHT, MAP_WIDTH), dtype=np.uint8)
    middles = []
    for band, name in enumerate(names):
        fired, fired_s = recording.fired(name)
        strengths = recording[topics.fis_topic(name)]["firing_strengths"][fired]
        num_rules = strengths.shape[1]
        over_samples = np.zeros((len(sample_time_s), num_rules))
        over_samples[np.searchsorted(sample_time_s, fired_s)] = strengths
        rows, top = np.arange(height) * num_rules // height, band * (height + MAP_GAP)
        image[top : top + height] = np.round(255.0 * np.clip(over_samples[columns][:, rows].T, 0.0, 1.0))
        middles.append((drawable(name), top + height / 2))
    return image, middles


def map_cursors(sample_time_s: Floats) -> NDArray[np.float32]:
    """Draw a vertical line across the map at each of its samples, in pixels, shape (N, 2, 2)."""
    since = sample_time_s - sample_time_s[0]
    lines = np.zeros((len(since), 2, 2), dtype=np.float32)
    lines[:, :, 0] = (MAP_WIDTH * since / max(since[-1], 1e-9))[:, None]
    lines[:, 1, 1] = MAP_HEIGHT
    return lines


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
        indices = np.searchsorted(sample_time_s, fired_s)
        for index, row in zip(indices, zip(*columns, strict=True), strict=True):
            samples[index] += _one_inference(description, *row)
    at_rest = _rest_in_words(recording, sample_time_s)
    return [drawable("\n".join(lines)) or rest for lines, rest in zip(samples, at_rest, strict=True)]


def _rest_in_words(recording: Recording, sample_time_s: Floats) -> list[str]:
    """Describe for each sample why nothing was fired, or why thrust was fired that no rule commanded."""
    control = recording[topics.DEPUTY_CONTROL]
    if not len(control) or not control["reason"].shape[1]:
        return [NO_INFERENCE] * len(sample_time_s)
    kinds = [", ".join(dict.fromkeys(row)).replace("_", " ") for row in control["reason"].tolist()]
    is_fired = np.any(control["force_hill_n"], axis=1)
    sentences = [
        f"*{'No rule asked for what is fired' if fires else 'Nothing is fired'}: {kind}.*"
        for kind, fires in zip(kinds, is_fired, strict=True)
    ]
    words = dict(zip(control.time_s.tolist(), sentences, strict=True))
    return [words.get(time_s, NO_INFERENCE) for time_s in sample_time_s.tolist()]


def _one_inference(
    description: FisDescription, inputs: Floats, strengths: Floats, output: np.float64, shares: Floats
) -> list[str]:
    """Describe one inference: output, inputs, and the leading rules."""
    sensed = " · ".join(
        f"{name} {value:.3f} {unit}".rstrip()
        for name, unit, value in zip(description.input_names, description.input_units, inputs, strict=True)
    )
    return [
        f"- **{description.output_name} = {output:+.4f} {description.output_unit}** · {sensed}",
        *(f"  - {_rule_words(description, rule, strengths, shares)}" for rule in _leading(strengths, shares)),
    ]


def _leading(strengths: Floats, shares: Floats) -> list[int]:
    """Return the rules with the largest recorded shares of an output, else those that fire most."""
    size = np.abs(shares) if np.any(shares) else strengths * (strengths >= _LEAST_STRENGTH_IN_WORDS)
    order = np.argsort(-size, kind="stable")[:NUM_RULES_IN_WORDS]
    return [int(rule) for rule in order if size[rule] > 0.0]


def _rule_words(description: FisDescription, rule: int, strengths: Floats, shares: Floats) -> str:
    share = f"`{shares[rule]:+.4f} {description.output_unit}` " if np.any(shares) else ""
    holds = "holds back, " if rule + 1 in description.holding else ""
    return f"{share}{holds}rule {rule + 1} ({strengths[rule]:.2f}): {description.rules[rule]}"


def events_in_words(recordings: Sequence[Recording], names: Sequence[str]) -> list[tuple[float, str, str]]:
    """Return time (s), level and text of events in order of time, long ones in several rows.

    Several flights are named.
    """
    events = []
    for recording, name in zip(recordings, names, strict=True):
        log = recording[topics.LOG]
        whose = f"{name}: " if len(recordings) > 1 else ""
        rows = zip(log.time_s.tolist(), log["level"].tolist(), log["message"].tolist(), strict=True)
        for time_s, level, text in rows:
            # rerun shows the first line of each
            lines = wrap(drawable(f"{time_s:.0f} s: {whose}{text}"), EVENT_WIDTH, subsequent_indent=" " * 8)
            events += [(time_s, level.upper(), line) for line in lines]
    return sorted(events, key=lambda event: event[0])


def flights_in_words(recordings: Sequence[Recording], names: Sequence[str]) -> str:
    """Summarise flights as Markdown: one flight fact by fact, several in a line each."""
    if len(recordings) == 1:
        return f"{table([('flight', names[0]), *_facts(recordings[0])])}\n\n{COLOURS_IN_WORDS}"
    rows = ["| flight | points | m/s |", "|---|---|---|"]
    for recording, name in zip(recordings, names, strict=True):
        mission = recording[topics.MISSION]
        rows.append(f"| {name} | {mission['inspected_count'][-1]} | {mission['delta_v_m_s'][-1]:.3f} |")
    return "\n".join(rows) + f"\n\nIn full: {names[0]}; overlaid: the others. {COLOURS_IN_WORDS}"


def _facts(recording: Recording) -> list[tuple[str, str]]:
    """Return a flight's result as names and values."""
    outcome = recording.outcome
    end_s = recording.episode.end_s
    count, num_points = outcome["inspected_count"], outcome["num_points"]
    inspected = ("inspected", f"{count} of {num_points} points")
    facts = [
        inspected if end_s is None else ("end", ending(count > 0, end_s)),
        ("delta-v", f"{outcome['delta_v_m_s']:.3f} m/s"),
        ("distance", f"{outcome['min_distance_m']:.1f} to {outcome['max_distance_m']:.1f} m"),
        ("duration", f"{recording[topics.MISSION].time_s[-1]:.0f} s"),
    ]
    if recording.epoch is not None:
        facts.append(("start", f"{recording.epoch:%Y-%m-%d %H:%M:%S} UTC"))
    inspectable = outcome["inspectable_count"]
    if 0 < inspectable < num_points:
        facts.insert(1, ("ever lit", f"{inspectable} points"))
    if recording.episode.scenario_id:
        facts.append(("scenario", drawable(recording.episode.scenario_id)))
    if topics.RECOVERY_METADATA in recording.metadata:
        facts.append(("rescued", "the file was truncated; this is what was recovered"))
    return facts


def pulls(recording: Recording, sample_time_s: Floats) -> Floats | None:
    """Return each point's contribution at each sample to the input that it adds most to.

    The shape is (N, P), from 0 to 1, what any point ever adds to that input; None where it is not recorded.
    """
    cloud, names = recording.topics.get(topics.CHIEF_PULLS), recording.metadata.get(topics.PULLS_METADATA, {})
    num_points = recording[topics.CHIEF_POINTS]["position_m"].shape[1]
    if cloud is None or not len(cloud) or not names or not num_points:
        return None
    columns = [cloud.columns[name] for name in names if name in cloud.columns]
    if len(columns) < len(names) or any(values.shape != (len(cloud), num_points) for values in columns):
        return None
    parts = np.abs(np.array(columns, dtype=np.float64))
    most = np.max(parts / np.maximum(parts.max(axis=(1, 2), keepdims=True), 1e-300), axis=0)
    rows = np.searchsorted(cloud.time_s, sample_time_s, side="right") - 1
    return np.where((rows >= 0)[:, None], most[rows], 0.0)


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


#: Hill axes: towards less, towards more
DIRECTIONS = (
    ("inwards", "outwards"),
    ("backwards", "forwards"),
    ("against the orbit normal", "along the orbit normal"),
)
#: a component smaller than this part of the largest is not told
WORTH_TELLING = 0.1
WHY = {
    "silent": "No rule asks for a force",
    "dead_band": "No burn: what the rules ask for is below the dead band",
    "below_least_impulse": "No burn: what the rules asked for is below the thrusters' least impulse",
    "delayed": "No burn yet: the thrusters fire what they are told later",
    "empty_tank": "No burn: the tank is empty",
    "waiting": "No burn until the next decision",
    "clipped": "at the thruster's limit",
    "safety": "changed by the safety layer",
    "parked": "to park on a closed ellipse inside the limits",
}
#: reasons for which nothing is fired, the first that applies is told
AT_REST = ("safety", "empty_tank", "below_least_impulse", "delayed", "dead_band", "waiting", "silent")
#: reasons that the line itself tells
ELSE = ("fired", "coasting", "complete")


def now_in_words(recording: Recording, sample_time_s: Floats) -> list[str]:
    """Describe what the controller does at each sample and why, with the points left.

    A recording gives reasons, or they follow from what it holds: whether a force was applied, whether the
    rules were asked, and whether every point is inspected.

    Parameters
    ----------
    recording : Recording
    sample_time_s : (N,)
        Times of the samples of the flight.
    """
    control, mission = recording[topics.DEPUTY_CONTROL], recording[topics.MISSION]
    indices = np.maximum(np.searchsorted(mission.time_s, sample_time_s, side="right") - 1, 0)
    # recordings of earlier versions do not say how many can be inspected
    all_points = int(mission["inspectable_count"][-1]) or mission["inspected_mask"].shape[1]
    left = all_points - mission["inspected_count"].astype(np.int64)[indices]
    names = [name for name in recording.fis_names if len(recording[topics.fis_topic(name)])]
    fired_times = {float(time) for name in names for time in recording[topics.fis_topic(name)].time_s}
    rows = {float(time): row for row, time in enumerate(control.time_s)}
    lines = []
    for time, count in zip(sample_time_s.tolist(), left.tolist(), strict=True):
        row = rows.get(time)
        if row is None:
            lines.append(
                f"The flight is over: {_points(count)}" if time >= control.time_s[-1:].max(initial=0) else ""
            )
        else:
            lines.append(_line(recording, row, count, time in fired_times or not names))
    return lines


def _line(recording: Recording, row: int, left: int, was_asked: bool) -> str:
    """Describe what the controller does at a sample: it fires, coasts or rests, and why."""
    control = recording[topics.DEPUTY_CONTROL]
    force = control["force_hill_n"][row].astype(np.float64)
    reasons = [reason for reason in control["reason"][row].tolist() if reason in (*WHY, *ELSE)]
    if np.any(force):
        limits = [WHY[reason] for reason in ("parked", "clipped", "safety") if reason in reasons]
        words = [f"Firing {_force(force)}{_leader(recording, row)}", *limits]
        return ", ".join(words) + f": {_points(left)}"
    if "complete" in reasons or left == 0:
        return "Coasting: every point is inspected"
    if "coasting" in reasons or (not reasons and not was_asked):
        return f"Coasting: {_points(left)}{_foreseen(recording, row, left)}"
    why = next((WHY[reason] for reason in AT_REST if reason in reasons), "No burn")
    return f"{why}: {_points(left)}"


def _leader(recording: Recording, row: int) -> str:
    """Return the rule that pushes most along the largest output fired, where it is recorded.

    Rules that conclude no force hold back, and push no way, whatever their shares.
    """
    time = recording[topics.DEPUTY_CONTROL].time_s[row]
    leaders = []
    for name in recording.fis_names:
        topic, (fired, fired_s) = recording[topics.fis_topic(name)], recording.fired(name)
        holding = np.array(recording.fis_description(name).holding, dtype=np.intp) - 1
        for index in fired[fired_s == time].tolist():
            output, shares = float(topic["output_n"][index]), topic["shares_n"][index]
            if not shares.size:
                continue
            pushes = np.sign(output) * shares
            pushes[holding] = 0.0
            if np.any(pushes > 0.0):
                leaders.append((abs(output), int(pushes.argmax()) + 1, name))
    return ", mostly by rule {} of {}".format(*max(leaders)[1:]) if leaders else ""


def _points(count: int) -> str:
    return f"{count} point{'' if count == 1 else 's'} left"


def _foreseen(recording: Recording, row: int, left: int) -> str:
    """Describe how many of the points left will be seen without thrust, where that is recorded."""
    control = recording[topics.DEPUTY_CONTROL]
    missed = control["coasting_missed"][row]
    if not np.isfinite(missed):
        return ""
    return ", all foreseen" if missed == 0 else f", {left - int(missed)} of them foreseen"


def _force(force: Floats) -> str:
    """Describe a force by its size and directions, the largest component first."""
    order = np.argsort(-np.abs(force))
    words = [
        DIRECTIONS[axis][int(force[axis] > 0)]
        for axis in order
        if abs(force[axis]) > WORTH_TELLING * abs(force[order[0]])
    ]
    return (
        f"{1e3 * np.linalg.norm(force):.3g} mN {', '.join(words[:-1])}{' and ' * (len(words) > 1)}{words[-1]}"
    )
