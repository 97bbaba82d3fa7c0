import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from pipeline.physics import quaternion as quaternions
from tests.pipeline.physics.what_flies import error_vector

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
