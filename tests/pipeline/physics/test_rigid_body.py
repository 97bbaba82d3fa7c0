from types import SimpleNamespace

import numba
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from fis_tools.compiled.three import Three
from pipeline.flight.reference import turning
from pipeline.flight.reference.pointing import looking, next_y
from pipeline.physics import attitude as attitudes
from pipeline.physics import quaternion as quaternions
from tests.pipeline.physics.what_flies import control_torque, error_vector, turned, turned_by_gradient

MEAN_MOTION = 0.0011068
HILL_RATE = np.array([0.0, 0.0, MEAN_MOTION])
IDENTITY = np.array([0.0, 0.0, 0.0, 1.0])
INERTIA = np.array([[2.0, 0.2, -0.1], [0.2, 1.4, 0.15], [-0.1, 0.15, 1.1]])
CHIEF_INERTIA = np.array([[900.0, 30.0, -50.0], [30.0, 1200.0, 20.0], [-50.0, 20.0, 700.0]])


def turned_by_scipy(inertia, rate, torque, duration):
    """Attitude from body to Hill axes, and the inertial rate in the body, after a held torque."""
    what = SimpleNamespace(deputy=SimpleNamespace(inertia_kg_m2=inertia))
    attitude, relative = Rotation.identity(), np.array(rate) - HILL_RATE
    num_parts = int(np.ceil(duration / 10.0 * max(1.0, np.linalg.norm(rate))))
    for _ in range(num_parts):
        attitude, relative = turning.turned(what, HILL_RATE, attitude, relative, torque, duration / num_parts)
    return attitude, relative + attitude.inv().apply(HILL_RATE)


@pytest.mark.parametrize(("speed", "tolerance"), [(0.05, 2e-6), (0.2, 5e-5)])
def test_steps_turn_as_two_inertial_rotations_do_and_converge_by_their_fourth_power(speed, tolerance):
    """A minute under a held torque, against the deputy's and Hill's own rotations."""
    torque = np.array([0.002, -0.001, 0.0015])
    start_rate = speed * np.array([0.6, -0.5, 0.6])
    attitude, inertial = turned_by_scipy(INERTIA, start_rate + HILL_RATE, torque, 60.0)
    wanted = inertial - attitude.inv().apply(HILL_RATE)
    errors = []
    for step in (1.0, 0.5):
        quaternion, rate = IDENTITY, start_rate
        for _ in range(round(60.0 / step)):
            quaternion, rate = turned(quaternion, rate, INERTIA, torque, step, MEAN_MOTION)
        assert abs(np.linalg.norm(quaternion) - 1.0) < 1e-15
        np.testing.assert_allclose(rate, wanted, atol=tolerance)
        errors.append((Rotation.from_quat(quaternion).inv() * attitude).magnitude())
    assert errors[0] < tolerance
    assert errors[1] < errors[0] / 12.0


def test_the_gradient_of_gravity_turns_as_scipy_and_the_frequency_of_libration_have_it():
    """Pitch of a long body swings by ``n sqrt(3 (J_y - J_x) / J_z)``; any attitude, by Euler's equation."""
    long, swing = np.diag([0.5, 2.0, 2.0]), MEAN_MOTION * 1.5
    start = Rotation.from_rotvec([0.0, 0.0, 0.01]).as_quat()
    angles = Rotation.from_quat(turned_by_gradient(start, long, 1000, MEAN_MOTION)).as_rotvec()
    np.testing.assert_allclose(angles[:, 2], 0.01 * np.cos(swing * np.arange(1001)), rtol=0.0, atol=2e-5)

    tilted = Rotation.from_rotvec([0.5, -0.4, 0.7])

    def rates(time, s):
        body, w = Rotation.from_quat(s[:4]), s[4:]
        upward = body.inv().apply([np.cos(MEAN_MOTION * time), np.sin(MEAN_MOTION * time), 0.0])
        torque = 3.0 * MEAN_MOTION**2 * np.cross(upward, INERTIA @ upward)
        spin = np.linalg.solve(INERTIA, torque - np.cross(w, INERTIA @ w))
        x, y, z, c = s[:4]
        turn = 0.5 * np.array([[c, -z, y], [z, c, -x], [-y, x, c], [-x, -y, -z]]) @ w
        return np.concatenate((turn, spin))

    begin = np.concatenate((tilted.as_quat(), tilted.inv().apply(HILL_RATE)))
    end = solve_ivp(rates, (0.0, 600.0), begin, "DOP853", rtol=1e-10, atol=1e-12).y[:4, -1]
    hill = Rotation.from_rotvec(600.0 * HILL_RATE)
    last = Rotation.from_quat(turned_by_gradient(tilted.as_quat(), INERTIA, 600, MEAN_MOTION)[-1])
    assert ((hill * last).inv() * Rotation.from_quat(end)).magnitude() < 2e-4
    assert (last.inv() * tilted).magnitude() > 0.1


