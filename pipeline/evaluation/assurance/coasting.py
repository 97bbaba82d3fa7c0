"""Passive safety: how near a deputy comes to the chief if it fires nothing more."""

from math import ceil

import numpy as np

from fis_tools.compiled.decorator import plainly
from pipeline.array_types import Floats
from pipeline.physics.motion import state_transition

#: between the instants of which the nearest is refined, s
SPACING_S = 10.0
#: states followed at a time, so that memory stays small
CHUNK = 2000


def coasting_distance(states: Floats, mean_motion: float, duration: float) -> Floats:
    """Return the least distance of free motion from states, (..., 6), over a duration, s, in m, (...).

    By Clohessy and Wiltshire's equations; around the nearest instant by the second-order series.
    """
    count = ceil(duration / SPACING_S) + 1
    times = np.linspace(0.0, duration, count)
    with plainly("pipeline"):
        transitions = np.array([state_transition(mean_motion, time) for time in times.tolist()])
    rows = np.ascontiguousarray(transitions[:, :3].reshape(-1, 6))
    flat = states.reshape(-1, 6)
    nearest = np.empty(len(flat))
    for first in range(0, len(flat), CHUNK):
        part = flat[first : first + CHUNK]
        paths = (rows @ part.T).reshape(count, 3, len(part))
        index = np.sum(paths * paths, axis=1).argmin(axis=0)
        then = np.einsum("bij,bj->bi", transitions[index], part)
        nearest[first : first + CHUNK] = _refined(then, mean_motion, times[index], duration)
    return nearest.reshape(states.shape[:-1])


def _refined(states: Floats, n: float, times: Floats, duration: float) -> Floats:
    """Return the least distance near states, (b, 6), at times from 0 to a duration, s."""
    position, velocity = states[:, :3], states[:, 3:]
    x, _, z = position.T
    u, v, _ = velocity.T
    pull = np.stack([3.0 * n * n * x + 2.0 * n * v, -2.0 * n * u, -n * n * z], axis=1)
    slope = np.sum(position * velocity, axis=1)
    curve = np.sum(velocity * velocity, axis=1) + np.sum(position * pull, axis=1)
    step = np.where(curve > 0.0, -slope / np.where(curve > 0.0, curve, 1.0), 0.0)
    step = np.clip(step, np.maximum(-SPACING_S, -times), np.minimum(SPACING_S, duration - times))
    ahead = position + step[:, np.newaxis] * (velocity + 0.5 * step[:, np.newaxis] * pull)
    return np.minimum(np.linalg.norm(ahead, axis=1), np.linalg.norm(position, axis=1))
