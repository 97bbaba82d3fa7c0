"""Flights as the stage records them, with inference and without, held against the flown arrays."""

import hashlib
import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation

from fis_tools.analysis import flights
from fis_tools.engines.kernel import evaluate
from fis_tools.engines.packing import pack
from fis_tools.formats import serialize
from fis_tools.model.thrust import thrust_logic
from fis_tools.words.text import sentence
from pipeline.controllers.source import named
from pipeline.flight.control.controller import Controller, RuleController, open_loop
from pipeline.flight.state.log import FlightLog, Scenario
from pipeline.flight.world.pack import inspection_points
from pipeline.recording.recorder import directions
from pipeline.run import maker
from telemetry.file.recording import Recording
from tests.fis_tools import step_by_step
from tests.pipeline.recording import cases

SYSTEMS = ("force_x", "force_y", "force_z")


@pytest.fixture(scope="module")
def full(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    """The whole flight of `+experiment=fly`, as the stage writes it."""
    return cases.staged(tmp_path_factory.mktemp("full"))


@pytest.fixture(scope="module")
def coasting(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    """A flight that completes its inspection of a tumbling chief and then coasts."""
    return cases.staged(tmp_path_factory.mktemp("coasting"), *cases.COASTING)


@pytest.fixture(scope="module")
def log() -> FlightLog:
    return cases.flown()


def test_counts_and_times(full: Recording):
    samples = 10.0 * np.arange(361)
    at_samples = ("/deputy/pose", "/chief/points", "/deputy/state", "/guidance", "/mission")
    at_controls = ("/deputy/attitude", "/deputy/control", *(f"/fis/{name}" for name in SYSTEMS))
    names = {"/tf", "/log", *at_samples, *at_controls}
    assert {name for name, topic in full.topics.items() if len(topic)} == names
    for topic in at_samples:
        assert_array_equal(full[topic].time_s, samples, topic)
    for topic in at_controls:
        assert_array_equal(full[topic].time_s, samples[:-1], topic)
    assert_array_equal(full["/tf"].time_s, [0.0, *np.repeat(samples, 2)])


def test_what_was_flown_in_full_precision(full: Recording, log: FlightLog):
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
            "quaternion": log.attitude_quaternion.astype(np.float32),
            "angular_velocity_rad_s": log.attitude_rate_b_rad_s.astype(np.float32),
            "torque_n_m": log.torque_b_n_m.astype(np.float32),
        },
        "/deputy/control": {"force_body_n": log.force_body_n, "force_hill_n": log.force_hill_n},
        "/deputy/pose": {"position_m": log.position_m, "quaternion": log.quaternion_b_from_h},
        "/guidance": {name: getattr(log, name) for name in ("num_candidates", "lambda_u_rad", "eta_u_rad")},
        "/mission": {
            "delta_v_m_s": log.delta_v_m_s,
            "sun_hidden_share": np.zeros(361),  # the paper's orbit has no shadow
            "inspected_count": log.is_inspected.sum(axis=1),
            "inspected_mask": log.is_inspected,
        },
        **{
            f"/fis/{name}": {field: flown[:, index] for field, flown in of_systems.items()}
            for index, name in enumerate(SYSTEMS)
        },
    }.items():
        for field, flown in fields.items():
            assert_array_equal(full[topic][field], flown, err_msg=f"{topic} {field}")
    assert np.abs(log.torque_b_n_m).max() > 1e-3
    assert np.abs(log.force_hill_n).max() > 1e-2


def test_transforms(full: Recording, log: FlightLog):
    assert set(full["/deputy/pose"]["frame"]) == {"hill"}
    transforms = full["/tf"]
    frames = list(zip(transforms["parent_frame"], transforms["child_frame"], strict=True))
    assert frames == [("tf#/", "hill"), *361 * [("hill", "deputy"), ("hill", "chief")]]
    assert_array_equal(transforms["translation_m"][1::2], log.position_m)
    assert_array_equal(transforms["quaternion"][1::2], log.quaternion_b_from_h)
    assert not transforms["translation_m"][2::2].any()
    assert_array_equal(transforms["quaternion"][2::2], log.quaternion_c_from_h)


