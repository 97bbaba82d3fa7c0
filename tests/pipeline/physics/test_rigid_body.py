import numba
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from fis_tools.compiled.three import Three
from pipeline.physics import quaternion as quaternions
from pipeline.physics.attitude import TUMBLING_TOLERANCE_RAD, euler, longest_tumbling_step, tumble
from pipeline.physics.quaternion import dcm_b_from_h
from tests.pipeline.physics.what_flies import error_vector, turned

MEAN_MOTION = 0.0011068
HILL_RATE = np.array([0.0, 0.0, MEAN_MOTION])
IDENTITY = np.array([0.0, 0.0, 0.0, 1.0])
INERTIA = np.array([[2.0, 0.2, -0.1], [0.2, 1.4, 0.15], [-0.1, 0.15, 1.1]])
CHIEF_INERTIA = np.array([[900.0, 30.0, -50.0], [30.0, 1200.0, 20.0], [-50.0, 20.0, 700.0]])


def integrate(rates, start, duration):
    solution = solve_ivp(rates, (0.0, duration), start, method="DOP853", rtol=1e-13, atol=1e-14)
    return solution.y[:, -1]


def inertial_rotation(inertia, torque):
    """Euler's equation and quaternion kinematics in inertial space, written out for the integrator."""
    inverse = np.linalg.inv(inertia)

    def rates(time, state):
        (x, y, z, s), (a, b, c) = state[:4].tolist(), state[4:].tolist()
        e, f, g = (inertia @ state[4:]).tolist()
        acceleration = inverse @ (torque(time) - np.array([b * g - c * f, c * e - a * g, a * f - b * e]))
        turning = [
            0.5 * (s * a + (y * c - z * b)),
            0.5 * (s * b + (z * a - x * c)),
            0.5 * (s * c + (x * b - y * a)),
            -0.5 * (x * a + y * b + z * c),
        ]
        return np.append(turning, acceleration)

    return rates


def matrix(quaternion):
    return Rotation.from_quat(quaternion).as_matrix().T


def test_free_rotation_keeps_energy_and_momentum():
    inverse = np.linalg.inv(CHIEF_INERTIA)
    rate = np.array([0.05, -0.03, 0.08])
    quaternion, momentum_h = IDENTITY, CHIEF_INERTIA @ rate
    energy = rate @ momentum_h
    quaternion, rate = tumble(quaternion, rate, CHIEF_INERTIA, inverse, 0.0, 3600.0, 3600)
    assert rate @ CHIEF_INERTIA @ rate == pytest.approx(energy, rel=1e-7)
    turned_back = dcm_b_from_h(quaternion).T @ CHIEF_INERTIA @ rate
    np.testing.assert_allclose(turned_back, momentum_h, atol=1e-5 * np.linalg.norm(momentum_h))


def test_an_axisymmetric_body_precesses_as_the_closed_form_says():
    """The transverse rate turns in the body at ``(J3 - J1)/J1 w3``; J3 keeps its own rate."""
    inertia = np.diag([10.0, 10.0, 16.0])
    spin, transverse = 0.05, 0.02
    rate, quaternion = np.array([transverse, 0.0, spin]), IDENTITY
    quaternion, rate = tumble(quaternion, rate, inertia, np.linalg.inv(inertia), 0.0, 600.0, 600)
    phase = (16.0 - 10.0) / 10.0 * spin * 600.0
    expected = [transverse * np.cos(phase), transverse * np.sin(phase), spin]
    np.testing.assert_allclose(rate, expected, atol=1e-8)
    # seen from outside, the symmetry axis turns about the momentum at |H|/J1
    momentum = np.array([10.0 * transverse, 0.0, 16.0 * spin])
    precession = np.linalg.norm(momentum) / 10.0 * 600.0 * momentum / np.linalg.norm(momentum)
    axis = Rotation.from_rotvec(precession).apply([0.0, 0.0, 1.0])
    np.testing.assert_allclose(dcm_b_from_h(quaternion)[2], axis, atol=1e-6)


