"""A training, finished or running, as a scene: fitness, its parts, and the flights of the champions."""

import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Final

import numpy as np
import rerun as rr

from telemetry.file import RecordingError
from telemetry.scene import blueprint, viewer
from telemetry.scene.blueprint import generations, send
from telemetry.scene.curves import PLAIN_COLOUR, SIGNAL_COLOURS, Colour, Curves, Plot, drawable, table
from telemetry.scene.runs import Training, file_of, has_training, is_finished, read_training
from telemetry.scene.viewer import Scene

CHAMPION: Final = f"{blueprint.SCENE}/champion"
EARLIER: Final = f"{blueprint.SCENE}/earlier"
EARLIER_COLOUR: Final = (95, 120, 175, 120)
DEFAULT_FARTHEST_M: Final = 75.0
POLL_S: Final = 0.5

#: key, title, whether it is logarithmic, and columns with their labels, of each plot
_PLOTS: Final[tuple[tuple[str, str, bool, dict[str, str]], ...]] = (
    ("fitness", "Fitness, log10; smaller is better", True, {"best": "best", "mean": "mean"}),
    ("step_size", "Step size of the mutation, log10", True, {"step_size": "step size"}),
    ("delta_v", "Champion: mean delta-v (m/s)", False, {"delta_v_m_s": "delta-v"}),
    ("points", "Champion: mean points inspected", False, {"points": "points"}),
    ("flights", "Champion: flights short, flights outside", False, {"short": "short", "outside": "outside"}),
    ("outside_m", "Champion: metres outside the limits", False, {"outside_m": "metres"}),
)


def scene(folder: Path) -> Scene:
    """Make a scene of the finished generations of a training.

    Parameters
    ----------
    folder : Path
        Of a run.

    Raises
    ------
    RecordingError
        If no generation is finished, or a file cannot be read.
    """
    training = read_training(folder)

    def send_all(stream: rr.RecordingStream) -> None:
        _send_surroundings(stream, training)
        _send_rows(stream, training, 0)

    reaches = [float(np.linalg.norm(track, axis=1).max()) for track in training.tracks.values()]
    layout = blueprint.training(
        plots(training, 0),
        earlier=EARLIER,
        farthest_m=float(np.median(reaches)) if reaches else DEFAULT_FARTHEST_M,
    )
    return Scene("training", f"{drawable(training.name)}: training", layout, send_all)


def follow(folder: Path, output: Path | None, *, in_browser: bool, report: Callable[[str], None]) -> None:
    """Show a training while it runs.

    Parameters
    ----------
    folder : Path
        Of a run; waits for its first generation.
    output : Path or None
        An .rrd file that grows until the training ends; None for a viewer, which stays until it is closed.
    in_browser : bool
        Serve a page to this machine alone, instead of a window.
    report : callable
        Takes sentences about the progress.

    Raises
    ------
    RecordingError
        If the folder is missing, a file cannot be read, the viewer cannot open, or the output cannot be
        written.
    """
    if not folder.is_dir():
        raise RecordingError(f"{folder} is not a folder; give the folder of a run")
    if output is None:
        viewer.require_display(in_browser=in_browser)
    else:
        viewer.require_ending(output)
    if not has_training(folder):
        report(f"waiting for the first generation in {folder}")
    while not has_training(folder):
        time.sleep(POLL_S)
    first = scene(folder)
    if output is None:
        # sending fails once the user closes the viewer, which is not an error
        with (
            suppress(OSError),
            viewer.stream_to_viewer(first, in_browser=in_browser) as (stream, running),
        ):
            _grow(stream, folder, lambda: running.process.poll() is not None, report)
        return
    try:
        with viewer.stream_to_file(first, output) as stream:
            _grow(stream, folder, lambda: is_finished(folder), report)
    except OSError as error:
        raise viewer.unwritable(output, error) from error


