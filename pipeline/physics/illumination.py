"""Where the Sun is, and what it lights (Choi, Kim and Leeghim, AAS 25-727)."""

from math import cos, sin

import numpy as np
from numpy.typing import NDArray

from fis_tools.engines.compiled import compiled
from pipeline.physics.vectors import dot

Floats = NDArray[np.float64]

ASTRONOMICAL_UNIT_M = 149_597_870_700.0


@compiled
def sun_angle(initial_sun_angle: float, mean_motion: float, time: float) -> float:
    """Return ``theta_0 - n t``, the Sun's angle in Hill's i-j plane from i towards j, rad."""
    return initial_sun_angle - mean_motion * time


@compiled
def sun_direction_h(angle: float) -> Floats:
    """Return the unit vector towards the Sun, shape (3,), Hill axes, for its angle in rad."""
    return np.array([cos(angle), sin(angle), 0.0])


@compiled
def is_illuminated(point_h: Floats, sun_h: Floats) -> bool:
    """Tell whether sunlight reaches a point on the chief: ``p . (p - r_s) < 0``.

    The point under the Sun counts as lit; the terminator is dark.

    Parameters
    ----------
    point_h : array, shape (3,)
        m, Hill axes.
    sun_h : array, shape (3,)
        Unit vector towards the Sun, which stands at one astronomical unit, Hill axes.

    Returns
    -------
    bool
    """
    return bool(dot(point_h, point_h) - ASTRONOMICAL_UNIT_M * dot(point_h, sun_h) < 0.0)
