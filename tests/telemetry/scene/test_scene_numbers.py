"""Numbers of a replay: curves and their axes, arrows, paths, pulls and layouts, each computed by hand."""

from dataclasses import replace
from types import MappingProxyType

import numpy as np
import pytest
from rerun.chunk import RrdReader

import telemetry
from telemetry.file import topics
from telemetry.file.recording import TopicColumns
from telemetry.scene import campaign, curves, drawing, replay, runs
from tests.telemetry import synthetic_flight
from tests.telemetry.scene.rrd_content import saved

#: properties of views and containers
READ = {
    *("ContainerBlueprint:row_shares", "ContainerBlueprint:col_shares", "VisualBounds2D:range"),
    *("TimeAxis:view_range", "EyeControls3D:position", "EyeControls3D:eye_up", "EyeControls3D:look_target"),
}


@pytest.fixture(scope="module")
def recording(flight_file):
    return telemetry.read(flight_file)


@pytest.fixture(scope="module")
def content(flight_file, tmp_path_factory):
    return saved(replay.scene([flight_file]), tmp_path_factory.mktemp("numbers"))


@pytest.fixture(scope="module")
def layout(content):
    """The values of `READ` in all views and containers."""
    reader, values = RrdReader(str(content.paths[0])), {}
    for chunk in reader.stream(store=reader.blueprints()[0]):
        batch = chunk.to_record_batch()
        for name in READ & {*batch.schema.names}:
            values.setdefault(name, []).extend(batch.column(name).to_pylist()[:1])
    return values


def within(axis, values):
    """The share of an axis that values take, and the room below and above."""
    low, high = np.min(values), np.max(values)
    length = axis[1] - axis[0]
    return (high - low) / length, (low - axis[0]) / length, (axis[1] - high) / length


def test_axes_hold_curves_and_limits_with_a_little_room(recording):
    colours = [curves.PLAIN_COLOUR]
    for plot in (*curves.mission_plots([recording], colours), *curves.effort_plots(recording)):
        values = np.concatenate([each.values.ravel() for each in plot.curves])
        if plot.key in ("distance", "rate"):
            values = np.append(values, 0.0)
        share, below, above = within(plot.ends, values)
        assert share > 0.35, plot.key
        assert below > 0.03, plot.key
        assert above > 0.03, plot.key


def test_mission_curves_are_those_of_the_flight(flight, recording):
    distance, rate, spent = curves.mission_plots([recording], [(1, 2, 3)])
    (flown, nearest, farthest), (seen, goal), (burnt,) = (plot.curves for plot in (distance, rate, spent))
    for curve, expected, in_steps in (
        (flown, np.full(361, 75.0), False),
        (seen, 100.0 * flight.inspected.sum(axis=1) / 99.0, True),
        (burnt, flight.delta_v_m_s, False),
    ):
        np.testing.assert_allclose(curve.values[:, 0], expected, rtol=1e-6)
        np.testing.assert_array_equal(curve.instants, flight.time_s)
        assert (curve.colours, curve.in_steps) == (((1, 2, 3),), in_steps)
    for curve, value in ((nearest, 15.0), (farthest, 200.0), (goal, 95.0)):
        assert curve.values.tolist() == [[value], [value]]
        assert curve.instants.tolist() == [0.0, 3600.0]
        assert curve.width < flown.width
    assert [plot.has_legend for plot in (distance, rate, spent)] == [False] * 3
    assert curves.mission_plots([recording, recording], [(1, 2, 3)] * 2)[2].has_legend


@pytest.mark.parametrize(
    ("largest", "ends"), [(0.5, 10), (0.2, 1), (0.3, 1), (0.31, 10), (1.0, 1), (4.0, 10)]
)
def test_an_axis_ends_where_labels_at_powers_of_ten_lie_on_it(recording, largest, ends):
    """Up to three of them, else the next power: the viewer writes no others."""
    mission = recording[topics.MISSION]
    spent = np.linspace(0.0, largest, len(mission))
    changed = replace(mission, columns={**mission.columns, "delta_v_m_s": spent})
    shown = replace(recording, topics={**recording.topics, topics.MISSION: changed})
    axis = curves.mission_plots([shown], [(0, 0, 0)])[2].ends
    power = {0.5: 0.1, 0.2: 0.1, 0.3: 0.1, 0.31: 0.1, 1.0: 1.0, 4.0: 1.0}[largest]
    reach = 1.08 * (largest if ends == 1 else 10.0 * power)
    assert axis == pytest.approx((-0.12 * reach, 1.1 * reach))