def test_eulers_equation_of_a_spinning_top_balances_its_torque():
    inertia = np.diag([1.0, 1.0, 2.0])
    acceleration = euler(inertia, np.linalg.inv(inertia), Three(0.0, 0.1, 1.0), Three(0.1, 0.0, 0.0))
    np.testing.assert_allclose(acceleration, [0.1 - (2.0 - 1.0) * 0.1 * 1.0, 0.0, 0.0], atol=1e-16)


@pytest.mark.parametrize(("speed", "tolerance"), [(0.05, 2e-6), (0.2, 5e-5)])
def test_steps_turn_as_two_inertial_rotations_do_and_converge_by_their_fourth_power(speed, tolerance):
    """A minute under a held torque, against the deputy's and Hill's own rotations."""
    torque = np.array([0.002, -0.001, 0.0015])
    start_rate = speed * np.array([0.6, -0.5, 0.6])
    deputy = integrate(
        inertial_rotation(INERTIA, lambda _: torque), [*IDENTITY, *(start_rate + HILL_RATE)], 60.0
    )
    dcm = matrix(deputy[:4]) @ Rotation.from_rotvec(60.0 * HILL_RATE).as_matrix()
    errors = []
    for step in (1.0, 0.5):
        quaternion, rate = IDENTITY, start_rate
        for _ in range(round(60.0 / step)):
            quaternion, rate = turned(quaternion, rate, INERTIA, torque, step, MEAN_MOTION)
        assert abs(np.linalg.norm(quaternion) - 1.0) < 1e-15
        np.testing.assert_allclose(rate, deputy[4:] - dcm @ HILL_RATE, atol=tolerance)
        errors.append(np.abs(matrix(quaternion) - dcm).max())
    assert errors[0] < tolerance
    assert errors[1] < errors[0] / 12.0


def test_a_tumbling_chief_turns_in_inertial_space_and_is_seen_from_hill():
    rate_start = np.array([0.02, 0.01, -0.03])
    inverse = np.linalg.inv(CHIEF_INERTIA)
    quaternion, rate = tumble(IDENTITY, rate_start, CHIEF_INERTIA, inverse, MEAN_MOTION, 600.0, 600)
    chief = integrate(
        inertial_rotation(CHIEF_INERTIA, lambda _: np.zeros(3)), [*IDENTITY, *rate_start], 600.0
    )
    hill = Rotation.from_rotvec(600.0 * HILL_RATE).as_matrix().T
    np.testing.assert_allclose(matrix(quaternion), matrix(chief[:4]) @ hill.T, atol=1e-7)
    np.testing.assert_allclose(rate, chief[4:], atol=1e-10)


@pytest.mark.parametrize(
    ("moments", "start", "duration"),
    [
        ((900.0, 1200.0, 700.0), (0.2, 0.3, 0.35), 600.0),
        ((1.0, 2.0, 2.9), (1.0, 2.0, 3.0), 100.0),
        ((1.0, 1.5, 2.0), (0.3, 0.1, 0.6), 300.0),
    ],
)
def test_the_step_fits_how_fast_a_chief_turns(moments, start, duration):
    inertia, rate_start = np.diag(moments), np.array(start)
    step = longest_tumbling_step(inertia, rate_start, MEAN_MOTION, duration)
    quaternion, rate = tumble(
        IDENTITY,
        rate_start,
        inertia,
        np.linalg.inv(inertia),
        MEAN_MOTION,
        duration,
        int(np.ceil(duration / step)),
    )
    chief = integrate(inertial_rotation(inertia, lambda _: np.zeros(3)), [*IDENTITY, *rate_start], duration)
    hill = Rotation.from_rotvec(duration * HILL_RATE).as_matrix().T
    off = Rotation.from_matrix(dcm_b_from_h(quaternion).T @ matrix(chief[:4]) @ hill.T).magnitude()
    assert off < 2.0 * TUMBLING_TOLERANCE_RAD
    np.testing.assert_allclose(rate, chief[4:], atol=1e-3 * np.linalg.norm(rate_start))


