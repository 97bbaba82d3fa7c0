import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pipeline.physics.motion import Motion, input_matrix, state_transition
from tests.pipeline.physics.what_flies import propagate

MEAN_MOTION = 0.0011068
MASS = 12.0
START = np.array([75.0, -40.0, 20.0, 0.05, -0.1, 0.02])


def integrate(state, force, duration, mean_motion=MEAN_MOTION):
    """Integrate the equations of motion as the paper writes them."""
    n = mean_motion

    def motion(_, s):
        x, _, z, vx, vy, vz = s
        return [
            vx,
            vy,
            vz,
            3.0 * n * n * x + 2.0 * n * vy + force[0] / MASS,
            -2.0 * n * vx + force[1] / MASS,
            -n * n * z + force[2] / MASS,
        ]

    scale = np.array([1.0, 1.0, 1.0, n, n, n])
    solution = solve_ivp(motion, (0.0, duration), state, method="DOP853", rtol=1e-13, atol=1e-12 * scale)
    return solution.y[:, -1]


def over(duration: float) -> Motion:
    """Motion by the closed form."""
    return Motion(
        state_transition(MEAN_MOTION, duration)[np.newaxis],
        input_matrix(MEAN_MOTION, duration, MASS)[np.newaxis],
    )


@pytest.mark.parametrize("duration", [0.5, 1.0, 10.0, 600.0, 3600.0, 40000.0])
def test_free_motion_is_that_of_the_differential_equation(duration):
    state = propagate(over(duration), START, np.zeros(3))
    expected = integrate(START, np.zeros(3), duration)
    np.testing.assert_allclose(state[:3], expected[:3], rtol=1e-10, atol=1e-8)
    np.testing.assert_allclose(state[3:], expected[3:], rtol=1e-10, atol=1e-11)


@pytest.mark.parametrize("duration", [0.5, 1.0, 10.0, 600.0, 3600.0])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_held_force_moves_as_the_differential_equation_says(duration, axis):
    force = np.eye(3)[axis]
    gained = input_matrix(MEAN_MOTION, duration, MASS)[:, axis]
    expected = integrate(np.zeros(6), force, duration)
    np.testing.assert_allclose(gained[:3], expected[:3], rtol=1e-10, atol=1e-12 * np.abs(expected[:3]).max())
    np.testing.assert_allclose(gained[3:], expected[3:], rtol=1e-10, atol=1e-12 * np.abs(expected[3:]).max())


def test_an_hour_of_forces_held_for_10_s():
    rng = np.random.default_rng(3)
    motion = over(10.0)
    state = expected = START
    for force in rng.uniform(-0.05, 0.05, (360, 3)):
        state = propagate(motion, state, force)
        expected = integrate(expected, force, 10.0)
    np.testing.assert_allclose(state[:3], expected[:3], rtol=0, atol=1e-8)
    np.testing.assert_allclose(state[3:], expected[3:], rtol=0, atol=1e-11)
