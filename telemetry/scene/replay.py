"""Flights as a scene: one in full, the others overlaid."""

from collections.abc import Sequence
from itertools import cycle, islice
from pathlib import Path
from typing import Final

import numpy as np
import rerun as rr
from rerun.components import FillMode

from telemetry.array_types import Floats
from telemetry.file import RecordingError, topics
from telemetry.file.reader import read
from telemetry.file.recording import Recording
from telemetry.scene import blueprint, curves, drawing
from telemetry.scene.blueprint import Stream, send
from telemetry.scene.viewer import Scene

SUN_COLOUR: Final = (255, 214, 64)
TARGET_COLOUR: Final = (0, 210, 230)
FORCE_COLOUR: Final = (255, 130, 60)
#: of the plans that a choice was between, and how many are drawn at most
PLAN_COLOUR: Final = (190, 190, 200)
MOST_PLANS: Final = 5
CAMERA_COLOUR: Final = (150, 190, 255, 110)
COMPANION_COLOURS: Final[tuple[curves.Colour, ...]] = (
    (255, 160, 90),
    (120, 200, 255),
    (200, 150, 255),
    (240, 220, 90),
)

#: the paper's, if the recording has none
DEFAULT_BORESIGHT: Final = (-1.0, 0.0, 0.0)
#: what is drawn as a path, and as an arrow, by its topic
VECTORS: Final = {topics.DEPUTY_STATE: "position_m", topics.DEPUTY_CONTROL: "force_hill_n"}
#: length of the arrow of the largest force
FORCE_ARROW_M: Final = 25.0
#: how much larger, and how much nearer to white, the point that pulls most is
GLOW_LARGER, GLOW_LIGHTER = 1.0, 0.6
#: radius of a point, of the chief's
POINT_SIZE: Final = 0.075


def scene(paths: Sequence[Path]) -> Scene:
    """Make a scene of recordings.

    Parameters
    ----------
    paths : sequence of Path
        One recording, or several to overlay; the first is shown in full.

    Raises
    ------
    RecordingError
        If a recording cannot be read or shown.
    """
    recordings = [_showable(read(path)) for path in paths]
    colours = [curves.PLAIN_COLOUR, *islice(cycle(COMPANION_COLOURS), len(recordings) - 1)]
    names = curves.flight_names(recordings)
    mission = curves.mission_plots(recordings, colours)
    effort = curves.effort_plots(recordings[0])
    fis = curves.fis_plots(recordings[0])
    farthest_m = max(float(_distances(recording).max()) for recording in recordings)
    boresight = recordings[0].episode.boresight or DEFAULT_BORESIGHT
    trails = [blueprint.trail_path(index) for index in range(len(recordings))]
    layout = blueprint.replay(mission, effort, fis, farthest_m=farthest_m, boresight=boresight, trails=trails)

    def send_all(recording_stream: rr.RecordingStream) -> None:
        stream = Stream(recording_stream, recordings[0].epoch)
        blueprint.send_curves(stream, (*mission, *effort, *fis))
        _send_flight(stream, recordings[0])
        _send_plans(stream, recordings[0])
        _send_inferences(stream, recordings[0])
        _send_words(stream, recordings, names)
        for index, name in enumerate(names):
            _send_trail(stream, recordings[index], blueprint.trail_path(index), colours[index])
            if len(names) > 1:
                _send_marker(stream, recordings[index], index, name, colours[index])

    return Scene("flight", " + ".join(names), layout, send_all)


def _showable(recording: Recording) -> Recording:
    """Return a recording that holds all a replay needs; raise RecordingError for others."""
    missing = [topic for topic in topics.FIXED_TOPICS if topic not in recording.topics]
    missing += [
        t for t in (topics.DEPUTY_STATE, topics.MISSION) if t not in missing and not len(recording[t])
    ]
    missing += [t for t in map(topics.fis_topic, recording.fis_names) if t not in recording.topics]
    if missing:
        raise RecordingError(
            f"{recording.path} holds no messages on {', '.join(missing)}, which a replay needs; "
            "give a recording that telemetry.EpisodeWriter wrote"
        )
    for topic, field in VECTORS.items():
        recording.check_vectors(topic, field, 3)
    return recording


