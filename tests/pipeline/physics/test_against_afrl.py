"""Motion and attitude against the tables that AFRL tests its own spacecraft by.

Theirs are integrated by Runge-Kutta methods with single precision in the derivatives; a case tells how far
off it may be. Their attitude turns as if Hill axes did not, and their wheels stop at a rate, which ours have
no limit for.
"""

import numpy as np
import pytest

from pipeline.array_types import Floats
from pipeline.physics.quaternion import dcm_b_from_h
from tests.pipeline.physics.what_flies import motion_over, propagate, turned
from tests.places import PROJECT

#: their defaults
MEAN_MOTION, MASS, MAX_FORCE, INERTIA, FASTEST = 0.001027, 12.0, 1.0, 0.0573 * np.eye(3), 0.034907
STEP_S = 0.1
TABLES = PROJECT / "tests" / "pipeline" / "physics" / "afrl"


@pytest.mark.parametrize("case", np.genfromtxt(TABLES / "cwh.csv", delimiter=",", skip_header=2))
def test_motion(case: Floats) -> None:
    start, force, seconds, end, bound = np.split(case, [6, 9, 10, 16])
    motion = motion_over(MEAN_MOTION, float(seconds[0]), MASS)
    moved = propagate(motion, start, np.clip(force, -MAX_FORCE, MAX_FORCE))
    np.testing.assert_allclose(moved, end, rtol=0, atol=0.01 * bound[0])


@pytest.mark.parametrize("case", np.genfromtxt(TABLES / "sixdof.csv", delimiter=",", skip_header=2))
def test_motion_and_attitude(case: Floats) -> None:
    """The force acts along the axes of the body halfway through each step."""
    start, force, torque, seconds, end, bound = np.split(case, [13, 16, 19, 20, 33])
    position, quaternion, velocity, rate = np.split(start, [3, 7, 10])
    force = np.clip(force, -MAX_FORCE, MAX_FORCE)
    state, step = np.concatenate((position, velocity)), motion_over(MEAN_MOTION, STEP_S, MASS)
    for _ in range(round(float(seconds[0]) / STEP_S)):
        is_fastest = np.abs(rate + 0.5 * STEP_S * np.linalg.solve(INERTIA, torque)).max() > FASTEST
        turning = quaternion, rate, INERTIA, np.zeros(3) if is_fastest else torque
        force_h = dcm_b_from_h(turned(*turning, 0.5 * STEP_S)[0]).T @ force
        state = propagate(step, state, force_h)
        quaternion, rate = turned(*turning, STEP_S)
    is_told = ~np.isnan(end)
    predicted = np.concatenate((state[:3], quaternion, state[3:], rate))
    np.testing.assert_allclose(predicted[is_told], end[is_told], rtol=0, atol=bound[0])
