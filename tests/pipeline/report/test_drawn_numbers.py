"""Numbers that are read back from pictures of made-up flights, each computed by hand."""

import numpy as np
import pytest
from matplotlib.colors import to_rgba
from matplotlib.patches import Circle
from mpl_toolkits.mplot3d.art3d import Line3DCollection, Path3DCollection, Poly3DCollection

from pipeline.command_line.config import compose_experiment
from pipeline.evaluation.comparison import ComparisonRow
from pipeline.flight.state.arrays import TRACK_LEFT
from pipeline.report.figures import flights
from pipeline.report.figures import style as looks
from pipeline.report.figures.comparison import ControllerMark, by_world, compared, front_of_runs
from pipeline.report.figures.flights import METRICS, Sample, approach, controls, distributions
from pipeline.report.figures.style import BLUE, MUTED, PALETTE, PAPER, VERMILION, style
from pipeline.report.figures.trajectories import Tracks, trajectories, trajectories_apart
from tests.pipeline.recording import cases

MISSION = cases.composed("duration_s=600.0").experiment.mission
DOCKING = compose_experiment(["+experiment=fly", "problem=docking"]).experiment.mission
#: the eye is 24° above the plane of the first two axes, at -52° in it
EYE = np.array([0.5624, -0.7199, 0.4067])


@pytest.fixture(autouse=True)
def _in_style():
    with style():
        yield


@pytest.fixture
def kept(monkeypatch):
    """Figures that are turned into files, before they are."""
    figures = []
    monkeypatch.setattr(looks, "illustrate", lambda *words: figures.append(words[2]))
    return figures


def line_of(ax, colour, number=0):
    return [line for line in ax.lines if line.get_color() == colour][number]


def rings_of(ax):
    return [(patch.center, patch.radius) for patch in ax.patches if isinstance(patch, Circle)]


def made_track():
    """Thirteen samples on a line, from 100 to 40 m along the radial axis, points seen one by one."""
    track = np.zeros((13, 15))
    track[:, 0], track[:, 1], track[:, 2] = np.linspace(100.0, 40.0, 13), 30.0, -5.0
    track[:, 3], track[:, TRACK_LEFT] = -0.5, 99 - np.arange(13)
    return track


def test_a_flight_of_an_inspection_on_a_strip(kept):
    track = made_track()
    flights.draw_flight(track, 99, MISSION, 40)
    plane, far, progress = kept[0].axes
    path, start = plane.lines
    np.testing.assert_array_equal(path.get_xydata(), track[:, [1, 0]])
    np.testing.assert_array_equal(start.get_xydata(), [[30.0, 100.0]])
    assert rings_of(plane) == [((0, 0), 10.0), ((0, 0), 15.0)]
    assert plane.get_xlim() == plane.get_ylim() == pytest.approx((-112.0, 112.0))
    times = 10.0 * np.arange(13)
    distances = np.sqrt(track[:, 0] ** 2 + 30.0**2 + 5.0**2)
    np.testing.assert_allclose(far.lines[0].get_xydata(), np.column_stack([times, distances]))
    assert [line.get_ydata()[0] for line in far.lines[1:]] == [15.0, 200.0]
    assert far.get_ylim()[0] == 0.0
    seen = np.column_stack([times, 100.0 * np.arange(13) / 99.0])
    np.testing.assert_allclose(progress.lines[0].get_xydata(), seen, atol=1e-12)
    assert far.get_xlim() == progress.get_xlim() == (0.0, 120.0)
    assert 100.0 < progress.get_ylim()[1] < 110.0


def test_a_flight_to_a_goal_on_a_strip(kept):
    track = made_track()
    flights.draw_flight(track, 0, DOCKING, 40)
    plane, far, progress = kept[0].axes
    assert rings_of(plane) == []
    assert len(far.lines) == 1
    speed, limit = progress.lines
    np.testing.assert_allclose(speed.get_ydata(), 0.5)
    problem, distances = DOCKING.problem, far.lines[0].get_ydata()
    slope = problem.limit_slope_per_s
    allowed = problem.limit_base_m_s + slope * (distances - problem.limit_offset_m)
    np.testing.assert_allclose(limit.get_ydata(), allowed)
    np.testing.assert_allclose(limit.get_xdata(), speed.get_xdata())
    assert progress.get_ylim()[0] == 0.0


