"""Layouts of the views, for a window of about 1600 x 900, and the entities that they share."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any, Final

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from rerun.components import FillMode, InterpolationMode

from telemetry.array_types import Floats
from telemetry.scene.curves import Plot, drawable
from telemetry.scene.drawing import MAP_HEIGHT, MAP_NAME_WIDTH, MAP_WIDTH

#: the timeline of a flight, s
TIME: Final = "time"
#: the same as dates of UTC, of a flight whose mission has an epoch
DATE: Final = "date"
#: an hour of flight in a minute
PLAYBACK_SPEED: Final = 60.0

SCENE: Final = "/scene"
CURVES: Final = "/curves"
RULE_MAP: Final = "/rules/map"
RULES_IN_WORDS: Final = "/rules/words"
SUMMARY: Final = "/summary"
NOW: Final = "/now"
EVENTS: Final = "/events"

#: the chief's centre with the deputy's axes
SEEN: Final = f"{SCENE}/seen"

_MAP_MARGIN: Final = 20.0
_CLOSE_UP_M: Final = 32.0
BACKGROUND: Final = (10, 12, 20)
#: curves end left of the legend, which is wider where it names signals
_ROOM_FOR_LEGEND: Final = 1.45
_ROOM_FOR_NAMES: Final = 1.5
#: and before the end of the axis, so that its last label is whole
_ROOM_FOR_END: Final = 1.06
_EYE_DIRECTION: Final = np.array([0.70, -0.80, 0.42])


#: path of the plans that a flight's choices were between
PLANS: Final = f"{SCENE}/plans"


def trail_path(index: int) -> str:
    """Return the path of the trail of a flight; the first flight is 0."""
    return f"{SCENE}/flights/{index}/trail"


def plot_path(plot: Plot) -> str:
    """Return the path of the curves of a plot."""
    return f"{CURVES}/{plot.key}"


def replay(
    mission: Sequence[Plot],
    effort: Sequence[Plot],
    fis: Sequence[Plot],
    *,
    farthest_m: float,
    boresight: Sequence[float],
    trails: Sequence[str],
) -> rrb.Blueprint:
    """Lay out flights: the scene and the curves above, the rules and the events below.

    Parameters
    ----------
    mission : sequence of Plot
        Distance, inspection rate and delta-v.
    effort : sequence of Plot
        Force and torque.
    fis : sequence of Plot
        Outputs of the fuzzy systems, then their inputs; empty if there are none.
    farthest_m : float
        Largest distance of the deputy, which the view covers.
    boresight : (3,)
        Unit vector along which the camera looks, body axes.
    trails : sequence of str
        Entities shown from the start up to the selected time.
    """
    end_s = max(float(lines.instants[-1]) for lines in mission[0].curves)
    now = rrb.TextDocumentView(origin=NOW, name="Now")
    summary = rrb.TextDocumentView(origin=SUMMARY, name="Flight")
    eye = -_CLOSE_UP_M * np.asarray(boresight, dtype=np.float64)
    camera = _space(SEEN, "As the deputy sees it", eye, contents=[f"{SCENE}/chief/**"])
    beside = rrb.Vertical(camera, summary, row_shares=[43, 57])
    force, torque = (_plot(plot, _ROOM_FOR_LEGEND * end_s) for plot in effort)
    force_plots = [_plot(plot, _ROOM_FOR_LEGEND * end_s) for plot in fis[:1]]
    tabs = [_plot(plot, _ROOM_FOR_NAMES * end_s) for plot in fis[1:]]
    rows = [
        rrb.Horizontal(*(_plot(plot, _ROOM_FOR_END * end_s) for plot in mission), column_shares=[38, 34, 28]),
        rrb.Horizontal(force, *force_plots),
        rrb.Tabs(*tabs, torque, active_tab=0),
    ]
    start = rrb.TimeRangeBoundary.infinite()
    now_s = rrb.TimeRangeBoundary.cursor_relative(seconds=0.0)
    up_to_now = rrb.VisibleTimeRanges(timeline=TIME, start=start, end=now_s)
    overrides = dict.fromkeys(trails, up_to_now)
    scene = _space(SCENE, "Flight, Hill frame", _around(farthest_m), overrides=overrides)
    plots = rrb.Vertical(*rows, row_shares=[31, 36, 33])
    top = rrb.Horizontal(scene, beside, plots, column_shares=[34, 17, 49])
    if not fis:
        return _blueprint(rrb.Vertical(now, top, _events(), row_shares=[7, 69, 24]))
    words = rrb.TextDocumentView(origin=RULES_IN_WORDS, name="Inputs, outputs and rules of the controller")
    bottom = rrb.Horizontal(words, _rule_map(), _events(), column_shares=[42, 30, 28])
    return _blueprint(rrb.Vertical(now, top, bottom, row_shares=[7, 56, 37]))


def campaign(distance: Plot, *, farthest_m: float) -> rrb.Blueprint:
    """Lay out the trajectories of many cases.

    Parameters
    ----------
    distance : Plot
        Over the time of the flights.
    farthest_m : float
        Largest distance, which the view covers.
    """
    end_s = max(float(lines.instants[-1]) for lines in distance.curves)
    summary = rrb.TextDocumentView(origin=SUMMARY, name="Outcomes")
    side = rrb.Vertical(summary, _plot(distance, _ROOM_FOR_LEGEND * end_s), row_shares=[60, 40])
    scene = _space(SCENE, "All cases, Hill frame", _around(farthest_m))
    return _blueprint(rrb.Horizontal(scene, side, column_shares=[58, 42]))


def _blueprint(root: rrb.Container) -> rrb.Blueprint:
    """Return a blueprint of our layout, playing, with the other panels hidden."""
    time = rrb.TimePanel(
        state="collapsed", timeline=TIME, playback_speed=PLAYBACK_SPEED, play_state="playing", loop_mode="all"
    )
    selection = rrb.SelectionPanel(state="hidden")
    panel = rrb.BlueprintPanel(state="hidden")
    return rrb.Blueprint(root, time, selection, panel, auto_layout=False, auto_views=False)


def _events() -> rrb.View:
    """Return the view of events."""
    columns = rrb.TextLogColumns(
        timeline_columns=[rrb.encodings.TimelineColumn(TIME, visible=False)], text_log_columns=["Body"]
    )
    return rrb.TextLogView(origin=EVENTS, name="Events", columns=columns)


def _around(farthest_m: float) -> Floats:
    """Return the viewpoint from which a scene of this size is seen, Hill axes, m."""
    return 1.8 * max(farthest_m, 40.0) * _EYE_DIRECTION


def _space(origin: str, title: str, eye: Floats, **options: Any) -> rrb.View:
    """Return a 3D view towards the chief from a point."""
    return rrb.Spatial3DView(
        origin=origin,
        name=title,
        background=BACKGROUND,
        line_grid=rrb.LineGrid3D(visible=False),
        eye_controls=rrb.EyeControls3D(position=eye, look_target=[0, 0, 0], eye_up=[0, 0, 1]),
        **options,
    )


def _plot(plot: Plot, end_s: float) -> rrb.View:
    """Return the view of a plot over the whole flight."""
    corner = rrb.Corner2D.LeftTop if plot.rises else rrb.Corner2D.RightTop
    axis_y = rrb.ScalarAxis(range=plot.ends) if plot.ends else None
    whole_flight = rr.TimeRange(
        start=rr.TimeRangeBoundary.absolute(seconds=0.0), end=rr.TimeRangeBoundary.absolute(seconds=end_s)
    )
    axis_x = rrb.TimeAxis(link="Independent", view_range=whole_flight)
    legend = rrb.PlotLegend(corner, visible=plot.has_legend)
    name = drawable(plot.title)
    return rrb.TimeSeriesView(
        origin=plot_path(plot), name=name, axis_x=axis_x, axis_y=axis_y, plot_legend=legend
    )


def _rule_map() -> rrb.View:
    """Return the view of the map of rules that fired."""
    x, y = [-MAP_NAME_WIDTH, MAP_WIDTH + _MAP_MARGIN], [-_MAP_MARGIN, MAP_HEIGHT + _MAP_MARGIN]
    bounds = rrb.VisualBounds2D(x_range=x, y_range=y)
    name = "Rules fired: one row each, rule 1 on top"
    return rrb.Spatial2DView(origin=RULE_MAP, name=name, background=BACKGROUND, visual_bounds=bounds)


@dataclass(frozen=True)
class Stream:
    """Where a scene is sent to.

    Parameters
    ----------
    recording : rr.RecordingStream
    epoch : datetime or None
        The time, UTC, at which the simulation time is 0; with it the timeline `DATE` is there, too.
    """

    recording: rr.RecordingStream
    epoch: datetime | None = None

    def log(self, entity: str, content: Any, *, static: bool) -> None:
        """Log an entity's content."""
        self.recording.log(entity, content, static=static)