def test_guidance_and_mission(full: Recording, log: FlightLog):
    direction, mission = full["/guidance"]["target_direction"], full["/mission"]
    assert_allclose(np.linalg.norm(direction, axis=1), 1.0, rtol=1e-14)
    assert_allclose(np.cross(direction, log.target_m), 0.0, atol=1e-13)
    assert (np.sum(direction * log.target_m, axis=1) > 0.0).all()
    assert_array_equal(mission["inspection_rate_percent"], 100.0 * log.is_inspected.sum(axis=1) / 99)
    spent = np.abs(full["/deputy/control"]["force_hill_n"]).sum(axis=1) * 10.0 / 12.0
    assert_allclose(mission["delta_v_m_s"], np.concatenate([[0.0], spent.cumsum()]), rtol=1e-12)
    assert_allclose(mission["distance_m"], np.sqrt((log.position_m**2).sum(axis=1)), rtol=1e-15)
    assert_allclose(mission["sun_angle_rad"], -0.011068 * np.arange(361), rtol=0, atol=1e-14)


@pytest.mark.parametrize(("name", "overrides"), [("full", ()), ("coasting", cases.COASTING)])
def test_points_and_their_states(name: str, overrides: tuple[str, ...], request: pytest.FixtureRequest):
    recorded: Recording = request.getfixturevalue(name)
    flown, mission = cases.flown(*overrides), cases.composed(*overrides).experiment.mission
    points, clouds = inspection_points(mission), recorded["/chief/points"]
    assert clouds["state"].shape == flown.is_inspected.shape
    assert_array_equal(clouds["position_m"], np.tile(points.astype(np.float32), (len(clouds), 1, 1)))
    for k, position in enumerate(flown.position_m):
        points_h = Rotation.from_quat(flown.quaternion_c_from_h[k]).apply(points)
        boresight = Rotation.from_quat(flown.quaternion_b_from_h[k]).apply([-1.0, 0.0, 0.0])
        sight = points_h - position
        off_axis = np.arccos(sight @ boresight / np.linalg.norm(sight, axis=1))
        # a point of a sphere faces whoever stands above its tangent plane
        is_in_view = (off_axis <= math.radians(15.0)) & (np.sum(points_h * sight, axis=1) <= 0.0)
        sun = [np.cos(flown.sun_angle_rad[k]), np.sin(flown.sun_angle_rad[k]), 0.0]
        is_lit = points_h @ sun > 100.0 / 149_597_870_700.0
        # dark, lit, in view but dark, inspected
        kinds = np.select([flown.is_inspected[k], is_lit, is_in_view], [3, 1, 2], 0)
        assert_array_equal(clouds["state"][k], kinds)
    assert set(clouds["state"].ravel().tolist()) == {0, 1, 2, 3}
    # what is lit and not inspected is what guidance calls a candidate
    assert_array_equal((clouds["state"] == 1).sum(axis=1), recorded["/guidance"]["num_candidates"])


def test_firing_strengths_are_in_the_order_of_the_rules_in_words(full: Recording):
    for system in serialize.loads(full.attachments["controller.json"].decode(), "json").systems:
        inferred = full[f"/fis/{system.name}"]
        expected = step_by_step.firing_strengths(system, inferred["inputs"])
        assert expected.shape == (360, 25)
        assert_allclose(inferred["firing_strengths"], expected, rtol=1e-6, atol=1e-12)
        assert full.fis_description(system.name).rules == tuple(map(sentence, system.rules))


def test_inputs_are_recorded_before_they_are_clipped(tmp_path):
    # faster than the terms of the velocity reach, which end at 0.3 m/s; body axes are Hill's at the start
    fast = cases.staged(tmp_path, "duration_s=20.0", "deputy.initial_velocity_m_s=[0.5,-0.75,0.0]")
    assert fast["/fis/force_x"]["inputs"][0, 1] == 0.5
    assert fast["/fis/force_y"]["inputs"][0, 1] == -0.75
    for flown in flights.read_flight(fast.path):
        assert_array_equal(evaluate(pack(flown.system), flown.inputs), flown.output)


