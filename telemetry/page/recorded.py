"""A recording as a page that plays it: what the recording has is shown, and nothing else."""

import base64
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from plain_files.document import Block, Document, Heading, Paragraph
from plain_files.document.html import page
from telemetry.array_types import Booleans, Floats, Integers
from telemetry.file import RecordingError, topics
from telemetry.file.reader import read_decoded
from telemetry.file.recording import Recording, TopicColumns
from telemetry.page.panel import panel

#: samples of a page; a longer recording is thinned
MOST_SAMPLES = 5000
#: times the usual time between messages that is told of
GAP = 2.0
#: names of the states of a point in a recording
INSPECTED, LIT = 3, 1
#: radius of the ball that stands for a chief without points, of the nearest distance
BALL = 0.5
OF_FLEET = (
    "The deputies fly together: each scene has the path of the others, thin, and a point counts as inspected "
    "once a deputy knows that one of them has seen it."
)
#: of forces along the deputy's axes
BODY = "body"
#: before their reasons
ALONG_DEPUTY = "Along the deputy's axes: "
UNKNOWN = "The recording does not say why."
FIRED = topics.Reason.FIRED.name.lower()
#: where nothing was fired, these say less than others, which are told before them
TOLD_LAST = [
    reason.name.lower() for reason in (topics.Reason.REHEARSED, topics.Reason.PARKED, topics.Reason.SILENT)
]
#: what turning axes leaves of a force along one that has none
ROUNDED_N = 1e-12


def write(*files: Path) -> str:
    """Return a page that plays recordings beside each other, and needs no other file.

    Those of the deputies of one fleet show each other's paths.

    Raises
    ------
    RecordingError
        If one cannot be read, or does not say where the deputy is.
    """
    recordings, left_out = zip(*(read_decoded(file) for file in files), strict=True)
    names = [_name(recording, file) for recording, file in zip(recordings, files, strict=True)]
    runs, blocks = list[dict[str, Any]](), list[Block]([Heading(" and ".join(names), 1)])
    for recording, refusals, file, name in zip(recordings, left_out, files, names, strict=True):
        if topics.DEPUTY_STATE in refusals:
            raise refusals[topics.DEPUTY_STATE]
        flight, table = table_of(recording)
        runs.append(
            {
                **{"name": name, "fileName": file.stem, "command": "", "why": "", "flight": flight},
                **{"systems": [], "recorded": {0: table}, "reasons": {}, "ends": ""},
                **{"module": "", "snapshot": None, "own": None},
            }
        )
        blocks.append(Paragraph(_about(recording, flight, file)))
        reasons = (str(refusal).replace(str(file), file.name) for refusal in refusals.values())
        blocks += [Paragraph(f"Left out: {reason}.") for reason in reasons]
    is_fleet = _is_fleet(recordings)
    if is_fleet:
        blocks.append(Paragraph(OF_FLEET))
    content: dict[str, Any] = {
        **{"title": names[0], "fileName": files[0].stem, "runs": runs, "words": {}, "quadrature": ["", ""]},
        **{"cases": None, "first": 0, "modules": {}, "worker": ""},
        "fleets": [len(runs)] if is_fleet else [1] * len(runs),
    }
    return page(Document(blocks), "", panel("The flight", content, names))


def _name(recording: Recording, file: Path) -> str:
    episode = recording.episode
    name = episode.scenario_id or file.stem
    return name if episode.deputy is None else f"{name}, deputy {episode.deputy}"


def _is_fleet(recordings: Sequence[Recording]) -> bool:
    """Return whether recordings are those of different deputies of one fleet."""
    episodes = [recording.episode for recording in recordings]
    deputies = {episode.deputy for episode in episodes}
    flights = {(episode.scenario_id, episode.seed, episode.fleet_deputies) for episode in episodes}
    return (
        len(recordings) > 1 and None not in deputies and len(deputies) == len(episodes) and len(flights) == 1
    )