def test_speed_over_distance_is_drawn_up_to_the_goal():
    problem = DOCKING.problem
    states = np.zeros((2, 30, 6), dtype=np.float32)
    states[:, :, 1] = np.linspace(90.0, 0.1, 30)
    states[:, :, 4] = -0.01
    ax = approach(states, problem).axes[0]
    first = np.flatnonzero(states[0, :, 1] <= problem.goal_radius_m)[0]
    for line in ax.lines[:2]:
        np.testing.assert_allclose(line.get_xdata(), states[0, : first + 1, 1], rtol=1e-6)
        np.testing.assert_allclose(line.get_ydata(), 0.01, rtol=1e-6)
    limit, goal = ax.lines[2:]
    assert (limit.get_xdata()[0], limit.get_xdata()[-1]) == pytest.approx((problem.goal_radius_m, 90.0))
    assert goal.get_xdata()[0] == problem.goal_radius_m
    assert ax.get_xscale() == "log"


def test_a_tube_is_filled_over_flights(kept):
    # one box a step: between 3 and 4 m and between 5 and 6 m
    tube = {"step": np.repeat([0, 1], 2), "axis": np.tile([0, 1], 2), "low_m": np.array([3.0, 0.0, 5.0, 0.0])}
    tube |= {"high_m": np.array([4.0, 0.0, 6.0, 0.0]), "shear_per_s": np.zeros(4)}
    tube |= {"least_m_s": np.array([0.1, 0.0, 0.2, 0.0]), "greatest_m_s": np.array([0.3, 0.0, 0.4, 0.0])}
    states = np.zeros((1, 2, 6), dtype=np.float32)
    states[0, :, 0], states[0, :, 3] = (3.5, 5.5), 0.02
    flights.draw_tube(tube, states, DOCKING, 40)
    far, fast = kept[0].axes
    for ax, low, high in ((far, (3.0, 5.0), (4.0, 6.0)), (fast, (0.0, 0.0), (0.3, 0.4))):
        corners = {tuple(corner) for corner in ax.collections[0].get_paths()[0].vertices.round(9).tolist()}
        period_s = DOCKING.control_period_s
        assert corners == {(k * period_s, ends[k]) for ends in (low, high) for k in (0, 1)}
        assert ax.get_ylim()[0] == 0.0
    np.testing.assert_allclose(line_of(far, BLUE).get_xydata(), [[0.0, 3.5], [period_s, 5.5]])
    np.testing.assert_allclose(line_of(fast, BLUE).get_ydata(), 0.02)
    problem = DOCKING.problem
    allowed = problem.limit_base_m_s + problem.limit_slope_per_s * (
        np.array([3.0, 5.0]) - problem.limit_offset_m
    )
    np.testing.assert_allclose(line_of(fast, VERMILION).get_ydata(), allowed)
    assert fast.get_xlim() == (0.0, period_s)


def test_what_acts_is_held_until_the_next_moment():
    log = cases.flown("duration_s=600.0")
    force, turning, following = controls(log, MISSION).axes
    for ax in (force, turning, following):
        for line in ax.lines[:3]:
            assert line.get_ydata()[-1] == line.get_ydata()[-2]
        assert ax.get_xlim() == (ax.lines[0].get_xdata()[0], ax.lines[0].get_xdata()[-1])
    edges = np.concatenate([turning.lines[0].get_xdata()[:-1], following.lines[0].get_xdata()])
    np.testing.assert_allclose(edges, np.arange(len(edges)) * MISSION.attitude_period_s)
    assert (edges[0], edges[-1]) == (0.0, pytest.approx(600.0))


def test_turning_ends_a_while_after_the_last_large_torque_of_the_first_tenth():
    log = cases.flown("duration_s=600.0")
    for last, cut in ((55, 71), (20, 60)):  # 1.3 times as long, but at least a minute
        torques = np.full((600, 3), 1e-6)
        torques[: last + 1], torques[last + 1 : 60], torques[450:] = 1e-3, 0.5e-4, 5e-3
        made_up = log._replace(torque_b_n_m=torques.reshape(log.torque_b_n_m.shape))
        _, turning, following = controls(made_up, MISSION).axes
        assert [len(ax.lines[0].get_xdata()) for ax in (turning, following)] == [cut + 1, 600 - cut + 1]
        assert following.get_title(loc="left") == f"Torque, body axes, {cut} to 600 s"


def values_of(rows):
    return dict(zip(METRICS, rows, strict=True))


