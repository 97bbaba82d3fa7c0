"""What deputies predict by on a true course, against motion that SciPy integrates in fixed axes."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pipeline.flight.world.chief import predicted_motion
from pipeline.physics.motion import input_matrix, state_transition
from pipeline.physics.transitions import follows_course
from tests.pipeline.physics.test_course import EARTH, GRAVITY, J2, ORBITS, flown

MASS = 12.0


def predicted(name, j2):
    what = flown(name, None, j2)
    what = replace(what, orbit=replace(what.orbit, course="true"))
    return what, predicted_motion(what)[1]


def attraction(position, pole, j2):
    distance, height = np.linalg.norm(position), position @ pole
    oblate = -1.5 * j2 * GRAVITY * EARTH**2 / distance**5
    oblate = oblate * ((1.0 - 5.0 * height**2 / distance**2) * position + 2.0 * height * pole)
    return -GRAVITY / distance**3 * position + oblate


def frame(position, velocity, pull):
    """Rows i, j, k, and their rate, in axes that do not turn."""
    momentum = np.cross(position, velocity)
    i, k = position / np.linalg.norm(position), momentum / np.linalg.norm(momentum)
    rate = momentum / (position @ position)
    return np.array([i, np.cross(k, i), k]), rate + np.linalg.norm(position) * (pull @ k) / np.linalg.norm(
        momentum
    ) * i


def by_scipy(name, j2, state, times, force=(0.0, 0.0, 0.0), until=0.0):
    """Hill states of a deputy at some times; a force, N, is held along Hill axes up to a time."""
    axis, e, inclination, latitude, anomaly = ORBITS[name]
    slope, latitude, anomaly = np.radians([inclination, latitude, anomaly])
    pole = np.array([np.sin(slope) * np.sin(latitude), np.sin(slope) * np.cos(latitude), np.cos(slope)])
    parameter = axis * (1.0 - e * e)
    speed = np.sqrt(GRAVITY / parameter)
    chief = np.array([parameter / (1.0 + e * np.cos(anomaly)), 0.0, 0.0])
    moving = speed * np.array([e * np.sin(anomaly), 1.0 + e * np.cos(anomaly), 0.0])

    def rates(pushed):
        def of(_, s):
            pull = attraction(s[:3], pole, j2)
            relative = attraction(s[:3] + s[6:9], pole, j2) - pull
            axes, _ = frame(s[:3], s[3:6], pull)
            return np.concatenate((s[3:6], pull, s[9:], relative + pushed * axes.T @ np.array(force) / MASS))

        return of

    axes, rate = frame(chief, moving, attraction(chief, pole, j2))
    position = axes.T @ state[:3]
    begin = np.concatenate((chief, moving, position, axes.T @ state[3:] + np.cross(rate, position)))
    tight = {"method": "DOP853", "rtol": 1e-11, "atol": 1e-7}
    if until:
        begin = solve_ivp(rates(1.0), (0.0, until), begin, **tight).y[:, -1]
    path = solve_ivp(rates(0.0), (until, times[-1]), begin, t_eval=times, **tight).y.T
    states = []
    for s in path:
        axes, rate = frame(s[:3], s[3:6], attraction(s[:3], pole, j2))
        states.append(np.concatenate((axes @ s[6:9], axes @ (s[9:] - np.cross(rate, s[6:9])))))
    return np.array(states)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "j2"), [("circle", J2), ("0.05", 0.0), ("0.3", J2), ("transfer", J2)])
def test_free_motion_is_predicted_within_decimetres_from_the_start_and_from_any_later_sample(name, j2):
    what, motion = predicted(name, j2)
    generator = np.random.default_rng(7)
    samples = np.arange(0, what.num_controls + 1, 60)
    times = what.control_period_s * samples
    for _ in range(2):
        direction = generator.standard_normal(3)
        state = np.r_[60.0 * direction / np.linalg.norm(direction), 0.02 * generator.standard_normal(3)]
        expected = by_scipy(name, j2, state, times)
        far = np.linalg.norm(expected[:, :3], axis=1).max() / 100.0
        for first in (0, 4):
            constants = motion.back[samples[first]] @ expected[first]
            path = motion.onward[samples[first:]] @ constants
            errors = np.linalg.norm(path[:, :3] - expected[first:, :3], axis=1)
            assert errors.max() < 0.2 * max(1.0, far**2), (name, first)


@pytest.mark.parametrize("name", ["0.3", "transfer"])
def test_a_held_force_adds_what_an_integration_of_it_adds(name):
    what, motion = predicted(name, J2)
    still, force, last = np.array([1e-3, 0.0, 0.0, 0.0, 0.0, 0.0]), np.array([0.02, -0.01, 0.03]), 300
    times = np.array([0.0, last * what.control_period_s])[1:]
    period = what.control_period_s
    pushed = by_scipy(name, J2, still, times, force, until=period)[0] - by_scipy(name, J2, still, times)[0]
    mass = what.deputy.mass_kg
    added = motion.onward[last] @ motion.back[1] @ motion.pushes[0] @ force * mass / MASS
    np.testing.assert_allclose(added, pushed, rtol=2e-4, atol=2e-5)


def test_on_a_circle_about_a_sphere_it_is_the_motion_of_clohessy_and_wiltshire():
    what, motion = predicted("circle", 0.0)
    n, period = what.orbit.mean_motion_rad_s, what.control_period_s
    push = input_matrix(n, period, what.deputy.mass_kg)
    for k in (1, 7, 300, 600):
        phi = motion.onward[k] @ motion.back[0]
        np.testing.assert_allclose(phi, state_transition(n, k * period), rtol=1e-6, atol=1e-7)
        np.testing.assert_allclose(motion.pushes[k - 1], push, rtol=2e-4, atol=1e-5)


def test_where_hill_axes_turn_uniformly_nothing_is_tabulated():
    assert not follows_course(predicted_motion(flown("circle", None, J2))[1])
