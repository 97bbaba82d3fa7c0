"""Motion about the Earth against Basilisk's, SciPy's integration of both craft, and the linear limit."""

import json
from math import radians
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fis_tools.compiled.decorator import plainly
from pipeline.flight.control.controller import coast
from pipeline.flight.fly.reference import reference_of
from pipeline.flight.fly.workspace import make_state, make_workspace, optics_in_use
from pipeline.flight.period.decide.motion import CLOSEST_APPROACH, sense_approach
from pipeline.flight.period.look.optics import beam_of_case
from pipeline.flight.reference.light import share_of_sun, sun_direction
from pipeline.flight.reference.two_body import moved
from pipeline.flight.state.arrays import Moment
from pipeline.flight.state.log import Scenario
from pipeline.flight.world.pack import pack_world
from pipeline.physics.illumination import sun_direction_h
from pipeline.physics.orbit import Course, Elements, course_of
from pipeline.settings.orbit import OrbitSettings
from tests.pipeline.flight.cases import mission
from tests.pipeline.flight.missions import MEAN_MOTION, PAPER
from tests.pipeline.physics.what_flies import motion_over, move_beside, propagate

BASILISK = json.loads((Path(__file__).parent / "basilisk" / "trajectories.json").read_text(encoding="utf-8"))
BASILISK_MEAN_MOTION, PERIOD = BASILISK["mean_motion_rad_s"], 10.0
#: of the Earth, m^3/s^2
GRAVITY = 3.986004418e14
RADIUS = (GRAVITY / BASILISK_MEAN_MOTION**2) ** (1.0 / 3.0)
SUN = sun_direction_h(*(radians(degrees) for degrees in BASILISK["sun_deg"]))
#: about which a chief flies in a circle
ANGLES = ("true_anomaly_deg", "inclination_deg", "latitude_argument_deg")
SHAPE = ("eccentricity", *ANGLES)
ROUND = dict.fromkeys(Elements._fields, 0.0)
TILTED = {"eccentricity": 0.3} | dict(zip(ANGLES, (-50.0, 63.0, 110.0), strict=True))
#: drag that moves a deputy by a hundred metres in an hour, in air that thins
THINNING = {"drag_m_s2": 3e-5, "scale_height_m": 60e3}
OBLATE = {"j2": 1.08262668e-3, "drag_m_s2": 3e-7, "radiation_m_s2": 1e-7}


def course(dynamics, num_periods: int, has_shadow: bool = False, radius: float = RADIUS) -> Course:
    settings = SimpleNamespace(**(ROUND | dynamics))
    motion = float(np.sqrt(GRAVITY / radius**3))
    return course_of(motion, radius, settings, has_shadow, PERIOD, num_periods)


def flown(along: Course, start: np.ndarray, forces: np.ndarray) -> np.ndarray:
    states = [np.array(start, dtype=np.float64)]
    for period, force in enumerate(forces):
        states.append(move_beside(along, period, states[-1], force, SUN))
    return np.array(states)


@pytest.mark.parametrize("name", BASILISK["cases"])
def test_basilisk_flies_the_same_hour(name):
    case = BASILISK["cases"][name]
    along = course(case["dynamics"], 360, case["has_shadow"])
    start = [*case["position_m"], *case["velocity_m_s"]]
    path = flown(along, start, np.zeros((360, 3)))
    samples = np.rint(np.array(case["times_s"]) / PERIOD).astype(int)
    assert len(samples) == 13
    np.testing.assert_allclose(path[samples, :3], case["path_m"], rtol=0.0, atol=1e-3)


