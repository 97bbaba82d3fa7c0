"""What thrusters fire, against closed forms: rotated thrust keeps its length, and a tank ends at empty."""

from dataclasses import replace
from math import exp

import numpy as np
import pytest

from fis_tools.compiled.decorator import plainly
from pipeline.flight.cases.actuators import thrust_errors
from pipeline.flight.control.controller import open_loop
from pipeline.flight.fly.simulation import fly_logged
from pipeline.flight.state.log import Scenario
from pipeline.settings.mission import STANDARD_GRAVITY_M_S2
from pipeline.settings.mission_parts import Actuators
from tests.pipeline.flight.missions import IDEAL

START = Scenario(np.array([60.0, 20.0, 10.0]), np.zeros(3), 0.3, 0.0, (1, 0, 0))
REAL = Actuators(kind="real", scale_error=0.0, misalignment_deg=0.0, least_impulse_n_s=0.0)


@pytest.mark.parametrize("degrees", [0.1, 10.0, 30.0])
def test_a_misaligned_thrust_is_turned_and_not_stretched(degrees):
    mission = replace(IDEAL, actuators=replace(REAL, misalignment_deg=degrees))
    scenarios = [replace(START, noise=(1, 0, case)) for case in range(20)]
    matrices = thrust_errors(mission, scenarios).matrices[:, 0]
    drawn = [np.radians(degrees) * one.generator(2).standard_normal((2, 3))[1] for one in scenarios]
    for matrix, turn in zip(matrices, drawn, strict=True):
        np.testing.assert_allclose(matrix @ matrix.T, np.eye(3), rtol=0, atol=1e-14)
        assert np.trace(matrix) == pytest.approx(1.0 + 2.0 * np.cos(np.linalg.norm(turn)), abs=1e-14)
        np.testing.assert_allclose(matrix @ turn, turn, rtol=0, atol=1e-14)


def test_the_tank_ends_at_empty():
    propellant, impulse, force = 0.004, 60.0, 0.5
    mission = replace(
        IDEAL, duration_s=200.0, actuators=replace(REAL, specific_impulse_s=impulse, propellant_kg=propellant)
    )
    with plainly("pipeline"):  # no other test flies this kind
        log = fly_logged(mission, open_loop("steady", np.tile([force, 0.0, 0.0], (20, 1))), START)
    mass, speed = mission.deputy.mass_kg, impulse * STANDARD_GRAVITY_M_S2
    burnt_in_a_period = force * mission.control_period_s / speed
    whole = int(propellant // burnt_in_a_period)
    np.testing.assert_allclose(log.force_hill_n[:whole, 0], force, rtol=0, atol=0)
    left = propellant / burnt_in_a_period - whole
    assert log.force_hill_n[whole, 0] == pytest.approx(left * force, rel=1e-9)
    np.testing.assert_array_equal(log.force_hill_n[whole + 1 :], 0.0)
    assert log.mass_kg[-1] == pytest.approx(mass - propellant, rel=1e-12)
    # Tsiolkovsky: what the whole tank gives
    assert exp(-log.delta_v_m_s[-1] / speed) == pytest.approx((mass - propellant) / mass, rel=1e-9)
