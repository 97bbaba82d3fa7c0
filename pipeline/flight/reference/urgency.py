"""Where to look before it is dark for good (docs/reference/signals.md, what goes dark for good)."""

import numpy as np

from pipeline.array_types import Booleans, Floats
from pipeline.flight.reference.flight import ReferenceFlight
from pipeline.flight.reference.guidance import SHORTEST_M


def urgent_direction(flight: ReferenceFlight, k: int, position: Floats, is_wanted: Booleans) -> Floats:
    """Return the unit vector towards wanted points, weighted by how soon each goes dark.

    Near the chief it is turned aside.
    """
    weights = urgency(flight, k) * is_wanted
    mean = weights @ flight.surface_at(k)[0]
    length = np.linalg.norm(mean)
    if not length > SHORTEST_M * weights.sum():
        return np.zeros(3)
    return turned_aside(flight, mean / length, position)


def urgency(flight: ReferenceFlight, k: int) -> Floats:
    """Return the weight of each point that is yet to go dark for good: ``exp(-T/urgency_time_s)``."""
    left = np.maximum(0.0, flight.last_lit - flight.time(k))
    return np.exp(-left / flight.constants["urgency_time_s"])


def turned_aside(flight: ReferenceFlight, direction: Floats, position: Floats) -> Floats:
    """Return ``u + 2 s max(0, -u.r/|r|) r/|r|``, s from 0 at the skirt to 1 at the least distance allowed."""
    skirt, least = flight.constants["skirt_distance_m"], flight.mission.deputy.min_distance_m
    distance = float(np.linalg.norm(position))
    if distance >= skirt or skirt <= least:
        return direction
    outward = position / distance
    nearness = min(1.0, (skirt - distance) / (skirt - least))
    return direction + 2.0 * nearness * max(0.0, -float(direction @ outward)) * outward
