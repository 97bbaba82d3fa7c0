"""Shows recordings in rerun, in our layout."""

import os
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Final

import numpy as np
import rerun as rr
from numpy.typing import NDArray
from rerun.components import FillMode, InterpolationMode

from telemetry import blueprint, curves, drawing, topics
from telemetry.blueprint import TIMELINE
from telemetry.curves import AXIS_COLOURS, PLAIN_COLOUR, Colour, Plot
from telemetry.errors import RecordingError
from telemetry.reader import Recording, read

Floats = NDArray[np.float64]

APPLICATION: Final = "fuzzy-spacecraft-inspection"

SUN_COLOUR: Final = (255, 214, 64)
TARGET_COLOUR: Final = (0, 210, 230)
FORCE_COLOUR: Final = (255, 130, 60)
CAMERA_COLOUR: Final = (150, 190, 255, 110)
BODY_COLOUR: Final = (44, 48, 62)
SHELL_COLOUR: Final = (105, 42, 48)
COMPANION_COLOURS: Final[tuple[Colour, ...]] = (
    (255, 160, 90),
    (120, 200, 255),
    (200, 150, 255),
    (240, 220, 90),
)

#: where the recording does not tell: the paper's
DEFAULT_BORESIGHT: Final = (-1.0, 0.0, 0.0)
#: how long the largest force of the flight is drawn
FORCE_ARROW_M: Final = 25.0


def save(paths: Sequence[Path], output: Path) -> None:
    """Write recordings to an .rrd file that opens in our layout.

    Parameters
    ----------
    paths : sequence of Path
        One recording, or several to lay over each other; the first is shown in full.
    output : Path
        The .rrd file; one of the same name is replaced.

    Raises
    ------
    RecordingError
        If a recording cannot be read or shown, or the output cannot be written.
    """
    _write([_showable(read(path)) for path in paths], output)


def _write(recordings: Sequence[Recording], output: Path) -> None:
    num_companions = len(recordings) - 1
    colours = [PLAIN_COLOUR, *(COMPANION_COLOURS[i % len(COMPANION_COLOURS)] for i in range(num_companions))]
    mission = curves.mission_plots(recordings, colours)
    effort = curves.effort_plots(recordings[0])
    fis = curves.fis_plots(recordings[0])
    largest = max(float(_distances(recording).max()) for recording in recordings)
    layout = blueprint.layout(
        mission,
        effort,
        fis,
        farthest_m=largest,
        boresight=recordings[0].episode.boresight or DEFAULT_BORESIGHT,
        trails=[blueprint.trail_path(index) for index in range(len(recordings))],
    )
    _check_writable(output)
    stream = rr.RecordingStream(APPLICATION)
    stream.save(output, default_blueprint=layout)
    stream.send_recording_name(" + ".join(recording.path.stem for recording in recordings))
    _send_scene(stream, recordings[0])
    _send_plots(stream, (*mission, *effort, *fis))
    _send_inferences(stream, recordings[0])
    _send_words(stream, recordings[0])
    for index, name in enumerate(curves.flight_names(recordings)):
        _send_trail(stream, recordings[index], blueprint.trail_path(index), colours[index])
        if index > 0:
            _send_marker(stream, recordings[index], index, name, colours[index])
    stream.flush()
    stream.disconnect()


def show(paths: Sequence[Path], *, in_browser: bool) -> None:
    """Open recordings in rerun, in a window or in a browser, until the user ends it.

    Parameters
    ----------
    paths : sequence of Path
        As for `save`.
    in_browser : bool
        Serve a page to this machine alone, instead of a window.

    Raises
    ------
    RecordingError
        If a recording cannot be read or shown, or the viewer cannot open.
    """
    # a wrong path is wrong on every machine: it is told before a missing display
    recordings = [_showable(read(path)) for path in paths]
    if not in_browser and not _has_display():
        raise RecordingError(
            "this machine has no display to open the viewer on; "
            "look at the flight in a browser with --web, or write it to a file with --save FILE.rrd"
        )
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / f"{paths[0].stem}.rrd"
        _write(recordings, file)
        # by default the viewer would listen on every network interface
        command = [sys.executable, "-m", "rerun", "--bind", "127.0.0.1", "--port", "auto", str(file)]
        if in_browser:
            command.append("--web-viewer")
        with suppress(KeyboardInterrupt):
            code = subprocess.call(command)  # noqa: S603 - our own interpreter, and a file of ours
            if code != 0:
                raise RecordingError(
                    f"the viewer ended with exit code {code} and says why above; "
                    "write the flight to a file with --save FILE.rrd and open that elsewhere"
                )


def _has_display() -> bool:
    is_x11_or_wayland = sys.platform.startswith(("linux", "freebsd"))
    return not is_x11_or_wayland or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def _check_writable(output: Path) -> None:
    # the library only finds out once it holds data, which it then drops with a warning
    try:
        output.open("wb").close()
    except OSError as error:
        raise RecordingError(
            f"{output} cannot be written: {error.strerror or error}; choose a folder that exists"
        ) from error


