"""What a flight's log must hold, whatever the controller."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fis_tools.engines import inference
from fis_tools.scikit_fuzzy.build import ReferenceEngine
from pipeline.flight.reference.channels import channels_of, forced
from pipeline.flight.reference.guidance import choose_cluster
from pipeline.flight.reference.loop import fly, inference_of
from pipeline.flight.state.log import Scenario
from pipeline.physics.inspection_points import regular_placement
from tests.pipeline.flight.missions import (
    BEHIND,
    FULL_INERTIA,
    IDEAL,
    MEAN_MOTION,
    PAPER,
    TOWARDS_THE_POLE,
    restoring_systems,
    steering_systems,
)

SHORT = replace(PAPER, duration_s=200.0)
STEERING = steering_systems()


@pytest.fixture(scope="module")
def complete_flight():
    """All 99 points are inspected before the hour is over."""
    return fly(PAPER, BEHIND, channels_of(STEERING), inference_of(STEERING))


def assert_same(log, other, tolerance):
    for name, values in log._asdict().items():
        expected = getattr(other, name)
        assert values.shape == expected.shape, name
        if values.dtype == np.float64:
            np.testing.assert_allclose(values, expected, rtol=0, atol=tolerance, err_msg=name)
        else:
            np.testing.assert_array_equal(values, expected, err_msg=name)


def test_scikit_fuzzy_and_scikit_learn_fly_the_same():
    engines = [ReferenceEngine(system) for system in STEERING]
    mission = replace(SHORT, guidance=replace(PAPER.guidance, engine="sklearn"))
    by_libraries = fly(
        mission, BEHIND, channels_of(STEERING), lambda f, x: float(engines[f].compute(x[:2])[0])
    )
    assert_same(fly(SHORT, BEHIND, channels_of(STEERING), inference_of(STEERING)), by_libraries, 1e-9)


def test_any_guidance_can_be_flown():
    seen = []

    def guidance(candidates, num_candidates, position, memory):
        seen.append(num_candidates)
        return choose_cluster(candidates, num_candidates, position, memory)

    log = fly(SHORT, BEHIND, channels_of(()), lambda f, x: 0.0, guidance)
    assert seen == log.num_candidates.tolist()


def test_it_starts_as_the_mission_says():
    log = fly(SHORT, BEHIND, channels_of(STEERING), inference_of(STEERING))
    np.testing.assert_array_equal(log.position_m[0], BEHIND.position_m)
    np.testing.assert_array_equal(log.quaternion_b_from_h[0], [0.0, 0.0, 0.0, 1.0])
    np.testing.assert_array_equal(log.angular_velocity_b_rad_s[0], [0.0, 0.0, MEAN_MOTION])
    np.testing.assert_array_equal(log.quaternion_c_from_h, np.tile([0.0, 0.0, 0.0, 1.0], (21, 1)))
    np.testing.assert_allclose(log.sun_angle_rad, 2.0 - MEAN_MOTION * 10.0 * np.arange(21), rtol=1e-15)
    assert log.delta_v_m_s[0] == 0.0


def test_the_attitude_clock_starts_at_each_sample():
    log = fly(SHORT, BEHIND, channels_of(STEERING), inference_of(STEERING))
    assert log.attitude_quaternion.shape == (20, 10, 4)
    np.testing.assert_array_equal(log.attitude_quaternion[:, 0], log.quaternion_b_from_h[:-1])
    np.testing.assert_array_equal(log.attitude_rate_b_rad_s[:, 0], log.angular_velocity_b_rad_s[:-1])
    assert np.abs(log.torque_b_n_m).max() == 0.01  # the first turn needs all there is


def test_systems_sense_the_logged_state():
    log = fly(SHORT, BEHIND, channels_of(STEERING), inference_of(STEERING))
    body_velocity = Rotation.from_quat(log.quaternion_b_from_h).inv().apply(log.velocity_m_s)[:-1]
    distance = np.linalg.norm(log.position_m, axis=1)[:-1]
    first = [distance, log.lambda_u_rad[:-1], log.eta_u_rad[:-1]]
    np.testing.assert_allclose(log.fis_input[:, :, 0], np.column_stack(first), rtol=0, atol=1e-13)
    np.testing.assert_allclose(log.fis_input[:, :, 1], body_velocity, rtol=0, atol=1e-15)
    np.testing.assert_array_equal(log.fis_input[:, :, 2], 0.0)
    for f, system in enumerate(STEERING):
        expected = inference.evaluate(system, log.fis_input[:, f, :2])[:, 0]
        np.testing.assert_allclose(log.fis_output_n[:, f], expected, rtol=0, atol=1e-15)


def test_body_forces_are_turned_to_hill_then_clipped_there():
    mission = replace(SHORT, deputy=replace(PAPER.deputy, max_force_n=0.01))
    log = fly(mission, BEHIND, channels_of(STEERING), inference_of(STEERING))
    np.testing.assert_allclose(log.force_body_n, log.fis_output_n, rtol=0, atol=1e-15)
    turned = Rotation.from_quat(log.quaternion_b_from_h[:-1]).apply(log.fis_output_n)
    assert np.abs(turned).max() > 0.01
    np.testing.assert_allclose(log.force_hill_n, np.clip(turned, -0.01, 0.01), rtol=0, atol=1e-15)


def test_hill_forces_are_logged_in_body_axes_too():
    systems = restoring_systems()
    log = fly(SHORT, BEHIND, channels_of(systems, "hill"), inference_of(systems))
    np.testing.assert_array_equal(log.force_hill_n, log.fis_output_n)
    turned = Rotation.from_quat(log.quaternion_b_from_h[:-1]).inv().apply(log.force_hill_n)
    np.testing.assert_allclose(log.force_body_n, turned, rtol=0, atol=1e-15)


def test_delta_v_sums_what_was_applied(complete_flight):
    spent = np.cumsum(np.abs(complete_flight.force_hill_n).sum(axis=1)) * 10.0 / 12.0
    np.testing.assert_allclose(complete_flight.delta_v_m_s[1:], spent, rtol=1e-13)


def test_when_every_point_is_inspected_it_coasts(complete_flight):
    is_complete = complete_flight.is_inspected.all(axis=1)[:-1]
    assert is_complete.any()
    np.testing.assert_array_equal(complete_flight.is_decided, ~is_complete)
    for values in (complete_flight.force_hill_n, complete_flight.fis_input, complete_flight.fis_output_n):
        assert not np.any(values[is_complete])
    assert np.all(np.any(complete_flight.force_hill_n[~is_complete], axis=1))


def test_unless_it_may_not(complete_flight):
    mission = replace(PAPER, coast_when_complete=False)
    log = fly(mission, BEHIND, channels_of(STEERING), inference_of(STEERING))
    assert log.is_decided.all()
    is_complete = complete_flight.is_inspected.all(axis=1)[:-1]
    np.testing.assert_array_equal(log.force_hill_n[~is_complete], complete_flight.force_hill_n[~is_complete])
    assert np.any(log.force_hill_n[is_complete])


def test_without_candidates_there_is_no_target(complete_flight):
    is_idle = complete_flight.num_candidates == 0
    assert is_idle.any()
    assert not np.any(complete_flight.target_m[is_idle])
    assert not np.any(complete_flight.lambda_u_rad[is_idle])
    assert not np.any(complete_flight.eta_u_rad[is_idle])
    assert np.all(np.linalg.norm(complete_flight.target_m[~is_idle], axis=1) > 1.0)


def test_a_plan_is_played_to_its_end_and_clipped(complete_flight):
    plan = np.zeros((360, 3))
    plan[:, 1] = 1.5 * np.sin(np.arange(360))
    mission = replace(IDEAL, sensor=replace(PAPER.sensor, half_angle_deg=89.0))
    log = fly(mission, BEHIND, channels_of((), "hill", forced(plan)), inference_of(()))
    np.testing.assert_array_equal(log.force_hill_n, np.clip(plan, -1.0, 1.0))
    assert not log.is_decided.any()
    assert log.fis_output_n.shape == (360, 0)


def test_ideal_pointing_looks_at_the_chief_all_the_time():
    mission = replace(IDEAL, duration_s=200.0)
    log = fly(mission, BEHIND, channels_of(STEERING), inference_of(STEERING))
    boresight = Rotation.from_quat(log.quaternion_b_from_h).apply([-1.0, 0.0, 0.0])
    towards_chief = -log.position_m / np.linalg.norm(log.position_m, axis=1)[:, None]
    np.testing.assert_allclose(boresight, towards_chief, rtol=0, atol=1e-14)
    # the same formula, compiled alone and within another function, which rounds as it likes
    np.testing.assert_allclose(
        log.attitude_quaternion[:, 0], log.quaternion_b_from_h[:-1], rtol=0, atol=1e-15
    )
    steps = np.linalg.norm(np.diff(log.attitude_quaternion.reshape(-1, 4), axis=0), axis=1)
    assert 0.0 < steps.max() < 0.01
    assert not np.any(log.torque_b_n_m)
    assert not np.any(log.angular_velocity_b_rad_s)


def test_a_tumbling_chief_turns_its_points_and_nothing_else():
    chief = replace(PAPER.chief, initial_angular_velocity_rad_s=(0.0, 0.0, MEAN_MOTION + np.pi / 2 / 100.0))
    plan = np.zeros((10, 3))
    logs = [
        fly(mission, BEHIND, channels_of((), "hill", forced(plan)), inference_of(()))
        for mission in (replace(PAPER, duration_s=100.0), replace(PAPER, duration_s=100.0, chief=chief))
    ]
    for name in ("position_m", "quaternion_b_from_h", "sun_angle_rad"):
        np.testing.assert_array_equal(getattr(logs[0], name), getattr(logs[1], name))
    half = np.sqrt(0.5)  # a quarter turn about k
    np.testing.assert_allclose(logs[1].quaternion_c_from_h[-1], [0.0, 0.0, half, half], atol=1e-12)
    # what the chief calls i points along Hill's j then: the centroid of the candidates follows
    points = Rotation.from_euler("z", 90.0, degrees=True).apply(regular_placement(100, 10.0))
    sun = [np.cos(logs[1].sun_angle_rad[-1]), np.sin(logs[1].sun_angle_rad[-1]), 0.0]
    left = (points @ sun > 1e-9) & ~logs[1].is_inspected[-1]
    assert logs[1].num_candidates[-1] == left.sum()


def test_pole_blending_turns_less_over_a_pole():
    flights = [
        fly(
            replace(PAPER, duration_s=600.0, attitude=replace(PAPER.attitude, pole_blending=blending)),
            Scenario(np.array([-12.0, 0.3, 70.0]), np.array([0.1, 0.0, 0.0]), 0.0),
            channels_of((), "hill", forced(np.zeros((60, 3)))),
            inference_of(()),
        )
        for blending in (False, True)
    ]
    plain, blended = (np.linalg.norm(log.angular_velocity_b_rad_s[10:], axis=1).max() for log in flights)
    assert plain > 0.03
    assert blended < 0.01
    for log in flights:
        boresight = Rotation.from_quat(log.quaternion_b_from_h[12:]).apply([-1.0, 0.0, 0.0])
        towards_chief = -log.position_m[12:] / np.linalg.norm(log.position_m[12:], axis=1)[:, None]
        assert np.degrees(np.arccos(np.sum(boresight * towards_chief, axis=1))).max() < 5.0


@pytest.mark.parametrize("period", [0.5, 2.0, 5.0])
def test_other_attitude_clocks_fly_much_the_same(period):
    """Slower ticks hold their torque longer but are integrated in steps of a second."""
    mission = replace(SHORT, deputy=replace(PAPER.deputy, inertia_kg_m2=FULL_INERTIA))
    plan = channels_of((), "hill", forced(np.zeros((20, 3))))
    log = fly(mission, TOWARDS_THE_POLE, plan, inference_of(()))
    other = fly(replace(mission, attitude_period_s=period), TOWARDS_THE_POLE, plan, inference_of(()))
    assert other.torque_b_n_m.shape == (20, round(10.0 / period), 3)
    np.testing.assert_array_equal(other.position_m, log.position_m)
    turn = Rotation.from_quat(log.quaternion_b_from_h[12:]).inv() * Rotation.from_quat(
        other.quaternion_b_from_h[12:]
    )
    assert turn.magnitude().max() < 0.02