def test_histograms_reach_a_width_of_the_bulk_beyond_it():
    spent = np.concatenate([np.linspace(1.0, 2.0, 397), [-9.0, -8.0, 30.0]])
    sample = Sample("many", values_of([spent, np.full(400, 100.0 * 95 / 99), spent]), {"delta_v_m_s": 2.5})
    ax, rate, _ = distributions([sample], 99).axes
    first, last = np.percentile(spent, (1.0, 99.0))
    low, high = 2.0 * first - last, 2.0 * last - first
    assert ax.get_xlim() == pytest.approx((low - 0.05 * (high - low), high + 0.05 * (high - low)))
    assert len(ax.patches) == 2 * 20  # of 400 values
    assert sum(bar.get_height() for bar in ax.patches) == 397
    assert [text.get_text() for text in ax.texts] == [
        "← 2 more",
        "1 more →",
        f"— mean {spent.mean():.4g}",
        "- - paper 2.5",
    ]
    assert [line.get_xdata()[0] for line in ax.lines] == [pytest.approx(spent.mean()), 2.5]
    # a bin around each count of points, and around one fewer
    edges = [bar.get_x() for bar in rate.patches] + [rate.patches[-1].get_x() + rate.patches[-1].get_width()]
    np.testing.assert_allclose(np.array(edges) * 0.99, [93.5, 94.5, 95.5])


def test_values_that_are_equal_still_have_a_width():
    few = values_of([np.full(9, 5.0), np.full(9, 50.0), np.full(9, 200.0)])
    ax, _, far = distributions([Sample("few", few, {})], 99).axes
    assert ax.get_xlim() == pytest.approx((5.0 - 0.005, 5.0 + 0.005))
    assert far.get_xlim() == pytest.approx((200.0 - 0.2, 200.0 + 0.2))


def line(first, last, count=61):
    return np.linspace(first, last, count)


@pytest.mark.parametrize(("reach_m", "frame_m"), [(50.0, 60.0), (10.0, 20.0), (90.0, 100.0), (400.0, 220.0)])
def test_axes_reach_a_little_beyond_the_farthest_but_not_far_beyond_the_limit(reach_m, frame_m):
    tracks = line((0.0, reach_m, 0.0), (5.0, -4.0, 3.0))[np.newaxis]
    space, orbit, across, _ = trajectories(Tracks(tracks, [BLUE], {}), MISSION).axes
    limits = [space.get_xlim(), space.get_ylim(), space.get_zlim()]
    limits += [get() for ax in (orbit, across) for get in (ax.get_xlim, ax.get_ylim)]
    assert limits == [pytest.approx((-frame_m, frame_m))] * 7
    (start,) = [drawn for drawn in space.collections if isinstance(drawn, Path3DCollection)]
    assert len(start._offsets3d[0]) == (reach_m < frame_m)


def test_the_chief_is_a_sphere_that_is_lit_from_the_eye_and_above():
    space, orbit, _, _ = trajectories(
        Tracks(line((50.0, 0.0, 0.0), (0.0, 50.0, 9.0))[np.newaxis], [BLUE], {}), MISSION
    ).axes
    (sphere,) = [drawn for drawn in space.collections if isinstance(drawn, Poly3DCollection)]
    corners = np.asarray(sphere._faces)
    np.testing.assert_allclose(np.linalg.norm(corners, axis=-1), 10.0)
    # the faces cover it: two triangles each
    ab, ac, ad = (corners[:, k] - corners[:, 0] for k in (1, 2, 3))
    areas = (np.linalg.norm(np.cross(ab, ac), axis=1) + np.linalg.norm(np.cross(ac, ad), axis=1)) / 2.0
    assert areas.sum() == pytest.approx(4.0 * np.pi * 100.0, rel=0.01)
    shades = sphere._facecolor3d[:, :3] / to_rgba("#c3cad2")[:3]
    light = EYE + np.array([0.0, 0.0, 0.5])
    cosines = corners[:, 0] @ light / np.linalg.norm(light) / 10.0
    expected = 0.5 + 0.5 * np.maximum(cosines, 0.0)
    np.testing.assert_allclose(shades, np.repeat(expected[:, np.newaxis], 3, axis=1), atol=1e-3)
    assert rings_of(orbit) == [((0, 0), 10.0), ((0, 0), 15.0), ((0, 0), 200.0)]
    disc, *rings = orbit.patches
    assert all(ring.get_zorder() > disc.get_zorder() > orbit.collections[0].get_zorder() for ring in rings)
    dots = orbit.collections[1]
    np.testing.assert_allclose(dots.get_offsets(), [[0.0, 50.0]])
    assert dots.get_zorder() > rings[0].get_zorder()


