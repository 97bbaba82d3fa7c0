"""Free and forced motion near a circular orbit.

Clohessy and Wiltshire, Terminal guidance system for satellite rendezvous, J. Aerospace Sciences 27, 1960:
``x'' - 3 n^2 x - 2 n y' = f_x/m``, ``y'' + 2 n x' = f_y/m``, ``z'' + n^2 z = f_z/m``.
"""

from functools import lru_cache
from itertools import pairwise

import numpy as np
from scipy.linalg import expm


@lru_cache(maxsize=4096)
def transition(mean_motion, duration, mass=1.0):
    """Phi (6, 6) and Gamma (6, 3) of ``s(t) = Phi s + Gamma f`` under a held force."""
    n, system = mean_motion, np.zeros((9, 9))
    system[:3, 3:6] = np.eye(3)
    system[3, [0, 4]], system[4, 3], system[5, 2] = (3.0 * n * n, 2.0 * n), -2.0 * n, -n * n
    system[3:6, 6:] = np.eye(3) / mass
    moved = expm(system * duration)
    return moved[:6, :6], moved[:6, 6:]


def drifted(mission, state, duration):
    """A state of shape (6,) after free motion."""
    return transition(mission.orbit.mean_motion_rad_s, duration)[0] @ state


def pushed(mission, state, force, duration):
    """A state of shape (6,) after a force, N, held along Hill axes."""
    phi, gamma = transition(mission.orbit.mean_motion_rad_s, duration, mission.deputy.mass_kg)
    return phi @ state + gamma @ force


def closest_approach(mission, state):
    """The least distance within an orbit of free drift, along chords between places ten degrees apart."""
    part = 2.0 * np.pi / mission.orbit.mean_motion_rad_s / 36
    places = [drifted(mission, state, count * part)[:3] for count in range(37)]
    return min(_nearest_on(a, b) for a, b in pairwise(places))


def _nearest_on(a, b):
    chord = b - a
    share = np.clip(-(a @ chord) / (chord @ chord), 0.0, 1.0) if chord.any() else 0.0
    return np.linalg.norm(a + share * chord)
