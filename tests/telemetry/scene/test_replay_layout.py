"""What `replay --save` writes, read back with rerun's own reader; no viewer and no graphics driver needed."""

import subprocess
import sys
import tempfile
from collections import Counter
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from rerun.chunk import RrdReader
from scipy.spatial.transform import Rotation

import telemetry
from plain_files import file_access
from telemetry import EpisodeWriter, RecordingError
from telemetry.file.recording import TopicColumns
from telemetry.scene import replay, viewer
from tests.telemetry import synthetic_flight
from tests.telemetry.scene.rrd_content import saved, views


@pytest.fixture(scope="module")
def content(flight_file, tmp_path_factory):
    return saved(replay.scene([flight_file]), tmp_path_factory.mktemp("replay"))


def test_rerun_finds_the_file_sound(content):
    command = [sys.executable, "-m", "rerun", "rrd", "verify", *map(str, content.paths)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)  # noqa: S603 - our own interpreter
    assert done.returncode == 0, done.stderr


def test_layout_holds_every_view_and_plays_the_flight_in_a_minute(content):
    (path,) = content.paths
    shown = list(views(path))
    kinds = Counter(kind for kind, _ in shown)
    assert kinds == {"3D": 2, "2D": 1, "TimeSeries": 9, "TextDocument": 3, "TextLog": 1}
    expected = """Flight, Hill frame | As the deputy sees it | Distance (m; limits 15, 200)
        | Inspected (%; goal 95) | Force, Hill axes (N; limit ±1) | Torque, body axes (mN m; limit ±10)
        | Delta-v (m/s) | Events | Outputs that were fired (N) | Inputs (m) | Inputs (rad) | Inputs (m/s)"""
    assert {title.strip() for title in expected.split("|")} <= {name for _, name in shown}
    reader = RrdReader(str(path))
    panel: dict[str, Any] = {}
    for chunk in reader.stream(store=reader.blueprints()[0]):
        if chunk.entity_path == "/time_panel":
            batch = chunk.to_record_batch()
            names = [name for name in batch.schema.names if name.startswith("TimePanelBlueprint:")]
            panel |= {name: batch.column(name).to_pylist()[0] for name in names}
    assert panel["TimePanelBlueprint:timeline"] == ["time"]
    assert panel["TimePanelBlueprint:playback_speed"] == [60.0]


def test_deputy_flies_where_it_flew(flight, content):
    deputy = "/scene/deputy"
    np.testing.assert_allclose(content.times(deputy, "Transform3D:translation"), flight.time_s)
    translation = content.numbers(deputy, "Transform3D:translation")[:, 0]
    np.testing.assert_allclose(translation, flight.position_m, rtol=1e-6, atol=1e-5)
    quaternion = content.numbers(deputy, "Transform3D:quaternion")[:, 0]
    np.testing.assert_allclose(quaternion, flight.quaternion, atol=1e-6)


def test_field_of_view_reaches_the_chief(flight, content):
    """The drawn rim, in Hill axes, lies 15 degrees off the line to the chief and goes around its centre."""
    k, strips = 90, content.column("/scene/deputy/camera/view", "LineStrips3D:strips")[0]
    rim = np.array(strips[-1])
    rim_body = content.numbers("/scene/deputy/camera", "Transform3D:scale")[k, 0] * rim
    rim_hill = flight.position_m[k] + Rotation.from_quat(flight.quaternion[k]).apply(rim_body)
    np.testing.assert_allclose(rim_hill.mean(axis=0), 0.0, atol=4.0)
    line, to_chief = rim_hill - flight.position_m[k], -flight.position_m[k]
    cosine = line @ to_chief / np.linalg.norm(line, axis=1) / np.linalg.norm(to_chief)
    np.testing.assert_allclose(np.degrees(np.arccos(cosine)), 15.0, atol=1e-3)


