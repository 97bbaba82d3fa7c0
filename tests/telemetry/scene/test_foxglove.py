"""Foxglove: its libraries decode every message as we do; the layout asks for nothing that is not there."""

import json
import re
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

import telemetry
from telemetry import EpisodeWriter
from telemetry.file import topics
from tests.places import PROJECT
from tests.programs import installed, program
from tests.telemetry import synthetic_flight

pytestmark = pytest.mark.slow

READER = Path(__file__).parent / "foxglove_reader"
FOLDER = PROJECT / "docs" / "foxglove"
LAYOUT = FOLDER / "inspection.json"
layout = json.loads(LAYOUT.read_text(encoding="utf-8"))
MESSAGE_PATH = re.compile(r"(?P<topic>(?:/\w+)+)\.(?P<field>\w+)(?:\[(?P<index>\d+)\])?")


@pytest.fixture(scope="module")
def flown():
    return synthetic_flight.fly(20)


@pytest.fixture(scope="module")
def recorded(flown, tmp_path_factory):
    path = tmp_path_factory.mktemp("foxglove") / "flight.mcap"
    with EpisodeWriter(path, metadata=synthetic_flight.metadata(flown), attachments={}) as writer:
        synthetic_flight.write_samples(writer, flown, range(21))
        writer.log(200.0, "warning", "the end")
    return path


@pytest.fixture(scope="module")
def recording(recorded):
    return telemetry.read(recorded)


def panels(node: Any) -> Iterator[str]:
    if isinstance(node, str):
        yield node
    else:
        assert node["direction"] in ("row", "column")
        yield from panels(node["first"])
        yield from panels(node["second"])


PLOTTED = [series["value"] for config in layout["configById"].values() for series in config.get("paths", ())]
#: what the layout's scripts make
OUTPUTS = {
    re.search(r'^export const output = "(.+)";$', script["sourceCode"], re.MULTILINE).group(1)
    for script in layout["userNodes"].values()
}


def test_every_panel_has_a_place_and_a_configuration():
    placed = list(panels(layout["layout"]))
    assert sorted(placed) == sorted(layout["configById"])
    assert {name.split("!")[0] for name in placed} == {"3D", "Plot", "StateTransitions", "RosOut"}


def test_every_field_that_the_layout_plots_is_recorded(recording):
    plotted = set()
    for path in PLOTTED:
        if re.fullmatch(r"\d+", path):
            continue  # a line at a limit
        match = MESSAGE_PATH.fullmatch(path)
        assert match is not None, path
        if match["topic"] in OUTPUTS:
            continue
        values = recording[match["topic"]][match["field"]]
        assert (values.ndim > 1) == (match["index"] is not None), path
        if match["index"]:
            assert int(match["index"]) < values[0].size, path
        plotted.add(f"{match['topic']}.{match['field']}")
    assert plotted >= {
        *("/deputy/control.force_hill_n", "/deputy/attitude.torque_n_m"),
        *(f"/mission.{field}" for field in ("distance_m", "inspection_rate_percent", "delta_v_m_s")),
        *(f"/fis/force_{axis}.inputs" for axis in "xyz"),
    }


def test_every_topic_and_frame_that_the_scene_shows_is_recorded(recording):
    scene = layout["configById"]["3D!scene"]
    frames = set(recording["/tf"]["child_frame"]) | set(recording["/tf"]["parent_frame"])
    assert scene["followTf"] in frames
    assert {name.removeprefix("frame:") for name in scene["transforms"]} == frames
    shown = {topics.CHIEF_POINTS, topics.DEPUTY_POSE, "/studio_script/scene"}
    assert set(scene["topics"]) == shown
    assert shown & OUTPUTS == {"/studio_script/scene"}
    assert layout["configById"]["RosOut!events"]["topicToRender"] == topics.LOG


def test_the_layout_carries_the_scripts_that_lie_beside_it():
    """After a change of a script: ``node docs/foxglove/embed.mjs``."""
    assert set(layout["userNodes"]) == {path.stem for path in FOLDER.glob("*.ts")}
    for name, script in layout["userNodes"].items():
        assert script == {"name": name, "sourceCode": (FOLDER / f"{name}.ts").read_text(encoding="utf-8")}


def test_the_layouts_variables_and_lines_are_the_papers(recording):
    episode, variables = recording.episode, layout["globalVariables"]
    for name in ("min_distance_m", "max_distance_m"):
        assert variables[name] == getattr(episode, name)
    assert np.deg2rad(variables["half_angle_deg"]) == pytest.approx(episode.half_angle_rad)
    assert tuple(variables[f"boresight_{axis}"] for axis in "xyz") == episode.boresight
    lines = {float(path) for path in PLOTTED if re.fullmatch(r"\d+", path)}
    assert lines == {15.0, 200.0, episode.inspection_threshold_percent}