@pytest.mark.parametrize("share", [0.2, 0.3, 1e-6])
def test_limits_are_drawn_where_a_quarter_of_them_is_reached(recording, share):
    largest = float(np.abs(recording[topics.DEPUTY_CONTROL]["force_hill_n"]).max())
    (applied,) = curves.effort_plots(recording)[0].curves[:1]
    force = curves._with_limits("force", "F (N", applied, largest / share)
    assert force.title == f"F (N; limit ±{largest / share:g})"
    flown, *limits = force.curves
    if share < 0.25:
        assert limits == []
        assert force.ends[1] >= 1.08 * max(largest, 1e-3 * largest / share)
        assert force.ends[0] == -force.ends[1]
    else:
        assert [each.values[0, 0] for each in limits] == pytest.approx([largest / share, -largest / share])
        assert force.ends == pytest.approx((-1.1 * largest / share, 1.1 * largest / share))
        assert limits[0].instants[-1] == flown.instants[-1]


def test_signals_of_each_unit_are_in_a_plot_with_what_was_fired_first(flight, recording):
    outputs, *inputs = curves.fis_plots(recording)
    reach = np.abs(flight.fis_output_n).max()
    power = 10.0 ** np.floor(np.log10(reach))
    end = 1.08 * reach if reach <= 3.0 * power else 10.8 * power
    assert outputs.ends == pytest.approx((-end, end), rel=1e-6)
    for index, curve in enumerate(outputs.curves):
        np.testing.assert_allclose(curve.values[:, 0], flight.fis_output_n[index], rtol=1e-6)
        np.testing.assert_array_equal(curve.instants, flight.time_s[:-1])
        assert curve.labels == (synthetic_flight.FIS_NAMES[index],)
    assert len({curve.colours for curve in outputs.curves}) == 3
    assert [plot.title for plot in inputs] == ["Inputs (m)", "Inputs (m/s)", "Inputs (rad)"]
    systems = {
        "Inputs (m)": [(0, 0)],
        "Inputs (m/s)": [(0, 1), (1, 1), (2, 1)],
        "Inputs (rad)": [(1, 0), (2, 0)],
    }
    for plot in inputs:
        assert len({curve.colours for curve in plot.curves}) == len(plot.curves)
        for curve, (system, column) in zip(plot.curves, systems[plot.title], strict=True):
            np.testing.assert_allclose(curve.values[:, 0], flight.fis_inputs[system, :, column], rtol=1e-6)


def test_arrows_start_outside_the_chief_and_point_away(flight, content):
    angle = flight.sun_angle_rad
    sun = np.column_stack((np.cos(angle), np.sin(angle), 0.0 * angle))
    for name, direction, origin, length in (
        ("sun", sun, 16.0, 60.0),
        ("target", flight.target_direction, 10.0, 16.0),
    ):
        origins, vectors = (
            content.numbers(f"/scene/{name}", f"Arrows3D:{part}")[:, 0] for part in ("origins", "vectors")
        )
        np.testing.assert_allclose(origins, origin * direction, atol=1e-4)
        np.testing.assert_allclose(vectors, length * direction, atol=1e-4)
        tips = content.numbers(f"/scene/{name}/tip", "Points3D:positions")[:, 0]
        np.testing.assert_allclose(tips, (origin + length) * direction, atol=1e-4)