@pytest.mark.parametrize("name", BASILISK["eclipses"])
def test_basilisk_sees_the_same_shadow(name):
    """To a sample, on ellipses too, by both flights."""
    orbit = dict(BASILISK["eclipses"][name])
    duration, turns, is_dark = (orbit.pop(key) for key in ("duration_s", "turns_s", "is_dark_at_start"))
    what = mission(
        orbit=OrbitSettings(kind="elements", **orbit),
        dynamics={"model": "two_body"},
        light={"shadow": "conical"},
        duration_s=duration,
    )
    angle, elevation = np.radians(BASILISK["sun_deg"])
    world, case = pack_world(what), SimpleNamespace(sun_angle=angle, sun_elevation=elevation)
    optics, samples = optics_in_use(world, np.array([elevation])), range(what.num_controls + 1)
    with plainly("pipeline"):
        shines = [beam_of_case(world, optics, case, k).shines for k in samples]
    flight = reference_of(what, coast(), Scenario(np.array([75.0, 0, 0]), np.zeros(3), angle, elevation))
    seen = zip(flight.suns, flight.distances, strict=True)
    shares = [share_of_sun(what, sun_direction(*sun), distance) for sun, distance in seen]
    for is_lit in (np.array(shines), np.array(shares) >= 0.5):
        assert is_lit[0] != is_dark
        changes = PERIOD * (np.flatnonzero(np.diff(is_lit.astype(int))) + 1)
        np.testing.assert_allclose(changes, turns, rtol=0.0, atol=PERIOD)


def plainly_flown(dynamics, radius: float, start: np.ndarray, forces: np.ndarray) -> np.ndarray:
    """The places, Hill axes, at the beginning and after each force, held for a minute, of the reference."""
    motion = float(np.sqrt(GRAVITY / radius**3))
    what = mission(
        orbit={"mean_motion_rad_s": motion, "radius_m": radius}
        | {key: value for key, value in dynamics.items() if key in SHAPE},
        dynamics={"model": "two_body"} | {key: value for key, value in dynamics.items() if key not in SHAPE},
        control_period_s=6.0 * PERIOD,
        duration_s=6.0 * PERIOD * len(forces),
    )
    flight = reference_of(what, coast(), Scenario(start[:3], start[3:], *np.radians(BASILISK["sun_deg"])))
    sun = sun_direction(*np.radians(BASILISK["sun_deg"]))
    states = [start]
    for k, force in enumerate(forces):
        states.append(moved(flight.earth, what, flight.orbit[k], sun, states[-1], force, 0.0))
    return np.array(states)[:, :3]


@pytest.mark.parametrize(
    ("dynamics", "radius"),
    [
        (TILTED | OBLATE, 1.5 * RADIUS),
        (TILTED | OBLATE | {"eccentricity": 0.05}, RADIUS),
        (TILTED | OBLATE | {"eccentricity": 0.05} | THINNING, RADIUS),
    ],
)
def test_scipy_flies_the_same_hour_under_forces(dynamics, radius):
    forces = np.random.default_rng(5).normal(0.0, 2e-4, (60, 3))
    start = np.array([60.0, -40.0, 30.0, 0.05, 0.1, -0.08])
    fast = flown(course(dynamics, 360, radius=radius), start, np.repeat(forces, 6, axis=0))
    plain = plainly_flown(dynamics, radius, start, forces)
    np.testing.assert_allclose(fast[::6, :3], plain, rtol=0.0, atol=1e-4)
    # the velocity is the rate of the place: fourth-order differences of samples 10 s apart
    rate = (-fast[4:, :3] + 8.0 * fast[3:-1, :3] - 8.0 * fast[1:-3, :3] + fast[:-4, :3]) / (12.0 * PERIOD)
    quiet = np.arange(len(rate)) % 6 == 1
    np.testing.assert_allclose(fast[2:-2, 3:][quiet], rate[quiet], rtol=0.0, atol=1e-7)


MASS = 12.0
START = np.array([75.0, -40.0, 20.0, 0.05, -0.1, 0.02])


def hill(_, state, force=(0.0, 0.0, 0.0)):
    """The equations of motion as the paper writes them."""
    x, _, z, vx, vy, vz = state
    n = MEAN_MOTION
    a, b, c = np.asarray(force) / MASS
    return [vx, vy, vz, 3.0 * n * n * x + 2.0 * n * vy + a, -2.0 * n * vx + b, -n * n * z + c]