def _grow(
    stream: rr.RecordingStream, folder: Path, is_over: Callable[[], bool], report: Callable[[str], None]
) -> None:
    """Send newly finished generations until it is over."""
    num_sent, stamp = 0, -1
    while True:
        # asked first, so that the last generations are sent before the end
        over = is_over()
        changed = file_of(folder, "training_history").stat().st_mtime_ns
        if changed != stamp:
            stamp = changed
            training = read_training(folder)
            if len(training) < num_sent:
                raise RecordingError(f"the training in {folder} has been restarted; follow it again")
            if num_sent == 0:
                _send_surroundings(stream, training)
            _send_rows(stream, training, num_sent)
            viewer.flush(stream)
            num_sent = len(training)
            report(_headline(training, num_sent - 1))
        if over:
            return
        time.sleep(POLL_S)


def plots(training: Training, first: int) -> list[Plot]:
    """Plot a training over its generations from row `first` on."""
    found = []
    rows = np.arange(first, len(training), dtype=np.float64)
    for key, title, is_logarithmic, names in _PLOTS:
        curves = []
        colours: tuple[Colour, ...] = (PLAIN_COLOUR, SIGNAL_COLOURS[3])
        for (column, label), colour in zip(names.items(), colours, strict=False):
            if column not in training.columns:
                continue
            values = training.columns[column][first:].astype(np.float64)
            if is_logarithmic:
                # no curve where there is no logarithm
                values = np.log10(values, out=np.full(len(values), np.nan), where=values > 0.0)
            curves.append(Curves(column, rows, values[:, None], (label,), (colour,), in_steps=True))
        found.append(Plot(key, title, tuple(curves), has_legend=len(names) > 1))
    return found


def in_words(training: Training, row: int) -> str:
    """Describe a generation's champion as Markdown."""
    columns = training.columns
    since = max((at for at in training.tracks if at <= row), default=None)
    facts = [
        (name, f"{columns[key][row]:.{digits}f} {unit}".rstrip())
        for key, name, digits, unit in (
            ("delta_v_m_s", "mean delta-v", 3, "m/s"),
            ("points", "mean points inspected", 2, ""),
            ("short", "flights short of the goal", 0, ""),
            ("outside", "flights outside the limits", 0, ""),
        )
        if key in columns
    ]
    if since is not None:
        facts.append(("champion since", _moment(training, since)))
    head = (_moment(training, row), f"fitness {columns['best'][row]:.6g}")
    return (
        f"{table([head, *facts])}\n\n"
        "White: the champion's flight from the configured start; blue: the champions of the last "
        f"{blueprint.GENERATIONS_IN_SIGHT} generations."
    )


def _moment(training: Training, row: int) -> str:
    columns = training.columns
    return f"round {columns['round'][row] + 1}, generation {columns['generation'][row]}"


def _headline(training: Training, row: int) -> str:
    return f"{_moment(training, row)}: fitness {training.columns['best'][row]:.6g}"


def _send_surroundings(stream: rr.RecordingStream, training: Training) -> None:
    around = training.surroundings
    blueprint.send_chief(stream, around.chief_radius_m)
    blueprint.send_limits(stream, around.min_distance_m, around.max_distance_m)
    blueprint.send_styles(stream, plots(training, 0))
    for entity, colour, width in ((EARLIER, EARLIER_COLOUR, 0.5), (CHAMPION, (*PLAIN_COLOUR, 255), 2.0)):
        style = rr.LineStrips3D.from_fields(colors=[colour], radii=rr.Radius.ui_points(width))
        stream.log(entity, style, static=True)
    start = next((track[0] for track in training.tracks.values()), None)
    if start is not None:
        place = rr.Points3D(
            [start], labels=["start"], colors=[PLAIN_COLOUR], radii=rr.Radius.ui_points(4.0), show_labels=True
        )
        stream.log(f"{blueprint.SCENE}/start", place, static=True)


def _send_rows(stream: rr.RecordingStream, training: Training, first: int) -> None:
    """Send the generations from row `first` on."""
    blueprint.send_values(stream, plots(training, first), generations)
    new = [row for row in sorted(training.tracks) if row >= first]
    if new:
        strips = np.stack([training.tracks[row] for row in new])
        for entity in (EARLIER, CHAMPION):
            columns = rr.LineStrips3D.columns(strips=strips)
            send(stream, entity, generations(np.array(new)), columns)
    rows = range(first, len(training))
    words = rr.TextDocument.columns(
        text=[in_words(training, row) for row in rows], media_type=["text/markdown"] * len(rows)
    )
    if rows:
        send(stream, blueprint.SUMMARY, generations(np.array(rows)), words)
