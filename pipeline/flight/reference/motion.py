"""Free and forced motion near a circular orbit.

Clohessy and Wiltshire, Terminal guidance system for satellite rendezvous, J. Aerospace Sciences 27, 1960:
``x'' - 3 n^2 x - 2 n y' = f_x/m``, ``y'' + 2 n x' = f_y/m``, ``z'' + n^2 z = f_z/m``.
"""

from functools import lru_cache
from itertools import pairwise

import numpy as np
from scipy.linalg import expm

from pipeline.array_types import Floats
from pipeline.settings.experiment import Mission


@lru_cache(maxsize=4096)
def transition(mean_motion: float, duration: float, mass: float = 1.0) -> tuple[Floats, Floats]:
    """Return Phi, (6, 6), and Gamma, (6, 3), of ``s(t) = Phi s + Gamma f`` under a held force f, N."""
    n, system = mean_motion, np.zeros((9, 9))
    system[:3, 3:6] = np.eye(3)
    system[3, [0, 4]], system[4, 3], system[5, 2] = (3.0 * n * n, 2.0 * n), -2.0 * n, -n * n
    system[3:6, 6:] = np.eye(3) / mass
    exponential = np.asarray(expm(system * duration), dtype=np.float64)
    return exponential[:6, :6], exponential[:6, 6:]


def drifted(mission: Mission, state: Floats, duration: float) -> Floats:
    """Return a state after free motion."""
    return transition(mission.orbit.mean_motion_rad_s, duration)[0] @ state


def pushed(mission: Mission, state: Floats, force: Floats, duration: float) -> Floats:
    """Return a state after motion under a force, N, held along Hill axes."""
    phi, gamma = transition(mission.orbit.mean_motion_rad_s, duration, mission.deputy.mass_kg)
    return phi @ state + gamma @ force


def closest_approach(mission: Mission, state: Floats) -> float:
    """Return the least distance within an orbit of free drift, m, along chords between every ten degrees."""
    part = 2.0 * np.pi / mission.orbit.mean_motion_rad_s / 36
    positions = [drifted(mission, state, count * part)[:3] for count in range(37)]
    return min(_nearest_on(a, b) for a, b in pairwise(positions))


def _nearest_on(a: Floats, b: Floats) -> float:
    """Return the least distance of a chord from the origin."""
    chord = b - a
    share = np.clip(-(a @ chord) / (chord @ chord), 0.0, 1.0) if chord.any() else 0.0
    return float(np.linalg.norm(a + share * chord))
