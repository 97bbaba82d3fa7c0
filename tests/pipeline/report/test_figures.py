"""What the report's figures show, read back from their axes; and what is drawn of a tube."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.colors import to_rgba
from mpl_toolkits.mplot3d.art3d import Path3DCollection

from pipeline.report.figures.flights import METRICS, Sample, controls, distributions, tube_bounds
from pipeline.report.figures.style import BLUE, PALETTE, PURPLE, inline, save, style
from pipeline.report.figures.training import convergence
from pipeline.report.figures.trajectories import Tracks, trajectories, trajectories_apart
from tests.pipeline.recording import cases

TEN_MINUTES = "duration_s=600.0"
MISSION = cases.composed(TEN_MINUTES).experiment.mission


@pytest.fixture(autouse=True)
def _in_style():
    with style():
        yield


def test_force_and_torque_are_drawn_as_applied():
    log = cases.flown(TEN_MINUTES)
    force, turning, following = controls(log, MISSION).axes
    assert (force.get_xlabel(), force.get_ylabel()) == ("time (s)", "force (N)")
    for column, line in enumerate(force.lines[:3]):
        assert line.get_drawstyle() == "steps-post"
        np.testing.assert_array_equal(line.get_xdata(), 10.0 * np.arange(61))
        np.testing.assert_array_equal(line.get_ydata()[:-1], log.force_hill_n[:, column])
    assert turning.get_ylabel() == "torque (mN m)"
    for column in range(3):
        drawn = np.concatenate([ax.lines[column].get_ydata()[:-1] for ax in (turning, following)])
        np.testing.assert_array_equal(drawn, 1e3 * log.torque_b_n_m.reshape(-1, 3)[:, column])
    assert turning.lines[0].get_xdata()[-1] == following.lines[0].get_xdata()[0]
    # limits are lines where they are near, and words where they are far
    assert [text.get_text() for text in force.texts] == ["limits ± 1 N off scale"]
    assert [float(line.get_ydata()[0]) for line in turning.lines[3:]] == [-10.0, 10.0]


def around(radius: float, count: int = 61) -> np.ndarray:
    """A circle in the plane through the eye's direction and the vertical."""
    angle = np.linspace(0.0, 2.0 * np.pi, count)
    azimuth = np.radians(-52.0)
    across = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    return radius * (np.cos(angle)[:, None] * across + np.sin(angle)[:, None] * np.array([0.0, 0.0, 1.0]))


def test_the_chief_hides_what_is_behind_it():
    track = around(50.0)
    space = trajectories(Tracks(track[None], [BLUE], {}), MISSION).axes[0]
    lines = sorted((c for c in space.collections if hasattr(c, "_segments3d")), key=lambda c: c.get_zorder())
    behind, before = lines
    (sphere,) = [c for c in space.collections if c.get_zorder() == 3.0]
    assert behind.get_zorder() < sphere.get_zorder() < before.get_zorder()
    (level, up), (i, j) = ((np.cos(angle), np.sin(angle)) for angle in np.radians((24.0, -52.0)))
    eye = np.array([level * i, level * j, up])
    drawn = 0
    for collection, sign in ((behind, -1.0), (before, 1.0)):
        for piece in collection._segments3d:
            drawn += len(piece) - 1
            # a piece reaches to the first point on the other side
            assert np.all(sign * (np.asarray(piece)[:-1] @ eye) >= 0.0)
    assert drawn == len(track) - 1


@pytest.mark.parametrize("share", [0.4, 0.6])
def test_limits_are_lines_where_half_of_them_is_reached(share):
    log = cases.flown(TEN_MINUTES)
    limit = float(np.abs(log.force_hill_n).max()) / share
    force, *_ = controls(log, replace(MISSION, deputy=replace(MISSION.deputy, max_force_n=limit))).axes
    words = [text.get_text() for text in force.texts]
    if share < 0.5:
        assert words == [f"limits ± {limit:g} N off scale"]
    else:
        assert words == [f"limit {limit:g} N"]
        assert [float(line.get_ydata()[0]) for line in force.lines[3:]] == [-limit, limit]


def test_planes_and_distance_show_the_flights():
    tracks = np.stack([around(30.0), around(80.0)])
    _, orbit, across, distance = trajectories(Tracks(tracks, PALETTE[:2], {}), MISSION).axes
    for ax, axes in ((orbit, (1, 0)), (across, (1, 2))):
        for path, track in zip(ax.collections[0].get_segments(), tracks, strict=True):
            np.testing.assert_array_equal(path, track[:, axes])
    assert (orbit.get_xlabel(), orbit.get_ylabel()) == ("along-track j (m)", "radial i (m)")
    for path, radius in zip(distance.collections[0].get_segments(), (30.0, 80.0), strict=True):
        np.testing.assert_allclose(path[:, 1], radius)
        np.testing.assert_array_equal(path[:, 0], 10.0 * np.arange(61))
    assert [text.get_text() for text in distance.texts] == ["limit 15 m ", "limit 200 m "]


