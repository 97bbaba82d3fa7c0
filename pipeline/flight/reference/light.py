"""The Sun, the Earth's shadow, and which points are lit (docs/explanation/motion.md)."""

import numpy as np

from pipeline.array_types import Booleans, Floats
from pipeline.constants import ASTRONOMICAL_UNIT_M, EARTH_GRAVITY_M3_S2, EARTH_RADIUS_M, SUN_RADIUS_M
from pipeline.settings.experiment import Mission
from pipeline.settings.orbit import MeanMotionOrbit, PlanetOrbit

#: the Sun's angle in the orbit plane, from i towards j, and its elevation over that plane, rad
SunAngles = tuple[float, float]


def sun_direction(angle: float, elevation: float) -> Floats:
    """Return the unit vector towards the Sun."""
    level = np.cos(elevation)
    return np.array([level * np.cos(angle), level * np.sin(angle), np.sin(elevation)])


def later(mission: Mission, sun: SunAngles, periods: float) -> SunAngles:
    """Return the Sun some control periods later, ``theta - n t``, as the paper and the deputy predict it."""
    return sun[0] - mission.orbit.mean_motion_rad_s * periods * mission.control_period_s, sun[1]


def semi_major_axis(mission: Mission) -> float:
    """Return the chief's semi-major axis, m: Kepler's for the mean motion, unless the radius is given."""
    orbit, n = mission.orbit, mission.orbit.mean_motion_rad_s
    if isinstance(orbit, MeanMotionOrbit) and orbit.radius_m is not None:
        return orbit.radius_m
    gravity = orbit.gravity_m3_s2 if isinstance(orbit, PlanetOrbit) else EARTH_GRAVITY_M3_S2
    return float((gravity / n**2) ** (1.0 / 3.0))


def planet_radius(mission: Mission) -> float:
    """Return the radius of the planet that casts the shadow, m: the Earth's unless given."""
    given = mission.orbit.planet_radius_m if isinstance(mission.orbit, PlanetOrbit) else None
    return EARTH_RADIUS_M if given is None else given


def visible_share(sun_height: float, radius: float, planet: float = EARTH_RADIUS_M) -> float:
    """Return the share of the Sun's disc beside the Earth's: two circles in the sky, the Earth's about -i.

    Montenbruck and Gill, Satellite Orbits, 2000, 3.4.2. `sun_height` is the component along i, `radius` the
    distance from the Earth's centre, m, and `planet` the radius of the body that stands for the Earth.
    """
    sun, earth = np.arcsin(SUN_RADIUS_M / ASTRONOMICAL_UNIT_M), np.arcsin(planet / radius)
    apart = np.arccos(np.clip(-sun_height, -1.0, 1.0))
    if apart >= sun + earth:
        return 1.0
    if apart <= abs(earth - sun):
        return 0.0 if earth >= sun else 1.0 - (earth / sun) ** 2
    x = (apart**2 + sun**2 - earth**2) / (2.0 * apart)
    y = np.sqrt(max(0.0, sun**2 - x**2))
    hidden = sun**2 * np.arccos(np.clip(x / sun, -1.0, 1.0))
    hidden += earth**2 * np.arccos(np.clip((apart - x) / earth, -1.0, 1.0)) - apart * y
    return float(np.clip(1.0 - hidden / (np.pi * sun**2), 0.0, 1.0))


def share_of_sun(mission: Mission, sun: Floats, distance: float) -> float:
    """Return the visible share of the Sun's disc, by the unit vector towards the Sun.

    `distance` is the chief's from the Earth's centre, m.
    """
    if mission.light.shadow == "none":
        return 1.0
    return visible_share(sun[0], distance, planet_radius(mission))


def faces_sun(mission: Mission, points: Floats, normals: Floats, sun: Floats, distance: float) -> Booleans:
    """Return which points have the Sun above their tangent planes, outside the Earth's shadow, (P,).

    What other parts of the chief hide is the matter of `mesh`; the distance is as in `share_of_sun`.
    """
    if share_of_sun(mission, sun, distance) < mission.light.min_fraction:
        return np.zeros(len(points), dtype=np.bool_)
    # n . (p - r_s) < 0, for a sphere p . (p - r_s) < 0
    height = normals @ sun - np.sum(normals * points, axis=1) / ASTRONOMICAL_UNIT_M
    return np.asarray(height > -np.sin(np.radians(mission.light.past_terminator_deg)))
