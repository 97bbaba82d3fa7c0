"""The Sun's direction, what it lights (Choi, Kim and Leeghim, AAS 25-727), and when the Earth hides it."""

from math import acos, asin, cos, pi, sin, sqrt

import numpy as np

from fis_tools.compiled.decorator import compiled
from pipeline.array_types import Floats

ASTRONOMICAL_UNIT_M = 149_597_870_700.0
SUN_RADIUS_M, EARTH_RADIUS_M = 695_700_000.0, 6_378_137.0
EARTH_GRAVITY_M3_S2 = 3.986004418e14


@compiled
def sun_angle(initial_sun_angle: float, mean_motion: float, time: float) -> float:
    """Return ``theta_0 - n t``, the Sun's angle in Hill's i-j plane from i towards j, rad."""
    return initial_sun_angle - mean_motion * time


@compiled
def sun_direction_h(angle: float, elevation: float = 0.0) -> Floats:
    """Return the unit vector towards the Sun, shape (3,), Hill axes.

    Its angle is in the orbit plane from i towards j, rad, its elevation over that plane towards k, rad: the
    angle beta of orbital mechanics.
    """
    return np.array([cos(elevation) * cos(angle), cos(elevation) * sin(angle), sin(elevation)])


def orbit_radius(mean_motion: float) -> float:
    """Return the radius of the circular orbit about the Earth with a mean motion in rad/s, m (Kepler)."""
    return float((EARTH_GRAVITY_M3_S2 / mean_motion**2) ** (1.0 / 3.0))


@compiled
def share_at(sun_height: float, orbit_radius: float) -> float:
    """Return the same as `visible_share`, given the component of the Sun's direction along i."""
    sun, earth = asin(SUN_RADIUS_M / ASTRONOMICAL_UNIT_M), asin(EARTH_RADIUS_M / orbit_radius)
    apart = acos(max(-1.0, min(1.0, -sun_height)))
    if apart >= sun + earth:
        return 1.0
    if apart <= abs(earth - sun):
        return 0.0 if earth >= sun else 1.0 - (earth / sun) ** 2
    along = (apart * apart + sun * sun - earth * earth) / (2.0 * apart)
    across = sqrt(max(0.0, sun * sun - along * along))
    hidden = sun * sun * acos(max(-1.0, min(1.0, along / sun)))
    hidden += earth * earth * acos(max(-1.0, min(1.0, (apart - along) / earth))) - apart * across
    return min(1.0, max(0.0, 1.0 - hidden / (pi * sun * sun)))


@compiled
def visible_share(sun_h: Floats, orbit_radius: float) -> float:
    """Return the share of the Sun's disc that the Earth leaves visible from the chief, 0 to 1.

    Two circles in the sky: the Sun's about its direction, the Earth's about -i (O. Montenbruck and E. Gill,
    Satellite Orbits, 2000, section 3.4.2). Both bodies are spheres, the Sun is one astronomical unit away in
    the direction `sun_h`, a unit vector of shape (3,); the radius, m, is greater than the Earth's.
    """
    return share_at(sun_h[0], orbit_radius)


def least_sun_height(orbit_radius: float, min_share: float) -> float:
    """Return the lowest Sun at which a share of its disc is visible, as the cosine of its zenith angle.

    The higher the Sun stands over the chief's horizon, the more of its disc is visible, so that one number
    separates light from shadow; found by bisection of `share_at`. For a share of 0 there is no shadow: -2,
    which that cosine always exceeds.
    """
    if share_at(-1.0, orbit_radius) >= min_share:
        return -2.0
    dark, lit = pi, 0.5 * pi
    while True:  # to the last bit
        middle = 0.5 * (dark + lit)
        if middle in (dark, lit):
            return cos(lit)
        share = share_at(cos(middle), orbit_radius)
        dark, lit = (dark, middle) if share >= min_share else (middle, lit)