@pytest.fixture(scope="module")
def made(recorded, tmp_path_factory):
    """What the layout's scripts, compiled strictly, make of the recording as Foxglove's libraries read it."""
    folder = installed(READER, tmp_path_factory.mktemp("npm") / "reader")
    command = [program("node", "nodejs"), "run_scripts.mjs", str(LAYOUT), str(recorded)]
    done = subprocess.run(command, check=False, cwd=folder, capture_output=True, text=True)  # noqa: S603
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def turned(quaternion: dict[str, float], vector: ArrayLike) -> np.ndarray:
    return Rotation.from_quat([quaternion[name] for name in "xyzw"]).apply(vector)


def last_scene_of(scenes: list[dict[str, Any]], sample: int) -> dict[str, dict[str, Any]]:
    message = [scene["message"] for scene in scenes if scene["time_s"] == 10 * sample][-1]
    return {entity["id"]: entity for entity in message["entities"]}


def point(vector: dict[str, float]) -> np.ndarray:
    return np.array([vector[axis] for axis in "xyz"])


@pytest.mark.parametrize("sample", [0, 7, 19])
def test_arrows_of_the_scene_point_where_the_numbers_say(made, flown, sample):
    scene = last_scene_of(made["/studio_script/scene"], sample)
    angle = flown.sun_angle_rad[sample]
    force = flown.force_hill_n[sample]
    expected = {
        "sun": [np.cos(angle), np.sin(angle), 0.0],
        "target": flown.target_direction[sample],
        "force": force / np.linalg.norm(force),
    }
    for name, direction in expected.items():
        (arrow,) = scene[name]["arrows"]
        assert scene[name]["frame_id"] == "hill"
        drawn = turned(arrow["pose"]["orientation"], [1.0, 0.0, 0.0])
        np.testing.assert_allclose(drawn, direction, atol=1e-9)
    (arrow,) = scene["force"]["arrows"]
    np.testing.assert_array_equal(point(arrow["pose"]["position"]), flown.position_m[sample])
    assert arrow["shaft_length"] + arrow["head_length"] == pytest.approx(3000.0 * np.linalg.norm(force))


def test_the_field_of_view_is_a_cone_from_the_deputy_onto_the_chief(made, flown):
    scene = last_scene_of(made["/studio_script/scene"], 7)
    (cone,) = scene["field of view"]["cylinders"]
    assert scene["field of view"]["frame_id"] == "deputy"
    assert (cone["bottom_scale"], cone["top_scale"]) == (0, 1)
    depth = cone["size"]["z"]
    ends = [
        point(cone["pose"]["position"]) + turned(cone["pose"]["orientation"], [0.0, 0.0, side * depth / 2])
        for side in (-1.0, 1.0)
    ]
    np.testing.assert_allclose(ends[0], 0.0, atol=1e-9)
    # the camera of this flight looks at the chief's centre
    base = flown.position_m[7] + Rotation.from_quat(flown.quaternion[7]).apply(ends[1])
    np.testing.assert_allclose(base, 0.0, atol=1e-9)
    assert np.arctan2(cone["size"]["x"] / 2, depth) == pytest.approx(synthetic_flight.HALF_ANGLE)


def test_shells_body_and_trail_are_where_they_belong(made, flown):
    scene = last_scene_of(made["/studio_script/scene"], 12)
    for name, radius in (("least distance", 15.0), ("greatest distance", 200.0)):
        for circle in scene[name]["lines"]:
            np.testing.assert_allclose([np.linalg.norm(point(p)) for p in circle["points"]], radius)
        normals = [turned(circle["pose"]["orientation"], [0.0, 0.0, 1.0]) for circle in scene[name]["lines"]]
        np.testing.assert_allclose(np.abs(normals) @ np.ones(3), 1.0, atol=1e-9)
        assert np.linalg.matrix_rank(np.array(normals)) == 3
    (body,) = scene["body"]["spheres"]
    assert 0.9 * synthetic_flight.POINT_RADIUS < body["size"]["x"] / 2 < synthetic_flight.POINT_RADIUS
    dots = np.array([point(dot["pose"]["position"]) for dot in scene["trail"]["spheres"]])
    np.testing.assert_array_equal(dots, flown.position_m[:13])


def test_the_strongest_rule_is_named_by_its_number(made, flown):
    last = {event["time_s"]: event["message"] for event in made["/studio_script/rules"]}
    assert len(last) == 20
    strengths = flown.firing_strengths.astype(np.float32)
    for sample in range(20):
        for index, axis in enumerate("xyz"):
            assert last[10 * sample][f"force_{axis}"] == 1 + strengths[index, sample].argmax()
