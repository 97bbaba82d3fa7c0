"""What coasting to the end would show (docs/reference/signals.md, what coasting shows)."""

import numpy as np

from tests.readable_flight.camera import seen_points
from tests.readable_flight.light import later, lit_points
from tests.readable_flight.motion import drifted

#: seconds between previewed places
PREVIEW_PERIOD_S = 120.0


def foreseen(flight, k, state, is_inspected):
    """Points missed by coasting, and the least and greatest distance on the way, m."""
    period, last = flight.mission.control_period_s, flight.mission.num_controls
    stride = max(1, round(PREVIEW_PERIOD_S / period))
    is_left = flight.is_counted & ~is_inspected
    distances = [np.linalg.norm(state[:3])]
    for sample in range(last, k, -stride):
        position = drifted(flight.mission, state, (sample - k) * period)[:3]
        distances.append(np.linalg.norm(position))
        if is_left.any():
            sun = later(flight, flight.suns[k], sample - k)
            is_seen = seen_points(flight, sample, position, -position / distances[-1], sun)
            is_left &= ~(is_seen & lit_points(flight, sample, sun))
    return np.array([is_left.sum(), min(distances), max(distances)])