def _showable(recording: Recording) -> Recording:
    missing = [topic for topic in topics.FIXED_TOPICS if topic not in recording.topics]
    missing += [
        t for t in (topics.DEPUTY_STATE, topics.MISSION) if t not in missing and not len(recording[t])
    ]
    if missing:
        raise RecordingError(
            f"{recording.path} holds nothing on {', '.join(missing)}, without which there is no flight to "
            "show; give a recording that telemetry.EpisodeWriter wrote"
        )
    return recording


def _send(
    stream: rr.RecordingStream, entity: str, time_s: Floats, columns: Iterable[rr.ComponentColumn]
) -> None:
    stream.send_columns(entity, [rr.TimeColumn(TIMELINE, duration=time_s)], columns)


def _distances(recording: Recording) -> Floats:
    distances: Floats = np.linalg.norm(recording[topics.DEPUTY_STATE]["position_m"], axis=1)
    return distances


def _send_scene(stream: rr.RecordingStream, recording: Recording) -> None:
    _send_chief(stream, recording)
    _send_points(stream, recording)
    _send_deputy(stream, recording)
    _send_camera(stream, recording)
    _send_arrows(stream, recording)
    _send_limits(stream, recording)


def _send_chief(stream: rr.RecordingStream, recording: Recording) -> None:
    transforms = recording[topics.TRANSFORMS]
    is_chief = transforms["child_frame"] == topics.CHIEF_FRAME
    columns = rr.Transform3D.columns(quaternion=transforms["quaternion"][is_chief])
    _send(stream, f"{blueprint.SCENE}/chief", transforms.time_s[is_chief], columns)


def _send_points(stream: rr.RecordingStream, recording: Recording) -> None:
    cloud = recording[topics.CHIEF_POINTS]
    if not len(cloud):
        return
    positions = cloud["position_m"].astype(np.float32)
    rgba = cloud["colour_rgba"].astype(np.uint32)
    radius = float(np.linalg.norm(positions[0], axis=1).mean())
    body = rr.Ellipsoids3D(radii=[0.97 * radius], colors=[BODY_COLOUR], fill_mode=FillMode.Solid)
    stream.log(f"{blueprint.SCENE}/chief/body", body, static=True)
    packed = (rgba[..., 0] << 24) | (rgba[..., 1] << 16) | (rgba[..., 2] << 8) | rgba[..., 3]
    entity = f"{blueprint.SCENE}/chief/points"
    stream.log(entity, rr.Points3D.from_fields(radii=[0.075 * radius]), static=True)
    columns = rr.Points3D.columns(positions=positions.reshape(-1, 3), colors=packed.ravel())
    num_samples, num_points = packed.shape
    _send(stream, entity, cloud.time_s, columns.partition([num_points] * num_samples))


def _send_deputy(stream: rr.RecordingStream, recording: Recording) -> None:
    state = recording[topics.DEPUTY_STATE]
    deputy = f"{blueprint.SCENE}/deputy"
    columns = rr.Transform3D.columns(translation=state["position_m"], quaternion=state["quaternion"])
    _send(stream, deputy, state.time_s, columns)
    _send(stream, blueprint.SEEN, state.time_s, rr.Transform3D.columns(quaternion=state["quaternion"]))
    box = rr.Boxes3D(half_sizes=[(1.6, 1.6, 1.6)], colors=[PLAIN_COLOUR], fill_mode=FillMode.Solid)
    stream.log(f"{deputy}/body", box, static=True)
    axes = rr.Arrows3D(vectors=9.0 * np.eye(3), colors=AXIS_COLOURS, radii=0.35)
    stream.log(f"{deputy}/axes", axes, static=True)


def _send_camera(stream: rr.RecordingStream, recording: Recording) -> None:
    episode = recording.episode
    if episode.half_angle_rad is None or episode.boresight is None:
        return
    camera = f"{blueprint.SCENE}/deputy/camera"
    cone = rr.LineStrips3D(
        drawing.view_cone(episode.boresight, episode.half_angle_rad),
        colors=[CAMERA_COLOUR],
        radii=rr.Radius.ui_points(0.8),
    )
    stream.log(f"{camera}/view", cone, static=True)
    # the cone is of unit depth: the scale makes it reach the chief's centre
    scale = np.repeat(_distances(recording)[:, None], 3, axis=1)
    _send(stream, camera, recording[topics.DEPUTY_STATE].time_s, rr.Transform3D.columns(scale=scale))


def _send_arrows(stream: rr.RecordingStream, recording: Recording) -> None:
    mission = recording[topics.MISSION]
    angle = mission["sun_angle_rad"].astype(np.float64)
    sun = np.column_stack((np.cos(angle), np.sin(angle), np.zeros_like(angle)))
    _send_arrow(stream, "Sun", mission.time_s, origins=16.0 * sun, vectors=26.0 * sun, colour=SUN_COLOUR)
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
    stream: rr.RecordingStream,
    label: str,
    time_s: Floats,
    *,
    origins: Floats,
    vectors: Floats,
    colour: Colour,
) -> None:
    if not len(time_s):
        return
    entity = f"{blueprint.SCENE}/{label.lower()}"
    stream.log(entity, rr.Arrows3D.from_fields(colors=[colour], radii=[0.5], labels=[label]), static=True)
    _send(stream, entity, time_s, rr.Arrows3D.columns(origins=origins, vectors=vectors))


