"""What a flight's log must hold, whatever the controller."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pipeline.flight.control.controller import coast
from pipeline.flight.fly.simulation import fly_logged
from pipeline.flight.state.log import Scenario
from pipeline.flight.world.surface import regular_placement
from tests.pipeline.flight.cases import STEERING
from tests.pipeline.flight.missions import (
    BEHIND,
    FULL_INERTIA,
    IDEAL,
    MEAN_MOTION,
    PAPER,
    TOWARDS_THE_POLE,
)

SHORT = replace(PAPER, duration_s=200.0)


def test_it_starts_as_the_mission_says():
    log = fly_logged(SHORT, STEERING, BEHIND)
    np.testing.assert_array_equal(log.position_m[0], BEHIND.position_m)
    np.testing.assert_array_equal(log.quaternion_b_from_h[0], [0.0, 0.0, 0.0, 1.0])
    np.testing.assert_array_equal(log.angular_velocity_b_rad_s[0], [0.0, 0.0, MEAN_MOTION])
    np.testing.assert_array_equal(log.quaternion_c_from_h, np.tile([0.0, 0.0, 0.0, 1.0], (21, 1)))
    np.testing.assert_allclose(log.sun_angle_rad, 2.0 - MEAN_MOTION * 10.0 * np.arange(21), rtol=1e-15)
    assert log.delta_v_m_s[0] == 0.0


def test_the_attitude_clock_starts_at_each_sample():
    log = fly_logged(SHORT, STEERING, BEHIND)
    assert log.attitude_quaternion.shape == (20, 10, 4)
    np.testing.assert_array_equal(log.attitude_quaternion[:, 0], log.quaternion_b_from_h[:-1])
    np.testing.assert_array_equal(log.attitude_rate_b_rad_s[:, 0], log.angular_velocity_b_rad_s[:-1])
    assert np.abs(log.torque_b_n_m).max() == 0.01  # the first turn needs all there is


def test_ideal_pointing_looks_at_the_chief_all_the_time():
    mission = replace(IDEAL, duration_s=200.0)
    log = fly_logged(mission, STEERING, BEHIND)
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
    logs = [
        fly_logged(mission, coast(), BEHIND)
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
        fly_logged(
            replace(PAPER, duration_s=600.0, attitude=replace(PAPER.attitude, pole_blending=blending)),
            coast(),
            Scenario(np.array([-12.0, 0.3, 70.0]), np.array([0.1, 0.0, 0.0]), 0.0),
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
    log = fly_logged(mission, coast(), TOWARDS_THE_POLE)
    other = fly_logged(replace(mission, attitude_period_s=period), coast(), TOWARDS_THE_POLE)
    assert other.torque_b_n_m.shape == (20, round(10.0 / period), 3)
    np.testing.assert_array_equal(other.position_m, log.position_m)
    turn = Rotation.from_quat(log.quaternion_b_from_h[12:]).inv() * Rotation.from_quat(
        other.quaternion_b_from_h[12:]
    )
    assert turn.magnitude().max() < 0.02
