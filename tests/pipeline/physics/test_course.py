"""The chief's true course against orbits and bodies that SciPy integrates in axes that do not turn."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from pipeline.flight.fly.reference import reference_of
from pipeline.flight.world.chief import check_perigee, chief_attitudes, true_course_of
from pipeline.settings.checks import SettingError
from pipeline.settings.mission import TwoBody
from pipeline.settings.orbit import OrbitSettings
from tests.pipeline.flight.cases import STARTS, STEERING, mission

GRAVITY, EARTH, J2 = 3.986004418e14, 6_378_137.0, 1.08262668e-3
INERTIA = ((2.0, 0.1, 0.0), (0.1, 3.0, 0.0), (0.0, 0.0, 4.0))
#: semi-major axis (m), eccentricity, inclination, argument of latitude, true anomaly (deg)
ORBITS = {
    "circle": (6_878_137.0, 0.0, 51.6, 0.0, 0.0),
    "0.05": (7_450_000.0, 0.05, 51.6, 10.0, 90.0),
    "0.3": (9_600_000.0, 0.3, 63.4, 30.0, 290.0),
    "transfer": (24_478_137.0, 0.725, 7.0, 120.0, 290.0),
}
RATES = {"fixed": (0.0, 0.0, 0.0), "tumbling": (0.002, 0.01, 0.004)}


def flown(name, rate, j2, duration=6000.0):
    axis, eccentricity, *angles = ORBITS[name]
    keys = dict(zip(("inclination_deg", "latitude_argument_deg", "true_anomaly_deg"), angles, strict=True))
    return mission(
        orbit=OrbitSettings(kind="elements", semi_major_axis_m=axis, eccentricity=eccentricity, **keys),
        dynamics=TwoBody(j2=j2),
        chief={"initial_angular_velocity_rad_s": rate, "inertia_kg_m2": INERTIA},
        duration_s=duration,
    )


def hill(position, velocity):
    """Rows i, j, k."""
    normal = np.cross(position, velocity)
    i, k = position / np.linalg.norm(position), normal / np.linalg.norm(normal)
    return np.array([i, np.cross(k, i), k])


def by_scipy(name, rate, j2, times):
    """Rotations from the chief's axes to Hill's, Hill's rows in the equator's axes, and distances, m.

    Orbit and body are integrated together, without any rate of Hill axes.
    """
    axis, e, inclination, latitude, anomaly = ORBITS[name]
    perigee = Rotation.from_euler("ZXZ", [0.0, inclination, latitude - anomaly], degrees=True)
    anomaly, parameter = np.radians(anomaly), axis * (1.0 - e * e)
    radial, along = np.array([np.cos(anomaly), np.sin(anomaly), 0.0]), np.array([-np.sin(anomaly), 0.0, 0.0])
    along[1] = e + np.cos(anomaly)
    start = perigee.apply(
        [parameter / (1.0 + e * np.cos(anomaly)) * radial, np.sqrt(GRAVITY / parameter) * along]
    )
    inertia = np.array(INERTIA)
    inverse = np.linalg.inv(inertia)

    def rates(_time, s):
        r, q, w = s[:3], s[6:10], s[10:]
        distance = np.linalg.norm(r)
        high = 5.0 * (r[2] / distance) ** 2
        oblate = -1.5 * j2 * GRAVITY * EARTH**2 / distance**5 * r * np.array([1 - high, 1 - high, 3 - high])
        turning = 0.5 * np.array([*(q[3] * w + np.cross(q[:3], w)), -q[:3] @ w])
        spinning = inverse @ -np.cross(w, inertia @ w)
        return np.concatenate((s[3:6], -GRAVITY / distance**3 * r + oblate, turning, spinning))

    body = Rotation.from_matrix(hill(*start).T).as_quat()
    at_start = np.concatenate((start.ravel(), body, rate))
    path = solve_ivp(
        rates, (0.0, times[-1]), at_start, method="DOP853", rtol=1e-12, atol=1e-10, t_eval=times
    ).y.T
    axes = np.array([hill(row[:3], row[3:6]) for row in path])
    return Rotation.from_matrix(axes) * Rotation.from_quat(path[:, 6:10]), axes, path[:, :3]


@pytest.mark.parametrize("j2", [0.0, J2])
@pytest.mark.parametrize("rate", RATES)
@pytest.mark.parametrize("name", ORBITS)
def test_a_chief_turns_as_an_integration_without_hill_axes_has_it(name, rate, j2):
    what = flown(name, RATES[rate], j2)
    times = what.control_period_s * np.arange(what.num_controls + 1)
    expected, axes, positions = by_scipy(name, RATES[rate], j2, times)
    chief = Rotation.from_quat(chief_attitudes(what))
    assert np.degrees((expected.inv() * chief).magnitude().max()) < 1e-5
    course = true_course_of(what)
    assert (course is None) == (name == "circle" and j2 == 0.0)
    if course is not None:
        np.testing.assert_allclose(course.axes, axes @ axes[0].T, rtol=0.0, atol=1e-7)
        np.testing.assert_allclose(course.radius, np.linalg.norm(positions, axis=1), rtol=0.0, atol=0.2)


def test_attitudes_do_not_change_sign_from_sample_to_sample():
    attitudes = chief_attitudes(flown("transfer", RATES["tumbling"], J2))
    assert np.sum(attitudes[1:] * attitudes[:-1], axis=1).min() > 0.9


@pytest.mark.parametrize("name", ORBITS)
def test_the_reference_flight_turns_the_chief_alike(name):
    what = replace(flown(name, RATES["tumbling"], J2, duration=600.0), flight="reference")
    chief = reference_of(what, STEERING, STARTS[0]).chief
    expected = Rotation.from_quat(chief_attitudes(what))
    errors = [(a.inv() * b).magnitude() for a, b in zip(chief, expected, strict=True)]
    assert np.degrees(max(errors)) < 1e-5


@pytest.mark.parametrize(
    ("eccentricity", "words"), [(0.739, "10.7 km, in the air"), (0.75, "-258.6 km, inside the Earth")]
)
def test_perigees_in_the_air_are_refused(eccentricity, words):
    what = flown("transfer", RATES["fixed"], J2)
    with pytest.raises(SettingError, match=f"altitude of {words}.* at 100 km or more"):
        check_perigee(replace(what, orbit=replace(what.orbit, eccentricity=eccentricity)))


def test_perigees_above_the_air_are_flown():
    what = flown("transfer", RATES["fixed"], J2)
    just_above = 1.0 - (EARTH + 100_001.0) / what.orbit.elements.semi_major_axis_m
    check_perigee(replace(what, orbit=replace(what.orbit, eccentricity=just_above)))
