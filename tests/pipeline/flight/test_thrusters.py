"""What thrusters fire, against closed forms: rotated thrust keeps its length, and a tank ends at empty."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.flight.cases.actuators import thrust_errors
from pipeline.flight.state.log import Scenario
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