@pytest.mark.parametrize("unknown", ["half_angle_rad", "boresight"])
def test_a_camera_of_which_something_is_not_known_is_not_drawn(unknown, short_flight, tmp_path):
    metadata = synthetic_flight.metadata(short_flight)
    episode = {name: value for name, value in metadata["episode"].items() if name != unknown}
    path = tmp_path / "flight.mcap"
    synthetic_flight.record(short_flight, path, metadata=metadata | {"episode": episode})
    shown = saved(replay.scene([path]), tmp_path).batches
    assert "/scene/deputy/axes" in shown
    assert not any(name.startswith("/scene/deputy/camera") for name in shown)


def test_a_flight_of_one_control_period_is_drawn(tmp_path):
    flight = synthetic_flight.fly(1)
    path = synthetic_flight.record(flight, tmp_path / "flight.mcap")
    content = saved(replay.scene([path]), tmp_path)
    np.testing.assert_allclose(content.times("/scene/deputy", "Transform3D:translation"), flight.time_s)


def test_points_wear_the_colours_of_their_states(flight, content):
    colours = content.column("/scene/chief/points", "Points3D:colors")
    inspected = int.from_bytes(bytes((0, 190, 130, 255)), "big")
    for k in (0, 180, 360):
        assert [colour == inspected for colour in colours[k]] == flight.inspected[k].tolist()
    positions = np.array(content.column("/scene/chief/points", "Points3D:positions")[0])
    np.testing.assert_allclose(positions, flight.points_m, atol=1e-5)


def test_sun_target_and_force_are_arrows(flight, content):
    sun, angle = content.numbers("/scene/sun", "Arrows3D:vectors")[:, 0], flight.sun_angle_rad
    expected = np.column_stack((np.cos(angle), np.sin(angle), 0 * angle))
    np.testing.assert_allclose(sun / np.linalg.norm(sun, axis=1, keepdims=True), expected, atol=1e-6)
    target = content.numbers("/scene/target", "Arrows3D:vectors")[:, 0]
    np.testing.assert_allclose(target / 16.0, flight.target_direction, atol=1e-6)
    force = content.numbers("/scene/force", "Arrows3D:vectors")[:, 0]
    strength = np.linalg.norm(flight.force_hill_n, axis=1).max()
    np.testing.assert_allclose(force, 25.0 * flight.force_hill_n / strength, atol=1e-5)
    origin = content.numbers("/scene/force", "Arrows3D:origins")[:, 0]
    np.testing.assert_allclose(origin, flight.position_m[:-1], atol=1e-4)


def test_curves_and_shells_are_the_flights(flight, content):
    scalars = "Scalars:scalars"
    for curve, expected in {
        "force/applied": flight.force_hill_n,
        "torque/applied": 1e3 * flight.torque_n_m.reshape(-1, 3),
        "delta_v/flight_0": flight.delta_v_m_s[:, np.newaxis],
        "rate/flight_0": 100.0 * flight.inspected.sum(axis=1, keepdims=True) / 99,
        "fis_outputs/system_1": flight.fis_output_n[1][:, np.newaxis],
        "rate/goal": [[95.0], [95.0]],
        "distance/limit_200": [[200.0], [200.0]],
    }.items():
        shown = content.numbers(f"/curves/{curve}", scalars)
        np.testing.assert_allclose(shown, expected, rtol=1e-7, atol=1e-6 if "torque" in curve else 0)
    np.testing.assert_allclose(content.times("/curves/torque/applied", scalars), np.arange(3600.0))
    for name, radius in (("nearest", 15.0), ("farthest", 200.0)):
        assert content.column(f"/scene/limits/{name}", "Ellipsoids3D:half_sizes")[0][0] == [radius] * 3


def test_rules_are_told_in_words_at_each_instant(flight, content):
    words = content.column("/rules/words", "TextDocument:text")
    assert len(words) == 361
    strongest = int(np.argmax(flight.firing_strengths[0, 50]))
    strength = flight.firing_strengths[0, 50, strongest]
    assert f"rule {strongest + 1} ({strength:.2f}): if distance is " in words[50][0]
    assert "No inference" in words[360][0]


def test_trail_and_events_are_there(content):
    assert len(content.column("/scene/flights/0/trail", "LineStrips3D:strips")) == 360
    events = [text for (text,) in content.column("/events", "TextLog:text")]
    assert events == ["1180 s: 50 of 99 points inspected", "2260 s: 95 of 99 points inspected"]


