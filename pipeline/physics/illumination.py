"""The Sun's direction, what it lights (Choi, Kim and Leeghim, AAS 25-727), reflection, and Earth's shadow."""

from math import acos, asin, cos, pi, sin, sqrt
from typing import NamedTuple

import numpy as np

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.three import Three, dot
from pipeline.array_types import Floats
from pipeline.constants import ASTRONOMICAL_UNIT_M, EARTH_RADIUS_M, SUN_RADIUS_M


@compiled
def sun_angle(initial_sun_angle: float, mean_motion: float, time: float) -> float:
    """Return ``theta_0 - n t``, the Sun's angle in Hill's i-j plane from i towards j, rad."""
    return initial_sun_angle - mean_motion * time


def sun_direction_h(angle: float, elevation: float = 0.0) -> Floats:
    """Return the unit vector towards the Sun, shape (3,), Hill axes.

    Its angle is in the orbit plane from i towards j, rad, its elevation over that plane towards k, rad: the
    angle beta of orbital mechanics.
    """
    return np.array([cos(elevation) * cos(angle), cos(elevation) * sin(angle), sin(elevation)])


@compiled
def visible_share(sun_height: float, radius: float) -> float:
    """Return the share of the Sun's disc that the Earth leaves visible from the chief, 0 to 1.

    Two circles in the sky: the Sun's about its direction, the Earth's about -i (O. Montenbruck and E. Gill,
    Satellite Orbits, 2000, section 3.4.2). Both bodies are spheres, the Sun is one astronomical unit away;
    its height is the component along i of the unit vector towards it. The radius, the chief's distance from
    the Earth's centre, m, is greater than the Earth's.
    """
    sun, earth = asin(SUN_RADIUS_M / ASTRONOMICAL_UNIT_M), asin(EARTH_RADIUS_M / radius)
    apart = acos(max(-1.0, min(1.0, -sun_height)))
    if apart >= sun + earth:
        return 1.0
    if apart <= abs(earth - sun):
        return 0.0 if earth >= sun else 1.0 - (earth / sun) * (earth / sun)
    along = (apart * apart + sun * sun - earth * earth) / (2.0 * apart)
    across = sqrt(max(0.0, sun * sun - along * along))
    hidden = sun * sun * acos(max(-1.0, min(1.0, along / sun)))
    hidden += earth * earth * acos(max(-1.0, min(1.0, (apart - along) / earth))) - apart * across
    return min(1.0, max(0.0, 1.0 - hidden / (pi * sun * sun)))


def least_sun_height(radius: float, min_share: float) -> float:
    """Return the lowest Sun at which a share of its disc is visible, as the cosine of its zenith angle.

    The higher the Sun stands over the chief's horizon, the more of its disc is visible, so that one number
    separates light from shadow; found by bisection of `visible_share`. For a share of 0 there is no shadow:
    -2, which that cosine always exceeds.
    """
    if visible_share(-1.0, radius) >= min_share:
        return -2.0
    dark, lit = pi, 0.5 * pi
    while True:  # to the last bit
        middle = 0.5 * (dark + lit)
        if middle in (dark, lit):
            return cos(lit)
        share = visible_share(cos(middle), radius)
        dark, lit = (dark, middle) if share >= min_share else (middle, lit)


class Reflection(NamedTuple):
    """A surface's reflection by Blinn and Phong, and the intensities at which a point is seen.

    For each colour, ``ambient + diffuse (n . l) + specular (n . h)^p``, at most 1, with the unit normal n,
    the unit vectors l towards the Sun and v towards the camera, and h halfway between these (J. F. Blinn,
    Models of light reflection for computer synthesized pictures, Computer Graphics 11(2), 1977, 192-198).
    AFRL's safe-autonomy-simulation uses a quarter of a shininess as p, and counts a point as seen if each
    colour is between two limits. Here p is an integer, so that the power is a product and the same on every
    platform.
    Arrays are by colour.
    """

    is_on: bool  # if not, a point is seen whatever it reflects
    ambient: Floats
    diffuse: Floats
    specular: Floats
    exponent: int
    least: Floats  # intensities that each colour must lie between
    greatest: Floats


@compiled(error_model="numpy")
def power(base: float, exponent: int) -> float:
    """Return an integer power of a number, by squaring."""
    result = 1.0
    while exponent > 0:
        if exponent % 2 == 1:
            result *= base
        base *= base
        exponent //= 2
    return result


@compiled(error_model="numpy")
def is_bright(reflection: Reflection, normal: Three, to_sun: Three, to_camera: Three) -> bool:
    """Return whether a point is neither too dark nor too bright, see `Reflection`.

    `normal` and `to_sun` are unit vectors; `to_camera` may have any length.
    """
    half = to_sun + (1.0 / sqrt(dot(to_camera, to_camera))) * to_camera
    facing = max(0.0, dot(normal, to_sun))
    glancing = max(0.0, dot(normal, half) / sqrt(dot(half, half)))
    shine = power(glancing, reflection.exponent)
    for colour in range(3):
        lit = reflection.ambient[colour] + reflection.diffuse[colour] * facing
        intensity = min(1.0, lit + reflection.specular[colour] * shine)
        if not reflection.least[colour] < intensity < reflection.greatest[colour]:
            return False
    return True
