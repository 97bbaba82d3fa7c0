"""Orbits, however they are given, and the Sun at their epoch: against astropy, SciPy and published states."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from pipeline.command_line.config import compose_experiment
from pipeline.settings import ephemeris
from pipeline.settings.checks import SettingError
from pipeline.settings.experiment import Mission
from pipeline.settings.orbit import KeplerElements, OrbitSettings, elements_of
from pipeline.settings.schema import in_world

FLY = ["+experiment=fly", "controller=coast"]
SUNS = json.loads((Path(__file__).parent / "sun" / "suns.json").read_text(encoding="utf-8"))["suns"]
#: satellite 00005 of Spacetrack Report 3's revision (Vallado and others, AIAA 2006-6753), and its state at
#: the epoch, km and km/s
VANGUARD = (
    "1 00005U 58002B   00179.78495062  .00000023  00000-0  28098-4 0  4753",
    "2 00005  34.2682 348.7242 1859667 331.7664  19.3264 10.82419157413667",
)
VANGUARD_STATE = (7022.46529266, -1400.08296755, 0.03995155, 1.893841015, 6.405893759, 4.534807250)


@pytest.mark.parametrize("epoch", SUNS)
def test_the_sun_stands_where_astropy_has_it(epoch):
    direction = ephemeris.sun_direction(ephemeris.days_of(epoch))
    assert np.degrees(np.linalg.norm(np.subtract(direction, SUNS[epoch]))) < 0.015


@pytest.mark.parametrize("angles", [(51.6, 200.0, 77.0), (97.6, -20.0, 301.0), (0.0, 10.0, 20.0)])
def test_the_sun_turns_into_hill_axes_as_scipy_turns_it(angles):
    inclination, node, latitude = angles
    days = ephemeris.days_of("2026-11-26T12:00:00")
    turned = Rotation.from_euler("ZXZ", [node, inclination, latitude], degrees=True)
    x, y, z = turned.inv().apply(ephemeris.sun_direction(days))
    angle, elevation = ephemeris.sun_in_hill_deg(days, *angles)
    assert angle == pytest.approx(np.degrees(np.arctan2(y, x)) % 360.0)
    assert elevation == pytest.approx(np.degrees(np.arcsin(z)))


def test_a_state_has_the_elements_that_vallado_gives_it():
    """Example 2-5 of the fourth edition, whose argument of the perigee has two decimal places."""
    state = [6524.834e3, 6862.875e3, 6448.296e3, 4901.327, 5533.756, -1976.341]
    expected = KeplerElements(36_127_343.0, 0.832853, 87.870, 227.898 - 360.0, 53.38 + 92.335, 92.335)
    np.testing.assert_allclose(elements_of(state), expected, rtol=5e-5)


def test_sizes_of_all_kinds_are_of_one_orbit():
    """A sidereal day is 86,164.0905 s, and its circle 42,164.17 km wide."""
    motion, radius = 2.0 * np.pi / 86_164.0905, 42_164_170.0
    kinds = ({"kind": "radius", "radius_m": radius}, {"kind": "elements", "semi_major_axis_m": radius})
    kinds += ({"kind": "altitude", "altitude_m": radius - 6_378_137.0}, {"mean_motion_rad_s": motion})
    for given in kinds:
        orbit = OrbitSettings(**given)
        assert orbit.mean_motion_rad_s == pytest.approx(motion, rel=1e-6)
        assert orbit.elements.semi_major_axis_m == pytest.approx(radius, rel=1e-6)
    moon = OrbitSettings(kind="radius", radius_m=1_837_400.0, gravity_m3_s2=4.9028e12)
    assert 2.0 * np.pi / moon.mean_motion_rad_s == pytest.approx(117.8 * 60.0, rel=1e-3)


def test_a_two_line_set_is_flown_from_where_sgp4_has_it():
    pytest.importorskip("sgp4", reason="element sets need sgp4")
    orbit = OrbitSettings(kind="tle", tle=VANGUARD)
    axis, e, *angles, anomaly = orbit.elements
    parameter, turned = axis * (1.0 - e * e), Rotation.from_euler("ZXZ", np.array(angles)[[1, 0, 2]], True)
    radius, along = parameter / (1.0 + e * np.cos(np.radians(anomaly))), np.sin(np.radians(anomaly))
    speed = np.sqrt(3.986004418e14 / parameter)
    velocity = speed * np.array([e * along, parameter / radius, 0.0])
    state = [*turned.apply([radius, 0.0, 0.0]), *turned.apply(velocity)]
    np.testing.assert_allclose(state, np.multiply(VANGUARD_STATE, 1e3), rtol=0.0, atol=0.02)
    # day 179.78 of 2000
    assert orbit.osculating[1] == pytest.approx(179.78495062 - 1.5)
    later = OrbitSettings(kind="tle", tle=VANGUARD, epoch="2000-06-28T12:00:00")
    assert later.osculating[1] == 178.0 + 1.0
    with pytest.raises(SettingError, match="choose dynamics=two_body"):
        Mission(orbit=orbit)


def test_without_sgp4_a_sentence_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "sgp4.api", None)
    with pytest.raises(SettingError, match="needs the package sgp4; install it"):
        Mission(orbit={"kind": "tle", "tle": VANGUARD})


REFUSED = [
    ("dynamics=two_body orbit.radius_m=7500000", "an orbit about 1.297 of orbit.gravity_m3_s2"),
    ("light=shadow orbit.radius_m=42164000", "an orbit about 230.4 of"),
    ("orbit.altitude_m=550000", "orbit.altitude_m counts only with orbit.kind=altitude, and orbit.kind is"),
    ("orbit=radius orbit.gravity_m3_s2=4.9e12 light=shadow orbit.radius_m=7e6", "light.shadow=conical is"),
    ("dynamics.eccentricity=0.1", "there is no key dynamics.eccentricity in the configuration; it is orbit."),
    ("orbit.epoch=2026-13-01", "must be a date and time of UTC, as 2026-11-26T12:00:00"),
    ("orbit.epoch=2126-11-01", "must be from 1950 to 2050"),
    ("orbit=radius orbit.radius_m=6878", "makes a mean motion of 35 rad/s; it must be from 1e-08 to 0.1"),
    ("orbit=altitude orbit.altitude_m=500", "orbit.altitude_m is 500; it must be at least 100000 (m)"),
    ("orbit.kind=tle", "orbit.tle has 0 lines; it must have two"),
    (
        "orbit.epoch=2026-11-26 +dispersions.orbit.inclination_deg={kind:uniform,low:1,high:2}",
        "dispersions.orbit.inclination_deg is given, but the Sun follows from orbit.epoch",
    ),
]


@pytest.mark.parametrize(("words", "message"), REFUSED, ids=[words for words, _ in REFUSED])
def test_orbits_that_contradict_themselves_are_refused(words, message):
    with pytest.raises(ValueError, match="orbit") as refusal:
        compose_experiment([*FLY, *words.split(" ")])
    assert message in str(refusal.value)


def test_a_line_that_was_copied_wrongly_is_refused():
    wrong = VANGUARD[0].replace("179.78", "179.79")
    with pytest.raises(SettingError, match="its digits give the checksum"):
        OrbitSettings(kind="tle", tle=(wrong, VANGUARD[1]))
    with pytest.raises(SettingError, match="it must be line 2 of a set"):
        OrbitSettings(kind="tle", tle=(VANGUARD[0], VANGUARD[0]))
    with pytest.raises(SettingError, match=r"orbit.tle is empty; give its two lines"):
        Mission(orbit={"kind": "tle"})


def test_the_sun_follows_the_epoch_unless_it_is_given():
    words = [
        "orbit=altitude",
        "orbit.epoch=2026-11-26T12:30:00",
        "orbit.raan_deg=40",
        "orbit.inclination_deg=97",
    ]
    expected = Rotation.from_euler("ZX", [40.0, 97.0], degrees=True).inv().apply(SUNS["2026-11-26T12:30:00"])
    sun = compose_experiment([*FLY, *words]).experiment.sun
    angle, elevation = np.radians([sun.angle_deg, sun.elevation_deg])
    flat = np.cos(elevation)
    direction = [flat * np.cos(angle), flat * np.sin(angle), np.sin(elevation)]
    np.testing.assert_allclose(direction, expected, rtol=0.0, atol=np.radians(0.015))
    drawn = compose_experiment([*FLY, *words, "sun=random"]).experiment.sun
    assert drawn.elevation_deg == sun.elevation_deg
    assert compose_experiment([*FLY, *words, "sun.angle_deg=7"]).experiment.sun.angle_deg == 7.0
    assert compose_experiment(FLY).experiment.sun.angle_deg == 0.0


def test_the_sun_of_a_compared_world_is_that_of_its_own_epoch():
    words = ["orbit=altitude", "orbit.epoch=2026-11-26T12:30:00"]
    changes = "+compare.worlds.spring.orbit.epoch=2027-03-20T12:00:00"
    experiment = compose_experiment(["+experiment=baselines", *words, changes]).experiment
    alone = compose_experiment(
        ["+experiment=baselines", words[0], "orbit.epoch=2027-03-20T12:00:00"]
    ).experiment
    assert in_world(experiment, "spring").sun == alone.sun != experiment.sun


#: eccentricity, true anomaly at the start (degrees), duration (s): through the perigee, before and behind it,
#: about the apogee, and most of an orbit
ARCS = [
    (0.725, 290.0, 6000.0),
    (0.3, -30.0, 400.0),
    (0.3, 20.0, 900.0),
    (0.1, 150.0, 2000.0),
    (0.05, 5.0, 9e3),
]


@pytest.mark.parametrize(("eccentricity", "anomaly", "duration"), ARCS)
def test_an_ellipse_turns_hill_axes_and_pulls_as_an_integration_has_it(eccentricity, anomaly, duration):
    size = 24_478_137.0
    orbit = {"kind": "elements", "semi_major_axis_m": size, "eccentricity": eccentricity}
    orbit |= {"true_anomaly_deg": anomaly % 360.0}
    words = [f"orbit.{name}={value}" for name, value in orbit.items() if name != "kind"]
    words = [*FLY, "orbit=elements", "dynamics=two_body", *words, f"duration_s={duration}"]
    mission = compose_experiment(words).experiment.mission
    gravity, parameter, angle = 3.986004418e14, size * (1.0 - eccentricity**2), np.radians(anomaly)
    radius, speed = parameter / (1.0 + eccentricity * np.cos(angle)), np.sqrt(gravity / parameter)
    start = [radius, 0.0, speed * eccentricity * np.sin(angle), speed * (1.0 + eccentricity * np.cos(angle))]
    path = solve_ivp(
        lambda _, s: [*s[2:], *(-gravity * s[:2] / np.hypot(*s[:2]) ** 3)],
        *((0.0, duration), start),
        **{"method": "DOP853", "rtol": 1e-10, "atol": 1e-3, "t_eval": np.linspace(0.0, duration, 4001)},
    ).y
    radii = np.hypot(path[0], path[1])
    rates = (path[0] * path[3] - path[1] * path[2]) / radii**2
    assert mission.fastest_turn_rad_s == pytest.approx(rates.max(), rel=1e-6)
    assert mission.greatest_tide_per_s2 == pytest.approx(
        (2.0 * gravity / radii**3 + rates**2).max(), rel=1e-6
    )
