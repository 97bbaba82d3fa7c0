from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pipeline.physics.attitude import FIRST_Y, RETURN_RATE
from pipeline.physics.quaternion import dcm_b_from_h, from_dcm
from tests.pipeline.physics.what_flies import blended_y, control_torque, desired_dcm, desired_y, turned
from tests.readable_flight.pointing import looking, next_y

IDENTITY = np.array([0.0, 0.0, 0.0, 1.0])
MAX_TORQUE = 0.01


def above(elevation, azimuth=0.0, distance=60.0):
    return distance * np.array(
        [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)]
    )


@pytest.mark.parametrize("blends", [False, True])
@pytest.mark.parametrize("azimuth", [-2.0, 0.05])
def test_the_desired_attitude_is_that_of_the_readable_flight_over_both_poles(azimuth, blends):
    """From where nothing has to turn; so near to a pole that y* is kept, and a little beside it."""
    attitude = SimpleNamespace(pole_blending=blends)
    mission = SimpleNamespace(attitude=attitude, attitude_period_s=1.0)
    y = np.array(FIRST_Y)
    before = None
    pole = np.pi / 2 + np.array([-1.01e-3, -0.99e-3, 0.0, 0.99e-3, 1.01e-3])
    for elevation in np.sort(np.concatenate((np.arange(0.0, 2.0 * np.pi, 0.01), pole, pole + np.pi))):
        position = above(elevation, azimuth + 0.02 * elevation)  # past the poles, not straight over them
        y = desired_y(position, y) if before is None or not blends else blended_y(position, y, 1.0)
        before = next_y(mission, position, before)
        np.testing.assert_allclose(y, before, atol=1e-10)
        dcm = desired_dcm(position, y)
        np.testing.assert_allclose(dcm.T, looking(position, before).as_matrix(), atol=1e-10)
        np.testing.assert_allclose(dcm.T @ [-1.0, 0.0, 0.0], -position / 60.0, atol=1e-15)


def test_a_first_instant_on_the_i_axis_has_nothing_to_turn_and_one_over_a_pole_takes_j():
    dcm = desired_dcm(above(0.0), desired_y(above(0.0), np.array(FIRST_Y)))
    np.testing.assert_array_equal(from_dcm(dcm), IDENTITY)
    np.testing.assert_array_equal(desired_y(np.array([0.0, 0.0, 60.0]), np.array(FIRST_Y)), FIRST_Y)


def test_blending_never_turns_y_about_x_faster_than_its_rate():
    y = desired_y(above(1.2), np.array(FIRST_Y))
    x_before, y_before = above(1.2) / 60.0, y
    largest = 0.0
    for elevation in np.arange(1.2, np.pi - 1.2, 0.002):  # over the pole, where the plain y* flips
        position = above(elevation, 0.05)
        y = blended_y(position, y, 1.0)
        x = position / 60.0
        carried = Rotation.align_vectors([x, np.cross(x_before, x)], [x_before, np.cross(x_before, x)])[0]
        turn = np.arccos(min(1.0, carried.apply(y_before) @ y)) if np.any(x != x_before) else 0.0
        largest = max(largest, turn)
        x_before, y_before = x, y
    assert largest < 1.02 * RETURN_RATE
    assert y @ desired_y(position, y) < 0.0  # still the other way round: half a turn takes 628 s


def test_blending_returns_in_time():
    position, y = above(0.3), -desired_y(above(0.3), np.array(FIRST_Y))
    for _ in range(int(np.pi / RETURN_RATE / 2.0) + 1):
        y = blended_y(position, y, 2.0)
    np.testing.assert_allclose(y, desired_y(position, y), atol=1e-14)


def test_the_torque_opposes_error_and_rate_and_is_clipped_and_gains_are_matrices():
    small = from_dcm(Rotation.from_rotvec([0.02, 0.0, 0.0]).as_matrix().T)
    gains = 0.08 * np.eye(3), 0.32 * np.eye(3)
    torque = control_torque(small, IDENTITY, np.zeros(3), *gains, MAX_TORQUE)
    np.testing.assert_allclose(torque, [-0.08 * np.sin(0.01), 0.0, 0.0], atol=1e-17)
    torque = control_torque(IDENTITY, IDENTITY, np.array([0.0, 0.01, -1.0]), *gains, MAX_TORQUE)
    np.testing.assert_allclose(torque, [0.0, -0.0032, MAX_TORQUE], atol=1e-17)
    inertia = np.array([[2.0, 0.3, 0.0], [0.3, 1.0, 0.1], [0.0, 0.1, 1.5]])
    rate = np.array([1.0, -2.0, 3.0])
    torque = control_torque(IDENTITY, IDENTITY, 0.001 * rate, 0.08 * inertia, 0.32 * inertia, 1.0)
    np.testing.assert_allclose(torque, -0.00032 * inertia @ rate, rtol=1e-14)


def errors_after(seconds, axis, angle, line_of_sight_rate):
    """Turn from a misalignment while the line of sight turns about k; return later boresight errors, deg."""
    quaternion = Rotation.from_rotvec(angle * np.array(axis) / np.linalg.norm(axis)).as_quat()
    rate, errors, y = np.zeros(3), [], np.array(FIRST_Y)
    inertia = np.eye(3)
    for second in range(seconds + 150):
        position = above(0.0, line_of_sight_rate * second)
        y = desired_y(position, y)
        desired = from_dcm(desired_dcm(position, y))
        torque = control_torque(quaternion, desired, rate, 0.08 * inertia, 0.32 * inertia, MAX_TORQUE)
        boresight = dcm_b_from_h(quaternion).T @ [-1.0, 0.0, 0.0]
        errors.append(np.degrees(np.arccos(np.clip(-boresight @ position / 60.0, -1.0, 1.0))))
        quaternion, rate = turned(quaternion, rate, inertia, torque, 1.0, 0.0011068)
    return np.array(errors[seconds:])


@pytest.mark.parametrize("axis", [[0, 0, 1], [0, 1, 0], [1, 1, 1], [1, -2, 0.5]])
@pytest.mark.parametrize("line_of_sight_rate", [0.0, 0.004, -0.008])
def test_from_100_s_on_the_boresight_is_within_5_deg(axis, line_of_sight_rate):
    assert errors_after(100, axis, np.pi * 0.999, line_of_sight_rate).max() < 5.0


def test_the_lag_is_twice_the_ratio_of_gains_times_the_rate():
    lag = np.radians(errors_after(300, [0, 0, 1], 0.1, 0.004)[-1])
    assert lag == pytest.approx(2.0 * 0.32 / 0.08 * 0.004, rel=0.02)