def test_starts_bear_their_numbers_and_share_a_label_where_they_coincide():
    tracks = np.stack([around(60.0), around(60.0) * (1.0, 1.0, -1.0), -around(60.0)])
    tracks[:, 0] += (0.0, 0.0, 5.0), (0.0, 0.0, -5.0), (0.0, 0.0, 0.0)
    space, orbit, across, _ = trajectories(Tracks(tracks, PALETTE[:3], {}), MISSION).axes
    assert [text.get_text() for text in space.texts] == ["0", "1", "2"]
    assert [text.get_text() for text in orbit.texts] == ["0, 1", "2"]
    assert [text.get_text() for text in across.texts] == ["0", "1", "2"]
    starts = tracks[:, 0]
    np.testing.assert_allclose([text.get_position_3d() for text in space.texts], starts)
    (dots,) = [drawn for drawn in space.collections if isinstance(drawn, Path3DCollection)]
    np.testing.assert_allclose(np.transpose(dots._offsets3d), starts)
    for ax, axes, shown in ((orbit, (1, 0), (0, 2)), (across, (1, 2), (0, 1, 2))):
        expected = [starts[case][list(axes)] for case in shown]
        np.testing.assert_allclose([text.get_position() for text in ax.texts], expected, atol=0.051)


def test_a_runaway_does_not_shrink_the_others_and_stands_apart_from_the_crowd():
    tracks = np.stack([around(radius) for radius in np.random.default_rng(1).uniform(50.0, 90.0, 60)])
    tracks[-1] = np.linspace((60.0, 0.0, 0.0), (5000.0, 0.0, 0.0), 61)
    groups = {"in": Tracks(tracks[:-1], [BLUE] * 59, {}), "out": Tracks(tracks[-1:], [PURPLE], {})}
    columns = np.array(trajectories_apart(groups, MISSION).axes).reshape(2, 3)
    for (space, orbit, distance), (title, group) in zip(columns, groups.items(), strict=True):
        assert [text.get_text() for text in space.texts] == [title]
        assert orbit.get_xlim()[1] <= 1.1 * MISSION.deputy.max_distance_m
        assert orbit.get_xlim() == columns[0, 1].get_xlim()
        lines = orbit.collections[0]
        assert len(lines.get_segments()) == len(group.positions_m)
        np.testing.assert_allclose(lines.get_colors()[0][:3], to_rgba(group.colours[0])[:3])
        assert len(distance.collections[0].get_segments()) == len(group.positions_m)
    crowd, lone = (column[1].collections[0] for column in columns)
    assert crowd.get_rasterized()
    assert lone.get_linewidths()[0] > 1.5 * crowd.get_linewidths()[0]


def values_of(count: int, delta_v: np.ndarray) -> dict[str, np.ndarray]:
    points = np.random.default_rng(2).integers(90, 100, count)
    return dict(zip(METRICS, (delta_v, 100.0 * points / 99.0, 66.0 + 0.1 * delta_v), strict=True))


def test_small_samples_show_each_value_and_large_ones_are_counted():
    few, many = np.linspace(1.0, 2.0, 8), np.random.default_rng(4).normal(1.5, 0.2, 500)
    paper = dict.fromkeys(METRICS, 5.0)
    samples = [Sample("few", values_of(8, few), paper), Sample("many", values_of(500, many), paper)]
    rows = np.array(distributions(samples, 99).axes).reshape(2, 3)
    (dots,) = [line for line in rows[0, 0].lines if line.get_marker() == "o"]
    np.testing.assert_array_equal(dots.get_xdata(), few)
    for ax in rows[1]:
        assert sum(bar.get_height() for bar in ax.patches) == 500
        assert ax.get_xlim()[0] <= min(bar.get_x() for bar in ax.patches)
        assert max(bar.get_x() + bar.get_width() for bar in ax.patches) <= ax.get_xlim()[1] + 1e-9
    # a bin for each possible count of points
    rates = values_of(500, many)["inspection_rate_percent"]
    counts, heights = np.unique(np.rint(rates * 0.99), return_counts=True)
    bars = {round((bar.get_x() + bar.get_width() / 2) * 0.99): bar.get_height() for bar in rows[1, 1].patches}
    assert [bars[int(count)] for count in counts] == heights.tolist()
    assert "paper 5 →" in [text.get_text() for text in rows[1, 0].texts]
    assert "← paper 5" in [text.get_text() for text in rows[1, 2].texts]
    assert [ax.get_xlabel() for ax in rows[1]] == list(METRICS.values())


