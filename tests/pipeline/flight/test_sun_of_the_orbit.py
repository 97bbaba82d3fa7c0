"""The Sun that lights the points stands where the chief's true orbit has it, against SciPy's integration."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fis_tools.compiled.decorator import plainly
from pipeline.flight.period.look.optics import sun_after
from pipeline.flight.world.chief import semi_major_axis
from pipeline.flight.world.pack import pack_world
from pipeline.physics.illumination import EARTH_RADIUS_M
from pipeline.settings.mission_parts import Dynamics
from tests.pipeline.flight.missions import IDEAL

ABOUT_EARTH = Dynamics(model="two_body", inclination_deg=0.0)
ORBITS = [
    replace(ABOUT_EARTH, j2=1.08262668e-3, inclination_deg=51.6, latitude_argument_deg=20.0),
    replace(ABOUT_EARTH, eccentricity=0.05, true_anomaly_deg=40.0),
]


def hill_axes(dynamics, orbit, times):
    """Return Hill axes at some times in those at the start, (n, 3, 3), from the chief's motion alone."""
    radius = semi_major_axis(orbit)
    gravity, e = orbit.mean_motion_rad_s**2 * radius**3, dynamics.eccentricity
    anomaly, slope = np.radians(dynamics.true_anomaly_deg), np.radians(dynamics.inclination_deg)
    latitude, parameter = np.radians(dynamics.latitude_argument_deg), radius * (1.0 - e**2)
    pole = np.array([np.sin(slope) * np.sin(latitude), np.sin(slope) * np.cos(latitude), np.cos(slope)])

    def pull(_, state):
        r, v = state[:3], state[3:]
        far, height = np.linalg.norm(r), r @ pole
        oblate = -1.5 * dynamics.j2 * gravity * EARTH_RADIUS_M**2 / far**5
        force = oblate * ((1.0 - 5.0 * height**2 / far**2) * r + 2.0 * height * pole)
        return np.concatenate([v, -gravity / far**3 * r + force])

    start = np.array([parameter / (1.0 + e * np.cos(anomaly)), 0.0, 0.0])
    speed = np.sqrt(gravity / parameter) * np.array([e * np.sin(anomaly), 1.0 + e * np.cos(anomaly), 0.0])
    flown = solve_ivp(
        pull,
        (0.0, times[-1]),
        np.concatenate([start, speed]),
        t_eval=times,
        rtol=1e-12,
        atol=1e-6,
        method="DOP853",
    )
    assert flown.success
    axes = []
    for state in flown.y.T:
        normal = np.cross(state[:3], state[3:])
        up, normal = state[:3] / np.linalg.norm(state[:3]), normal / np.linalg.norm(normal)
        axes.append([up, np.cross(normal, up), normal])
    return np.array(axes)


@pytest.mark.parametrize("dynamics", ORBITS, ids=["oblate", "eccentric"])
def test_the_sun_follows_the_orbit(dynamics):
    mission = replace(IDEAL, dynamics=dynamics, duration_s=5600.0)
    world, angle, elevation = pack_world(mission), 0.4, 0.2
    times = mission.control_period_s * np.arange(mission.num_controls + 1)
    sun = [np.cos(elevation) * np.cos(angle), np.cos(elevation) * np.sin(angle), np.sin(elevation)]
    wanted = hill_axes(dynamics, mission.orbit, times) @ sun
    at_start, height = (np.cos(angle), np.sin(angle)), (np.cos(elevation), np.sin(elevation))
    found = []
    with plainly("pipeline"):
        for k in range(len(times)):
            (x, y), (flat, z) = sun_after(world, at_start, height, k)
            found.append([flat * x, flat * y, z])
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-6)
    # the uniform turn of a circular orbit about a sphere is another one
    turned = angle - mission.orbit.mean_motion_rad_s * times
    apart = np.cos(elevation) * np.stack([np.cos(turned), np.sin(turned)], axis=1) - np.array(found)[:, :2]
    assert np.abs(apart).max() > 1e-3
