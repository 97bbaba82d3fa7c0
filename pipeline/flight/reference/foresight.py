"""What coasting to the end would show (docs/reference/signals.md, what coasting shows)."""

import numpy as np

from pipeline.array_types import Booleans, Floats
from pipeline.flight.reference.camera import aimed, seen_points
from pipeline.flight.reference.flight import ReferenceFlight

#: seconds between previewed positions
PREVIEW_PERIOD_S = 120.0


def preview(
    flight: ReferenceFlight, k: int, state: Floats, is_inspected: Booleans
) -> tuple[Booleans, float, float]:
    """Return which points coasting misses, (P,), and the least and greatest distance on the way, m."""
    period, last = flight.mission.control_period_s, flight.mission.num_controls
    stride = max(1, round(PREVIEW_PERIOD_S / period))
    is_left = flight.is_counted & ~is_inspected
    distances = [float(np.linalg.norm(state[:3]))]
    for sample in range(last, k, -stride):
        position = (flight.transition(k, sample) @ state)[:3]
        distances.append(float(np.linalg.norm(position)))
        if is_left.any():
            sun = flight.sun_at(k, sample)
            is_seen = seen_points(flight, sample, position, aimed(flight.mission, position), sun)
            is_left &= ~(is_seen & flight.lit_at(sample, sun))
    return is_left, min(distances), max(distances)


def foreseen(flight: ReferenceFlight, k: int, state: Floats, is_inspected: Booleans) -> Floats:
    """Return the number of points missed by coasting, and the least and greatest distance on the way, m."""
    is_missed, nearest, farthest = preview(flight, k, state, is_inspected)
    return np.array([is_missed.sum(), nearest, farthest])