def test_flights_are_laid_over_each_other(flight, flight_file, short_flight, short_file, tmp_path):
    content = saved(replay.scene([flight_file, short_file]), tmp_path)
    positions = content.numbers("/scene/flights/1/deputy", "Points3D:positions")[:, 0]
    np.testing.assert_allclose(positions, short_flight.position_m, atol=1e-4)
    assert content.column("/curves/distance/flight_1", "SeriesLines:names") == [["short"]]
    for index, name in enumerate(("flight", "short")):
        assert content.column(f"/scene/flights/{index}/deputy", "Points3D:labels") == [[name]]
    colours = [content.column(f"/scene/flights/{i}/trail", "LineStrips3D:colors") for i in (0, 1)]
    assert colours[0] != colours[1]
    assert [text for (text,) in content.column("/events", "TextLog:text")] == [
        "1180 s: flight: 50 of 99 points inspected",
        "1180 s: short: 50 of 99 points inspected",
        "2260 s: flight: 95 of 99 points inspected",
    ]
    ((summary,),) = content.column("/summary", "TextDocument:text")
    assert f"| flight | 97 | {flight.delta_v_m_s[-1]:.3f} |" in summary
    assert len(content.column("/curves/delta_v/flight_1", "Scalars:scalars")) == 131


@pytest.mark.parametrize(
    ("metadata_kinds", "missing"), [(["episode"], "/rules/words"), ([], "/scene/limits/nearest")]
)
def test_a_flight_is_shown_without_fuzzy_systems_or_any_words_on_it(metadata_kinds, missing, tmp_path):
    flight, path = synthetic_flight.fly(4), tmp_path / "coast.mcap"
    metadata = {name: synthetic_flight.metadata(flight)[name] for name in metadata_kinds}
    with EpisodeWriter(path, metadata=metadata, attachments={}) as writer:
        synthetic_flight.write_state(writer, flight, slice(None))
    entities = saved(replay.scene([path]), tmp_path).batches
    assert "/scene/deputy" in entities
    assert missing not in entities
    assert "2D" not in {kind for kind, _ in views(tmp_path / "x.rrd")}


def test_a_recording_without_a_flight_is_refused(tmp_path):
    with EpisodeWriter(tmp_path / "empty.mcap", metadata={}, attachments={}):
        pass
    with pytest.raises(RecordingError, match="holds no messages on /deputy/state, /mission"):
        saved(replay.scene([tmp_path / "empty.mcap"]), tmp_path)
    assert not (tmp_path / "x.rrd").exists()


def test_an_impossible_output_and_a_full_disk_are_said(short_file, tmp_path, monkeypatch):
    def flush(_stream):
        raise RuntimeError("File-writer thread shut down prematurely")

    with pytest.raises(RecordingError, match=r"nowhere/x\.rrd cannot be written: No such file"):
        saved(replay.scene([short_file]), tmp_path / "nowhere")

    def create_full(path):
        path.symlink_to("/dev/full")  # a file that takes no byte
        return path.open("wb")

    with monkeypatch.context() as patch:
        patch.setattr(file_access, "create", create_full)
        # the library's own writer sometimes waits for ever for room
        patch.delattr("rerun.RecordingStream.save")
        with pytest.raises(RecordingError, match=r"x\.rrd cannot be written: No space left .* free space"):
            saved(replay.scene([short_file]), tmp_path)
    assert list(tmp_path.iterdir()) == []
    monkeypatch.setattr("rerun.RecordingStream.flush", flush)
    with pytest.raises(RecordingError, match=r"x\.rrd cannot be written: File-writer .* free space"):
        saved(replay.scene([short_file]), tmp_path)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("in_browser", "code"), [(False, 7), (True, 8)])
def test_a_viewer_that_fails_is_said_and_only_a_browser_gets_a_page(
    short_file, monkeypatch, *, in_browser, code
):
    script = "import sys; sys.exit(8 if '--web-viewer' in sys.argv else 7)"
    monkeypatch.setattr("telemetry.scene.viewer._RERUN", (sys.executable, "-c", script))
    monkeypatch.setenv("DISPLAY", ":0")
    message = f"the viewer ended with exit code {code}; see its message above; write a file"
    with pytest.raises(RecordingError, match=message):
        viewer.show(replay.scene([short_file]), in_browser=in_browser)


