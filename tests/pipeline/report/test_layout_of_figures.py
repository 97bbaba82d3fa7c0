"""All pictures of reports can be read: words are within and apart, data fill the axes, lines are thin."""

from inspect import get_annotations, getmembers, isfunction
from itertools import combinations

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.colors import same_color
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.text import Text
from mpl_toolkits.mplot3d import Axes3D
from mpl_toolkits.mplot3d.art3d import Text3D

from pipeline.command_line.config import compose_experiment
from pipeline.evaluation.comparison import ComparisonRow
from pipeline.report.figures import comparison, flights, training, trajectories
from pipeline.report.figures.comparison import ControllerMark
from pipeline.report.figures.flights import METRICS, Sample
from pipeline.report.figures.style import BLUE, MUTED, PALETTE, PURPLE, style
from pipeline.report.figures.trajectories import Tracks
from tests.pipeline.recording import cases
from tests.pipeline.report.test_side_by_side import made_up

TEN_MINUTES = "duration_s=600.0"
MISSION = cases.composed(TEN_MINUTES).experiment.mission
DOCKING = compose_experiment(["+experiment=fly", "problem=docking"]).experiment.mission.problem


def orbits(count, reach_m=150.0):
    """Flights around the chief; the last is the farthest."""
    angles = np.linspace(0.0, 2.0 * np.pi, 61)
    radii = np.linspace(reach_m, 40.0, count)[::-1, np.newaxis, np.newaxis]
    return radii * np.stack([np.sin(angles), np.cos(angles), 0.8 * np.sin(angles + 0.5)], axis=1)


def spread():
    draw, paper = np.random.default_rng(1), dict.fromkeys(METRICS, 5.0)
    values = [
        (1.0 + draw.random(n), draw.integers(90, 100, n) / 0.99, 60.0 + 9.0 * draw.random(n))
        for n in (8, 500)
    ]
    drawn = [Sample(f"{len(of[0])}", dict(zip(METRICS, of, strict=True)), paper) for of in values]
    return flights.distributions(drawn, 99)


def trained():
    columns = {"round": np.repeat([0, 1], 10), "best": np.geomspace(1e5, 10.0, 20)}
    columns |= {"mean": 30.0 * columns["best"], "delta_v_m_s": np.linspace(9.0, 3.0, 20)}
    columns |= {"points": np.linspace(50.0, 99.0, 20)}
    return training.convergence(columns | dict.fromkeys(("outside", "short"), np.arange(20)[::-1]), 99, 95)


def side_by_side():
    marks = [ControllerMark(f"law_{i}", (0.1 + 0.2 * i, 0.05), (90.0 + i, 3.0)) for i in range(5)]
    return comparison.compared([("one", marks), ("two", marks[:2])], 95.0)


def worlds():
    share = {"count": 4, "fraction": 0.4, "low": 0.0, "high": 1.0}
    summary = {"success_and_within_limits": share, "violated": share, "delta_v_m_s": {"mean": 1.0}}
    row = {"source": "flown", "sun": "random", "num_cases": 10, "rules": None, "summary": summary}
    kinds = [
        (name, world, layer) for name in "ab" for world in ("leo", "geo") for layer in ("none", "filter")
    ]
    rows = [ComparisonRow(controller=name, world=world, safety=layer, **row) for name, world, layer in kinds]
    return comparison.by_world(rows)


def front():
    spent, rates = np.array([0.2, 0.5, 0.9, 0.6]), np.array([70.0, 90.0, 95.0, 75.0])
    ends = np.array([0.0, -0.05, 0.05])
    intervals = spent[:, np.newaxis] + ends, rates[:, np.newaxis] + 20.0 * ends
    return comparison.front_of_runs(list("abcd"), *intervals, np.array([True, True, True, False]))


def descents():
    states = np.zeros((3, 50, 6), dtype=np.float32)
    states[:, :, 0] = np.geomspace(100.0, 2.0, 50)
    states[:, :, 3] = -0.005 * states[:, :, 0] * np.array([[0.5], [0.7], [0.9]])
    return flights.approach(states, DOCKING)


def two_groups():
    groups = {"in": Tracks(orbits(60), [BLUE] * 60, {}), "out": Tracks(orbits(1), [PURPLE], {})}
    return trajectories.trajectories_apart(groups, MISSION)


def around(count, *names):
    colours = PALETTE[:count]
    legend = dict(zip(names, colours, strict=False))
    return trajectories.trajectories(Tracks(orbits(count), colours, legend), MISSION)


