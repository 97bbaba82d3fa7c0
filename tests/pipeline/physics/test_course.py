"""The chief's true course against orbits and bodies that SciPy integrates in axes that do not turn."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from pipeline.flight.control.controller import coast, open_loop
from pipeline.flight.fly.reference import reference_of
from pipeline.flight.fly.simulation import fly_logged
from pipeline.flight.reference.light import sun_direction
from pipeline.flight.state.arrays import AIMED
from pipeline.flight.world.chief import check_perigee, chief_attitudes, chief_course, true_course_of
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
    "synchronous": (7_078_137.0, 0.001, 98.19, 0.0, 0.0),
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


def by_scipy(name, rate, j2, times, body=None):
    """Rotations from a body's axes to Hill's, Hill's rows in the equator's axes, and positions, m.

    The body starts along Hill's axes unless a rotation to them is given. Orbit and body are integrated
    together, without any rate of Hill axes.
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

    body = Rotation.from_matrix(hill(*start).T) * (body or Rotation.identity())
    at_start = np.concatenate((start.ravel(), body.as_quat(), rate))
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


@pytest.mark.slow
def test_a_deputy_that_nothing_turns_turns_as_an_integration_without_hill_axes_has_it():
    what = flown("transfer", None, J2, duration=1200.0)
    what = replace(what, deputy=replace(what.deputy, inertia_kg_m2=INERTIA))
    torqueless = open_loop("free", np.zeros((0, 3)), turns=AIMED._replace(torques=np.zeros((1, 3))))
    log = fly_logged(what, torqueless, STARTS[0])
    body = Rotation.from_quat(log.quaternion_b_from_h)
    times = what.control_period_s * np.arange(what.num_controls + 1)
    course = true_course_of(what)
    at_start = np.array(what.rate_at_start_rad_s) + body[0].inv().apply(course.rates[0])
    expected, _, _ = by_scipy("transfer", at_start, J2, times, body[0])
    assert np.degrees((expected.inv() * body).magnitude().max()) < 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("momentum", [None, 0.05])
def test_a_steered_deputy_turns_as_the_reference_does(momentum):
    what = flown("transfer", RATES["tumbling"], J2, duration=120.0)
    what = replace(what, deputy=replace(what.deputy, inertia_kg_m2=INERTIA, max_momentum_n_m_s=momentum))
    fast, slow = (
        fly_logged(replace(what, flight=kind), coast(), STARTS[0]) for kind in ("compiled", "reference")
    )
    turned = Rotation.from_quat(fast.quaternion_b_from_h).inv() * Rotation.from_quat(slow.quaternion_b_from_h)
    assert turned.magnitude().max() < 1e-6
    for field in ("angular_velocity_b_rad_s", "torque_b_n_m", "wheel_momentum_b_n_m_s"):
        np.testing.assert_allclose(
            getattr(fast, field), getattr(slow, field), rtol=0.0, atol=1e-7, err_msg=field
        )


#: unit vectors to the Sun at noon of six days from 2026-11-27, UTC, equator and equinox of date, by astropy's
#: `get_sun` in its frame TETE
SUNS = np.array(
    [
        [-0.4186927, -0.8332021, -0.3612073],
        [-0.402588, -0.8398567, -0.3640929],
        [-0.3863511, -0.8462518, -0.3668662],
        [-0.3699869, -0.852385, -0.369526],
        [-0.3535003, -0.8582544, -0.3720712],
        [-0.3368965, -0.8638575, -0.3745009],
    ]
)


def test_the_sun_moves_as_astropy_has_it_beside_an_orbit_whose_plane_follows_it():
    days, node = 5, 40.0
    what = flown("synchronous", RATES["fixed"], J2, duration=days * 86_400.0)
    orbit = replace(what.orbit, raan_deg=node, epoch="2026-11-27T12:00:00")
    what = replace(what, orbit=orbit, control_period_s=60.0)
    course, samples = chief_course(what), np.arange(days + 1) * 1440
    at_start = sun_direction(*np.radians(orbit.sun_at_epoch_deg))
    axes = course.axes[2 * course.num_steps * samples]
    directions = np.einsum("kij,kjl,l->ki", axes, course.sun_turns[samples], at_start)
    _, true_axes, _ = by_scipy("synchronous", RATES["fixed"], J2, samples * what.control_period_s)
    suns = Rotation.from_euler("Z", -node, degrees=True).apply(SUNS)
    expected = np.einsum("kij,kj->ki", true_axes, suns)
    assert np.degrees(np.linalg.norm(directions - expected, axis=1).max()) < 0.02
    # were it to stay among the stars
    assert np.degrees(np.linalg.norm(axes[-1] @ at_start - expected[-1])) > 4.0
    reference = reference_of(replace(what, flight="reference", duration_s=600.0), STEERING, STARTS[0])
    moved = np.array(reference.fixed_suns[-1]) @ course.sun_turns[10] @ reference.fixed_suns[0]
    assert moved == pytest.approx(1.0, abs=1e-12)


def test_a_circle_about_an_oblate_earth_turns_uniformly_for_a_day_unless_a_chief_turns_or_it_is_asked_for():
    for rate, duration, course, is_true in (
        (None, 86_400.0, "auto", False),
        (None, 86_410.0, "auto", True),
        (None, 600.0, "true", True),
        (RATES["fixed"], 600.0, "auto", True),
        (RATES["fixed"], 600.0, "uniform", False),
    ):
        what = flown("circle", rate, J2, duration)
        what = replace(what, orbit=replace(what.orbit, course=course))
        assert (true_course_of(what) is not None) == is_true, (rate, duration, course)


def test_the_sun_stays_on_a_circle_about_a_sphere_and_without_an_epoch():
    for name, j2, epoch in (("circle", 0.0, "2026-11-27T12:00:00"), ("transfer", J2, None)):
        what = flown(name, RATES["fixed"], j2, duration=600.0)
        assert len(chief_course(replace(what, orbit=replace(what.orbit, epoch=epoch))).sun_turns) == 0


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