def test_metadata_tells_what_the_episode_was(full: Recording):
    episode = dict(full.metadata["episode"])
    config = yaml.safe_load(full.attachments["config.yaml"])
    text = json.dumps({key: config[key] for key in config if key != "hydra"}, sort_keys=True)
    assert episode.pop("config_hash") == hashlib.sha256(text.encode()).hexdigest()
    assert episode.pop("scenario_id") == "start"
    assert episode.pop("product_version") == maker.product_version()
    numbers = {key: json.loads(value) for key, value in episode.items()}
    assert numbers.pop("half_angle_rad") == pytest.approx(math.pi / 12, rel=1e-15)
    text = """{seed: 1, position_m: [43.30127018922194, 43.30127018922194, 43.30127018922194],
        velocity_m_s: [0.0, 0.0, 0.0], sun_angle_rad: 0.0, sun_elevation_rad: 0.0, min_distance_m: 15.0,
        max_distance_m: 200.0, max_force_n: 1.0, max_torque_n_m: 0.01, boresight: [-1.0, 0.0, 0.0],
        inspection_threshold_percent: 95.0, inspection_radius_m: 10.0, num_points: 99}"""
    assert numbers == yaml.safe_load(text)


def test_metadata_describes_each_system(full: Recording):
    assert set(full.metadata) == {"episode", *(f"fis.{name}" for name in SYSTEMS)}
    described = full.fis_description("force_y")
    assert described.input_names == ("lambda_u", "velocity_body_y")
    assert described.input_units == ("rad", "m/s")
    assert (described.output_name, described.output_unit) == ("force_y", "N")
    condition = "lambda_u is negative_large and velocity_body_y is negative_large"
    assert described.rules[0] == f"If {condition} then force_y is positive_large"


def test_inference_is_recorded_only_where_it_decides(coasting: Recording):
    log = cases.flown(*cases.COASTING)
    complete = int(np.flatnonzero(log.is_inspected.all(axis=1))[0])
    assert 0 < complete < 90
    for index, name in enumerate(SYSTEMS):
        topic = coasting[f"/fis/{name}"]
        assert_array_equal(topic.time_s, 10.0 * np.arange(complete))
        assert_array_equal(topic["inputs"], log.fis_input[:complete, index, :2])
        assert_array_equal(topic["output_n"], log.fis_output_n[:complete, index])
    assert_array_equal(coasting["/deputy/control"].time_s, 10.0 * np.arange(90))
    assert not coasting["/deputy/control"]["force_hill_n"][complete:].any()
    assert not coasting["/guidance"]["num_candidates"][complete:].any()
    assert not coasting["/guidance"]["target_direction"][complete:].any()


def test_the_log_of_an_eventful_flight(coasting: Recording):
    lines, mission = coasting["/log"], coasting["/mission"]
    assert lines["level"].tolist() == ["info", "info", "warning", "error", "warning"]
    inspected, distance = mission["inspected_count"], mission["distance_m"]
    firsts = [np.flatnonzero(such)[0] for such in (inspected == 12, distance > 140.0, distance > 200.0)]
    assert_array_equal(lines.time_s, 10.0 * np.array([firsts[0], *firsts, 90]))
    words = ("95 % reached", "complete: all 12", "from the greatest", "beyond the greatest", "end: 12 of 12")
    for text, beginning in zip(lines["message"], words, strict=True):
        assert beginning in text


def short(path: Path, controller: Controller) -> Recording:
    """The miniature flight of a controller, from 75 m along i."""
    start = Scenario(np.array([75.0, 0.0, 0.0]), np.zeros(3), 0.3)
    return cases.recorded(path, cases.composed("duration_s=100.0").experiment.mission, controller, start)[1]


def test_a_system_of_one_input_records_one(tmp_path):
    system = serialize.from_mapping(cases.composed().config["controller"]).systems[0]
    rules = tuple(replace(rule, antecedent=rule.antecedent.operands[1]) for rule in system.rules[:5])
    lean = replace(system, inputs=system.inputs[1:], rules=rules)
    recording = short(tmp_path / "lean.mcap", RuleController("lean", (lean,), "hill"))
    inferred = recording["/fis/force_x"]
    assert (inferred["inputs"].shape, inferred["firing_strengths"].shape) == ((10, 1), (10, 5))
    assert recording.fis_description("force_x").input_names == ("velocity_body_x",)
    # in Hill axes the output is the force along i, whatever the attitude
    assert_array_equal(recording["/deputy/control"]["force_hill_n"][:, 0], inferred["output_n"])
    rebuilt = serialize.loads(recording.attachments["controller.json"].decode(), "json")
    assert rebuilt.systems == (lean,)
    assert dict(rebuilt.attributes) == {"force_axes": "hill"}