def _about(recording: Recording, flight: dict[str, Any], file: Path) -> str:
    """Return what was recorded, and what was not, in words."""
    minutes = (flight["numSamples"] - 1) * flight["periodS"] / 60.0
    absent = {
        "points of the chief": not flight["numPoints"] and recording.episode.end_s is None,
        "forces": _control(recording) is None,
        "where the Sun is, or what was spent": not _rows(recording, topics.MISSION),
    }
    missing = [what for what, is_absent in absent.items() if is_absent]
    without = f" It does not tell {', '.join(missing)}." if missing else ""
    whole = f"{file.name}: {minutes:.0f} minutes, a sample every {flight['periodS']:g} s."
    return f"{whole}{_when(recording[topics.DEPUTY_STATE].time_s)}{without}"


def _when(time_s: Floats) -> str:
    """Return when a recording begins, if not at 0, and its longest gap, in words."""
    begins = f" It begins at {time_s[0]:.12g} s, which is 0 here." if time_s[0] else ""
    gaps = np.diff(time_s)
    longest = int(np.argmax(gaps))
    if gaps[longest] <= GAP * _usual(gaps):
        return begins
    return (
        f"{begins} From {time_s[longest]:.12g} to {time_s[longest + 1]:.12g} s nothing is recorded; the page "
        "shows what was last."
    )


def _rows(recording: Recording, topic: str) -> int:
    return len(recording.topics.get(topic, ()))


def _control(recording: Recording) -> TopicColumns | None:
    """Return the messages that tell forces; None if none does."""
    control = recording.topics.get(topics.DEPUTY_CONTROL)
    if control is None or not control["force_hill_n"].size:
        return None
    recording.check_vectors(topics.DEPUTY_CONTROL, "force_hill_n", 3)
    return control


def table_of(recording: Recording) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return what the flight has as a whole, and its samples, as ``recorded.js`` takes them.

    Samples are evenly spaced: of a recording that is not, each is the last message until then.

    Raises
    ------
    RecordingError
        If the recording does not say where the deputy is.
    """
    if _rows(recording, topics.DEPUTY_STATE) < 2:
        raise RecordingError(
            f"{recording.path} has no two messages on {topics.DEPUTY_STATE}, so nothing can be played; "
            "give a recording that says where the deputy is"
        )
    recording.check_vectors(topics.DEPUTY_STATE, "position_m", 3)
    state = recording[topics.DEPUTY_STATE]
    times = _times(state, recording.end_s)
    position = _at(state, "position_m", times)
    points, attitude, is_seen, is_lit = _points(recording, times)
    episode = recording.episode
    limits = [limit for limit in (episode.min_distance_m, episode.max_distance_m) if limit is not None]
    nearest = float(np.linalg.norm(position, axis=1).min())
    flight = {
        "numSamples": len(times),
        "periodS": float(times[1] - times[0]),
        "meanMotion": 0.0,
        "radius": float(np.linalg.norm(points, axis=1).max()) if len(points) else BALL * nearest,
        "isSphere": topics.CHIEF_ATTACHMENT not in recording.attachments,
        "limits": limits,
        "numPoints": len(points),
        "points": _floats(points),
        "freeMotion": "",
        "numSystems": 0,
    }
    mission, control = recording.topics.get(topics.MISSION), _control(recording)
    texts, reasons = _reasons(recording, times)
    spent = _at(mission, "delta_v_m_s", times) if mission else np.full(len(times), np.nan)
    samples = {
        "attitude": _floats(attitude),
        "position": _floats(position),
        "velocity": _floats(_at(state, "velocity_m_s", times)),
        "force": _floats(_at(control, "force_hill_n", times) if control else np.zeros((len(times), 3))),
        "sun": _floats(_sun(mission, times)) if mission else "",
        "spent": _floats(spent),
        "isSeen": _bits(is_seen),
        "isLit": _bits(is_lit),
        "texts": texts,
        "reasons": reasons,
    }
    return flight, samples


def _times(state: TopicColumns, end_s: float) -> Floats:
    """Return evenly spaced times of samples, s, up to where a flight towards a goal ends."""
    first = float(state.time_s[0])
    last = max(min(float(state.time_s[-1]), end_s), float(state.time_s[1]))
    gaps = np.diff(state.time_s)
    usual = _usual(gaps)
    if usual <= 0.0:
        raise RecordingError(
            "all messages have one time, so nothing can be played; give a flight's recording"
        )
    count = min(MOST_SAMPLES, round((last - first) / usual) + 1)
    return np.linspace(first, last, max(2, count))


def _usual(gaps: Floats) -> float:
    """Return the usual time between messages, s; 0 if all have one time."""
    return float(np.median(gaps[gaps > 0.0])) if np.any(gaps > 0.0) else 0.0


def _at(topic: TopicColumns, field: str, times: Floats) -> Floats:
    """Return a field at some times: of the last message until then, or of the first."""
    rows = np.searchsorted(topic.time_s, times + 1e-6, side="right") - 1
    return np.asarray(topic[field][np.clip(rows, 0, len(topic) - 1)], dtype=np.float64)


def _sun(mission: TopicColumns, times: Floats) -> Floats:
    angle, height = (_at(mission, name, times) for name in ("sun_angle_rad", "sun_elevation_rad"))
    return np.stack([np.cos(height) * np.cos(angle), np.cos(height) * np.sin(angle), np.sin(height)], axis=1)


def _points(recording: Recording, times: Floats) -> tuple[Floats, Floats, Booleans, Booleans]:
    """Return the points at the start, Hill axes, the chief's attitude, and which are seen and lit."""
    cloud = recording.topics.get(topics.CHIEF_POINTS)
    # a flight towards a goal inspects nothing
    if not cloud or not len(cloud) or recording.episode.end_s is not None:
        nothing = np.zeros((len(times), 0), dtype=np.bool_)
        return np.zeros((0, 3)), np.zeros((0, 4)), nothing, nothing
    state = _at(cloud, "state", times)
    points = np.asarray(cloud["position_m"][0], dtype=np.float64)
    turns = recording.topics.get(topics.TRANSFORMS)
    is_chief = turns["child_frame"] == topics.CHIEF_FRAME if turns else np.zeros(0, dtype=np.bool_)
    if turns is None or not is_chief.any():
        return points, np.zeros((0, 4)), state == INSPECTED, state == LIT
    rows = np.searchsorted(turns.time_s[is_chief], times + 1e-6, side="right") - 1
    attitude = np.asarray(turns["quaternion"][is_chief], dtype=np.float64)[np.maximum(rows, 0)]
    turns_in_flight = bool(np.any(np.abs(attitude - attitude[0]) > 1e-9))
    in_hill = _turned(attitude[0], points)
    return in_hill, attitude if turns_in_flight else np.zeros((0, 4)), state == INSPECTED, state == LIT


