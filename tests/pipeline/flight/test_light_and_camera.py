"""Flights under a Sun out of the orbit plane, in the Earth's shadow, and with cameras of limited sight."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from fis_tools.compiled.decorator import plainly
from pipeline.flight.cases.starts import cases_of, starts_of
from pipeline.flight.control.controller import coast, law_of
from pipeline.flight.fly.population import FlightError, fly_population
from pipeline.flight.fly.simulation import fly_all, fly_logged
from pipeline.flight.fly.workspace import inspectable_points
from pipeline.flight.period.look.optics import sun_after
from pipeline.flight.state.log import Scenario
from pipeline.flight.world.chief import chief_attitudes, num_chief_steps, semi_major_axis
from pipeline.flight.world.pack import pack_world
from pipeline.physics.illumination import EARTH_RADIUS_M
from pipeline.settings.experiment import SettingError
from pipeline.settings.mission import Dynamics, Light
from tests.pipeline.flight.as_written import assert_as_written
from tests.pipeline.flight.cases import SEEING, STARTS, mission
from tests.pipeline.flight.missions import IDEAL, MEAN_MOTION, PAPER

POINTED = IDEAL.attitude
SHADOW = Light(shadow="conical")
#: seen where it reflects neither too little nor too much, and while the Sun is 3 degrees below the horizon
GLITTER = Light(
    past_terminator_deg=3.0,
    reflection="blinn_phong",
    least_intensity=(0.7,) * 3,
    greatest_intensity=(2.0, 0.95, 2.0),
)
TILTED = [replace(start, sun_elevation_rad=up) for start, up in zip(STARTS, (0.5, -0.3, 1.2), strict=True)]
WORLDS = {
    "a Sun out of the plane": mission(attitude=POINTED),
    "shadow": mission(attitude=POINTED, light=SHADOW),
    "a camera of little sight": mission(
        attitude=POINTED, sensor={"max_incidence_deg": 65.0, "max_range_m": 90.0, "min_sun_angle_deg": 35.0}
    ),
    "a camera that sees more than half of all, backwards": mission(
        attitude=POINTED, sensor={"half_angle_deg": 120.0, "boresight": (0.0, 0.0, 1.0)}
    ),
    "all of it on a chief that tumbles": mission(
        attitude=POINTED,
        light=replace(GLITTER, shadow="conical", min_fraction=1.0),
        sensor={"max_incidence_deg": 65.0},
        chief={"initial_angular_velocity_rad_s": (0.003, 0.0, 0.002)},
    ),
}


@pytest.mark.parametrize(
    "name", ["shadow", *(pytest.param(name, marks=pytest.mark.slow) for name in WORLDS if name != "shadow")]
)
def test_flights_are_as_written(name: str) -> None:
    for start in (TILTED[0], STARTS[1]):
        assert_as_written(replace(WORLDS[name], duration_s=600.0), SEEING, start)


@pytest.mark.parametrize(("elevation_deg", "most"), [(0.0, 99), (30.0, 87), (60.0, 74), (90.0, 41)])
def test_points_on_the_far_side_of_a_high_sun_are_never_lit(elevation_deg: float, most: int) -> None:
    """Counted over whole orbits by rings of latitude: a ring is lit once its sunward point is."""
    start = replace(STARTS[0], sun_elevation_rad=np.radians(elevation_deg))
    world = pack_world(mission(duration_s=5680.0))
    (lit,) = inspectable_points(world, starts_of([start]))
    assert lit.sum() == most


def test_the_hour_from_noon_in_the_orbit_plane_lights_80_points_beside_the_shadow() -> None:
    noon = Scenario(np.array([0.0, 60.0, 0.0]), np.zeros(3), 0.0)
    log = fly_logged(mission(light=SHADOW), coast(), noon)
    assert log.is_inspectable.sum() == 80
    dark = np.flatnonzero(log.visible_sun_share < 0.5)
    assert dark[0] * 10.0 == pytest.approx(1766.0, abs=10.0)
    outcomes = fly_all(mission(light=SHADOW), coast(), [noon])
    assert outcomes.inspectable_count[0] == 80
    assert outcomes.inspected_count[0] == log.is_inspected[-1].sum()


def test_a_flight_is_over_when_all_is_inspected_that_can_be() -> None:
    """After the last point that is ever lit the deputy fires no more, though others are never seen."""
    what, start = mission(attitude=POINTED), TILTED[1]
    log = fly_logged(what, SEEING, start)
    count, inspectable = log.is_inspected.sum(axis=1), log.is_inspectable.sum()
    assert inspectable == 95
    assert count[-1] == inspectable
    done = int(np.argmax(count == inspectable))
    assert done < 340
    assert not log.force_hill_n[done:].any()


def test_a_day_of_orbits_flies_as_one_hour_does() -> None:
    """Three orbits: the Sun turns three times, and what is seen in the first is in the longer flight, too."""
    short, long = mission(light=SHADOW, duration_s=5680.0), mission(light=SHADOW, duration_s=17030.0)
    start = Scenario(np.array([0.0, 60.0, 0.0]), np.zeros(3), 0.0)
    first, whole = fly_logged(short, coast(), start), fly_logged(long, coast(), start)
    assert first.is_inspectable.all()
    np.testing.assert_array_equal(whole.is_inspected[: len(first.is_inspected)], first.is_inspected)
    shadowed = np.diff((whole.visible_sun_share < 0.5).astype(int))
    assert np.count_nonzero(shadowed == 1) == 3
    orbit = 2.0 * np.pi / MEAN_MOTION
    assert np.diff(np.flatnonzero(shadowed == 1)).tolist() == pytest.approx([orbit / 10.0] * 2, abs=1.0)


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


@pytest.mark.slow
@pytest.mark.parametrize("rate", [(0.1, 0.2, 0.45), (1.0, 2.0, 3.0)])
def test_a_fast_chief_points_where_it_should_after_a_flight(rate):
    mission = tumbling(rate, duration_s=600.0)
    attitudes = chief_attitudes(mission)
    hill = Rotation.from_rotvec([0.0, 0.0, 600.0 * MEAN_MOTION])
    truth = hill.inv() * Rotation.from_quat(inertial(rate, 600.0))
    assert (truth.inv() * Rotation.from_quat(attitudes[-1])).magnitude() < 2e-4


@pytest.mark.slow
def test_a_chief_that_is_too_fast_to_be_followed_is_refused():
    with pytest.raises(SettingError, match=r"to turn the chief truly for so long takes .* steps"):
        num_chief_steps(tumbling((3.0, 4.0, 5.0), duration_s=36_000.0))


@pytest.mark.slow
def test_a_slow_chief_is_turned_by_the_second():
    assert num_chief_steps(tumbling((0.0005, 0.0, 0.002))) == 10


@pytest.mark.slow
def test_a_flight_that_does_not_stay_finite_is_no_result():
    start = Scenario(np.array([1e200, 0.0, 0.0]), np.array([1e308, 1e308, 0.0]), 0.0)
    mission = replace(PAPER, duration_s=60.0)
    for fly in (lambda: fly_all(mission, coast(), [start]), lambda: fly_logged(mission, coast(), start)):
        with pytest.raises(FlightError, match="did not stay finite"):
            fly()


@pytest.mark.slow
def test_an_attitude_that_does_not_stay_finite_is_no_result():
    world = pack_world(replace(PAPER, duration_s=60.0))
    gain = 1e300 * np.eye(3)
    wild = world._replace(proportional_gain=gain, derivative_gain=gain, max_torque=1e300)
    law, numbers = law_of(coast(), replace(PAPER, duration_s=60.0)), coast().numbers
    cases = cases_of(PAPER, [Scenario(np.array([40.0, 30.0, 20.0]), np.zeros(3), 0.0)])
    assert np.isfinite(fly_population(world, law, numbers, cases).delta_v_m_s).all()
    with pytest.raises(FlightError, match="did not stay finite"):
        fly_population(wild, law, numbers, cases)