def _send_trail(stream: rr.RecordingStream, recording: Recording, entity: str, colour: Colour) -> None:
    state = recording[topics.DEPUTY_STATE]
    position = state["position_m"].astype(np.float32)
    ahead = rr.LineStrips3D([position], colors=[(*colour, 45)], radii=rr.Radius.ui_points(0.7))
    stream.log(f"{entity}_ahead", ahead, static=True)
    if len(position) < 2:
        return
    style = rr.LineStrips3D.from_fields(colors=[colour], radii=rr.Radius.ui_points(1.6))
    stream.log(entity, style, static=True)
    segments = np.stack((position[:-1], position[1:]), axis=1)
    _send(stream, entity, state.time_s[1:], rr.LineStrips3D.columns(strips=segments))


def _send_limits(stream: rr.RecordingStream, recording: Recording) -> None:
    episode = recording.episode
    for name, radius in (("nearest", episode.min_distance_m), ("farthest", episode.max_distance_m)):
        if radius is None:
            continue
        shell = rr.Ellipsoids3D(
            radii=[radius],
            colors=[SHELL_COLOUR],
            line_radii=rr.Radius.ui_points(0.6),
            fill_mode=FillMode.MajorWireframe,
        )
        stream.log(f"{blueprint.SCENE}/limits/{name}", shell, static=True)


def _send_plots(stream: rr.RecordingStream, plots: Iterable[Plot]) -> None:
    for plot in plots:
        for lines in plot.curves:
            if not lines.values.size:
                continue
            entity = f"{blueprint.plot_path(plot)}/{lines.name}"
            style = rr.SeriesLines(
                colors=lines.colours,
                names=lines.labels,
                widths=[lines.width] * len(lines.labels),
                interpolation_mode=InterpolationMode.StepAfter if lines.in_steps else None,
            )
            stream.log(entity, style, static=True)
            num_instants, num_lines = lines.values.shape
            columns = rr.Scalars.columns(scalars=lines.values.ravel())
            _send(stream, entity, lines.time_s, columns.partition([num_lines] * num_instants))


def _send_inferences(stream: rr.RecordingStream, recording: Recording) -> None:
    time_s = drawing.sample_times(recording)
    picture = drawing.activation_map(recording, time_s)
    if picture is None:
        return
    image = rr.DepthImage(picture.image, colormap="inferno", depth_range=(0.0, 255.0), meter=255.0)
    stream.log(f"{blueprint.RULE_MAP}/strengths", image, static=True)
    names = rr.Points2D(
        [(-drawing.MAP_NAME_WIDTH / 2, middle) for middle in picture.band_middles],
        labels=list(picture.band_names),
        colors=[PLAIN_COLOUR],
        radii=0.5,
        show_labels=True,
    )
    stream.log(f"{blueprint.RULE_MAP}/names", names, static=True)
    now = f"{blueprint.RULE_MAP}/now"
    style = rr.LineStrips2D.from_fields(colors=[PLAIN_COLOUR], radii=rr.Radius.ui_points(1.0))
    stream.log(now, style, static=True)
    _send(stream, now, time_s, rr.LineStrips2D.columns(strips=picture.cursors(time_s)))
    words = drawing.inference_in_words(recording, time_s)
    columns = rr.TextDocument.columns(text=words, media_type=["text/markdown"] * len(words))
    _send(stream, blueprint.RULES_IN_WORDS, time_s, columns)


def _send_words(stream: rr.RecordingStream, recording: Recording) -> None:
    events = recording[topics.LOG]
    if len(events):
        levels = [level.upper() for level in events["level"].tolist()]
        texts = [
            f"{time_s:.0f} s: {text}"
            for time_s, text in zip(events.time_s, events["message"].tolist(), strict=True)
        ]
        columns = rr.TextLog.columns(text=texts, level=levels)
        _send(stream, blueprint.EVENTS, events.time_s, columns)
    text = rr.TextDocument(drawing.flight_in_words(recording), media_type="text/markdown")
    stream.log(blueprint.FLIGHT_IN_WORDS, text, static=True)


def _send_marker(
    stream: rr.RecordingStream, recording: Recording, index: int, name: str, colour: Colour
) -> None:
    entity = f"{blueprint.SCENE}/flights/{index}/deputy"
    state = recording[topics.DEPUTY_STATE]
    stream.log(entity, rr.Points3D.from_fields(radii=[1.6], colors=[colour], labels=[name]), static=True)
    _send(stream, entity, state.time_s, rr.Points3D.columns(positions=state["position_m"]))