def test_equal_values_stand_on_one_another():
    values = np.array([1.0, 2.0, 1.0, 3.0, 1.0, 2.0])
    ax = distributions([Sample("few", values_of(6, values), {})], 99).axes[0]
    (dots,) = [line for line in ax.lines if line.get_marker() == "o"]
    heights = np.asarray(dots.get_ydata())
    step = heights[2] - heights[0]
    assert step > 0.0
    np.testing.assert_allclose(heights, heights[0] + step * np.array([0, 0, 1, 0, 2, 1]))
    assert ax.get_ylim()[0] < heights.min()
    assert heights.max() < ax.get_ylim()[1]


def test_what_stands_far_apart_is_counted_beside_the_histogram():
    many = np.append(np.random.default_rng(4).normal(1.5, 0.2, 500), [40.0, 50.0])
    ax = distributions([Sample("many", values_of(502, many), {})], 99).axes[0]
    assert ax.get_xlim()[1] < 10.0
    assert "2 more →" in [text.get_text() for text in ax.texts]
    assert sum(bar.get_height() for bar in ax.patches) == 500
    # equal values make a picture all the same
    assert save(distributions([Sample("one", values_of(1, np.zeros(1)), {})], 99), "one", 40).png


def test_convergence_shows_the_logbook_and_the_rounds():
    history = {
        "round": np.array([0, 0, 0, 1, 1]),
        "best": np.array([1e6, 1e3, 5.0, 4.0, 3.0]),
        "mean": np.array([1e9, 1e7, 1e4, 50.0, 40.0]),
        "delta_v_m_s": np.array([9.0, 8.0, 5.0, 4.0, 3.0]),
        "points": np.array([50.0, 80.0, 97.0, 98.0, 99.0]),
        "outside": np.array([3.0, 1.0, 0.0, 0.0, 0.0]),
        "short": np.array([8.0, 5.0, 2.0, 0.0, 0.0]),
    }
    fitness, delta_v, points, flights = convergence(history, 99, 95).axes
    assert fitness.get_yscale() == "log"
    by_label = {line.get_label(): line.get_ydata() for ax in (fitness, flights) for line in ax.lines}
    labels = ("best", "mean of the population", "outside the distance limits", "short of 95 points")
    for label, name in zip(labels, ("best", "mean", "outside", "short"), strict=True):
        np.testing.assert_array_equal(by_label[label], history[name])
    np.testing.assert_array_equal(delta_v.lines[0].get_ydata(), history["delta_v_m_s"])
    np.testing.assert_array_equal(points.lines[0].get_ydata(), history["points"])
    assert fitness.yaxis.get_major_formatter()(1e-3) == "10⁻³"
    for ax in (fitness, delta_v, points, flights):
        assert [2.5, 2.5] in [list(line.get_xdata()) for line in ax.lines]


def test_an_svg_in_a_page_has_ids_of_its_own_and_takes_the_pages_colours():
    figure = distributions([Sample("id='x' \"fill: #0072b2\" <b>", values_of(8, np.arange(8.0)), {})], 99)
    picture = save(figure, "one", 40)
    first, second = inline(picture.svg, "one", 'a "b" <c>'), inline(picture.svg, "two", "d")
    assert first.startswith('<svg role="img" aria-label="a &quot;b&quot; &lt;c&gt;" viewBox=')
    assert not [word for word in ("metadata", "<!--", "DejaVu") if word in first]
    # words stay as they are
    for words in ("var(--blue)", '"fill: #0072b2" &lt;b&gt;', 'id="one-'):
        assert words in first
    assert 'id="two-' in second


def test_bounds_hold_corners_and_are_met_by_them() -> None:
    draw = np.random.default_rng(5)
    low, least = draw.uniform(-3.0, 3.0, (2, 24))
    high, greatest = low + draw.uniform(0.0, 2.0, 24), least + draw.uniform(0.0, 2.0, 24)
    step, axis = np.repeat(np.arange(6.0), 4), np.tile([0.0, 0.0, 1.0, 1.0], 6)
    shear = draw.uniform(-1.0, 1.0, 24)
    tube = {"step": step, "axis": axis, "low_m": low, "high_m": high, "shear_per_s": shear}
    results = tube_bounds(tube | {"least_m_s": least, "greatest_m_s": greatest})
    for k in range(6):
        boxes = [np.flatnonzero((step == k) & (axis == letter)) for letter in (0, 1)]
        distances, speeds = [], []
        for x in boxes[0]:
            for y in boxes[1]:
                # a fine grid of states of the two boxes, corners included
                grids = [np.linspace(low[i], high[i], 41) for i in (x, y)]
                leaning = [np.linspace(least[i], greatest[i], 3) for i in (x, y)]
                parts = zip((x, y), grids, leaning, strict=True)
                both = [np.subtract.outer(s, shear[i] * p) for i, p, s in parts]
                distances.append(np.hypot.outer(*grids))
                speeds.append(np.hypot.outer(both[0].ravel(), both[1].ravel()).max())
        assert results[0][k] <= np.min(distances) <= results[0][k] + 0.1
        assert np.isclose(np.max(distances), results[1][k])
        assert np.isclose(np.max(speeds), results[2][k])