def _distances(recording: Recording) -> Floats:
    return np.linalg.norm(recording[topics.DEPUTY_STATE]["position_m"], axis=1)


def _send_flight(stream: Stream, recording: Recording) -> None:
    """Send a flight in full: chief, points, deputy, camera, arrows and limits."""
    _send_chief(stream, recording)
    _send_points(stream, recording)
    _send_deputy(stream, recording)
    _send_camera(stream, recording)
    _send_arrows(stream, recording)
    episode = recording.episode
    blueprint.send_limits(stream, episode.min_distance_m, episode.max_distance_m)


def _send_chief(stream: Stream, recording: Recording) -> None:
    """Send the chief's attitude."""
    transforms = recording[topics.TRANSFORMS]
    is_chief = transforms["child_frame"] == topics.CHIEF_FRAME
    columns = rr.Transform3D.columns(quaternion=transforms["quaternion"][is_chief])
    send(stream, f"{blueprint.SCENE}/chief", transforms.time_s[is_chief], columns)


def _send_points(stream: Stream, recording: Recording) -> None:
    """Send the chief's body and points; points that pull on the controller are larger and lighter."""
    cloud = recording[topics.CHIEF_POINTS]
    if not len(cloud):
        return
    positions = cloud["position_m"].astype(np.float32)
    rgba = cloud["colour_rgba"].astype(np.uint32)
    radius = float(np.linalg.norm(positions[0], axis=1).mean())
    if topics.CHIEF_ATTACHMENT in recording.attachments:
        blueprint.send_mesh(stream, recording.attachments[topics.CHIEF_ATTACHMENT])
    else:
        blueprint.send_chief(stream, radius)
    entity, radii = f"{blueprint.SCENE}/chief/points", None
    pulls = drawing.pulls(recording, cloud.time_s)
    if pulls is None:
        stream.log(entity, rr.Points3D.from_fields(radii=[POINT_SIZE * radius]), static=True)
    else:
        radii = (POINT_SIZE * radius * (1.0 + GLOW_LARGER * pulls)).ravel()
        rgba = np.round(rgba + GLOW_LIGHTER * pulls[..., None] * (255.0 - rgba)).astype(np.uint32)
    packed = (rgba[..., 0] << 24) | (rgba[..., 1] << 16) | (rgba[..., 2] << 8) | rgba[..., 3]
    of_points = rr.Points3D.columns(positions=positions.reshape(-1, 3), colors=packed.ravel(), radii=radii)
    num_samples, num_points = packed.shape
    send(stream, entity, cloud.time_s, of_points.partition([num_points] * num_samples))


def _send_deputy(stream: Stream, recording: Recording) -> None:
    """Send the deputy's pose, body and axes."""
    state = recording[topics.DEPUTY_STATE]
    deputy = f"{blueprint.SCENE}/deputy"
    columns = rr.Transform3D.columns(translation=state["position_m"], quaternion=state["quaternion"])
    send(stream, deputy, state.time_s, columns)
    send(stream, blueprint.SEEN, state.time_s, rr.Transform3D.columns(quaternion=state["quaternion"]))
    box = rr.Boxes3D(half_sizes=[(2.0, 2.0, 2.0)], colors=[curves.PLAIN_COLOUR], fill_mode=FillMode.Solid)
    stream.log(f"{deputy}/body", box, static=True)
    axes = rr.Arrows3D(vectors=12.0 * np.eye(3), colors=curves.AXIS_COLOURS, radii=0.45)
    stream.log(f"{deputy}/axes", axes, static=True)