def test_the_sun_s_arrow_is_the_shorter_the_more_the_earth_hides(
    recording, short_file, tmp_path, monkeypatch
):
    mission = recording[topics.MISSION]
    hidden = np.linspace(0.0, 1.0, len(mission))
    changed = replace(mission, columns={**mission.columns, "sun_hidden_share": hidden})
    shaded = replace(recording, topics={**recording.topics, topics.MISSION: changed})
    monkeypatch.setattr(replay, "read", lambda _: shaded)
    vectors = saved(replay.scene([short_file]), tmp_path).numbers("/scene/sun", "Arrows3D:vectors")[:, 0]
    np.testing.assert_allclose(np.linalg.norm(vectors, axis=1), 60.0 - 48.0 * hidden, rtol=1e-5)


def test_a_trail_has_a_piece_from_each_sample_to_the_next(flight, content):
    entity = "/scene/flights/0/trail"
    pieces = np.array(content.column(entity, "LineStrips3D:strips"), dtype=np.float64)[:, 0]
    expected = np.stack([flight.position_m[:-1], flight.position_m[1:]], axis=1)
    np.testing.assert_allclose(pieces, expected, atol=1e-4)
    np.testing.assert_allclose(content.times(entity, "LineStrips3D:strips"), flight.time_s[1:])
    (whole,) = content.column(f"{entity}_ahead", "LineStrips3D:strips")[0]
    np.testing.assert_allclose(whole, flight.position_m, atol=1e-4)


def test_the_deputy_s_camera_and_axes_have_their_sizes(content):
    scale = content.numbers("/scene/deputy/camera", "Transform3D:scale")[:, 0]
    np.testing.assert_allclose(scale, np.full((361, 3), 75.0), rtol=1e-5)
    axes = content.column("/scene/deputy/axes", "Arrows3D:vectors")[0]
    np.testing.assert_allclose(np.array(axes) / np.linalg.norm(axes[0]), np.eye(3), atol=1e-7)
    half = np.array(content.column("/scene/deputy/body", "Boxes3D:half_sizes")[0])
    assert np.ptp(half) == 0.0
    assert half.max() < np.linalg.norm(axes[0])
    radii = content.column("/scene/chief/points", "Points3D:radii")[0]
    np.testing.assert_allclose(radii, 0.75, rtol=1e-6)
    body = np.array(content.column("/scene/chief/body", "Ellipsoids3D:half_sizes")[0])
    assert np.all((body > 9.0) & (body < 10.0))  # inside the points


def test_views_share_a_window_and_show_the_whole_flight(layout):
    for name in ("row_shares", "col_shares"):
        for shares in layout[f"ContainerBlueprint:{name}"]:
            assert shares is None or sum(
                shares[0] if isinstance(shares[0], list) else shares
            ) == pytest.approx(100.0)
    ends_s = sorted(each[0]["end"] / 1e9 for each in layout["TimeAxis:view_range"])
    assert {each[0]["start"] for each in layout["TimeAxis:view_range"]} == {0}
    # with room for a legend, which names signals in some
    assert all(3600.0 * 1.03 < end_s < 3600.0 * 1.6 for end_s in ends_s)
    close, around = sorted((np.array(eye[0]) for eye in layout["EyeControls3D:position"]), key=np.linalg.norm)
    np.testing.assert_allclose(close / np.linalg.norm(close), [1.0, 0.0, 0.0], atol=1e-6)  # against its sight
    assert 20.0 < np.linalg.norm(close) < 50.0
    assert 1.5 * 75.0 < np.linalg.norm(around) < 2.5 * 75.0
    np.testing.assert_allclose(np.array(layout["EyeControls3D:eye_up"]).reshape(-1, 3), [[0.0, 0.0, 1.0]] * 2)
    np.testing.assert_allclose(np.array(layout["EyeControls3D:look_target"]).reshape(-1, 3), np.zeros((2, 3)))
    ((bounds,),) = layout["VisualBounds2D:range"]
    (left, right), (top, bottom) = bounds["x_range"], bounds["y_range"]
    # around the map the same room on each side, but left of it that for names
    assert 0.0 < right - 1000.0 == -top == bottom - 640.0 < 40.0
    assert left == -260.0


