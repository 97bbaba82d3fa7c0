"""The entities that scenes share: the chief, the limits, the curves."""

from collections.abc import Callable, Iterable
from typing import Final

import numpy as np
import rerun as rr
from rerun.components import FillMode, InterpolationMode

from telemetry.array_types import Floats
from telemetry.scene import blueprint
from telemetry.scene.curves import Plot, drawable

#: makes a column of the scene's timeline from times
Clock = Callable[[Floats], rr.TimeColumn]

BODY_COLOUR: Final = (44, 48, 62)
SHELL_COLOUR: Final = (105, 42, 48)


def seconds(instants: Floats) -> rr.TimeColumn:
    """Return a column of flight times, s."""
    return rr.TimeColumn(blueprint.TIME, duration=instants)


def generations(instants: Floats) -> rr.TimeColumn:
    """Return a column of generations of a training."""
    return rr.TimeColumn(blueprint.GENERATION, sequence=instants.astype(np.int64))


def send(
    stream: rr.RecordingStream, entity: str, instants: rr.TimeColumn, columns: Iterable[rr.ComponentColumn]
) -> None:
    """Send the components of an entity at each time."""
    stream.send_columns(entity, [instants], columns)


def send_chief(stream: rr.RecordingStream, radius_m: float | None) -> None:
    """Send the chief's body, slightly smaller than the sphere of its points, if its radius is known."""
    if radius_m is None:
        return
    body = rr.Ellipsoids3D(radii=[0.97 * radius_m], colors=[BODY_COLOUR], fill_mode=FillMode.Solid)
    stream.log(f"{blueprint.SCENE}/chief/body", body, static=True)


def send_mesh(stream: rr.RecordingStream, stl: bytes) -> None:
    """Send the chief's body as the triangles of an STL file in its axes, m."""
    body = rr.Asset3D(contents=stl, media_type="model/stl", albedo_factor=BODY_COLOUR)
    stream.log(f"{blueprint.SCENE}/chief/body", body, static=True)


def send_limits(
    stream: rr.RecordingStream, min_distance_m: float | None, max_distance_m: float | None
) -> None:
    """Send the shells that limit the deputy's distance, if they are known."""
    for name, radius in (("nearest", min_distance_m), ("farthest", max_distance_m)):
        if radius is None:
            continue
        shell = rr.Ellipsoids3D(
            radii=[radius],
            colors=[SHELL_COLOUR],
            line_radii=rr.Radius.ui_points(0.6),
            fill_mode=FillMode.MajorWireframe,
        )
        stream.log(f"{blueprint.SCENE}/limits/{name}", shell, static=True)


def send_styles(stream: rr.RecordingStream, plots: Iterable[Plot]) -> None:
    """Send colours, names and widths of curves."""
    for plot in plots:
        for lines in plot.curves:
            style = rr.SeriesLines(
                colors=lines.colours,
                names=[drawable(label) for label in lines.labels],
                widths=[lines.width] * len(lines.labels),
                interpolation_mode=InterpolationMode.StepAfter if lines.in_steps else None,
            )
            stream.log(f"{blueprint.plot_path(plot)}/{lines.name}", style, static=True)


def send_values(stream: rr.RecordingStream, plots: Iterable[Plot], clock: Clock) -> None:
    """Send the values of curves."""
    for plot in plots:
        for lines in plot.curves:
            num_instants, num_lines = lines.values.shape
            if not lines.values.size:
                continue
            columns = rr.Scalars.columns(scalars=lines.values.ravel())
            entity = f"{blueprint.plot_path(plot)}/{lines.name}"
            send(stream, entity, clock(lines.instants), columns.partition([num_lines] * num_instants))
