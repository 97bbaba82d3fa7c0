"""A deputy that waits 20 m ahead of the chief, where nothing pulls it: its points can be counted by hand.

From (0, 20, 0) the visible cap reaches acos(10/20) = 60 deg from +j, that is points with y >= 5 m. Of the
ring at polar angle 50 deg (13 points every 27.69 deg, azimuth from 40.75 to 139.25 deg) these are the
azimuths 55.4, 83.1, 110.8, 138.5; at 70 deg (16 every 22.5, from 32.15 to 147.85) 45, 67.5, 90, 112.5, 135;
at 90 deg (17 every 21.18, from 30 to 150) 42.4, 63.5, 84.7, 105.9, 127.1, 148.2; at 30 deg the highest, at
azimuth 80, has y = 4.92. With the mirror images below the orbit plane 2 (4 + 5) + 6 = 24 points.
"""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.flight.control.controller import coast, open_loop
from pipeline.flight.fly.simulation import fly_all, fly_logged
from pipeline.flight.state.log import Scenario
from pipeline.flight.world.limits import metres_beyond
from pipeline.flight.world.surface import regular_placement
from pipeline.settings.equipment import RealActuators
from tests.pipeline.flight.missions import IDEAL, MEAN_MOTION, PAPER

AZIMUTHS = {50: [55.385, 83.077, 110.769, 138.462], 70: [45.0, 67.5, 90.0, 112.5, 135.0]}
EQUATOR = [42.353, 63.529, 84.706, 105.882, 127.059, 148.235]
#: looks at the middle of what is left, as most flights that are compiled
CENTRED = replace(IDEAL, guidance=replace(IDEAL.guidance, kind="centroid"))


def wait(sun_deg, duration_s=100.0, mission=IDEAL, half_angle_deg=80.0):
    mission = replace(
        mission, duration_s=duration_s, sensor=replace(mission.sensor, half_angle_deg=half_angle_deg)
    )
    scenario = Scenario(np.array([0.0, 20.0, 0.0]), np.zeros(3), np.radians(sun_deg))
    return fly_logged(mission, coast(), scenario)


def counted(dark_up_to_deg):
    """Points of the cap whose azimuth exceeds the terminator's."""
    on_rings = sum(azimuth > dark_up_to_deg for ring in AZIMUTHS.values() for azimuth in ring)
    return 2 * on_rings + sum(azimuth > dark_up_to_deg for azimuth in EQUATOR)


def test_with_the_sun_behind_the_whole_cap_is_inspected_at_once_and_stays_so_when_the_sun_has_left_it():
    log = wait(90.0, 3600.0)
    assert counted(0.0) == 24
    np.testing.assert_array_equal(log.is_inspected.sum(axis=1), 24)
    points = regular_placement(100, 10.0)
    np.testing.assert_array_equal(log.is_inspected[0], points[:, 1] >= 5.0)
    # candidates are what is lit and left
    assert log.num_candidates[0] == (points[:, 1] > 1e-9).sum() - 24
    assert 90.0 - np.degrees(MEAN_MOTION) * 3600.0 < -90.0


def test_with_the_sun_opposite_nothing_is():
    assert wait(270.0).is_inspected.sum() == 0


def test_as_the_sun_sinks_the_terminator_uncovers_points_one_ring_after_another():
    """The Sun starts over azimuth 180 deg; the terminator's near side, 90 deg behind, recedes from 90 deg."""
    log = wait(180.0, 600.0)
    degrees_a_sample = np.degrees(MEAN_MOTION) * 10.0
    expected = [counted(90.0 - degrees_a_sample * k) for k in range(61)]
    assert expected[:2] == [11, 13]  # the two at 90 deg lie in the dark at first
    assert expected[-1] == 21
    np.testing.assert_array_equal(log.is_inspected.sum(axis=1), expected)


@pytest.mark.parametrize(("half_angle_deg", "points"), [(5.0, 0), (6.0, 1), (15.0, 2), (30.1, 24)])
def test_the_field_of_view_narrows_the_cap(half_angle_deg, points):
    """A point at psi from +j is seen at atan(10 sin psi/(20 - 10 cos psi)) from the boresight.

    On the equator azimuth 84.7 lies at psi = 5.29 deg and is seen at 5.25 deg, 105.9 at 15.88 and 14.77
    deg. The next, on the rings at 70 deg, lie at 20 deg and are seen at 17.9 deg; the limb of the cap is
    seen at 30 deg.
    """
    assert wait(90.0, 10.0, half_angle_deg=half_angle_deg).is_inspected[-1].sum() == points