@pytest.mark.parametrize("rate", [(0.2, 0.02, 0.02), (2.0, 0.1, -0.1), (5.0, 0.3, -0.2), (10.0, 1.0, 1.0)])
def test_fast_rotation(rate):
    """Which takes shorter steps the faster it is; over ten seconds."""
    inertia, torque = np.diag([1.0, 2.0, 2.5]), np.array([0.01, -0.01, 0.01])
    attitude, inertial = turned_by_scipy(inertia, rate, torque, 10.0)
    quaternion, relative = IDENTITY, np.array(rate) - HILL_RATE
    for _ in range(10):
        quaternion, relative = turned(quaternion, relative, inertia, torque, 1.0, MEAN_MOTION)
    assert (Rotation.from_quat(quaternion).inv() * attitude).magnitude() < 1e-5
    np.testing.assert_allclose(relative, inertial - attitude.inv().apply(HILL_RATE), rtol=0, atol=2e-5)


@pytest.mark.parametrize(
    ("inertia", "start", "duration", "accuracy"),
    [
        (CHIEF_INERTIA, (0.02, 0.01, -0.03), 600.0, 1e-7),
        (np.diag([900.0, 1200.0, 700.0]), (0.2, 0.3, 0.35), 600.0, None),
        (np.diag([1.0, 2.0, 2.9]), (1.0, 2.0, 3.0), 100.0, None),
        (np.diag([1.0, 1.5, 2.0]), (0.3, 0.1, 0.6), 300.0, None),
    ],
)
def test_a_chief_tumbles_in_inertial_space_and_the_step_fits_how_fast(inertia, start, duration, accuracy):
    """Or it is a second, which is more accurate."""
    rate = np.array(start)
    inverse = np.linalg.inv(inertia)
    step = 1.0 if accuracy else attitudes.longest_tumbling_step(inertia, rate, MEAN_MOTION, duration)
    steps = int(np.ceil(duration / step))
    accuracy = accuracy or 2.0 * attitudes.TUMBLING_TOLERANCE_RAD
    quaternion, rate_at_end = attitudes.tumble(IDENTITY, rate, inertia, inverse, MEAN_MOTION, duration, steps)
    attitude, wanted = turned_by_scipy(inertia, rate, np.zeros(3), duration)
    assert (Rotation.from_quat(quaternion).inv() * attitude).magnitude() < accuracy
    np.testing.assert_allclose(rate_at_end, wanted, atol=min(1e-2 * accuracy, 1e-3) * np.linalg.norm(rate))


def test_a_top_that_spins_fast_for_an_hour_points_where_the_closed_form_says():
    duration = 300.0 if numba.config.DISABLE_JIT else 3600.0  # an hour of plain Python takes 20 s
    inertia, start = np.diag([10.0, 10.0, 16.0]), np.array([0.2, 0.0, 0.7])
    steps = int(np.ceil(duration / attitudes.longest_tumbling_step(inertia, start, 0.0, duration)))
    quaternion, _ = attitudes.tumble(IDENTITY, start, inertia, np.linalg.inv(inertia), 0.0, duration, steps)
    # the body spins about its axis by (J1 - J3)/J1 w3 within a frame that precesses about the momentum
    spin = Rotation.from_rotvec([0.0, 0.0, (10.0 - 16.0) / 10.0 * 0.7 * duration])
    turned = Rotation.from_rotvec(inertia @ start / 10.0 * duration) * spin
    error = (turned.inv() * Rotation.from_quat(quaternion)).magnitude()
    assert error < 2.0 * attitudes.TUMBLING_TOLERANCE_RAD