def test_pieces_of_a_track_in_space_leave_out_what_is_outside_the_frame():
    # towards the eye, out of the picture and back: what is outside is in no piece
    out = np.concatenate([line(20.0, 380.0, 37), line(370.0, 20.0, 36)])
    track = out[:, np.newaxis] * EYE / np.linalg.norm(EYE)
    space, *_ = trajectories(Tracks(track[np.newaxis], [BLUE], {}), MISSION).axes
    pieces = [
        p for drawn in space.collections if isinstance(drawn, Line3DCollection) for p in drawn._segments3d
    ]
    inside = track[(np.abs(track) <= 220.0).all(axis=1)]
    half = len(inside) // 2
    assert [len(piece) for piece in pieces] == [half, len(inside) - half]
    np.testing.assert_allclose(np.concatenate(pieces), inside)


@pytest.mark.parametrize(
    ("count", "width", "alpha"), [(8, 1.3, 1.0), (30, 0.9, 0.7), (100, 0.5, 0.6), (900, 0.5, 0.15)]
)
def test_the_more_flights_the_fainter(count, width, alpha):
    tracks = np.repeat(line((50.0, 0.0, 0.0), (0.0, 50.0, 0.0), 3)[np.newaxis], count, axis=0)
    few = Tracks(tracks, (PALETTE * 200)[:count], {"any": BLUE})
    space, orbit, _, distance = trajectories(few, MISSION).axes
    (lines,) = [drawn for drawn in space.collections if isinstance(drawn, Line3DCollection)][:1]
    for drawn, thinner in ((lines, 1.0), (orbit.collections[0], 0.8), (distance.collections[0], 0.8)):
        np.testing.assert_allclose(drawn.get_linewidths(), thinner * width)
        np.testing.assert_allclose(drawn.get_colors()[:, 3], alpha)
    assert distance.get_ylim()[0] == 0.0
    assert distance.get_ylim()[1] > 200.0
    assert distance.get_xlim() == (0.0, 20.0)


def test_groups_stand_side_by_side_in_panels_of_the_same_size():
    tracks = Tracks(line((50.0, 0.0, 0.0), (0.0, 50.0, 0.0))[np.newaxis], [BLUE], {})
    for count in (2, 3):
        figure = trajectories_apart({str(k): tracks for k in range(count)}, MISSION)
        boxes = np.array([ax.get_position(original=True).bounds for ax in figure.axes]).reshape(count, 3, 4)
        np.testing.assert_allclose(
            boxes - boxes[:1], (boxes[1] - boxes[0]) * np.arange(count)[:, None, None], atol=1e-9
        )
        assert np.ptp(boxes[:, :, 1:], axis=0) == pytest.approx(0.0, abs=1e-9)
        # in a column: space above the plane above the distance, as wide as each other
        space, plane, distance = boxes[0]
        assert space[1] >= plane[1] + plane[3] > plane[1] > distance[1] + distance[3]
        assert plane[0] == distance[0]
        assert plane[2] == distance[2] < space[2]
        labels = [ax.get_ylabel() for ax in figure.axes if ax.name != "3d"]
        assert labels == ["radial i (m)", "distance (m)"] + [""] * (2 * count - 2)


