"""What follows a flight, and what a failure of all thrusters within it would lead to, if nothing is fired.

Motion is that of `pipeline.flight.world.coasting`.
"""

from collections.abc import Sequence
from itertools import combinations
from math import pi
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipeline.array_types import Booleans, Floats
from pipeline.flight.cases.processes import drifts_of
from pipeline.flight.state.log import Scenario
from pipeline.flight.world.coasting import FreeMotion
from pipeline.settings.experiment import Mission

#: how long a flight that stays does so, in orbits
ORBITS: Final = (1, 3)
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


def aftermath(
    mission: Mission, tracks: NDArray[Any], workers: int = 1, scenarios: Sequence[Scenario] = ()
) -> Aftermath | None:
    """Return what follows flights from their tracks, (n, K+1, 6 or more): position, m, and velocity, m/s.

    Tracks of fleets, (n, D, K+1, 6 or more), tell it of each deputy: arrays of shape (n, D).
    None where an orbit is so long, and control periods so short, that there would be too many samples.

    Parameters
    ----------
    mission : Mission
    tracks : array
    workers : int
        Threads.
    scenarios : sequence of Scenario
        Of the flights: drag that varies within them goes on after their end as it was drawn for each. Without
        any it is constant.
    """
    orbit = _orbit_s(mission)
    if orbit is None:
        return None
    if tracks.ndim == 4:
        each = aftermath(mission.of_each, tracks.reshape(-1, *tracks.shape[2:]), workers)
        return None if each is None else Aftermath(*(so.reshape(tracks.shape[:2]) for so in each))
    motion, parts = FreeMotion(mission, ORBITS[-1] * orbit), list[Aftermath]()
    for first in range(0, len(tracks), CHUNK):
        states = np.asarray(tracks[first : first + CHUNK, :, :6], dtype=np.float64)
        low, high = mission.deputy.min_distance_m, mission.deputy.max_distance_m
        drifts = drifts_of(motion, mission, scenarios[first : first + CHUNK], ORBITS[-1] * orbit)
        ends = [
            motion.distances(states[:, -1:], count * orbit, workers, mission.num_controls, drifts=drifts)
            for count in ORBITS
        ]
        stay = [(nearest[:, 0] >= low) & (farthest[:, 0] <= high) for nearest, farthest in ends]
        nearest, _ = motion.distances(states, orbit, workers, drifts=drifts)
        is_safe = np.asarray(np.min(nearest[:, 1:], axis=1) >= low)
        parts.append(Aftermath(stay[0], stay[1], is_safe))
    return joined(parts)


def _orbit_s(mission: Mission) -> float | None:
    """Return the time of an orbit, s; None where it has too many samples."""
    orbit = 2.0 * pi / mission.orbit.mean_motion_rad_s
    return orbit if ORBITS[-1] * orbit / mission.control_period_s <= MOST_SAMPLES else None


def coasting_pairs(mission: Mission, tracks: NDArray[Any], workers: int = 1) -> Floats:
    """Return how near two deputies would come within an orbit if all thrusters failed, (n,), m.

    At any sample after the start, which is not the controllers', and all at the same. `tracks` are those of n
    fleets, (n, D, K+1, 6 or more). NaN where an orbit has too many samples.
    """
    orbit, nearest = _orbit_s(mission), np.full(len(tracks), np.inf)
    if orbit is None:
        return np.full(len(tracks), np.nan)
    motion = FreeMotion(mission, ORBITS[-1] * orbit)
    for first in range(0, len(tracks), CHUNK):
        part = slice(first, first + CHUNK)
        for pair in combinations(range(tracks.shape[1]), 2):
            states = tracks[part, list(pair), :, :6].astype(np.float64)
            between, _ = motion.distances(states[:, 0] - states[:, 1], orbit, workers, is_relative=True)
            nearest[part] = np.minimum(nearest[part], between[:, 1:].min(axis=1))
    return nearest


def joined(parts: Sequence[Aftermath | None]) -> Aftermath | None:
    """Return what follows the flights of several parts, in order; None if that of one is unknown."""
    known = [part for part in parts if part is not None]
    if len(known) < len(parts):
        return None
    return Aftermath(*(np.concatenate(columns) for columns in zip(*known, strict=True)))
