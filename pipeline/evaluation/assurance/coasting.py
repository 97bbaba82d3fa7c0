"""What follows if a deputy fires nothing more: how near it comes to the chief, and how far it goes."""

from math import ceil

import numpy as np

from fis_tools.compiled.decorator import plainly
from pipeline.array_types import Floats
from pipeline.physics.motion import state_transition

#: between the instants of which the nearest and the farthest are refined, s
SPACING_S = 10.0
#: states followed at a time, so that memory stays small
CHUNK = 2000


def coasting_distances(states: Floats, mean_motion: float, duration: float) -> tuple[Floats, Floats]:
    """Return the least and the greatest distance of free motion from states over a duration.

    By Clohessy and Wiltshire's equations; around the nearest and the farthest instant by the second-order
    series.

    Parameters
    ----------
    states : (..., 6) array
        Position, m, and velocity, m/s, Hill axes.
    mean_motion : float
        rad/s.
    duration : float
        s.

    Returns
    -------
    nearest, farthest : (...) arrays
        m.
    """
    count = ceil(duration / SPACING_S) + 1
    times = np.linspace(0.0, duration, count)
    with plainly("pipeline"):
        transitions = np.array([state_transition(mean_motion, time) for time in times.tolist()])
    rows = np.ascontiguousarray(transitions[:, :3].reshape(-1, 6))
    flat = states.reshape(-1, 6)
    ends = np.empty((2, len(flat)))
    for first in range(0, len(flat), CHUNK):
        part = flat[first : first + CHUNK]
        paths = (rows @ part.T).reshape(count, 3, len(part))
        squares = np.sum(paths * paths, axis=1)
        for end, index in enumerate((squares.argmin(axis=0), squares.argmax(axis=0))):
            then = np.einsum("bij,bj->bi", transitions[index], part)
            sign = 1.0 if end == 0 else -1.0
            ends[end, first : first + CHUNK] = _refined(then, mean_motion, times[index], duration, sign)
    nearest, farthest = ends.reshape(2, *states.shape[:-1])
    return nearest, farthest


def _refined(states: Floats, n: float, times: Floats, duration: float, sign: float) -> Floats:
    """Return the least (sign 1) or greatest (-1) distance near states, (b, 6), at times up to a duration."""
    position, velocity = states[:, :3], states[:, 3:]
    x, _, z = position.T
    u, v, _ = velocity.T
    pull = np.stack([3.0 * n * n * x + 2.0 * n * v, -2.0 * n * u, -n * n * z], axis=1)
    slope = np.sum(position * velocity, axis=1)
    curve = np.sum(velocity * velocity, axis=1) + np.sum(position * pull, axis=1)
    bends = sign * curve > 0.0
    step = np.where(bends, -slope / np.where(bends, curve, 1.0), 0.0)
    step = np.clip(step, np.maximum(-SPACING_S, -times), np.minimum(SPACING_S, duration - times))
    ahead = position + step[:, np.newaxis] * (velocity + 0.5 * step[:, np.newaxis] * pull)
    best = np.minimum if sign > 0.0 else np.maximum
    return np.asarray(best(np.linalg.norm(ahead, axis=1), np.linalg.norm(position, axis=1)))
