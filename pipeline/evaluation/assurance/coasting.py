"""What follows if a deputy fires nothing more: how near it comes to the chief, and how far it goes."""

from math import ceil

import numpy as np

from fis_tools.compiled.decorator import plainly
from pipeline.array_types import Floats
from pipeline.flight.world.coasting import FreeMotion
from pipeline.physics.motion import state_transition
from pipeline.settings.experiment import Mission
from pipeline.settings.mission import TwoBody

#: between the instants of which the nearest and the farthest are refined, s
SPACING_S = 10.0
#: states followed at a time, so that memory stays small
CHUNK = 2000


def coasting_distances(mission: Mission, states: Floats, duration: float) -> tuple[Floats, Floats]:
    """Return the least and the greatest distance of free motion from the states of flights over a duration.

    Motion is that of `pipeline.flight.world.coasting`: about the Earth along the chief's orbit, which is
    followed for whole control periods.

    Parameters
    ----------
    mission : Mission
    states : (n, K+1, 6) array
        Position, m, and velocity, m/s, Hill axes, at each sample.
    duration : float
        s.

    Returns
    -------
    nearest, farthest : (n, K+1) arrays
        m.
    """
    if not isinstance(mission.dynamics, TwoBody):
        return by_mean_motion(states, mission.orbit.mean_motion_rad_s, duration)
    motion, ends = FreeMotion(mission, duration), np.empty((2, *states.shape[:-1]))
    for k in range(states.shape[1]):
        for first in range(0, len(states), CHUNK):
            path = motion.path(k, states[first : first + CHUNK, k], duration, SPACING_S)
            squares = np.sum(path * path, axis=1)
            ends[0, first : first + CHUNK, k] = least_of(squares)
            ends[1, first : first + CHUNK, k] = -least_of(-squares)
    nearest, farthest = np.sqrt(ends.clip(0.0))
    return nearest, farthest


def least_of(samples: Floats) -> Floats:
    """Return the least of functions, (m,), from evenly spaced samples, (J, m): by the parabola through three.

    The last sample may be nearer to the one before.
    """
    index = samples.argmin(axis=0)
    lowest = np.take_along_axis(samples, index[np.newaxis], axis=0)[0]
    if len(samples) < 4:
        return np.asarray(lowest)
    middle = index.clip(1, len(samples) - 3)
    before, now, after = (
        np.take_along_axis(samples, (middle + step)[np.newaxis], axis=0)[0] for step in (-1, 0, 1)
    )
    slope, bend = 0.5 * (after - before), after - 2.0 * now + before
    is_valley = (bend > 0.0) & (index < len(samples) - 1)
    step = np.where(is_valley, -slope / np.where(is_valley, bend, 1.0), 0.0).clip(-1.0, 1.0)
    return np.minimum(lowest, now + step * (slope + 0.5 * step * bend))


def by_mean_motion(states: Floats, mean_motion: float, duration: float) -> tuple[Floats, Floats]:
    """Return the least and the greatest distance of a circle's free motion from states over a duration.

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
