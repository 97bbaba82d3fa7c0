"""The closest approach of free drift against the equations of motion, integrated with SciPy."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fis_tools.compiled.decorator import plainly
from pipeline.flight.fly.workspace import make_state, make_workspace
from pipeline.flight.period.decide.motion import CLOSEST_APPROACH, sense_approach
from pipeline.flight.state.arrays import Moment
from pipeline.flight.world.pack import pack_world
from tests.pipeline.flight.missions import MEAN_MOTION, PAPER

WORLD = pack_world(PAPER)
ORBIT_S = 2.0 * np.pi / MEAN_MOTION
#: of the ellipse's largest half axis: an eighth of the square of ten degrees
SHARE = np.radians(10.0) ** 2 / 8.0


def closest_approach(position: np.ndarray, velocity: np.ndarray) -> float:
    state, work = make_state(WORLD, None, 1), make_workspace(WORLD, 1)
    state.belief.position[:, 0], state.belief.velocity[:, 0] = position, velocity
    with plainly("pipeline"):
        sense_approach(Moment(WORLD, state, work, 0, 1, 0))
    return float(work.signals[CLOSEST_APPROACH, 0])


def hill(_: float, state: np.ndarray) -> np.ndarray:
    x, _y, z, x_rate, y_rate, z_rate = state
    n = MEAN_MOTION
    return np.array([x_rate, y_rate, z_rate, 3 * n * n * x + 2 * n * y_rate, -2 * n * x_rate, -n * n * z])


def least_distance(state: np.ndarray) -> float:
    """At 20,000 instants of an integrated orbit: nearer to the truth than a millimetre."""
    times = np.linspace(0.0, ORBIT_S, 20_001)
    path = solve_ivp(hill, (0.0, ORBIT_S), state, "DOP853", times, rtol=1e-11, atol=1e-11).y[:3]
    return float(np.linalg.norm(path, axis=0).min())


def half_axis(state: np.ndarray) -> float:
    """Largest distance of a place on the ellipse from its moving centre, across the track included."""
    x, _, z, x_rate, y_rate, z_rate = state
    height = np.hypot(3.0 * x + 2.0 * y_rate / MEAN_MOTION, x_rate / MEAN_MOTION)
    return float(np.hypot(2.0 * height, np.hypot(z, z_rate / MEAN_MOTION)))


def test_it_is_as_near_to_the_truth_as_it_says() -> None:
    generator = np.random.default_rng(5)
    states = np.hstack([generator.normal(0.0, 50.0, (60, 3)), generator.normal(0.0, 0.05, (60, 3))])
    # half of them drift little, so that they come round the chief
    states[:30, 4] = -2.0 * MEAN_MOTION * states[:30, 0] + generator.normal(0.0, 0.005, 30)
    errors = []
    for state in states:
        found, true = closest_approach(state[:3], state[3:]), least_distance(state)
        errors.append(abs(found - true) / (SHARE * half_axis(state)))
    assert max(errors) <= 1.0
    distances = np.linalg.norm(states[:, :3], axis=1)
    nearest = np.array([closest_approach(state[:3], state[3:]) for state in states])
    assert (nearest < 0.7 * distances).sum() > 15  # now would be far off


@pytest.mark.parametrize("after_s", [500.0, 2500.0, 5000.0])
def test_a_deputy_on_its_way_through_the_chief_is_seen(after_s: float) -> None:
    centre = np.array([0.0, 0.0, 0.0, 0.03, -0.02, 0.01])
    start = solve_ivp(hill, (after_s, 0.0), centre, "DOP853", rtol=1e-11, atol=1e-11).y[:, -1]
    assert closest_approach(start[:3], start[3:]) <= SHARE * half_axis(start)
    assert np.linalg.norm(start[:3]) > 10.0


def test_what_rests_along_the_track_keeps_its_distance() -> None:
    assert closest_approach(np.array([0.0, -60.0, 0.0]), np.zeros(3)) == pytest.approx(60.0)


def test_what_has_passed_and_goes_away_is_nearest_now() -> None:
    leaving = closest_approach(np.array([20.0, 5.0, 0.0]), np.array([0.0, -0.05, 0.0]))
    assert leaving <= np.hypot(20.0, 5.0)
    far = np.array([100.0, -300.0, 0.0])
    assert closest_approach(far, np.zeros(3)) == pytest.approx(np.linalg.norm(far))
