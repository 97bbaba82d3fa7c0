"""What a camera that looks at the chief's centre inspects along a path, told without a flight."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fis_tools.engines.compiled import compiled
from pipeline.flight.log import Scenario
from pipeline.flight.world import pack_world
from pipeline.physics.sight import Sight, is_facing, is_in_cone, is_lit
from pipeline.settings.experiment import Mission

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Coverage:
    """The points of a mission and the camera.

    Parameters
    ----------
    points : (K+1 or 1, 3, P)
        m, Hill axes; one sample where the chief does not turn.
    mean_motion, period : float
        rad/s; between two samples, s.
    sight : Sight
    """

    points: Floats
    mean_motion: float
    period: float
    sight: Sight


def coverage_of(mission: Mission) -> Coverage:
    """Return what is to be seen in a mission."""
    world = pack_world(mission)
    return Coverage(
        points=np.ascontiguousarray(world.points[:, :, : world.num_points]),
        mean_motion=world.mean_motion,
        period=world.control_period,
        sight=world.sight,
    )


def count_seen(coverage: Coverage, scenario: Scenario, paths: Floats, stride: int = 1) -> NDArray[np.int64]:
    """Count the points that are lit and in view at some sample of each path.

    Parameters
    ----------
    coverage : Coverage
    scenario : Scenario
        Whose Sun shines.
    paths : (n, samples, 3)
        Positions, m, Hill axes.
    stride : int
        Control periods between two of them.

    Returns
    -------
    (n,) array of int
    """
    times = np.arange(paths.shape[1]) * (stride * coverage.period)
    angles = scenario.sun_angle_rad - coverage.mean_motion * times
    counts = np.zeros(len(paths), dtype=np.int64)
    _count(
        np.ascontiguousarray(paths),
        np.ascontiguousarray(coverage.points[::stride]),
        np.cos(angles),
        np.sin(angles),
        coverage.sight,
        counts,
    )
    return counts


@compiled(nogil=True, error_model="numpy", fastmath={"contract"})
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
                # the boresight is -r, as long as the distance
                squared = (dx * dx + dy * dy + dz * dz) * squared_distance
                is_seen = is_lit(sight, px, py, sun_cos[k], sun_sin[k]) & is_facing(sight, along)
                is_seen &= is_in_cone(sight, squared_distance - along, squared)
                seen[j] = 1.0 if is_seen else seen[j]
        counts[path] = int(np.sum(seen))