def test_a_top_that_spins_fast_for_an_hour_points_where_the_closed_form_says():
    duration = 300.0 if numba.config.DISABLE_JIT else 3600.0  # an hour of plain Python takes 20 s
    inertia, rate_start = np.diag([10.0, 10.0, 16.0]), np.array([0.2, 0.0, 0.7])
    steps = int(np.ceil(duration / longest_tumbling_step(inertia, rate_start, 0.0, duration)))
    quaternion, _ = tumble(IDENTITY, rate_start, inertia, np.linalg.inv(inertia), 0.0, duration, steps)
    momentum = inertia @ rate_start
    # the body spins about its axis by (J1 - J3)/J1 w3 within a frame that precesses about the momentum
    spin = Rotation.from_rotvec([0.0, 0.0, (10.0 - 16.0) / 10.0 * 0.7 * duration])
    turned = Rotation.from_rotvec(momentum / 10.0 * duration) * spin
    assert (turned.inv() * Rotation.from_quat(quaternion)).magnitude() < 2.0 * TUMBLING_TOLERANCE_RAD


components = arrays(np.float64, 4, elements=st.floats(-1.0, 1.0))
unit_quaternions = components.filter(lambda q: np.linalg.norm(q) > 1e-3).map(lambda q: q / np.linalg.norm(q))
#: the first example waits for the compiler
unhurried = settings(deadline=None)
rates = arrays(np.float64, 3, elements=st.floats(-0.5, 0.5))


def same_rotation(a, b):
    return np.abs(a - b).max() < 1e-12 or np.abs(a + b).max() < 1e-12


@unhurried
@given(unit_quaternions)
def test_the_matrix_is_the_transpose_of_the_active_rotation_by_the_same_numbers(q):
    np.testing.assert_allclose(
        quaternions.dcm_b_from_h(q), Rotation.from_quat(q).as_matrix().T, rtol=0, atol=4e-15
    )


def test_a_turned_body_sees_hill_axes_turned_the_other_way():
    quarter_turn_about_k = np.array([0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)])
    i_in_body = quaternions.dcm_b_from_h(quarter_turn_about_k) @ np.array([1.0, 0.0, 0.0])
    np.testing.assert_allclose(i_in_body, [0.0, -1.0, 0.0], atol=1e-15)


@unhurried
@given(unit_quaternions, unit_quaternions)
def test_matrices_of_a_product_multiply_in_reverse(a, b):
    np.testing.assert_allclose(
        quaternions.dcm_b_from_h((Rotation.from_quat(a) * Rotation.from_quat(b)).as_quat()),
        quaternions.dcm_b_from_h(b) @ quaternions.dcm_b_from_h(a),
        rtol=0,
        atol=4e-15,
    )


@unhurried
@given(unit_quaternions)
def test_a_matrix_gives_its_quaternion_back(q):
    back = quaternions.from_dcm(quaternions.dcm_b_from_h(q))
    assert same_rotation(back, q)
    largest = np.abs(back) > np.abs(back).max() - 1e-9  # several where they are equal
    assert back[largest].max() > 0.0


def test_half_turns_give_their_quaternion_back():
    for axis in range(3):
        half_turn = np.zeros(4)
        half_turn[axis] = 1.0
        back = quaternions.from_dcm(quaternions.dcm_b_from_h(half_turn))
        np.testing.assert_array_equal(back, half_turn)


@unhurried
@given(components.filter(lambda q: np.linalg.norm(q) > 1e-3))
def test_normalised_keeps_the_direction(q):
    unit = quaternions.normalised(q)
    assert abs(np.linalg.norm(unit) - 1.0) < 1e-15
    assert unit @ q > 0.999999 * np.linalg.norm(q)


@unhurried
@given(unit_quaternions, unit_quaternions)
def test_the_error_is_the_turn_from_desired_to_actual(q, desired):
    error = error_vector(q, desired)
    scalar = np.sqrt(max(0.0, 1.0 - error @ error))
    turn = quaternions.dcm_b_from_h(q) @ quaternions.dcm_b_from_h(desired).T
    np.testing.assert_allclose(quaternions.dcm_b_from_h(np.append(error, scalar)), turn, rtol=0, atol=1e-7)


@unhurried
@given(unit_quaternions, unit_quaternions)
def test_the_error_ignores_the_signs_of_the_quaternions(q, desired):
    error = error_vector(q, desired)
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