def test_open_loop(tmp_path):
    plan = np.array([[0.5, -0.25, 0.0], [0.0, 0.0, 3.0]])
    recording = short(tmp_path / "open.mcap", open_loop("table", plan))
    assert [topic for topic in recording.topics if topic.startswith("/fis")] == []
    assert set(recording.metadata) == {"episode"}
    applied = np.zeros((10, 3))
    applied[:2] = [[0.5, -0.25, 0.0], [0.0, 0.0, 1.0]]
    assert_array_equal(recording["/deputy/control"]["force_hill_n"], applied)
    planned = np.vstack((plan, np.zeros((8, 3))))
    attitude = Rotation.from_quat(recording["/deputy/state"]["quaternion"][:10])
    assert_allclose(recording["/deputy/control"]["force_body_n"], attitude.inv().apply(planned), atol=1e-14)
    assert recording["/mission"]["delta_v_m_s"][-1] == pytest.approx(1.75 * 10.0 / 12.0, rel=1e-15)
    content = json.loads(recording.attachments["controller.json"])
    assert (content["kind"], content["name"], content["force_axes"]) == ("open_loop", "table", "hill")
    assert_array_equal(content["forces_n"], plan)


def test_ideal_pointing_and_another_clock(tmp_path):
    words = ("duration_s=40.0", "attitude=ideal", "attitude_period_s=2.5", "control_period_s=5.0")
    recording = cases.staged(tmp_path, *words)
    assert_array_equal(recording["/deputy/state"].time_s, 5.0 * np.arange(9))
    assert_array_equal(recording["/deputy/attitude"]["time_offset_s"], np.tile([0.0, 2.5], (8, 1)))
    assert not recording["/deputy/attitude"]["torque_n_m"].any()


def test_no_target_has_no_direction():
    vectors = np.array([[0.0, 0.0, 0.0], [3.0, 0.0, -4.0], [1e-9, 0.0, 0.0]])
    assert_array_equal(directions(vectors), [[0.0, 0.0, 0.0], [0.6, 0.0, -0.8], [1.0, 0.0, 0.0]])


def test_what_was_asked_for_and_why_it_was_not_fired_is_recorded(tmp_path):
    """By the champion for any Sun, which has dead bands and coasts."""
    mission, start = cases.composed().experiment.mission, Scenario(np.full(3, 43.3), np.zeros(3), np.pi)
    controller = named("champion_any_sun", mission)
    _, recording = cases.recorded(tmp_path / "a.mcap", mission, controller, start)
    control, logic = recording["/deputy/control"], thrust_logic(controller.fuzzy)
    requested, reason, fired = control["force_asked_n"], control["reason"], control["force_hill_n"]
    assert {"fired", "dead_band", "coasting"} <= set(reason.ravel())
    assert_array_equal(fired, np.where(reason == "fired", requested, 0.0))
    is_small = np.abs(requested) < logic.dead_bands_n
    assert_array_equal(is_small & (requested != 0.0), reason == "dead_band")
    is_coasting = (reason == "coasting").all(axis=1)
    for index, name in enumerate(recording.fis_names):
        assert_array_equal(recording[f"/fis/{name}"].time_s, control.time_s[~is_coasting])
        assert_array_equal(recording[f"/fis/{name}"]["output_n"], requested[~is_coasting, index])
    enough = control["coasting_missed"] < logic.coast_below_points
    enough &= control["coasting_nearest_m"] >= 15.0 + logic.coast_margin_m
    enough &= control["coasting_farthest_m"] <= 200.0 - logic.coast_margin_m
    assert_array_equal(enough, is_coasting)
    # every change is told, and nothing else
    levels = [text.split(":")[0] for text in recording["/log"]["message"] if text.startswith("coasting ")]
    changes = np.diff(is_coasting.astype(int), prepend=0)
    words = {1: "coasting begins", -1: "coasting ends"}
    assert levels == [words[change] for change in changes[changes != 0].tolist()]
    assert levels
