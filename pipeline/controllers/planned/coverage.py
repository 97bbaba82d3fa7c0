"""The points that a camera aimed at the chief's centre inspects along a path, computed without a flight."""

import numpy as np
from numpy.typing import NDArray

from fis_tools.compiled.decorator import compiled
from pipeline.flight.cases.cases import starts_of
from pipeline.flight.fly.workspace import make_workspace, optics_in_use
from pipeline.flight.period.look.optics import note_seen_along
from pipeline.flight.state.arrays import World
from pipeline.flight.state.log import Scenario
from pipeline.physics.sight import Sight, is_facing, is_in_cone, is_lit

Floats = NDArray[np.float64]


def count_seen(world: World, scenario: Scenario, paths: Floats, stride: int = 1) -> NDArray[np.int64]:
    """Return the number of points that are lit and in view at some sample of each path.

    Parameters
    ----------
    world : World
        Of the mission.
    scenario : Scenario
        Gives the Sun's direction.
    paths : (n, samples, 3)
        Positions, m, Hill axes.
    stride : int
        Control periods between two positions.

    Returns
    -------
    (n,) array of int
    """
    starts = starts_of([scenario])
    counts = np.zeros(len(paths), dtype=np.int64)
    optics = optics_in_use(world, starts)
    if optics is not None:
        note_seen_along(
            world, optics, make_workspace(world), starts, np.ascontiguousarray(paths), stride, counts
        )
        return counts
    times = np.arange(paths.shape[1]) * (stride * world.control_period)
    angles = scenario.sun_angle_rad - world.mean_motion * times
    _count(
        np.ascontiguousarray(paths),
        np.ascontiguousarray(world.points[::stride, :, : world.num_points]),
        np.cos(angles),
        np.sin(angles),
        world.sight,
        counts,
    )
    return counts


@compiled(nogil=True, error_model="numpy")
def _count(
    paths: Floats,
    points: Floats,
    sun_cos: Floats,
    sun_sin: Floats,
    sight: Sight,
    counts: NDArray[np.int64],
) -> None:
    num_points = points.shape[2]
    seen = np.zeros(num_points)
    for path in range(len(paths)):
        seen[:] = 0.0
        for k in range(paths.shape[1]):
            x, y, z = paths[path, k, 0], paths[path, k, 1], paths[path, k, 2]
            sample = k if len(points) > 1 else 0
            squared_distance = x * x + y * y + z * z
            for j in range(num_points):
                px, py, pz = points[sample, 0, j], points[sample, 1, j], points[sample, 2, j]
                along = px * x + py * y + pz * z
                dx, dy, dz = px - x, py - y, pz - z
                # the boresight is -r, with the distance as its length
                squared = (dx * dx + dy * dy + dz * dz) * squared_distance
                is_seen = is_lit(sight, px, py, sun_cos[k], sun_sin[k]) & is_facing(sight, along)
                is_seen &= is_in_cone(sight, squared_distance - along, squared)
                seen[j] = 1.0 if is_seen else seen[j]
        counts[path] = int(np.sum(seen))
