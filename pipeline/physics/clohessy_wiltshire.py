"""Relative motion near a circular orbit, in closed form.

The Clohessy-Wiltshire equations in Hill axes (i radial, j along-track, k orbit normal)::

    x'' - 3 n^2 x - 2 n y' = f_x / m
    y'' + 2 n x'           = f_y / m
    z'' + n^2 z            = f_z / m

are linear with constant coefficients, so that a state moves exactly by ``Phi(t) state + Gamma(t) force``
while the force is held (Choi, Kim and Leeghim, AAS 25-727; Schaub and Junkins, Analytical Mechanics of Space
Systems, section 14.4), for states ``[x, y, z, x', y', z']`` in m and m/s and forces in N.
"""

from math import cos, sin

import numpy as np

from fis_tools.compiled.decorator import compiled
from pipeline.array_types import Floats


@compiled
def _angle_minus_sine(angle: float) -> float:
    """Return ``angle - sin(angle)`` without cancellation for small angles."""
    if abs(angle) > 0.5:
        return angle - sin(angle)
    square = angle * angle
    term = angle * square / 6.0
    total = term
    for k in range(4, 20, 2):
        term *= -square / (k * (k + 1))
        total += term
    return total


@compiled
def state_transition(mean_motion: float, duration: float) -> Floats:
    """Return Phi, shape (6, 6), for a mean motion above zero, rad/s, and a duration, s."""
    n = mean_motion
    angle = n * duration
    s = sin(angle)
    c = cos(angle)
    one_minus_c = 2.0 * sin(0.5 * angle) ** 2
    late = _angle_minus_sine(angle)
    return np.array(
        [
            [1.0 + 3.0 * one_minus_c, 0.0, 0.0, s / n, 2.0 * one_minus_c / n, 0.0],
            [-6.0 * late, 1.0, 0.0, -2.0 * one_minus_c / n, duration - 4.0 * late / n, 0.0],
            [0.0, 0.0, c, 0.0, 0.0, s / n],
            [3.0 * n * s, 0.0, 0.0, c, 2.0 * s, 0.0],
            [-6.0 * n * one_minus_c, 0.0, 0.0, -2.0 * s, 1.0 - 4.0 * one_minus_c, 0.0],
            [0.0, 0.0, -n * s, 0.0, 0.0, c],
        ]
    )


@compiled
def input_matrix(mean_motion: float, duration: float, mass: float) -> Floats:
    """Return Gamma, shape (6, 3), for a mean motion above zero, rad/s, a duration, s, and a mass, kg."""
    n = mean_motion
    angle = n * duration
    s = sin(angle)
    one_minus_c = 2.0 * sin(0.5 * angle) ** 2
    late = _angle_minus_sine(angle)
    along_track = 4.0 * one_minus_c / (n * n) - 1.5 * duration * duration
    return (
        np.array(
            [
                [one_minus_c / (n * n), 2.0 * late / (n * n), 0.0],
                [-2.0 * late / (n * n), along_track, 0.0],
                [0.0, 0.0, one_minus_c / (n * n)],
                [s / n, 2.0 * one_minus_c / n, 0.0],
                [-2.0 * one_minus_c / n, duration - 4.0 * late / n, 0.0],
                [0.0, 0.0, s / n],
            ]
        )
        / mass
    )
