"""Sunlight reflected by a surface towards a camera: Blinn and Phong's model.

For each colour, ``ambient + diffuse (n . l) + specular (n . h)^p``, at most 1, with the unit normal n, the
unit vectors l towards the Sun and v towards the camera, and h halfway between these (J. F. Blinn, Models of
light reflection for computer synthesized pictures, Computer Graphics 11(2), 1977, 192-198). AFRL's
safe-autonomy-simulation uses a quarter of a shininess as p, and counts a point as seen if each colour is
between two limits. Here p is an integer, so that the power is a product and the same on every platform.
"""

from math import sqrt
from typing import NamedTuple

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.three import Three, dot, plus, scaled
from pipeline.array_types import Floats


class Reflection(NamedTuple):
    """A surface's reflection, and the intensities at which a point is seen; arrays are by colour."""

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
    half = plus(to_sun, scaled(1.0 / sqrt(dot(to_camera, to_camera)), to_camera))
    facing = max(0.0, dot(normal, to_sun))
    glancing = max(0.0, dot(normal, half) / sqrt(dot(half, half)))
    shine = power(glancing, reflection.exponent)
    for colour in range(3):
        lit = reflection.ambient[colour] + reflection.diffuse[colour] * facing
        intensity = min(1.0, lit + reflection.specular[colour] * shine)
        if not reflection.least[colour] < intensity < reflection.greatest[colour]:
            return False
    return True