def test_a_viewer_that_is_too_slow_is_said(monkeypatch):
    monkeypatch.setattr("telemetry.scene.viewer._START_LIMIT_S", 0.0)
    monkeypatch.setattr("telemetry.scene.viewer._RERUN", (sys.executable, "-c", "import time; time.sleep(9)"))
    with (
        tempfile.TemporaryFile() as log,
        pytest.raises(RecordingError, match="not ready within 0 s; end what else keeps this machine busy"),
        viewer.started(log=log),
    ):
        pass


@pytest.mark.parametrize(
    ("names", "text"),
    [
        (["none.mcap"], "none.mcap cannot be opened: No such file"),
        (["a.yaml"], "not an MCAP file"),
        ([], r"no display.*--web.*--save FILE\.rrd"),
    ],
)
def test_a_wrong_path_is_told_before_a_missing_display(tmp_path, monkeypatch, short_file, names, text):
    monkeypatch.setattr("sys.platform", "linux")
    for variable in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(variable, raising=False)
    (tmp_path / "a.yaml").write_text("kind: mamdani\n")
    with pytest.raises(RecordingError, match=text):
        viewer.show(replay.scene([short_file, *(tmp_path / name for name in names)]), in_browser=False)


def test_points_glow_by_how_much_they_add(short_file, tmp_path, monkeypatch):
    """From 100 s on point 3 adds most to an input, point 5 a quarter of that; until then none adds any."""
    flight = telemetry.read(short_file)
    parts = np.zeros((2, 99))
    parts[1, [3, 5]] = -0.04, 0.01
    pulls = {"position_m": np.zeros((2, 99, 3)), "aim": parts, "calm": np.zeros((2, 99))}
    cloud = TopicColumns("/chief/pulls", "foxglove.PointCloud", np.array([50.0, 100.0]), pulls, {})
    metadata = {**flight.metadata, "pulls": {"aim": "m/s", "calm": ""}}
    pulled = replace(flight, topics={**flight.topics, "/chief/pulls": cloud}, metadata=metadata)
    monkeypatch.setattr(replay, "read", lambda path: pulled)
    shown = saved(replay.scene([short_file]), tmp_path)
    sizes = shown.numbers("/scene/chief/points", "Points3D:radii")
    np.testing.assert_allclose(sizes[:10], 0.75, rtol=1e-5)
    np.testing.assert_allclose(sizes[10:, 3], 1.5, rtol=1e-5)
    np.testing.assert_allclose(sizes[10:, 5], 0.75 * 1.25, rtol=1e-5)
    np.testing.assert_allclose(np.delete(sizes, [3, 5], axis=1), 0.75, rtol=1e-5)
    colours = shown.numbers("/scene/chief/points", "Points3D:colors").astype(np.uint32)
    plain = flight["/chief/points"]["colour_rgba"].astype(np.uint32)
    np.testing.assert_array_equal(colours[:, 0] >> 24, plain[:, 0, 0])
    assert np.all(colours[10:, 3] >> 24 > plain[10:, 3, 0])


def test_a_flight_with_an_epoch_is_shown_with_its_date(tmp_path):
    flight = synthetic_flight.fly(4)
    metadata = synthetic_flight.metadata(flight)
    metadata["episode"]["epoch"] = "2026-11-26T12:00:00"
    path = synthetic_flight.record(flight, tmp_path / "dated.mcap", metadata=metadata)
    content = saved(replay.scene([path]), tmp_path)
    (batch,) = content.batches["/scene/deputy"]
    dates = batch.column("date").cast("timestamp[ns]").to_numpy()
    expected = np.datetime64("2026-11-26T12:00:00") + np.arange(0, 50, 10).astype("timedelta64[s]")
    np.testing.assert_array_equal(dates, expected)
    (words,) = content.column("/summary", "TextDocument:text")
    assert "| start | 2026-11-26 12:00:00 UTC |" in words[0]
