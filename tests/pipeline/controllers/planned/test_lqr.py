"""The regulator: its gain solves the Riccati equation, its loop is stable, it comes to the ring."""

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

from pipeline.controllers.planned.lqr import gain
from pipeline.controllers.source import load
from pipeline.flight.fly.simulation import fly_logged
from pipeline.settings.controllers import planned_settings
from pipeline.settings.experiment import SettingError
from tests.pipeline.controllers.planned.cases import MEAN_MOTION, composed, discrete, flown, planner, starts

SETTINGS = planned_settings(composed("lqr").experiment.controller)
MISSION, STARTS = starts("lqr", "sun=random")


def costs():
    tolerated = [SETTINGS.position_tolerance_m] * 2 + [SETTINGS.height_tolerance_m]
    tolerated += [SETTINGS.velocity_tolerance_m_s] * 3
    return np.diag(1.0 / np.square(tolerated)), np.eye(3) / SETTINGS.force_tolerance_n**2


def test_the_gain_is_that_of_scipys_riccati_solution():
    transition, control = discrete()
    state_cost, force_cost = costs()
    solution = solve_discrete_are(transition, control, state_cost, force_cost)
    expected = np.linalg.inv(force_cost + control.T @ solution @ control) @ control.T @ solution @ transition
    np.testing.assert_allclose(gain(SETTINGS, transition, control), expected, rtol=1e-6, atol=1e-9)


def test_the_closed_loop_is_stable():
    transition, control = discrete()
    poles = np.linalg.eigvals(transition - control @ gain(SETTINGS, transition, control))
    assert np.abs(poles).max() < 1.0
    # within a quarter of an orbit errors fall to a fifth
    assert np.abs(poles).max() ** 142 < 0.2


def test_forces_follow_the_law_to_a_ring_in_phase_with_the_sun():
    controller = load(composed("lqr", "sun=random").experiment.controller, MISSION)
    feedback = gain(SETTINGS, *discrete())
    for start in STARTS:
        plan = fly_logged(MISSION, controller, start).force_hill_n
        states = flown(start, plan)
        turned = MEAN_MOTION * 10.0 * np.arange(361)
        phase = start.sun_angle_rad - SETTINGS.ring_lead_rad - turned
        size, height = SETTINGS.ring_size_m, SETTINGS.max_height_m
        height = np.clip(start.position_m[2], -height, height)
        ring = np.column_stack(
            [
                size * np.cos(phase),
                2 * size * np.sin(phase),
                height * np.cos(turned + SETTINGS.height_lead_rad),
            ]
        )
        # the ring's velocity is the derivative of its position: the phase falls at n
        speed = MEAN_MOTION * np.column_stack(
            [
                size * np.sin(phase),
                -2 * size * np.cos(phase),
                -height * np.sin(turned + SETTINGS.height_lead_rad),
            ]
        )
        error = states - np.hstack([ring, speed])
        asked = np.clip(-(error[:-1] @ feedback.T), -1.0, 1.0)
        asked[np.abs(asked) < SETTINGS.dead_band_n] = 0.0
        np.testing.assert_allclose(plan, asked, atol=1e-7)
        assert np.linalg.norm(error[-1, :3]) < 0.2 * np.linalg.norm(error[0, :3])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"ring_size_m": 110.0},
            "a ring from 110 to 221.5 m from the chief; it must stay within deputy.min_",
        ),
        ({"ring_size_m": 10.0}, "controller.ring_size_m is 10"),
        ({"ring_size_m": "big"}, "controller.ring_size_m is 'big'; it must be a number"),
        ({"position_tolerance_m": 0.0}, "controller.position_tolerance_m is 0.0; it must be greater than 0"),
        ({"ring_lead_rad": 4.0}, "controller.ring_lead_rad is 4.0; it must be from -3.14159 to 3.14159 "),
        ({"force_tolerance_n": 1e-30}, "controller.force_tolerance_n is 1e-30; it must be from 1e-09 to "),
    ],
)
def test_regulators_that_cannot_be(changes, message):
    with pytest.raises(SettingError, match=message):
        planner("lqr", **changes)
