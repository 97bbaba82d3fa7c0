"""Preview of the readable reference: what a deputy would see by coasting."""

import numpy as np
from numpy.typing import NDArray

from fis_tools.compiled.decorator import compiled
from pipeline.flight.reference.sight import lit_points, seen_points, sun_at
from pipeline.flight.reference.world import PlainWorld, turn_chief
from pipeline.physics.motion import propagate
from pipeline.physics.vectors import norm

Floats = NDArray[np.float64]
Booleans = NDArray[np.bool_]


@compiled
def preview(
    world: PlainWorld,
    state: Floats,
    k: int,
    sun_at_start: Floats,
    quaternion_c_from_h: Floats,
    chief_rate_c: Floats,
    is_inspected: Booleans,
) -> Floats:
    """Follow free motion to the flight's end, looking every `preview_stride` control periods and at the end.

    Parameters
    ----------
    world : PlainWorld
    state : array, shape (6,)
        At sample k, m and m/s, Hill axes.
    k : int
    sun_at_start : array, shape (2,)
        Angle and elevation at k = 0, rad.
    quaternion_c_from_h, chief_rate_c : array, shape (4,), (3,)
        Of the chief at sample k.
    is_inspected : array of bool, shape (P,)
        Inspected by then, or not counted.

    Returns
    -------
    array, shape (3,)
        Number of points left with the camera aimed at the chief's centre, and the least and the greatest
        distance on the way, m.
    """
    is_seen, no_force = is_inspected.copy(), np.zeros(3)
    nearest = norm(state[:3])
    farthest = nearest
    for sample in range(k + 1, world.num_controls + 1):
        state = propagate(world.motion, state, no_force)
        quaternion_c_from_h, chief_rate_c = turn_chief(world, quaternion_c_from_h, chief_rate_c)
        if (world.num_controls - sample) % world.preview_stride != 0:
            continue
        position = state[:3].copy()
        nearest, farthest = min(nearest, norm(position)), max(farthest, norm(position))
        sun_h = sun_at(world, sun_at_start, sample)
        is_sought = lit_points(world, quaternion_c_from_h, sun_h) & ~is_seen
        boresight_h = -position / norm(position)
        is_seen |= seen_points(world, quaternion_c_from_h, position, boresight_h, sun_h, is_sought)
    return np.array([float(len(is_seen) - is_seen.sum()), nearest, farthest])