@pytest.mark.parametrize(("rate", "duration"), [(0.01, 400.0), (0.7, 3600.0)])
def test_the_longest_step_spends_the_tolerance_of_one_error(rate, duration):
    """By the stability function of the Runge-Kutta method, at the fastest rate that the energy allows."""
    start, fastest = np.array([0.0, 0.0, rate]), np.sqrt(2.9) * rate + MEAN_MOTION
    step = attitudes.longest_tumbling_step(np.diag([1.0, 2.0, 2.9]), start, MEAN_MOTION, duration)
    steps, turned = duration / step, fastest * step
    factor = np.polyval([1 / 24, 1 / 6, 1 / 2, 1.0, 1.0], 1j * turned)
    slowed = steps * (turned - np.angle(factor))
    damped = 0.5 * fastest * duration * (1.0 - abs(factor) ** steps)
    assert max(slowed, damped) == pytest.approx(attitudes.TUMBLING_TOLERANCE_RAD, rel=0.02)
    assert (slowed > damped) == (rate == 0.01)


components = arrays(np.float64, 4, elements=st.floats(-1.0, 1.0))
unit_quaternions = components.filter(lambda q: np.linalg.norm(q) > 1e-3).map(lambda q: q / np.linalg.norm(q))
#: the first example waits for the compiler
unhurried = settings(deadline=None)
rates = arrays(np.float64, 3, elements=st.floats(-0.5, 0.5))


@unhurried
@given(unit_quaternions)
def test_the_matrix_is_the_transpose_of_the_active_rotation_and_gives_its_quaternion_back(q):
    matrix = quaternions.dcm_b_from_h(q)
    np.testing.assert_allclose(matrix, Rotation.from_quat(q).as_matrix().T, rtol=0, atol=4e-15)
    back = np.array(quaternions.from_dcm(matrix))
    assert min(np.abs(back - q).max(), np.abs(back + q).max()) < 1e-12
    largest = np.abs(back) > np.abs(back).max() - 1e-9  # several where they are equal
    assert back[largest].max() > 0.0


@pytest.mark.parametrize("half_turn", np.eye(4)[:3])
def test_half_turns_give_their_quaternion_back(half_turn):
    np.testing.assert_array_equal(quaternions.from_dcm(quaternions.dcm_b_from_h(half_turn)), half_turn)


@unhurried
@given(components.filter(lambda q: np.linalg.norm(q) > 1e-3))
def test_normalised_keeps_the_direction(q):
    unit = quaternions.normalised(q)
    assert abs(np.linalg.norm(unit) - 1.0) < 1e-15
    assert unit @ q > 0.999999 * np.linalg.norm(q)


@unhurried
@given(unit_quaternions, unit_quaternions)
def test_the_error_is_the_turn_from_desired_to_actual_whatever_their_signs(q, desired):
    error = error_vector(q, desired)
    scalar = np.sqrt(max(0.0, 1.0 - error @ error))
    turn = quaternions.dcm_b_from_h(q) @ quaternions.dcm_b_from_h(desired).T
    np.testing.assert_allclose(quaternions.dcm_b_from_h(np.append(error, scalar)), turn, rtol=0, atol=1e-7)
    if error @ error < 1.0 - 1e-12:  # at half a turn both ways round are as short
        np.testing.assert_array_equal(error_vector(-q, desired), error)
        np.testing.assert_array_equal(error_vector(q, -desired), error)


@unhurried
@given(unit_quaternions, rates)
def test_the_derivative_is_that_of_a_steady_rotation(q, rate):
    def after(time):
        # body-fixed rate: the active rotation is multiplied on the right
        return (Rotation.from_quat(q) * Rotation.from_rotvec(rate * time)).as_quat()

    h = 1e-3
    ends = [after(-2 * h), after(-h), after(h), after(2 * h)]
    ends = [end if end @ q > 0.0 else -end for end in ends]
    numerical = (ends[0] - 8.0 * ends[1] + 8.0 * ends[2] - ends[3]) / (12.0 * h)
    np.testing.assert_allclose(quaternions.derivative(q, rate), numerical, rtol=0, atol=1e-11)


