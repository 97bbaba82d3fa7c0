"""What follows a flight, and what a failure of all thrusters within it would lead to, if nothing is fired.

Motion is that of `pipeline.flight.world.coasting`.
"""

from collections.abc import Sequence
from math import pi
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipeline.array_types import Booleans, Floats
from pipeline.flight.world.coasting import FreeMotion
from pipeline.settings.experiment import Mission

#: how long a flight that stays does so, in orbits
ORBITS: Final = (1, 3)
#: between the samples of a first look and of a close one at what free motion leads to, s; control periods
#: are, where they are longer
FIRST_LOOK_S, CLOSE_LOOK_S = 60.0, 10.0
#: most samples of an orbit that is tabulated: beyond, the columns are left out
MOST_SAMPLES = 200_000
#: flights that are followed together, so that memory stays small
CHUNK = 1000


class Aftermath(NamedTuple):
    """What follows n flights if nothing more is fired."""

    stays_orbit: Booleans  # (n,) between the distance limits for an orbit after the end
    stays_three_orbits: Booleans  # (n,)
    # (n,) had all thrusters failed at any sample after the first push, it would not have come nearer than the
    # least distance within an orbit; the start is not the controller's
    passively_safe: Booleans


def aftermath(mission: Mission, tracks: NDArray[Any]) -> Aftermath | None:
    """Return what follows flights from their tracks, (n, K+1, 6 or more): position, m, and velocity, m/s.

    None where an orbit is so long, and control periods so short, that there would be too many samples.
    """
    orbit = 2.0 * pi / mission.orbit.mean_motion_rad_s
    if ORBITS[-1] * orbit / mission.control_period_s > MOST_SAMPLES:
        return None
    motion, parts = FreeMotion(mission, ORBITS[-1] * orbit), list[Aftermath]()
    for first in range(0, len(tracks), CHUNK):
        states = np.asarray(tracks[first : first + CHUNK, :, :6], dtype=np.float64)
        orbit_long, three_long = (stays(mission, motion, states[:, -1], count * orbit) for count in ORBITS)
        parts.append(Aftermath(orbit_long, three_long, _are_passively_safe(mission, motion, states, orbit)))
    return joined(parts)


def joined(parts: Sequence[Aftermath | None]) -> Aftermath | None:
    """Return what follows the flights of several parts, in order; None if that of one is unknown."""
    known = [part for part in parts if part is not None]
    if len(known) < len(parts):
        return None
    return Aftermath(*(np.concatenate(columns) for columns in zip(*known, strict=True)))


def stays(mission: Mission, motion: FreeMotion, states: Floats, seconds: float) -> Booleans:
    """Return which flights stay between the limits from their ends on, (n,)."""
    path = motion.path(mission.num_controls, states, seconds, CLOSE_LOOK_S)
    farthest = np.sqrt(np.max(np.sum(path * path, axis=1), axis=0))
    return (nearest_on(path) >= mission.deputy.min_distance_m) & (farthest <= mission.deputy.max_distance_m)


def _are_passively_safe(mission: Mission, motion: FreeMotion, states: Floats, orbit: float) -> Booleans:
    """Return which flights are never, but at the start, where coasting leads too near, (n,)."""
    least = mission.deputy.min_distance_m
    is_safe = np.ones(len(states), dtype=np.bool_)
    spacing = max(FIRST_LOOK_S, mission.control_period_s)
    for k in range(1, states.shape[1]):
        followed = np.flatnonzero(is_safe)
        squares = np.sum(motion.path(k, states[followed, k], orbit, spacing) ** 2, axis=1)
        nearest, farthest = np.sqrt(squares.min(axis=0)), np.sqrt(squares.max(axis=0))
        # free motion is no faster than this, and so no nearer between two samples
        way = 0.5 * spacing * 2.5 * motion.fastest * farthest
        is_safe[followed[nearest < least]] = False
        doubtful = followed[(nearest >= least) & (nearest < np.hypot(least, way))]
        if len(doubtful):
            path = motion.path(k, states[doubtful, k], orbit, CLOSE_LOOK_S)
            is_safe[doubtful] = nearest_on(path) >= least
    return is_safe


def nearest_on(path: Floats) -> Floats:
    """Return the least distances of chords of paths, (J, 3, m), from the origin, (m,), m."""
    before, chord = path[:-1], np.diff(path, axis=0)
    square = np.sum(chord * chord, axis=1, keepdims=True)
    share = -np.sum(before * chord, axis=1, keepdims=True) / np.where(square > 0.0, square, 1.0)
    passed = before + np.clip(share, 0.0, 1.0) * chord
    return np.asarray(np.sqrt(np.min(np.sum(passed * passed, axis=1), axis=0)))
