"""When inference is recorded, and what flights without inference record."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from scipy.spatial.transform import Rotation

import telemetry
from fis_tools.formats import serialize
from fis_tools.model.thrust import thrust_logic
from pipeline.flight.control.controller import Controller, open_loop
from pipeline.flight.state.log import Scenario
from pipeline.recording.recorder import directions
from pipeline.run.runner import run_stages
from tests.pipeline.recording import cases
from tests.pipeline.recording.cases import Contents

SHORT = ("duration_s=100.0",)


def recorded(path: Path, controller: Controller) -> Contents:
    """The miniature flight of a controller, from 75 m along i."""
    start = Scenario(np.array([75.0, 0.0, 0.0]), np.zeros(3), 0.3)
    cases.recorded(path, cases.composed(*SHORT).experiment.mission, controller, start)
    return cases.contents(path)


def test_inference_is_recorded_only_where_it_decides(coasting: Contents):
    log = cases.flown(*cases.COASTING)
    complete = int(np.flatnonzero(log.is_inspected.all(axis=1))[0])
    assert 0 < complete < 90
    decided = [10_000_000_000 * k for k in range(complete)]
    for place, name in enumerate(("force_x", "force_y", "force_z")):
        assert coasting.times(f"/fis/{name}") == decided
        assert_array_equal(coasting.values(f"/fis/{name}", "inputs"), log.fis_input[:complete, place, :2])
        assert_array_equal(coasting.values(f"/fis/{name}", "output_n"), log.fis_output_n[:complete, place])
    assert coasting.times("/deputy/control") == [10_000_000_000 * k for k in range(90)]
    assert not coasting.values("/deputy/control", "force_hill_n")[complete:].any()
    assert not coasting.values("/guidance", "num_candidates")[complete:].any()
    assert not coasting.values("/guidance", "target_direction")[complete:].any()


def test_the_log_of_an_eventful_flight(coasting: Contents):
    lines = [(time // 10_000_000_000, line.level, line.message) for time, line in coasting.messages["/log"]]
    info, warning, error = 2, 3, 4
    assert [level for _, level, _ in lines] == [info, info, warning, error, warning]
    samples = [sample for sample, _, _ in lines]
    inspected, distance = (coasting.values("/mission", key) for key in ("inspected_count", "distance_m"))
    firsts = [np.flatnonzero(such)[0] for such in (inspected == 12, distance > 140.0, distance > 200.0)]
    assert samples == [firsts[0], *firsts, 90]
    words = ("95 % reached", "complete: all 12", "from the greatest", "beyond the greatest", "end: 12 of 12")
    for (_, _, text), beginning in zip(lines, words, strict=True):
        assert beginning in text


def test_a_system_of_one_input_records_one(tmp_path):
    fuzzy = serialize.from_mapping(cases.composed().config["controller"])
    system = fuzzy.systems[0]
    rules = tuple(replace(rule, antecedent=rule.antecedent.operands[1]) for rule in system.rules[:5])
    lean = replace(system, inputs=system.inputs[1:], rules=rules)
    found = recorded(tmp_path / "lean.mcap", Controller("lean", (lean,), "hill"))
    assert found.values("/fis/force_x", "inputs").shape == (10, 1)
    assert found.values("/fis/force_x", "firing_strengths").shape == (10, 5)
    assert json.loads(found.metadata["fis.force_x"]["input_names"]) == ["velocity_body_x"]
    # in Hill axes the output is the force along i, whatever the attitude
    fired = found.values("/deputy/control", "force_hill_n")[:, 0]
    assert_array_equal(fired, found.values("/fis/force_x", "output_n"))
    rebuilt = serialize.loads(found.attachments["controller.json"].decode(), "json")
    assert rebuilt.systems == (lean,)
    assert dict(rebuilt.attributes) == {"force_axes": "hill"}


def test_open_loop(tmp_path):
    plan = np.array([[0.5, -0.25, 0.0], [0.0, 0.0, 3.0]])
    found = recorded(tmp_path / "open.mcap", open_loop("table", plan))
    assert [topic for topic in found.messages if topic.startswith("/fis")] == []
    assert set(found.metadata) == {"episode"}
    applied = np.zeros((10, 3))
    applied[:2] = [[0.5, -0.25, 0.0], [0.0, 0.0, 1.0]]
    assert_array_equal(found.values("/deputy/control", "force_hill_n"), applied)
    asked = np.vstack((plan, np.zeros((8, 3))))
    attitude = Rotation.from_quat(found.values("/deputy/state", "quaternion")[:10])
    body = found.values("/deputy/control", "force_body_n")
    np.testing.assert_allclose(body, attitude.inv().apply(asked), atol=1e-14)
    assert found.values("/mission", "delta_v_m_s")[-1] == pytest.approx(1.75 * 10.0 / 12.0, rel=1e-15)
    told = json.loads(found.attachments["controller.json"])
    assert (told["kind"], told["name"], told["force_axes"]) == ("open_loop", "table", "hill")
    assert_array_equal(told["forces_n"], plan)


def test_ideal_pointing_and_another_clock(tmp_path):
    run = cases.composed("duration_s=40.0", "attitude=ideal", "attitude_period_s=2.5", "control_period_s=5.0")
    run_stages(run.experiment, run.config, tmp_path)
    found = cases.contents(tmp_path / "episodes" / "start.mcap")
    assert found.times("/deputy/state") == [5_000_000_000 * k for k in range(9)]
    assert_array_equal(found.values("/deputy/attitude", "time_offset_s"), np.tile([0.0, 2.5], (8, 1)))
    assert not found.values("/deputy/attitude", "torque_n_m").any()


def test_no_target_has_no_direction():
    vectors = np.array([[0.0, 0.0, 0.0], [3.0, 0.0, -4.0], [1e-9, 0.0, 0.0]])
    assert_array_equal(directions(vectors), [[0.0, 0.0, 0.0], [0.6, 0.0, -0.8], [1.0, 0.0, 0.0]])


def test_what_was_asked_for_and_why_it_was_not_fired_is_recorded(tmp_path):
    controller, start = cases.champion(), Scenario(np.array([43.3, 43.3, 43.3]), np.zeros(3), np.pi)
    cases.recorded(tmp_path / "a.mcap", cases.composed().experiment.mission, controller, start)
    found = telemetry.read(tmp_path / "a.mcap")
    control, logic = found["/deputy/control"], thrust_logic(controller.fuzzy)
    asked, reason, fired = control["force_asked_n"], control["reason"], control["force_hill_n"]
    assert {"fired", "dead_band", "coasting"} <= set(reason.ravel())
    np.testing.assert_array_equal(fired, np.where(reason == "fired", asked, 0.0))
    is_small = np.abs(asked) < logic.dead_bands_n
    np.testing.assert_array_equal(is_small & (asked != 0.0), reason == "dead_band")
    is_coasting = (reason == "coasting").all(axis=1)
    for place, name in enumerate(found.fis_names):
        np.testing.assert_array_equal(found[f"/fis/{name}"].time_s, control.time_s[~is_coasting])
        np.testing.assert_array_equal(found[f"/fis/{name}"]["output_n"], asked[~is_coasting, place])
    enough = control["coasting_missed"] < logic.coast_below_points
    enough &= control["coasting_nearest_m"] >= 15.0 + logic.coast_margin_m
    enough &= control["coasting_farthest_m"] <= 200.0 - logic.coast_margin_m
    np.testing.assert_array_equal(enough, is_coasting)
    # every change is told, and nothing else
    told = [text.split(":")[0] for text in found["/log"]["message"] if text.startswith("coasting ")]
    changes = np.diff(is_coasting.astype(int), prepend=0)
    words = {1: "coasting begins", -1: "coasting ends"}
    assert told == [words[change] for change in changes[changes != 0].tolist()]
    assert told