def _send_camera(stream: Stream, recording: Recording) -> None:
    """Send the camera's field of view as a cone that reaches the chief."""
    episode = recording.episode
    if episode.half_angle_rad is None or episode.boresight is None:
        return
    if episode.half_angle_rad > drawing.WIDEST_CONE_RAD:
        return
    camera = f"{blueprint.SCENE}/deputy/camera"
    strips = drawing.view_cone(episode.boresight, episode.half_angle_rad)
    cone = rr.LineStrips3D(strips, colors=[CAMERA_COLOUR], radii=rr.Radius.ui_points(0.8))
    stream.log(f"{camera}/view", cone, static=True)
    # the cone has unit depth: scaled, it reaches the chief's centre
    scale = np.repeat(_distances(recording)[:, None], 3, axis=1)
    send(stream, camera, recording[topics.DEPUTY_STATE].time_s, rr.Transform3D.columns(scale=scale))


def _send_arrows(stream: Stream, recording: Recording) -> None:
    """Send the arrows of Sun, target and force."""
    mission = recording[topics.MISSION]
    sun = drawing.sun_directions(mission)
    # the shorter, the more of the Sun the Earth hides
    length = 60.0 - 48.0 * mission["sun_hidden_share"].astype(np.float64)[:, None]
    _send_arrow(stream, "Sun", mission.time_s, origins=16.0 * sun, vectors=length * sun, colour=SUN_COLOUR)
    guidance = recording[topics.GUIDANCE]
    target = guidance["target_direction"].astype(np.float64)
    _send_arrow(
        stream, "target", guidance.time_s, origins=10.0 * target, vectors=16.0 * target, colour=TARGET_COLOUR
    )
    control, state = recording[topics.DEPUTY_CONTROL], recording[topics.DEPUTY_STATE]
    is_placed = np.isin(control.time_s, state.time_s)
    time_s, force = control.time_s[is_placed], control["force_hill_n"][is_placed].astype(np.float64)
    if len(force):
        origins = state["position_m"][np.searchsorted(state.time_s, time_s)].astype(np.float64)
        scale = FORCE_ARROW_M / max(float(np.linalg.norm(force, axis=1).max()), 1e-12)
        _send_arrow(stream, "force", time_s, origins=origins, vectors=scale * force, colour=FORCE_COLOUR)


def _send_arrow(
    stream: Stream, label: str, time_s: Floats, *, origins: Floats, vectors: Floats, colour: curves.Colour
) -> None:
    """Send an arrow that changes over time, with a label at its tip."""
    if not len(time_s):
        return
    entity = f"{blueprint.SCENE}/{label.lower()}"
    stream.log(entity, rr.Arrows3D.from_fields(colors=[colour], radii=[0.5]), static=True)
    style = rr.Points3D.from_fields(colors=[colour], radii=[0.5], labels=[label], show_labels=True)
    stream.log(f"{entity}/tip", style, static=True)
    # what has no length has no arrow, and no label
    is_shown = np.any(vectors != 0.0, axis=1)
    columns = rr.Arrows3D.columns(origins=origins[is_shown], vectors=vectors[is_shown])
    send(stream, entity, time_s, columns.partition(is_shown.astype(int)))
    tips = rr.Points3D.columns(positions=(origins + vectors)[is_shown])
    send(stream, f"{entity}/tip", time_s, tips.partition(is_shown.astype(int)))


def _send_trail(stream: Stream, recording: Recording, entity: str, colour: curves.Colour) -> None:
    """Send a flight's path: the trail behind the deputy, and faintly all of it."""
    state = recording[topics.DEPUTY_STATE]
    position = state["position_m"].astype(np.float32)
    ahead = rr.LineStrips3D([position], colors=[(*colour, 45)], radii=rr.Radius.ui_points(0.7))
    stream.log(f"{entity}_ahead", ahead, static=True)
    if len(position) < 2:
        return
    style = rr.LineStrips3D.from_fields(colors=[colour], radii=rr.Radius.ui_points(1.6))
    stream.log(entity, style, static=True)
    segments = np.stack((position[:-1], position[1:]), axis=1)
    send(stream, entity, state.time_s[1:], rr.LineStrips3D.columns(strips=segments))


