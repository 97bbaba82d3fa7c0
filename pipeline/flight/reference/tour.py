"""The push that leads a deputy of the readable reference onto the tour."""

import numpy as np
from numpy.typing import NDArray

from pipeline.flight.signals import TOUR_PARTS, TOUR_WAVES, constant
from pipeline.physics.clohessy_wiltshire import state_transition

Floats = NDArray[np.float64]

MEANS = {part: constant(f"tour_{part}_mean_m") for part in TOUR_PARTS}


def tour_place(constants: Floats, sun_angle: float, sun_elevation: float) -> Floats:
    """Return the place of the tour at a direction of the Sun, shape (3,), m, Hill axes.

    Each component is ``mean + sum of cos_m cos(m angle) + sin_m sin(m angle)``, m of 1 and 2; the lift,
    another such sum, adds to the last by the sine of the elevation.
    """
    multiples = np.arange(1, 1 + len(TOUR_WAVES) // 2) * sun_angle
    waves = np.concatenate(([1.0], np.column_stack((np.cos(multiples), np.sin(multiples))).ravel()))
    x, y, z, lift = (waves @ constants[mean : mean + len(TOUR_WAVES)] for mean in MEANS.values())
    return np.array((x, y, z + np.sin(sun_elevation) * lift))


def push_to(place_h: Floats, state: Floats, mean_motion: float, time: float) -> Floats:
    """Return the push that leads a state of shape (6,) by free motion to a place after some time, m/s."""
    transition = state_transition(mean_motion, time)
    return np.linalg.solve(transition[:3, 3:], place_h - transition[:3] @ state).astype(np.float64)
