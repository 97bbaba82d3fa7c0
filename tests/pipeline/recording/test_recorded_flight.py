"""A whole flight as the stage records it, read with the mcap library and held against the flown arrays."""

import functools
import hashlib
import json
import math

import numpy as np
import pytest
import yaml
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation

from fis_tools.analysis import flights
from fis_tools.engines.kernel import evaluate
from fis_tools.engines.packing import pack
from pipeline.flight.state.log import FlightLog
from pipeline.flight.world.pack import inspection_points
from pipeline.run import maker
from pipeline.run.runner import run_stages
from tests.pipeline.recording import cases
from tests.pipeline.recording.cases import Contents

SYSTEMS = ("force_x", "force_y", "force_z")
LIT = (240, 228, 66, 255)
#: dark, lit, in view but dark, inspected
COLOURS = ((86, 88, 102, 255), LIT, (204, 121, 167, 255), (0, 190, 130, 255))


@pytest.fixture(scope="module")
def log() -> FlightLog:
    return cases.flown()


def test_counts_and_times(full: Contents):
    samples = [10_000_000_000 * k for k in range(361)]
    at_samples = ("/deputy/pose", "/chief/points", "/deputy/state", "/guidance", "/mission")
    at_controls = ("/deputy/attitude", "/deputy/control", *(f"/fis/{name}" for name in SYSTEMS))
    assert set(full.messages) == {"/tf", "/log", *at_samples, *at_controls}
    for topic in at_samples:
        assert full.times(topic) == samples, topic
    for topic in at_controls:
        assert full.times(topic) == samples[:-1], topic
    assert full.times("/tf") == [0, *sorted(2 * samples)]


def test_what_was_flown_in_full_precision(full: Contents, log: FlightLog):
    of_systems = {"inputs": log.fis_input[:, :, :2], "output_n": log.fis_output_n}
    for topic, fields in {
        "/deputy/state": {
            "position_m": log.position_m,
            "velocity_m_s": log.velocity_m_s,
            "quaternion": log.quaternion_b_from_h,
            "angular_velocity_rad_s": log.angular_velocity_b_rad_s,
        },
        "/deputy/attitude": {
            "time_offset_s": np.tile(np.arange(10.0), (360, 1)),
            "quaternion": log.attitude_quaternion.reshape(360, -1).astype(np.float32),
            "angular_velocity_rad_s": log.attitude_rate_b_rad_s.reshape(360, -1).astype(np.float32),
            "torque_n_m": log.torque_b_n_m.reshape(360, -1).astype(np.float32),
        },
        "/deputy/control": {"force_body_n": log.force_body_n, "force_hill_n": log.force_hill_n},
        "/guidance": {name: getattr(log, name) for name in ("num_candidates", "lambda_u_rad", "eta_u_rad")},
        "/mission": {"delta_v_m_s": log.delta_v_m_s, "inspected_count": log.is_inspected.sum(axis=1)},
        **{
            f"/fis/{name}": {field: flown[:, place] for field, flown in of_systems.items()}
            for place, name in enumerate(SYSTEMS)
        },
    }.items():
        for field, flown in fields.items():
            assert_array_equal(full.values(topic, field), flown, err_msg=f"{topic} {field}")
    assert np.abs(log.torque_b_n_m).max() > 1e-3
    assert np.abs(log.force_hill_n).max() > 1e-2


def test_poses_and_transforms(full: Contents, log: FlightLog):
    assert {message.frame_id for _, message in full.messages["/deputy/pose"]} == {"hill"}
    assert_array_equal(full.vectors("/deputy/pose", "pose.position", "xyz"), log.position_m)
    assert_array_equal(full.vectors("/deputy/pose", "pose.orientation", "xyzw"), log.quaternion_b_from_h)
    (_, root), *rest = full.messages["/tf"]
    assert (root.parent_frame_id, root.child_frame_id) == ("tf#/", "hill")
    frames = [(message.parent_frame_id, message.child_frame_id) for _, message in rest]
    assert frames == 361 * [("hill", "deputy"), ("hill", "chief")]
    assert_array_equal(full.vectors("/tf", "translation", "xyz")[1::2], log.position_m)
    assert_array_equal(full.vectors("/tf", "rotation", "xyzw")[1::2], log.quaternion_b_from_h)
    assert not full.vectors("/tf", "translation", "xyz")[2::2].any()
    assert_array_equal(full.vectors("/tf", "rotation", "xyzw")[2::2], log.quaternion_c_from_h)


def test_guidance_and_mission(full: Contents, log: FlightLog):
    direction = full.values("/guidance", "target_direction")
    assert_allclose(np.linalg.norm(direction, axis=1), 1.0, rtol=1e-14)
    assert_allclose(np.cross(direction, log.target_m), 0.0, atol=1e-13)
    assert (np.sum(direction * log.target_m, axis=1) > 0.0).all()
    masks = np.array([np.frombuffer(m.inspected_mask, dtype=np.uint8) for _, m in full.messages["/mission"]])
    assert_array_equal(masks, log.is_inspected)
    mission = functools.partial(full.values, "/mission")
    assert_array_equal(mission("inspection_rate_percent"), 100.0 * masks.sum(axis=1) / 99)
    spent = np.abs(full.values("/deputy/control", "force_hill_n")).sum(axis=1) * 10.0 / 12.0
    assert_allclose(mission("delta_v_m_s"), np.concatenate([[0.0], spent.cumsum()]), rtol=1e-12)
    assert_allclose(mission("distance_m"), np.sqrt((log.position_m**2).sum(axis=1)), rtol=1e-15)
    assert_allclose(mission("sun_angle_rad"), -0.011068 * np.arange(361), rtol=0, atol=1e-14)