def test_names_of_systems_stand_left_of_their_bands(content):
    names = content.column("/rules/map/names", "Points2D:labels")[0]
    positions = np.array(content.column("/rules/map/names", "Points2D:positions")[0])
    assert names == list(synthetic_flight.FIS_NAMES)
    # three bands with two gaps
    height = (640 - 2 * 14) / 3
    np.testing.assert_allclose(positions[:, 0], -130.0)
    np.testing.assert_allclose(positions[:, 1], height / 2 + np.arange(3) * (height + 14), atol=1.0)


def test_the_map_has_a_band_a_system_with_gaps_between(flight, recording):
    image, _ = drawing.activation_map(recording, flight.time_s)
    assert image.shape == (640, 1000)
    height = (640 + 14) // 3 - 14
    for band in range(3):
        top = band * (height + 14)
        assert not image[top + height : top + height + 14].any()
        for rule in range(25):
            row = top + int((rule + 0.5) * height / 25)
            for column in (0, 321, 640, 999):
                sample = column * 361 // 1000
                strength = flight.firing_strengths[band, :, rule][sample] if sample < 360 else 0.0
                assert image[row, column] == pytest.approx(255.0 * strength, abs=0.51)


def test_points_pull_by_their_largest_share_of_any_input(recording):
    parts = np.zeros((3, 99))
    parts[0, 2], parts[1, [3, 5]], parts[2, 3] = 0.02, (-0.04, 0.01), 0.01
    other = np.zeros((3, 99))
    other[2, 7], other[1, 3] = 3.0, 1.5
    fields = {"aim": parts, "turn": other, "position_m": np.zeros((3, 99, 3))}
    cloud = TopicColumns(topics.CHIEF_PULLS, "x", np.array([5.0, 20.0, 30.0]), fields, {})
    metadata = {**recording.metadata, topics.PULLS_METADATA: MappingProxyType({"aim": "", "turn": ""})}
    pulled = replace(recording, topics={**recording.topics, topics.CHIEF_PULLS: cloud}, metadata=metadata)
    pulls = drawing.pulls(pulled, np.array([0.0, 5.0, 29.0, 30.0, 99.0]))
    expected = np.zeros((5, 99))
    expected[1, 2] = 0.5
    expected[2, [3, 5]] = 1.0, 0.25
    expected[3:, [3, 7]] = 0.25, 1.0
    np.testing.assert_allclose(pulls, expected)
    assert drawing.pulls(recording, np.array([0.0])) is None


@pytest.mark.parametrize(
    ("force", "words"),
    [
        ((0.0, 0.0, 0.02), "20 mN along the orbit normal"),
        ((-0.03, 0.0, 0.04), "50 mN along the orbit normal and inwards"),
        ((0.04, -0.03, 0.0041), "50.2 mN outwards, backwards and along the orbit normal"),
        ((0.04, -0.03, 0.0039), "50.2 mN outwards and backwards"),
    ],
)
def test_forces_are_worded_by_their_components(force, words):
    assert drawing._force(np.array(force)) == words


def test_a_cone_has_a_ray_every_third_of_its_rim():
    *rays, rim = drawing.view_cone((0.0, 1.0, 0.0), 0.2)
    assert (len(rays), len(rim)) == (8, 25)
    np.testing.assert_allclose(np.array([ray[1] for ray in rays]), rim[:-1:3])
    turns = np.diff(np.unwrap(np.arctan2(rim[:, 0], rim[:, 2])))
    np.testing.assert_allclose(np.abs(turns), 2.0 * np.pi / 24.0)


def test_long_events_take_several_rows_that_fit(recording):
    words = " ".join(["ten points"] * 12)
    log = TopicColumns(
        topics.LOG,
        "x",
        np.array([9.6, 4.0]),
        {"level": np.array(["info", "warning"]), "message": np.array([words, "near"])},
        {},
    )
    noted = replace(recording, topics={**recording.topics, topics.LOG: log})
    rows = drawing.events_in_words([noted], ["flight"])
    assert rows[0] == (4.0, "WARNING", "4 s: near")
    assert len(rows) > 2
    assert all(len(text) <= 62 for _, _, text in rows)
    assert " ".join(" ".join(text for _, _, text in rows[1:]).split()) == f"10 s: {words}"
    assert all(text.startswith(" " * 8) for _, _, text in rows[2:])


