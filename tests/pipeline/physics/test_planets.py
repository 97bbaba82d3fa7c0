"""Orbits about the Moon and an asteroid against SciPy's, and the shadows of these bodies by geometry."""

from math import asin, degrees, pi

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pipeline.command_line.config import compose_experiment
from pipeline.flight.control.controller import open_loop
from pipeline.flight.fly.simulation import fly_logged
from pipeline.flight.state.log import Scenario
from pipeline.flight.world.chief import chief_course
from pipeline.flight.world.pack import sun_shares
from pipeline.settings.checks import SettingError

#: gravity (m^3/s^2), equatorial radius (m), oblateness, semi-major axis (m)
BODIES = {
    "moon": (4.9028e12, 1_738_100.0, 2.033e-4, 1_838_100.0),
    "small_body": (1.7288e10, 265_000.0, 0.071, 475_000.0),
}
ASTRONOMICAL_UNIT_M, SUN_RADIUS_M = 149_597_870_700.0, 695_700_000.0


def mission_of(*overrides):
    job = compose_experiment(["+experiment=evaluate", "controller=coast", "attitude=ideal", *overrides])
    return job.experiment.mission


def pull(name, position):
    """Attraction of an oblate body, as the gradient of its potential by central differences, m/s^2."""
    gravity, radius, j2, _ = BODIES[name]

    def potential(at):
        r, height = np.linalg.norm(at), at[2]
        return gravity / r * (1.0 - j2 * (radius / r) ** 2 * (1.5 * (height / r) ** 2 - 0.5))

    ways = np.linalg.norm(position) * 1e-5 * np.eye(3)
    return np.array(
        [(potential(position + way) - potential(position - way)) / (2.0 * way.max()) for way in ways]
    )


@pytest.mark.parametrize("name", BODIES)
def test_both_craft_fly_as_scipy_has_it(name):
    """From the ascending node over the poles; a deputy that a force pushes, for half an hour."""
    gravity, _, _, axis = BODIES[name]
    mission = mission_of(f"world={name}", "duration_s=1800")
    speed = np.sqrt(gravity / axis)
    chief = np.array([axis, 0.0, 0.0, 0.0, 0.0, speed])
    # at the node i is along x, j along z and k along -y
    hill_axes = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
    start = Scenario(np.array([40.0, -60.0, 30.0]), np.array([0.02, 0.03, -0.04]), 0.0)
    turning = np.array([0.0, -1.0, 0.0]) * speed / axis
    # oblateness turns the plane, but at the node it pulls along i alone
    away = hill_axes.T @ start.position_m
    deputy = chief + np.r_[away, hill_axes.T @ start.velocity_m_s + np.cross(turning, away)]

    def rates(_time, both):
        return np.concatenate([both[3:6], pull(name, both[:3]), both[9:], pull(name, both[6:9])])

    path = solve_ivp(
        rates,
        (0.0, 1800.0),
        np.r_[chief, deputy],
        "DOP853",
        np.arange(0.0, 1801.0, 10.0),
        rtol=1e-11,
        atol=1e-7,
    ).y
    log = fly_logged(mission, open_loop("none", np.zeros((0, 3))), start)
    expected = np.linalg.norm(path[6:9] - path[:3], axis=0)
    np.testing.assert_allclose(np.linalg.norm(log.position_m, axis=1), expected, rtol=0.0, atol=0.01)
    course = chief_course(mission)
    distances = np.linalg.norm(course.positions[:: 2 * course.num_steps], axis=1)
    np.testing.assert_allclose(distances, np.linalg.norm(path[:3], axis=0), rtol=0.0, atol=0.1)


@pytest.mark.parametrize("name", BODIES)
def test_the_shadow_is_as_wide_as_the_body(name):
    _, radius, _, axis = BODIES[name]
    mission = mission_of(f"world={name}")
    half, sun = asin(radius / axis), asin(SUN_RADIUS_M / ASTRONOMICAL_UNIT_M)
    angles = np.linspace(0.0, 2.0 * pi, mission.num_controls + 1)
    shares = sun_shares(mission, angles, np.zeros(len(angles)))
    from_nadir = np.abs(angles - pi)
    assert (shares[from_nadir < half - sun] == 0.0).all()
    assert (shares[from_nadir > half + sun] == 1.0).all()
    assert 0.1 < np.mean(shares == 0.0) < 0.5, degrees(half)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("world=moon orbit.planet_radius_m=null", "give orbit.planet_radius_m"),
        ("world=moon orbit.epoch=2026-11-26T12:00:00 sun=fixed", "orbit.epoch is about the Earth"),
        ("world=moon orbit.eccentricity=0.2 light=paper", "below orbit.planet_radius_m"),
        ("world=moon orbit.semi_major_axis_m=1700000", "inside the planet"),
    ],
)
def test_what_a_planet_cannot_be_is_refused(words, message):
    with pytest.raises(SettingError, match=message):
        sun_shares(mission := mission_of(*words.split()), np.zeros(1), np.zeros(1)), chief_course(mission)
