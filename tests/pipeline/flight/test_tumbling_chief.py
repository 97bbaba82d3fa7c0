"""A chief that tumbles fast: where it points after a flight, against scipy's integrator."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from pipeline.flight.cases.starts import cases_of
from pipeline.flight.control.controller import coast, law_of
from pipeline.flight.fly.population import FlightError, fly_population
from pipeline.flight.fly.simulation import fly_all, fly_logged
from pipeline.flight.state.log import Scenario
from pipeline.flight.world.chief import chief_attitudes, num_chief_steps
from pipeline.flight.world.pack import pack_world
from pipeline.settings.experiment import SettingError
from tests.pipeline.flight.missions import MEAN_MOTION, PAPER

pytestmark = pytest.mark.slow

MOMENTS = np.array([1.0, 2.0, 2.9])


def tumbling(rate, **changes):
    inertia = tuple(map(tuple, np.diag(MOMENTS).tolist()))
    chief = replace(PAPER.chief, initial_angular_velocity_rad_s=tuple(rate), inertia_kg_m2=inertia)
    return replace(PAPER, chief=chief, **changes)


def inertial(rate, duration):
    """The chief's inertial attitude by Euler's equation, scalar last."""

    i, j, k = MOMENTS.tolist()

    def rates(_time, state):
        a, b, c, d, x, y, z = state.tolist()
        turning = (
            d * x + b * z - c * y,
            d * y + c * x - a * z,
            d * z + a * y - b * x,
            -a * x - b * y - c * z,
        )
        return (
            *(0.5 * part for part in turning),
            (j - k) / i * y * z,
            (k - i) / j * z * x,
            (i - j) / k * x * y,
        )

    start = [0.0, 0.0, 0.0, 1.0, *rate]
    return solve_ivp(rates, (0.0, duration), start, method="DOP853", rtol=1e-12, atol=1e-13).y[:4, -1]


@pytest.mark.parametrize("rate", [(0.1, 0.2, 0.45), (1.0, 2.0, 3.0)])
def test_a_fast_chief_points_where_it_should_after_a_flight(rate):
    mission = tumbling(rate, duration_s=600.0)
    attitudes = chief_attitudes(mission)
    hill = Rotation.from_rotvec([0.0, 0.0, 600.0 * MEAN_MOTION])
    truth = hill.inv() * Rotation.from_quat(inertial(rate, 600.0))
    assert (truth.inv() * Rotation.from_quat(attitudes[-1])).magnitude() < 2e-4


def test_a_chief_that_is_too_fast_to_be_followed_is_refused():
    with pytest.raises(SettingError, match=r"to turn the chief truly for so long takes .* steps"):
        num_chief_steps(tumbling((3.0, 4.0, 5.0), duration_s=36_000.0))


def test_a_slow_chief_is_turned_by_the_second():
    assert num_chief_steps(tumbling((0.0005, 0.0, 0.002))) == 10


def test_a_flight_that_does_not_stay_finite_is_no_result():
    start = Scenario(np.array([1e200, 0.0, 0.0]), np.array([1e308, 1e308, 0.0]), 0.0)
    mission = replace(PAPER, duration_s=60.0)
    for fly in (lambda: fly_all(mission, coast(), [start]), lambda: fly_logged(mission, coast(), start)):
        with pytest.raises(FlightError, match="did not stay finite"):
            fly()


def test_an_attitude_that_does_not_stay_finite_is_no_result():
    world = pack_world(replace(PAPER, duration_s=60.0))
    gain = 1e300 * np.eye(3)
    wild = world._replace(proportional_gain=gain, derivative_gain=gain, max_torque=1e300)
    law, numbers = law_of(coast(), replace(PAPER, duration_s=60.0)), coast().numbers
    cases = cases_of(PAPER, [Scenario(np.array([40.0, 30.0, 20.0]), np.zeros(3), 0.0)])
    assert np.isfinite(fly_population(world, law, numbers, cases).delta_v_m_s).all()
    with pytest.raises(FlightError, match="did not stay finite"):
        fly_population(wild, law, numbers, cases)