@pytest.mark.parametrize("force", [np.zeros(3), *np.eye(3)])
@pytest.mark.parametrize("duration", [0.5, 1.0, 10.0, 600.0, 3600.0, 40000.0])
def test_motion_is_that_of_the_differential_equation(duration, force):
    """Free, and what a held force adds."""
    start = np.zeros(6) if force.any() else START
    state = propagate(motion_over(MEAN_MOTION, duration, MASS), start, force)
    scale = np.repeat([1.0, MEAN_MOTION], 3)
    solved = solve_ivp(hill, (0.0, duration), start, "DOP853", args=(force,), rtol=1e-13, atol=1e-12 * scale)
    expected = solved.y[:, -1]
    for part, free in ((slice(3), 1e-8), (slice(3, 6), 1e-11)):
        atol = 1e-12 * np.abs(expected[part]).max() if force.any() else free
        np.testing.assert_allclose(state[part], expected[part], rtol=1e-10, atol=atol)


WORLD = pack_world(PAPER)
ORBIT_S = 2.0 * np.pi / MEAN_MOTION
#: of the ellipse's largest half axis: an eighth of the square of ten degrees
SHARE = np.radians(10.0) ** 2 / 8.0


def closest_approach(start: np.ndarray) -> float:
    state, work = make_state(WORLD, None, 1), make_workspace(WORLD, 1)
    state.belief.position[:, 0], state.belief.velocity[:, 0] = start[:3], start[3:]
    with plainly("pipeline"):
        sense_approach(Moment(WORLD, state, 0, 1, 0), work.signals)
    return float(work.signals[CLOSEST_APPROACH, 0])


def least_distance(state: np.ndarray) -> float:
    """At 20,000 instants of an integrated orbit: nearer to the truth than a millimetre."""
    times = np.linspace(0.0, ORBIT_S, 20_001)
    path = solve_ivp(hill, (0.0, ORBIT_S), state, "DOP853", times, rtol=1e-11, atol=1e-11).y[:3]
    return float(np.linalg.norm(path, axis=0).min())


def test_it_is_as_near_to_the_truth_as_it_says():
    """Also for three that come to pass through the chief; and what rests, or goes away, is nearest now."""
    generator = np.random.default_rng(5)
    states = np.hstack([generator.normal(0.0, 50.0, (60, 3)), generator.normal(0.0, 0.05, (60, 3))])
    # half of them drift little, so that they come round the chief
    states[:30, 4] = -2.0 * MEAN_MOTION * states[:30, 0] + generator.normal(0.0, 0.005, 30)
    centre = [0.0, 0.0, 0.0, 0.03, -0.02, 0.01]
    for index, after_s in enumerate((500.0, 2500.0, 5000.0)):
        states[index] = solve_ivp(hill, (after_s, 0.0), centre, "DOP853", rtol=1e-11, atol=1e-11).y[:, -1]
    nearest = np.array([closest_approach(state) for state in states])
    errors = np.abs(nearest - [least_distance(state) for state in states])
    # the largest distance of a place on the ellipse from its moving centre, across the track included
    x, _, z, x_rate, y_rate, z_rate = states.T
    height = np.hypot(3.0 * x + 2.0 * y_rate / MEAN_MOTION, x_rate / MEAN_MOTION)
    assert (errors <= SHARE * np.hypot(2.0 * height, np.hypot(z, z_rate / MEAN_MOTION))).all()
    distances = np.linalg.norm(states[:, :3], axis=1)
    assert (nearest <= distances).all()
    assert (nearest < 0.7 * distances).sum() > 15  # now would be far off
    still = np.array([[0.0, -60.0, 0.0, 0.0, 0.0, 0.0], [100.0, -300.0, 0.0, 0.0, 0.0, 0.0]])
    now = np.linalg.norm(still, axis=1)
    np.testing.assert_allclose([closest_approach(state) for state in still], now, rtol=1e-6)