def test_points_too_near_are_out_of_focus():
    """Within 18.65 deg of +j they are nearer than 11 m: of the equator's, azimuths 84.7 and 105.9."""
    focused = replace(CENTRED, sensor=replace(IDEAL.sensor, min_range_m=11.0))
    assert wait(90.0, 10.0, focused).is_inspected[-1].sum() == 22


@pytest.mark.parametrize(("turn", "points"), [(0.0, 5), (90.0, 4)])
def test_a_rectangular_field_of_view(turn, points):
    """A point is seen at atan(|x|/(20 - y)) across and atan(|z|/(20 - y)) up.

    Across come 84.7 of the equator (5.2 deg), 90 of the rings at 70 deg (0 across, 17.9 up) and 83.1 of those
    at 50 deg (4.3, 27.4). Turned by a right angle, 84.7, 105.9, 63.5 and 127.1 (26.6 deg) of the equator.
    """
    up = (0.0, float(np.sin(np.radians(turn))), float(np.cos(np.radians(turn))))
    sensor = replace(IDEAL.sensor, rectangle_deg=(8.5, 28.0), up=up)
    mission = replace(CENTRED, sensor=sensor, duration_s=10.0)
    log = fly_logged(mission, coast(), Scenario(np.array([0.0, 20.0, 0.0]), np.zeros(3), 0.5 * np.pi))
    assert log.is_inspected[-1].sum() == points


def test_spheres_that_turn_with_the_chief():
    """One 14 m out of a chief that spins by w about k goes past the deputy, as near as 6 m at 90 deg.

    By the law of cosines it is ``sqrt(20^2 + 14^2 - 2 20 14 sin((w - n) t))`` away.
    """
    spin, time = 0.006, 10.0 * np.arange(61)
    boom = ((14.0, 0.0, 0.0, 8.0), (0.0, 0.0, -14.0, 8.0))
    chief = replace(IDEAL.chief, keep_out_m=boom, initial_angular_velocity_rad_s=(0.0, 0.0, spin))
    mission = replace(IDEAL, chief=chief, duration_s=600.0)
    start = Scenario(np.array([0.0, 20.0, 0.0]), np.zeros(3), 0.5 * np.pi)
    apart = np.sqrt(20.0**2 + 14.0**2 - 2 * 20.0 * 14.0 * np.sin((spin - MEAN_MOTION) * time))
    log = fly_logged(mission, coast(), start)
    np.testing.assert_allclose(metres_beyond(mission, log), np.maximum(8.0 - apart, -5.0), atol=1e-3)
    for flight in ("compiled", "reference"):
        outcomes = fly_all(replace(mission, flight=flight), coast(), [start], 1)
        assert outcomes.outside_m[0] == pytest.approx((8.0 - apart[1:]).max(), abs=1e-3)
    assert 1.5 < (8.0 - apart).max() < 2.0


def test_a_thruster_that_fails_fires_until_then():
    """It pushes up by 0.01 N; of ten control periods those that begin before 45 s are five.

    Drifting aside, it fires others a little.
    """
    rows = [tuple(sign * part for part in axis) for axis in np.eye(3).tolist() for sign in (1.0, -1.0)]
    exact = {"scale_error": 0.0, "misalignment_deg": 0.0, "least_impulse_n_s": 0.0}
    fails = {"failed_thruster": 0, "failure_s": 45.0}
    layout = RealActuators(thrusters=tuple((0.0, 0.0, 0.0, *row, 0.5) for row in rows), **exact, **fails)
    above = Scenario(np.array([60.0, 0.0, 0.0]), np.zeros(3), 0.0)
    push = open_loop("push", np.tile([0.01, 0.0, 0.0], (10, 1)))
    log = fly_logged(replace(CENTRED, duration_s=100.0, actuators=layout), push, above)
    np.testing.assert_allclose(log.delta_v_m_s[[5, 10]], 5 * 0.01 * 10.0 / 12.0, rtol=5e-3)


def test_a_camera_that_looks_elsewhere_sees_nothing_until_it_has_turned():
    log = wait(90.0, 600.0, PAPER, 15.0)
    assert log.is_inspected[0].sum() == 0
    np.testing.assert_array_equal(log.quaternion_b_from_h[0], [0.0, 0.0, 0.0, 1.0])
    assert log.is_inspected[-1].sum() == 2