def test_the_summary_of_a_flight_has_its_numbers(flight, recording):
    lines = drawing.flights_in_words([recording], ["flight"]).splitlines()
    rows = dict(line.strip("| ").split(" | ") for line in lines if line.startswith("| "))
    assert rows["flight"] == "flight"
    assert rows["inspected"] == f"{flight.inspected[-1].sum()} of 99 points"
    assert rows["delta-v"] == f"{flight.delta_v_m_s[-1]:.3f} m/s"
    assert rows["distance"] == "75.0 to 75.0 m"
    assert rows["duration"] == "3600 s"
    assert rows["scenario"] == "circle-0"


def evaluation_of(surroundings, *, are_known=True):
    """Three cases of four samples on lines along the first axis."""
    distances = np.array([[50.0, 40.0, 30.0, 20.0], [60.0, 70.0, 80.0, 90.0], [55.0, 55.0, 55.0, 56.0]])
    positions = np.zeros((3, 4, 3), dtype=np.float32)
    positions[:, :, 0] = distances
    episodes = {"delta_v_m_s": np.array([0.2, 0.5, 0.3]), "inspected_count": np.array([99, 98, 40])}
    episodes |= {"inspection_rate_percent": np.array([100.0, 99.0, 40.4])}
    episodes |= {"success": np.array([True, True, False]), "violated": np.array([False, True, False])}
    return runs.EvaluatedCases(
        "run", np.array([4, 5, 9]), positions, episodes if are_known else {}, surroundings
    )


def test_extremes_are_labelled_where_they_are():
    around = runs.Surroundings(10.0, 15.0, 85.0, 95.0, 10.0)
    shown = campaign.extremes(evaluation_of(around))
    assert [(each.what, each.row, each.sample, each.label.partition(": ")[2]) for each in shown] == [
        ("nearest", 0, 3, "case 4, 20.0 m"),
        ("farthest", 1, 3, "case 5, 90.0 m"),
        ("most delta-v", 1, 3, "case 5, 0.500 m/s"),
        ("least inspected", 2, 3, "case 9, 40 points"),
    ]
    assert len(campaign.extremes(evaluation_of(replace(around, threshold_percent=None)))) == 3
    assert len(campaign.extremes(evaluation_of(around, are_known=False))) == 2


def test_outcomes_of_cases_are_counted_and_spread():
    around = runs.Surroundings(10.0, 15.0, 85.0, 95.0, 10.0)
    lines = campaign.in_words(evaluation_of(around)).splitlines()
    rows = dict(line.strip("| ").split(" | ") for line in lines if line.startswith("| "))
    assert rows["cases"] == "3"
    assert rows["green: success, 95 % inspected"] == "1 (33.3 %)"
    assert rows["orange: short of 95 %"] == "1 (33.3 %)"
    assert rows["red: outside 15 to 85 m"] == "1 (33.3 %)"
    spent = np.std([0.2, 0.5, 0.3], ddof=1)
    assert rows["delta-v"] == f"0.333 ± {spent:.3f} m/s, 0.200 to 0.500"
    assert rows["inspected"].startswith("79.8 ± ")
    assert rows["nearest"] == "case 4, 20.0 m"


def test_the_spread_of_distances_is_over_cases_at_each_time():
    plot = campaign.distance_plot(evaluation_of(runs.Surroundings(10.0, 15.0, 120.0)))
    spread, nearest, farthest = plot.curves
    np.testing.assert_allclose(spread.instants, [0.0, 10.0, 20.0, 30.0])
    expected = [[60.0, 55.0, 50.0], [70.0, 55.0, 40.0], [80.0, 55.0, 30.0], [90.0, 56.0, 20.0]]
    np.testing.assert_allclose(spread.values, expected)
    assert [each.values.tolist() for each in (nearest, farthest)] == [[[15.0]] * 2, [[120.0]] * 2]
    assert nearest.instants.tolist() == [0.0, 30.0]
    assert plot.ends == pytest.approx((0.0, 126.0))
    # without a period times are numbers of samples
    np.testing.assert_allclose(evaluation_of(runs.Surroundings()).time_s, np.arange(4.0))
