"""What a flight's log must hold, whatever the controller."""

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from pipeline.flight.control.controller import coast
from pipeline.flight.fly.simulation import fly_logged
from pipeline.flight.state.log import Scenario
from tests.pipeline.flight.cases import STEERING
from tests.pipeline.flight.missions import BEHIND, MEAN_MOTION, PAPER

SHORT = replace(PAPER, duration_s=200.0)


def test_it_starts_as_the_mission_says():
    log = fly_logged(SHORT, STEERING, BEHIND)
    np.testing.assert_array_equal(log.position_m[0], BEHIND.position_m)
    np.testing.assert_array_equal(log.quaternion_b_from_h[0], [0.0, 0.0, 0.0, 1.0])
    np.testing.assert_array_equal(log.angular_velocity_b_rad_s[0], [0.0, 0.0, MEAN_MOTION])
    np.testing.assert_array_equal(log.quaternion_c_from_h, np.tile([0.0, 0.0, 0.0, 1.0], (21, 1)))
    np.testing.assert_allclose(log.sun_angle_rad, 2.0 - MEAN_MOTION * 10.0 * np.arange(21), rtol=1e-15)
    assert log.delta_v_m_s[0] == 0.0


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
