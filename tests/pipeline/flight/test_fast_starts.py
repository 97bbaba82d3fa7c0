"""A deputy that starts tumbling fast, against SciPy's integration of Euler's equations and the kinematics."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from fis_tools.compiled.decorator import plainly
from fis_tools.compiled.three import Three
from pipeline.flight.period.act.attitude import turn_body
from pipeline.flight.world.pack import pack_world
from tests.pipeline.flight.missions import PAPER

INERTIA = np.diag([1.0, 2.0, 2.5])
TORQUE = np.array([0.01, -0.01, 0.01])
MISSION = replace(PAPER, deputy=replace(PAPER.deputy, inertia_kg_m2=tuple(map(tuple, INERTIA.tolist()))))


@pytest.mark.parametrize(
    "rate", [(0.2, 0.02, 0.02), (0.3, 0.1, 0.2), (2.0, 0.1, -0.1), (5.0, 0.3, -0.2), (10.0, 1.0, 1.0)]
)
def test_a_period_of_fast_rotation(rate):
    world = pack_world(MISSION)
    attitude, turning = (0.0, 0.0, 0.0, 1.0), Three(*rate)
    with plainly("pipeline"):
        for _ in range(world.num_attitude_steps):
            attitude, turning = turn_body(world, attitude, turning, Three(*TORQUE))

    def change(_, state):
        q, w = state[:4], state[4:]
        # Hill axes turn about k, which is seen from the body through the attitude, Hill to body
        hill_b = Rotation.from_quat(q).inv().apply([0.0, 0.0, world.mean_motion])
        u = w - hill_b
        turned = np.append(0.5 * (q[3] * u + np.cross(q[:3], u)), -0.5 * q[:3] @ u)
        return np.concatenate([turned, np.linalg.solve(INERTIA, TORQUE - np.cross(w, INERTIA @ w))])

    solved = solve_ivp(
        change, (0.0, 10.0), [0.0, 0.0, 0.0, 1.0, *rate], rtol=1e-12, atol=1e-13, method="DOP853"
    )
    wanted = solved.y[:, -1]
    apart = Rotation.from_quat(attitude).inv() * Rotation.from_quat(wanted[:4])
    assert apart.magnitude() < 1e-5
    np.testing.assert_allclose(turning, wanted[4:], rtol=0, atol=2e-5)
