"""What AFRL's environments count by: points by a priority, and how near free flight would come."""

from math import ceil, pi

import numpy as np

from pipeline.array_types import Floats
from pipeline.physics.motion import Deputy, Orbit, free_path, motion_over


def priority_weights(points: Floats, priority: Floats) -> Floats:
    """Return what points count, shape (P,), one in all: as their angle from the opposite of a direction."""
    cosines = points @ -priority / (np.linalg.norm(points, axis=1) * np.linalg.norm(priority))
    angles = np.arccos(np.clip(cosines, -1.0, 1.0))
    return np.asarray(angles / angles.sum())


def nearest_in_orbit(orbit: Orbit, deputy: Deputy, state: Floats) -> float:
    """Return the least distance of free motion from a state, (6,), sampled each second of an orbit, m."""
    num_seconds = ceil(2.0 * pi / orbit.mean_motion_rad_s)
    path = free_path(motion_over(orbit, deputy, (1.0,)), state, num_seconds)
    return float(np.linalg.norm(path[:, :3], axis=1).min())