PICTURES = {
    "controls": lambda: flights.controls(cases.flown(TEN_MINUTES), MISSION),
    "distributions": spread,
    "convergence": trained,
    "compared": side_by_side,
    "by_world": worlds,
    "front_of_runs": front,
    "beside_optimum": lambda: comparison.beside_optimum(made_up(20), 95),
    "approach": descents,
    "trajectories": lambda: around(1),
    "trajectories of four": lambda: around(4),
    "trajectories of two": lambda: around(2, "with", "without"),
    "trajectories_apart": two_groups,
}


@pytest.fixture(scope="module", params=PICTURES)
def drawn(request):
    """A picture, laid out."""
    with style():
        figure = PICTURES[request.param]()
        FigureCanvasAgg(figure)
        figure.draw_without_rendering()
        yield figure


def words_of(figure):
    """The words that are seen, without those in space; of ticks, those within their axis."""
    hidden = set()
    for ax in figure.axes:
        for axis in ax._axis_map.values():
            labels = {
                label for tick in (*axis.majorTicks, *axis.minorTicks) for label in (tick.label1, tick.label2)
            }
            is_read = ax.get_visible() and not isinstance(ax, Axes3D)
            hidden |= labels - ({tick.label1 for tick in axis._update_ticks()} if is_read else set())
    return [
        text
        for text in figure.findobj(Text)
        if text.get_text().strip()
        and text.get_visible()
        and text not in hidden
        and not isinstance(text, Text3D)
        and (text.axes is None or text.axes.get_visible())
    ]


def boxes_of(texts):
    # without the line that leads from a name to its mark
    return [Text.get_window_extent(text) for text in texts]


def panels_of(figure):
    return [ax for ax in figure.axes if ax.get_visible() and not isinstance(ax, Axes3D)]


def test_every_kind_of_picture_is_looked_at():
    modules = comparison, flights, training, trajectories
    functions = [member for module in modules for member in getmembers(module, isfunction)]
    kinds = {name for name, function in functions if get_annotations(function).get("return") is Figure}
    assert {name.partition(" ")[0] for name in PICTURES} == kinds


def test_words_are_in_the_picture_and_apart_from_each_other_and_from_other_panels(drawn):
    assert drawn.get_figwidth() <= 9.6  # as a page is
    texts, (width, height) = words_of(drawn), drawn.bbox.size
    boxes = boxes_of(texts)
    for text, box in zip(texts, boxes, strict=True):
        is_within = min(box.x0, box.y0) >= -1.0 and box.x1 <= width + 1.0 and box.y1 <= height + 1.0
        assert is_within, text.get_text()
        assert 6.0 <= text.get_fontsize() <= 10.0
        for ax in panels_of(drawn):
            assert text.axes in (ax, None) or not box.overlaps(ax.bbox), text.get_text()
    for first, other in combinations(range(len(texts)), 2):
        assert not boxes[first].overlaps(boxes[other]), (texts[first].get_text(), texts[other].get_text())


def test_panels_are_apart_and_no_band_of_the_picture_is_empty(drawn):
    for first, other in combinations(drawn.axes, 2):
        assert not first.bbox.overlaps(other.bbox) or isinstance(first, Axes3D)
    corners = np.array([box.extents for box in (*boxes_of(words_of(drawn)), *(ax.bbox for ax in drawn.axes))])
    for axis, length in enumerate(drawn.bbox.size):
        # what begins after all that has begun before has ended
        begins = np.append(np.sort(corners[:, axis]), length)
        ended = [max([0.0, *corners[corners[:, axis] < begin, 2 + axis]]) for begin in begins]
        assert np.max(begins - ended) <= 0.45 * drawn.dpi


def test_lines_are_thin_and_borders_and_limits_thinner(drawn):
    for ax in drawn.axes:
        for line in ax.findobj(Line2D):
            if line.get_linestyle() != "None":
                assert 0.4 <= line.get_linewidth() <= (1.6 if same_color(line.get_color(), MUTED) else 2.0)
        assert all(2.0 <= line.get_markersize() <= 8.0 for line in ax.lines)
        for lines in ax.findobj(LineCollection):
            assert np.all(np.array(lines.get_linewidths()) <= 1.4)


def test_data_are_in_their_panels_and_fill_them(drawn):
    # in planes around the chief, limits are farther than flights
    for ax in (ax for ax in panels_of(drawn) if ax.get_aspect() != 1.0):
        together = ax.get_shared_x_axes().get_siblings(ax), ax.get_shared_y_axes().get_siblings(ax)
        for axis, siblings in enumerate(together):
            ends = [
                (each.transData - each.transAxes).transform(each.dataLim.get_points()) for each in siblings
            ]
            inside = np.array(ends)[..., axis]
            assert np.all((inside >= -0.01) & (inside <= 1.01))
            assert np.ptp(inside) >= (0.35 if len(ax.get_yticks()) else 0.25)
