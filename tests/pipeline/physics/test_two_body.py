"""Motion about the Earth against Basilisk's, SciPy's integration of both craft, and the linear limit."""

import json
from math import cos, radians, sin
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pipeline.physics.illumination import EARTH_GRAVITY_M3_S2, EARTH_RADIUS_M, orbit_radius, sun_direction_h
from pipeline.physics.motion import motion_over
from pipeline.physics.orbit import Course, course_of
from tests.pipeline.physics.what_flies import move_beside, propagate

TOLD = json.loads((Path(__file__).parent / "basilisk" / "trajectories.json").read_text(encoding="utf-8"))
MEAN_MOTION, PERIOD = TOLD["mean_motion_rad_s"], 10.0
RADIUS = orbit_radius(MEAN_MOTION)
SUN = sun_direction_h(*(radians(degrees) for degrees in TOLD["sun_deg"]))
#: about which a chief flies in a circle
ROUND = dict.fromkeys(
    (
        "eccentricity",
        "true_anomaly_deg",
        "inclination_deg",
        "latitude_argument_deg",
        "j2",
        "drag_m_s2",
        "radiation_m_s2",
    ),
    0.0,
)
TILTED = {
    "eccentricity": 0.3,
    "true_anomaly_deg": -50.0,
    "inclination_deg": 63.0,
    "latitude_argument_deg": 110.0,
}
OBLATE = {"j2": 1.08262668e-3, "drag_m_s2": 3e-7, "radiation_m_s2": 1e-7}


def course(
    dynamics: dict[str, float], num_periods: int, has_shadow: bool = False, radius: float = RADIUS
) -> Course:
    mean_motion = float(np.sqrt(EARTH_GRAVITY_M3_S2 / radius**3))
    return course_of(
        mean_motion, radius, SimpleNamespace(**(ROUND | dynamics)), has_shadow, PERIOD, num_periods
    )


def flown(along: Course, start: np.ndarray, forces: np.ndarray) -> np.ndarray:
    states = [np.array(start, dtype=np.float64)]
    for period, force in enumerate(forces):
        states.append(move_beside(along, period, states[-1], force, SUN))
    return np.array(states)


@pytest.mark.parametrize("name", TOLD["cases"])
def test_basilisk_flies_the_same_hour(name: str) -> None:
    told = TOLD["cases"][name]
    path = flown(
        course(told["dynamics"], 360, told["has_shadow"]),
        np.concatenate((told["position_m"], told["velocity_m_s"])),
        np.zeros((360, 3)),
    )
    samples = np.rint(np.array(told["times_s"]) / PERIOD).astype(int)
    assert len(samples) == 13
    np.testing.assert_allclose(path[samples, :3], told["path_m"], rtol=0.0, atol=1e-3)


def plain_attraction(place: np.ndarray, j2: float, pole: np.ndarray) -> np.ndarray:
    """Return the Earth's attraction, a point's and its oblateness's."""
    square, height = place @ place, place @ pole
    oblate = 1.5 * j2 * EARTH_RADIUS_M**2 / square
    along, up = 1.0 + oblate * (1.0 - 5.0 * height**2 / square), 2.0 * oblate * height
    return -EARTH_GRAVITY_M3_S2 / square**1.5 * (along * place + up * pole)


def plain_frame(place: np.ndarray, velocity: np.ndarray) -> np.ndarray:
    normal = np.cross(place, velocity)
    upward, normal = place / np.linalg.norm(place), normal / np.linalg.norm(normal)
    return np.array([upward, np.cross(normal, upward), normal])