BODY_COLOUR: Final = (44, 48, 62)
SHELL_COLOUR: Final = (105, 42, 48)


def send(stream: Stream, entity: str, time_s: Floats, columns: Iterable[rr.ComponentColumn]) -> None:
    """Send the components of an entity at each time."""
    times = [rr.TimeColumn(TIME, duration=time_s)]
    if stream.epoch is not None:
        # numpy's times have no zone, and are of UTC
        start = np.datetime64(stream.epoch.replace(tzinfo=None), "ns")
        since = np.rint(np.asarray(time_s) * 1e9).astype(np.int64).astype("timedelta64[ns]")
        times.append(rr.TimeColumn(DATE, timestamp=start + since))
    stream.recording.send_columns(entity, times, columns)


def send_chief(stream: Stream, radius_m: float | None) -> None:
    """Send the chief's body, slightly smaller than the sphere of its points, if its radius is known."""
    if radius_m is None:
        return
    body = rr.Ellipsoids3D(radii=[0.97 * radius_m], colors=[BODY_COLOUR], fill_mode=FillMode.Solid)
    stream.log(f"{SCENE}/chief/body", body, static=True)


def send_mesh(stream: Stream, stl: bytes) -> None:
    """Send the chief's body as the triangles of an STL file in its axes, m."""
    body = rr.Asset3D(contents=stl, media_type="model/stl", albedo_factor=BODY_COLOUR)
    stream.log(f"{SCENE}/chief/body", body, static=True)


def send_limits(stream: Stream, min_distance_m: float | None, max_distance_m: float | None) -> None:
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
        stream.log(f"{SCENE}/limits/{name}", shell, static=True)


def send_curves(stream: Stream, plots: Iterable[Plot]) -> None:
    """Send curves: their colours, names and widths, and their values."""
    for plot in plots:
        for lines in plot.curves:
            entity = f"{plot_path(plot)}/{lines.name}"
            names = [drawable(label) for label in lines.labels]
            widths = [lines.width] * len(names)
            mode = InterpolationMode.StepAfter if lines.in_steps else None
            style = rr.SeriesLines(colors=lines.colours, names=names, widths=widths, interpolation_mode=mode)
            stream.log(entity, style, static=True)
            if lines.values.size:
                num_instants, num_lines = lines.values.shape
                columns = rr.Scalars.columns(scalars=lines.values.ravel())
                send(stream, entity, lines.instants, columns.partition([num_lines] * num_instants))