def _send_plans(stream: Stream, recording: Recording) -> None:
    """Draw the paths of the plans compared before the flight, faintly; the chosen one is brighter."""
    colours = [(*PLAN_COLOUR, 200), *[(*PLAN_COLOUR, 70)] * (MOST_PLANS - 1)]
    style = rr.LineStrips3D.from_fields(colors=colours, radii=rr.Radius.ui_points(0.8))
    stream.log(blueprint.PLANS, style, static=True)
    for rehearsal in recording.rehearsals.values():
        if rehearsal.paths_m is None:
            continue
        strips = np.array(rehearsal.paths_m, dtype=np.float32).reshape(len(rehearsal.names), -1, 3)
        columns = rr.LineStrips3D.columns(strips=strips[:MOST_PLANS])
        columns = columns.partition([min(MOST_PLANS, len(strips))])
        send(stream, blueprint.PLANS, np.array([rehearsal.from_s]), columns)


def _send_inferences(stream: Stream, recording: Recording) -> None:
    """Send what the controller does in words, and the map of rules that fire."""
    time_s = drawing.sample_times(recording)
    texts = [f"**{line}**" if line else "" for line in drawing.now_in_words(recording, time_s)]
    _send_texts(stream, blueprint.NOW, time_s, texts)
    image, middles = drawing.activation_map(recording, time_s)
    if not middles:
        return
    strengths = rr.DepthImage(image, colormap="inferno", depth_range=(0.0, 255.0), meter=255.0)
    stream.log(f"{blueprint.RULE_MAP}/strengths", strengths, static=True)
    positions = [(-drawing.MAP_NAME_WIDTH / 2, middle) for _, middle in middles]
    labels = [name for name, _ in middles]
    names = rr.Points2D(positions, labels=labels, colors=[curves.PLAIN_COLOUR], radii=0.5, show_labels=True)
    stream.log(f"{blueprint.RULE_MAP}/names", names, static=True)
    now = f"{blueprint.RULE_MAP}/now"
    line = rr.LineStrips2D.from_fields(colors=[curves.PLAIN_COLOUR], radii=rr.Radius.ui_points(1.0))
    stream.log(now, line, static=True)
    send(stream, now, time_s, rr.LineStrips2D.columns(strips=drawing.map_cursors(time_s)))
    _send_texts(stream, blueprint.RULES_IN_WORDS, time_s, drawing.inference_in_words(recording, time_s))


def _send_texts(stream: Stream, entity: str, time_s: Floats, texts: list[str]) -> None:
    columns = rr.TextDocument.columns(text=texts, media_type=["text/markdown"] * len(texts))
    send(stream, entity, time_s, columns)


def _send_words(stream: Stream, recordings: Sequence[Recording], names: Sequence[str]) -> None:
    """Send the events and the summary of flights."""
    rows = drawing.events_in_words(recordings, names)
    if rows:
        times, levels, texts = zip(*rows, strict=True)
        send(stream, blueprint.EVENTS, np.array(times), rr.TextLog.columns(text=texts, level=levels))
    text = rr.TextDocument(drawing.flights_in_words(recordings, names), media_type="text/markdown")
    stream.log(blueprint.SUMMARY, text, static=True)


def _send_marker(stream: Stream, recording: Recording, index: int, name: str, colour: curves.Colour) -> None:
    """Send a further flight's deputy as a named point."""
    entity = f"{blueprint.SCENE}/flights/{index}/deputy"
    state = recording[topics.DEPUTY_STATE]
    stream.log(entity, rr.Points3D.from_fields(radii=[1.6], colors=[colour], labels=[name]), static=True)
    send(stream, entity, state.time_s, rr.Points3D.columns(positions=state["position_m"]))