def _turned(quaternion: Floats, vectors: Floats) -> Floats:
    """Turn vectors by a quaternion, scalar last, read as an active rotation."""
    axis, w = quaternion[:3], quaternion[3]
    side = 2.0 * np.cross(axis, vectors)
    return vectors + w * side + np.cross(axis, side)


def _reasons(recording: Recording, times: Floats) -> tuple[list[str], list[list[int]]]:
    """Return why each component of the force was fired, or nothing was, as texts and their indices.

    Where a fuzzy system inferred what was fired, it is the rule with the largest share along it.
    """
    control = _control(recording)
    texts: list[str] = [UNKNOWN]
    if control is None:
        return texts, [[0, 0, 0]] * len(times)
    indices = np.zeros((len(control), 3), dtype=np.int64)
    told_last: list[int] = []
    if control["reason"].shape[1]:
        words = np.unique(control["reason"])
        known = {str(word): len(texts) + index for index, word in enumerate(words)}
        texts += [f"{str(word).replace('_', ' ').capitalize()}." for word in words]
        indices = np.vectorize(known.get, otypes=[np.int64])(control["reason"].astype(str))
        told_last = [known[word] for word in TOLD_LAST if word in known]
    rules, sizes = np.full(indices.shape, -1), np.zeros(indices.shape)
    for name in recording.fis_names:
        _name_rules(recording, name, texts, rules, sizes)
    are_pushes = np.abs(control["force_hill_n"]) >= ROUNDED_N
    is_idle: Booleans = ~np.any(are_pushes, axis=1, keepdims=True)
    if control["reason"].shape[1]:
        # reasons of forces along the deputy's axes, of which others were fired
        is_denied = are_pushes & np.isin(control["reason"], topics.NOT_FIRED)
        indices[is_denied] = known.get(FIRED, 0)
        are_pushes &= ~np.isin(control["reason"], topics.NOT_AS_ASKED)
    if any(recording.fis_description(name).output_axes == BODY for name in recording.fis_names):
        rules = along_hill(rules, sizes, are_pushes)
        texts = [f"{ALONG_DEPUTY}{text}" if text.startswith("Rule ") else text for text in texts]
    indices = np.where(rules >= 0, rules, indices)
    indices = with_a_single_reason(indices, is_idle, told_last)
    rows = np.clip(np.searchsorted(control.time_s, times + 1e-6, side="right") - 1, 0, None)
    return texts, indices[rows].tolist()