@pytest.mark.parametrize("blends", [False, True])
@pytest.mark.parametrize("azimuth", [-2.0, 0.05])
def test_the_desired_attitude_is_that_of_the_reference_over_both_poles(azimuth, blends):
    """From where nothing has to turn; so near to a pole that y* is kept, and a little beside it."""
    mission = SimpleNamespace(attitude=SimpleNamespace(pole_blending=blends), attitude_period_s=2.0)
    y, before = Three(0.0, 1.0, 0.0), None
    pole = np.pi / 2 + np.array([-1.01e-3, -0.99e-3, 0.0, 0.99e-3, 1.01e-3])
    for elevation in np.sort(np.concatenate((np.arange(0.0, 2.0 * np.pi, 0.01), pole, pole + np.pi))):
        around = azimuth + 0.02 * elevation  # past the poles, not straight over them
        flat = np.cos(elevation) * np.array([np.cos(around), np.sin(around)])
        position = 60.0 * np.array([*flat, np.sin(elevation)])
        at, blended = Three(*position), blends and before is not None
        y = attitudes.blended_y(at, y, 2.0) if blended else attitudes.desired_y(at, y)
        before = next_y(mission, position, before)
        np.testing.assert_allclose(y, before, atol=1e-10)
        dcm = attitudes.desired_dcm(at, y)
        np.testing.assert_allclose(dcm.T, looking(position, before).as_matrix(), atol=1e-10)
        np.testing.assert_allclose(dcm.T @ [-1.0, 0.0, 0.0], -position / 60.0, atol=1e-15)


def test_the_torque_opposes_error_and_rate_and_is_clipped_and_gains_are_matrices():
    small = Rotation.from_rotvec([0.02, 0.0, 0.0]).as_quat()
    gains = 0.08 * np.eye(3), 0.32 * np.eye(3)
    torque = control_torque(small, IDENTITY, np.zeros(3), *gains, 0.01)
    np.testing.assert_allclose(torque, [-0.08 * np.sin(0.01), 0.0, 0.0], atol=1e-17)
    torque = control_torque(IDENTITY, IDENTITY, np.array([0.0, 0.01, -1.0]), *gains, 0.01)
    np.testing.assert_allclose(torque, [0.0, -0.0032, 0.01], atol=1e-17)
    inertia = np.array([[2.0, 0.3, 0.0], [0.3, 1.0, 0.1], [0.0, 0.1, 1.5]])
    rate = np.array([1.0, -2.0, 3.0])
    torque = control_torque(IDENTITY, IDENTITY, 0.001 * rate, 0.08 * inertia, 0.32 * inertia, 1.0)
    np.testing.assert_allclose(torque, -0.00032 * inertia @ rate, rtol=1e-14)


def errors_after(seconds, axis, angle, line_of_sight_rate):
    """Turn from a misalignment while the line of sight turns about k; return later boresight errors, deg."""
    quaternion = Rotation.from_rotvec(angle * np.array(axis) / np.linalg.norm(axis)).as_quat()
    rate, errors, y = np.zeros(3), [], Three(0.0, 1.0, 0.0)
    for second in range(seconds + 150):
        around = line_of_sight_rate * second
        towards = Three(np.cos(around), np.sin(around), 0.0)
        y = attitudes.desired_y(towards, y)
        desired = np.array(quaternions.from_dcm(attitudes.desired_dcm(towards, y)))
        torque = control_torque(quaternion, desired, rate, 0.08 * np.eye(3), 0.32 * np.eye(3), 0.01)
        boresight = quaternions.dcm_b_from_h(quaternion).T @ [-1.0, 0.0, 0.0]
        errors.append(np.degrees(np.arccos(np.clip(-boresight @ [*towards], -1.0, 1.0))))
        quaternion, rate = turned(quaternion, rate, np.eye(3), torque, 1.0, MEAN_MOTION)
    return np.array(errors[seconds:])


@pytest.mark.parametrize("axis", [[0, 0, 1], [0, 1, 0], [1, 1, 1], [1, -2, 0.5]])
@pytest.mark.parametrize("line_of_sight_rate", [0.0, 0.004, -0.008])
def test_from_100_s_on_the_boresight_is_within_5_deg(axis, line_of_sight_rate):
    assert errors_after(100, axis, np.pi * 0.999, line_of_sight_rate).max() < 5.0


def test_the_lag_is_twice_the_ratio_of_gains_times_the_rate():
    lag = np.radians(errors_after(300, [0, 0, 1], 0.1, 0.004)[-1])
    assert lag == pytest.approx(2.0 * 0.32 / 0.08 * 0.004, rel=0.02)
