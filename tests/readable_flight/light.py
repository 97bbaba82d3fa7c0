"""The Sun, the Earth's shadow, and which points are lit (docs/explanation/light-and-camera.md)."""

import numpy as np

ASTRONOMICAL_UNIT_M, SUN_RADIUS_M = 149_597_870_700.0, 695_700_000.0
EARTH_RADIUS_M, EARTH_GRAVITY = 6_378_137.0, 3.986004418e14


def sun_direction(angle, elevation):
    """The unit vector towards the Sun, by its angle in the orbit plane from i to j and its elevation."""
    level = np.cos(elevation)
    return np.array([level * np.cos(angle), level * np.sin(angle), np.sin(elevation)])


def sun_at(flight, k):
    """The Sun's angle and elevation at a sample: ``theta_0 - n t``, or as a true orbit turns Hill axes."""
    angle, elevation = flight.scenario.sun_angle_rad, flight.scenario.sun_elevation_rad
    if flight.orbit is None:
        return later(flight, (angle, elevation), k)
    x, y, z = flight.hill_axes[k] @ sun_direction(angle, elevation)
    return np.arctan2(y, x), np.arctan2(z, np.hypot(x, y))


def later(flight, sun, periods):
    """The Sun's angle and elevation after some control periods, as the deputy predicts them."""
    mission = flight.mission
    return sun[0] - mission.orbit.mean_motion_rad_s * periods * mission.control_period_s, sun[1]


def orbit_radius(mission):
    """The chief's semi-major axis: by default Kepler's for the mean motion."""
    given, n = mission.orbit.radius_m, mission.orbit.mean_motion_rad_s
    return (EARTH_GRAVITY / n**2) ** (1.0 / 3.0) if given is None else given


def visible_share(sun_height, radius):
    """The share of the Sun's disc beside the Earth's: two circles in the sky, the Earth's about -i.

    Montenbruck and Gill, Satellite Orbits, 2000, 3.4.2. `sun_height` is the component along i.
    """
    sun, earth = np.arcsin(SUN_RADIUS_M / ASTRONOMICAL_UNIT_M), np.arcsin(EARTH_RADIUS_M / radius)
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


def share_of_sun(mission, sun):
    """The visible share of the Sun's disc, from the chief."""
    return visible_share(sun[0], orbit_radius(mission)) if mission.light.shadow != "none" else 1.0


def lit_points(flight, k, sun):
    """Which points a Sun lights at a sample, (P,): above their tangent planes, and hidden by nothing."""
    mission, sun = flight.mission, sun_direction(*sun)
    if share_of_sun(mission, sun) < mission.light.min_fraction:
        return np.zeros(len(flight.points), dtype=bool)
    points, normals = flight.surface_at(k)
    # n . (p - r_s) < 0, for a sphere p . (p - r_s) < 0
    height = normals @ sun - np.sum(normals * points, axis=1) / ASTRONOMICAL_UNIT_M
    is_lit = height > -np.sin(np.radians(mission.light.past_terminator_deg))
    return is_lit & flight.free_towards(np.tile(sun, (len(points), 1)), is_lit, k)