@pytest.mark.parametrize("name", ["full", "coasting"])
def test_points_and_their_colours(name: str, request: pytest.FixtureRequest):
    recorded: Contents = request.getfixturevalue(name)
    overrides = cases.COASTING if name == "coasting" else ()
    flown, mission = cases.flown(*overrides), cases.composed(*overrides).experiment.mission
    points = inspection_points(mission)
    clouds = recorded.clouds()
    assert clouds.shape == flown.is_inspected.shape
    assert_array_equal(clouds["position"], np.tile(points.astype(np.float32), (len(clouds), 1, 1)))
    told = set()
    for k, position in enumerate(flown.position_m):
        points_h = Rotation.from_quat(flown.quaternion_c_from_h[k]).apply(points)
        boresight = Rotation.from_quat(flown.quaternion_b_from_h[k]).apply([-1.0, 0.0, 0.0])
        sight = points_h - position
        off_axis = np.arccos(sight @ boresight / np.linalg.norm(sight, axis=1))
        # a point of a sphere faces whoever stands above its tangent plane
        is_in_view = (off_axis <= math.radians(15.0)) & (np.sum(points_h * sight, axis=1) <= 0.0)
        sun = [np.cos(flown.sun_angle_rad[k]), np.sin(flown.sun_angle_rad[k]), 0.0]
        is_lit = points_h @ sun > 100.0 / 149_597_870_700.0
        kinds = np.select([flown.is_inspected[k], is_lit, is_in_view], [3, 1, 2], 0)
        assert_array_equal(clouds["colour"][k], np.array(COLOURS)[kinds])
        told |= set(kinds.tolist())
    assert told == {0, 1, 2, 3}
    # what is lit and not inspected is what guidance calls a candidate
    num_lit = np.all(clouds["colour"] == LIT, axis=2).sum(axis=1)
    assert_array_equal(num_lit, recorded.values("/guidance", "num_candidates"))


def test_firing_strengths_are_in_the_order_of_the_rules_in_words(full: Contents):
    config = yaml.safe_load(full.attachments["config.yaml"])
    for system in config["controller"]["systems"]:
        words = json.loads(full.metadata[f"fis.{system['name']}"]["rules"])
        inputs = full.values(f"/fis/{system['name']}", "inputs")
        memberships = {}
        for variable, values in zip(system["inputs"], inputs.T, strict=True):
            universe = np.linspace(*variable["range"], variable["points"])
            for term in variable["terms"]:
                sampled = np.exp(-(((universe - term["mean"]) / term["standard_deviation"]) ** 2) / 2.0)
                memberships[f"{variable['name']} is {term['name']}"] = np.interp(values, universe, sampled)
        conditions = [
            sentence.removeprefix("If ").partition(" then ")[0].split(" and ") for sentence in words
        ]
        expected = [np.minimum.reduce([memberships[each] for each in both]) for both in conditions]
        recorded = full.values(f"/fis/{system['name']}", "firing_strengths")
        assert recorded.shape == (360, 25)
        assert_allclose(recorded, np.array(expected).T, rtol=1e-6, atol=1e-12)
        conclusions = [sentence.rpartition(" is ")[2] for sentence in words]
        assert conclusions == system["rules"]


def test_inputs_are_recorded_before_they_are_clipped(tmp_path):
    # faster than the terms of the velocity reach, which end at 0.3 m/s; body axes are Hill's at the start
    run = cases.composed("duration_s=20.0", "deputy.initial_velocity_m_s=[0.5,-0.75,0.0]")
    run_stages(run.experiment, run.config, tmp_path)
    fast = cases.contents(tmp_path / "episodes" / "start.mcap")
    assert fast.values("/fis/force_x", "inputs")[0, 1] == 0.5
    assert fast.values("/fis/force_y", "inputs")[0, 1] == -0.75
    for flown in flights.read_flight(fast.path):
        assert_array_equal(evaluate(pack(flown.system), flown.inputs), flown.output)


def test_metadata_tells_what_the_episode_was(full: Contents):
    episode = full.metadata["episode"]
    config = yaml.safe_load(full.attachments["config.yaml"])
    text = json.dumps({key: config[key] for key in config if key != "hydra"}, sort_keys=True)
    assert episode.pop("config_hash") == hashlib.sha256(text.encode()).hexdigest()
    assert episode.pop("scenario_id") == "start"
    assert episode.pop("product_version") == maker.product_version()
    numbers = {key: json.loads(value) for key, value in episode.items() if key != "crc32"}
    assert numbers.pop("half_angle_rad") == pytest.approx(math.pi / 12, rel=1e-15)
    text = """{seed: 1, position_m: [43.30127018922194, 43.30127018922194, 43.30127018922194],
        velocity_m_s: [0.0, 0.0, 0.0], sun_angle_rad: 0.0, sun_elevation_rad: 0.0, min_distance_m: 15.0,
        max_distance_m: 200.0, max_force_n: 1.0, max_torque_n_m: 0.01, boresight: [-1.0, 0.0, 0.0],
        inspection_threshold_percent: 95.0, inspection_radius_m: 10.0, num_points: 99}"""
    assert numbers == yaml.safe_load(text)


def test_metadata_describes_each_system(full: Contents):
    assert set(full.metadata) == {"episode", *(f"fis.{name}" for name in SYSTEMS)}
    described = full.metadata["fis.force_y"]
    assert json.loads(described["input_names"]) == ["lambda_u", "velocity_body_y"]
    assert json.loads(described["input_units"]) == ["rad", "m/s"]
    assert (described["output_name"], described["output_unit"]) == ("force_y", "N")
    rule = (
        "If lambda_u is negative_large and velocity_body_y is negative_large then force_y is positive_large"
    )
    assert json.loads(described["rules"])[0] == rule