def test_squares_of_worlds_are_at_their_controller_and_world():
    rows = []
    for x, name in enumerate(("a", "b", "c")):
        for y, world in enumerate(("leo", "geo")):
            # the controller b fails in the second world more often than chance has it
            count = 2 if (x, y) == (1, 1) else 90 + x
            share = {"count": count, "fraction": count / 100.0}
            summary = {"success_and_within_limits": share, "violated": {"count": 0, "fraction": 0.0}}
            summary["delta_v_m_s"] = {"mean": 1.0 + x + 10.0 * y}
            row = {"source": "flown", "sun": "random", "safety": "none", "num_cases": 100, "rules": None}
            rows.append(ComparisonRow(controller=name, world=world, summary=summary, **row))
    (ax,) = by_world(rows).axes
    for square, text, row in zip(ax.patches, ax.texts, rows, strict=True):
        x, y = "abc".index(row.controller), ["leo", "geo"].index(row.world)
        assert text.get_position() == (x, y)
        np.testing.assert_allclose(square.get_center(), (x, y), atol=1e-9)
        assert (
            0.8
            <= min(square.get_width(), square.get_height())
            <= max(square.get_width(), square.get_height())
            < 1.0
        )
        share = row.summary["success_and_within_limits"]["fraction"]
        assert text.get_text() == f"{100 * share:.0f} %, {1.0 + x + 10.0 * y:.2f}"
        is_broken = (x, y) == (1, 1)
        assert square.get_edgecolor() == to_rgba(VERMILION if is_broken else PAPER)
        assert (square.get_linewidth() > 1.5) == is_broken
        # from white to blue
        np.testing.assert_allclose(square.get_facecolor()[0], 1.0 - share, atol=0.01)
    assert [label.get_text() for label in ax.get_xticklabels()] == ["a", "b", "c"]
    assert [label.get_text() for label in ax.get_yticklabels()] == ["leo", "geo"]
    assert ax.get_xlim() == (-0.5, 2.5)
    assert ax.get_ylim() == (1.5, -0.5)


def test_a_front_has_a_point_with_its_intervals_for_each_setting():
    spent = np.array([[0.5, 0.4, 0.7], [0.2, 0.1, 0.25], [0.6, 0.6, 0.6]])
    rates = np.array([[90.0, 88.0, 95.0], [70.0, 69.0, 73.0], [80.0, 80.0, 80.0]])
    ax = front_of_runs(["x", "y", "z"], spent, rates, np.array([True, True, False])).axes[0]
    front, beaten = line_of(ax, BLUE), line_of(ax, MUTED)
    np.testing.assert_allclose(front.get_xydata(), [[0.2, 70.0], [0.5, 90.0]])
    np.testing.assert_allclose(beaten.get_xydata(), [[0.6, 80.0]])
    bars = {tuple(np.round(path, 9).ravel()) for drawn in ax.collections for path in drawn.get_segments()}
    for (mean, low, high), (rate, least, most) in zip(spent, rates, strict=True):
        assert (low, rate, high, rate) in bars
        assert (mean, least, mean, most) in bars
    assert {text.get_text(): tuple(text.xy) for text in ax.texts} == {
        "x": (0.5, 90.0),
        "y": (0.2, 70.0),
        "z": (0.6, 80.0),
    }
    assert [text.get_text() for text in ax.get_legend().get_texts()] == [
        "beaten by another in both",
        "on the front",
    ]


@pytest.mark.parametrize(("count", "named"), [(12, 12), (13, 4)])
def test_of_many_settings_those_on_the_front_are_named(count, named):
    spent = np.repeat(np.arange(count)[:, np.newaxis] * 1.0, 3, axis=1)
    rates = np.repeat(np.arange(count)[::-1, np.newaxis] * 1.0, 3, axis=1)
    is_on_front = np.arange(count) % 4 == 0
    is_on_front[0] &= count == 12
    is_on_front[1] |= count == 13
    ax = front_of_runs([f"s{k}" for k in range(count)], spent, rates, is_on_front).axes[0]
    assert len(ax.texts) == (named if count == 12 else np.count_nonzero(is_on_front))


def test_names_that_would_overlap_are_written_below_or_not_at_all():
    near = np.array([[0.0, 0.0], [0.0, 0.0], [0.0, 0.0], [1.0, 1.0], [0.03, 0.03], [0.2, 0.2]])
    ax = front_of_runs(list("abcdef"), *(np.repeat(near[:, :1], 3, axis=1),) * 2, np.full(6, True)).axes[0]
    offsets = {text.get_text(): text.xyann for text in ax.texts}
    assert list(offsets) == ["a", "b", "d", "f"]
    above, below = offsets["a"][1], offsets["b"][1]
    assert below < 0 < above


def test_a_name_with_room_around_it_is_as_near_to_its_mark_as_names_come():
    (ax,) = compared([("one", [ControllerMark("law", (0.5, 0.1), (90.0, 3.0))])], 95.0).axes
    (name,) = ax.texts
    across, up = name.xyann
    # three letters, of which one is 4.3 points wide: its nearest edge is 9 points away
    assert np.hypot(max(abs(across) - 1.5 * 4.3, 0.0), up) == pytest.approx(9.0)
