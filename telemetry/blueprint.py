"""The layout of a replay: which view shows what, and where."""

from collections.abc import Sequence
from typing import Final

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from telemetry.curves import Plot
from telemetry.drawing import MAP_HEIGHT, MAP_NAME_WIDTH, MAP_WIDTH

TIMELINE: Final = "time"
#: an hour of flight in a minute
PLAYBACK_SPEED: Final = 60.0

SCENE: Final = "/scene"
CURVES: Final = "/curves"
RULE_MAP: Final = "/rules/map"
RULES_IN_WORDS: Final = "/rules/words"
FLIGHT_IN_WORDS: Final = "/flight"
EVENTS: Final = "/events"

#: the chief's centre with the deputy's axes
SEEN: Final = f"{SCENE}/seen"

_MAP_MARGIN: Final = 20.0
_CLOSE_UP_M: Final = 36.0
BACKGROUND: Final = (10, 12, 20)
_EYE_DIRECTION: Final = np.array([0.70, -0.80, 0.42])


def trail_path(index: int) -> str:
    """Return under which path the trail of a flight is, the first flight being 0."""
    return f"{SCENE}/flights/{index}/trail"


def plot_path(plot: Plot) -> str:
    """Return under which path the curves of a plot are."""
    return f"{CURVES}/{plot.key}"


def layout(
    mission: Sequence[Plot],
    effort: Sequence[Plot],
    fis: Sequence[Plot],
    *,
    farthest_m: float,
    boresight: Sequence[float],
    trails: Sequence[str],
) -> rrb.Blueprint:
    """Lay out the views of a replay for a window of about 1600 x 900.

    Parameters
    ----------
    mission : sequence of Plot
        Distance, inspection rate and delta-v.
    effort : sequence of Plot
        Force and torque.
    fis : sequence of Plot
        What the fuzzy systems answered and were told, the first in front; empty where there were none.
    farthest_m : float
        The deputy's largest distance, which the scene has to hold.
    boresight : (3,)
        Unit vector along which the camera looks, body axes.
    trails : sequence of str
        Entities of which the scene shows everything up to now.
    """
    distance, rate, delta_v = mission
    end_s = max(float(curves.time_s[-1]) for curves in distance.curves)
    flight = rrb.TextDocumentView(origin=FLIGHT_IN_WORDS, name="Flight")
    rows: list[rrb.Container | rrb.View] = [
        rrb.Horizontal(_plot(distance, end_s), _plot(rate, end_s)),
        rrb.Horizontal(*(_plot(plot, end_s) for plot in effort)),
    ]
    if fis:
        tabs = rrb.Tabs(*(_plot(plot, end_s) for plot in fis), active_tab=0)
        rows.append(rrb.Horizontal(_plot(delta_v, end_s), tabs))
        rows.append(rrb.Horizontal(_rule_map(), rrb.Tabs(_events(), flight), column_shares=[64, 36]))
        words: rrb.Container | rrb.View = rrb.TextDocumentView(
            origin=RULES_IN_WORDS, name="What the controller is told, answers, and by which rules"
        )
    else:
        rows.append(_plot(delta_v, end_s))
        words = rrb.Horizontal(flight, _events())
    scene = rrb.Horizontal(_scene(farthest_m, trails), _camera_view(boresight), column_shares=[60, 40])
    left = rrb.Vertical(scene, words, row_shares=[55, 45])
    return rrb.Blueprint(
        rrb.Horizontal(left, rrb.Vertical(*rows), column_shares=[46, 54]),
        *_panels(),
        auto_layout=False,
        auto_views=False,
    )


def _panels() -> list[rrb.TimePanel | rrb.SelectionPanel | rrb.BlueprintPanel]:
    time = rrb.TimePanel(
        state="collapsed",
        timeline=TIMELINE,
        playback_speed=PLAYBACK_SPEED,
        play_state="playing",
        loop_mode="all",
    )
    return [time, rrb.SelectionPanel(state="hidden"), rrb.BlueprintPanel(state="hidden")]


def _events() -> rrb.View:
    columns = rrb.TextLogColumns(
        timeline_columns=[rrb.encodings.TimelineColumn(TIMELINE, visible=False)],
        text_log_columns=["Body"],
    )
    return rrb.TextLogView(origin=EVENTS, name="Events", columns=columns)


def _scene(farthest_m: float, trails: Sequence[str]) -> rrb.View:
    eye = 2.2 * max(farthest_m, 40.0) * _EYE_DIRECTION
    up_to_now = rrb.VisibleTimeRanges(
        timeline=TIMELINE,
        start=rrb.TimeRangeBoundary.infinite(),
        end=rrb.TimeRangeBoundary.cursor_relative(seconds=0.0),
    )
    return rrb.Spatial3DView(
        origin=SCENE,
        name="Flight, Hill frame",
        background=BACKGROUND,
        line_grid=rrb.LineGrid3D(visible=False),
        eye_controls=rrb.EyeControls3D(position=eye, look_target=[0, 0, 0], eye_up=[0, 0, 1]),
        overrides=dict.fromkeys(trails, up_to_now),
    )


def _camera_view(boresight: Sequence[float]) -> rrb.View:
    return rrb.Spatial3DView(
        origin=SEEN,
        contents=[f"{SCENE}/chief/**", f"{SCENE}/sun"],
        name="As the deputy sees it",
        background=BACKGROUND,
        line_grid=rrb.LineGrid3D(visible=False),
        eye_controls=rrb.EyeControls3D(
            position=-_CLOSE_UP_M * np.asarray(boresight, dtype=np.float64),
            look_target=[0, 0, 0],
            eye_up=[0, 0, 1],
        ),
    )


def _plot(plot: Plot, end_s: float) -> rrb.View:
    axis_y = None
    if plot.low is not None and plot.high is not None:
        axis_y = rrb.ScalarAxis(range=(plot.low, plot.high))
    whole_flight = rr.TimeRange(
        start=rr.TimeRangeBoundary.absolute(seconds=0.0), end=rr.TimeRangeBoundary.absolute(seconds=end_s)
    )
    return rrb.TimeSeriesView(
        origin=plot_path(plot),
        name=plot.title,
        axis_x=rrb.TimeAxis(link="Independent", view_range=whole_flight),
        axis_y=axis_y,
        plot_legend=rrb.PlotLegend(rrb.Corner2D.RightTop, visible=plot.has_legend),
    )


def _rule_map() -> rrb.View:
    return rrb.Spatial2DView(
        origin=RULE_MAP,
        name="Rules fired over the flight: one row each, rule 1 on top",
        background=BACKGROUND,
        visual_bounds=rrb.VisualBounds2D(
            x_range=[-MAP_NAME_WIDTH, MAP_WIDTH + _MAP_MARGIN],
            y_range=[-_MAP_MARGIN, MAP_HEIGHT + _MAP_MARGIN],
        ),
    )