def with_a_single_reason(indices: Integers, is_idle: Booleans, told_last: Sequence[int]) -> Integers:
    """Return reasons, where nothing was fired the first alone that says most.

    That nothing was asked for is true of a sample only where it is true of all axes, and what was planned is
    not told of what was not fired.

    Parameters
    ----------
    indices : (n, 3) int
        Of the reasons.
    is_idle : (n, 1) bool
        Where nothing was fired.
    told_last : sequence of int
        Reasons that say less than others, each less than the one before.
    """
    ranks = np.zeros(max(int(indices.max(initial=0)), *told_last, 0) + 1)
    ranks[list(told_last)] = np.arange(1, len(told_last) + 1)
    first = np.argmin(ranks[indices], axis=1)[:, np.newaxis]
    return np.where(is_idle, np.take_along_axis(indices, first, axis=1), indices)


def along_hill(rules: Integers, sizes: Floats, are_pushes: Booleans) -> Integers:
    """Return the rules of pushes along Hill's axes from those of forces along the deputy's.

    A page shows forces along Hill's axes, of each of which all those along the deputy's are a part: the rule
    of the largest is told of all.

    Parameters
    ----------
    rules : (n, 3) int
        Of each force that was fired, along the deputy's axes; -1 for none.
    sizes : (n, 3) float
        Of these forces, as they were asked for.
    are_pushes : (n, 3) bool
        Whether what rules ask for was fired along each of Hill's axes.
    """
    leading = np.argmax(np.where(rules >= 0, np.abs(sizes), -1.0), axis=1)
    return np.where(are_pushes, np.take_along_axis(rules, leading[:, np.newaxis], axis=1), -1)


def _name_rules(recording: Recording, name: str, texts: list[str], rules: Integers, sizes: Floats) -> None:
    """Put the leading rule of each inference that was fired into the texts, and its index and force."""
    description = recording.fis_description(name)
    if description.output_name not in topics.FORCE_COMPONENTS or topics.fis_topic(name) not in recording:
        return
    axis = topics.FORCE_COMPONENTS.index(description.output_name)
    fired, fired_s = recording.fired(name)
    shares, forces = (recording[topics.fis_topic(name)][part][fired] for part in ("shares_n", "output_n"))
    if not shares.size:
        return
    leading = np.argmax(shares * np.sign(forces)[:, np.newaxis], axis=1)
    of_rule: dict[int, int] = {}
    for rule in Counter(leading.tolist()):
        of_rule[rule] = len(texts)
        texts.append(f"Rule {rule + 1} of {name}: {description.rules[rule]}.")
    # of the control period in which it was fired, of which a page that is thinned may have no sample
    rows = np.searchsorted(recording[topics.DEPUTY_CONTROL].time_s, fired_s - 1e-6)
    is_known = rows < len(rules)
    rules[rows[is_known], axis] = np.array([of_rule[rule] for rule in leading.tolist()])[is_known]
    sizes[rows[is_known], axis] = forces[is_known]


def _floats(array: Any) -> str:
    return base64.b64encode(np.ascontiguousarray(array, dtype="<f4").tobytes()).decode("ascii")


def _bits(array: Booleans) -> str:
    return base64.b64encode(np.packbits(array, axis=None, bitorder="little").tobytes()).decode("ascii")