def plainly_flown(
    dynamics: dict[str, float], radius: float, start: np.ndarray, forces: np.ndarray
) -> np.ndarray:
    """Return the places, Hill axes, at the beginning and after each force, held for a minute, by SciPy."""
    told = SimpleNamespace(**(ROUND | dynamics))
    e, anomaly = told.eccentricity, radians(told.true_anomaly_deg)
    slope, latitude = radians(told.inclination_deg), radians(told.latitude_argument_deg)
    parameter, pole = radius * (1.0 - e * e), np.array([0.0, 0.0, 1.0])
    upward = np.array([cos(latitude), sin(latitude) * cos(slope), sin(latitude) * sin(slope)])
    forward = np.cross([0.0, -sin(slope), cos(slope)], upward)
    place = parameter / (1.0 + e * cos(anomaly)) * upward
    velocity = np.sqrt(EARTH_GRAVITY_M3_S2 / parameter) * (
        e * sin(anomaly) * upward + (1 + e * cos(anomaly)) * forward
    )
    to_hill = plain_frame(place, velocity)
    light = -told.radiation_m_s2 * to_hill.T @ SUN

    def rates(time: float, state: np.ndarray, force: np.ndarray) -> np.ndarray:
        at, speed, apart, drifting = state.reshape(4, 3)
        pull = plain_attraction(at, told.j2, pole)
        relative = (
            plain_attraction(at + apart, told.j2, pole) - pull + plain_frame(at, speed).T @ force + light
        )
        slowed = told.drag_m_s2 * np.linalg.norm(speed) * speed * radius / EARTH_GRAVITY_M3_S2
        return np.concatenate((speed, pull, drifting, relative - slowed))

    def turn() -> np.ndarray:
        """The rate of Hill axes, from how they turn in a second."""
        after, before = (
            plain_frame(
                place + sign * velocity * 0.5 + plain_attraction(place, told.j2, pole) * 0.125,
                velocity + sign * 0.5 * plain_attraction(place, told.j2, pole),
            )
            for sign in (1.0, -1.0)
        )
        rate = (after - before) @ to_hill.T
        return np.array([rate[1, 2], rate[2, 0], rate[0, 1]])

    moving = to_hill.T @ (start[3:] + np.cross(turn(), start[:3]))
    state, path = np.concatenate((place, velocity, to_hill.T @ start[:3], moving)), [start[:3]]
    for force in forces:
        state = solve_ivp(
            rates, (0.0, 6.0 * PERIOD), state, "DOP853", rtol=1e-13, atol=1e-12, args=(force,)
        ).y[:, -1]
        path.append(plain_frame(state[:3], state[3:6]) @ state[6:9])
    return np.array(path)


@pytest.mark.parametrize(
    ("dynamics", "radius"),
    [(TILTED | OBLATE, 1.5 * RADIUS), (TILTED | OBLATE | {"eccentricity": 0.05}, RADIUS)],
)
def test_scipy_flies_the_same_hour_under_forces(dynamics: dict[str, float], radius: float) -> None:
    forces = np.random.default_rng(5).normal(0.0, 2e-4, (60, 3))
    start = np.array([60.0, -40.0, 30.0, 0.05, 0.1, -0.08])
    fast = flown(course(dynamics, 360, radius=radius), start, np.repeat(forces, 6, axis=0))
    plain = plainly_flown(dynamics, radius, start, forces)
    np.testing.assert_allclose(fast[::6, :3], plain, rtol=0.0, atol=1e-4)
    # the velocity is the rate of the place: fourth-order differences of samples 10 s apart
    rate = (-fast[4:, :3] + 8.0 * fast[3:-1, :3] - 8.0 * fast[1:-3, :3] + fast[:-4, :3]) / (12.0 * PERIOD)
    quiet = np.arange(len(rate)) % 6 == 1
    np.testing.assert_allclose(fast[2:-2, 3:][quiet], rate[quiet], rtol=0.0, atol=1e-7)


def test_nearby_on_a_circle_motion_is_clohessy_and_wiltshires() -> None:
    start, force = np.array([0.6, -0.4, 0.3, 5e-4, 1e-3, -8e-4]), np.full((360, 3), [1e-7, -2e-7, 1e-7])
    path = flown(course({}, 360), start, force)
    linear = motion_over(
        SimpleNamespace(mean_motion_rad_s=MEAN_MOTION), SimpleNamespace(mass_kg=1.0), [PERIOD]
    )
    state = start
    for period in range(360):
        state = propagate(linear, state, force[period])
        np.testing.assert_allclose(path[period + 1], state, rtol=0.0, atol=1e-4)
    # what is left shrinks with the square of the distance
    half = flown(course({}, 360), 0.5 * start, 0.5 * force)[-1, :3] - 0.5 * state[:3]
    whole = path[-1, :3] - state[:3]
    np.testing.assert_allclose(whole, 4.0 * half, rtol=1e-2, atol=1e-9)
    assert np.abs(whole).max() > 1e-7
