"""What a camera that looks at the chief's centre inspects along a path, told without a flight."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fis_tools.engines.compiled import compiled
from pipeline.flight.log import Scenario
from pipeline.flight.world import pack_world
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
    sun_threshold, horizon, cos_half_angle_squared : float
        As in `pipeline.flight.kernel.arrays.World`.
    """

    points: Floats
    mean_motion: float
    period: float
    sun_threshold: float
    horizon: float
    cos_half_angle_squared: float


def coverage_of(mission: Mission) -> Coverage:
    """Return what is to be seen in a mission."""
    world = pack_world(mission)
    return Coverage(
        points=np.ascontiguousarray(world.points[:, :, : world.num_points]),
        mean_motion=world.mean_motion,
        period=world.control_period,
        sun_threshold=world.sun_threshold,
        horizon=world.horizon,
        cos_half_angle_squared=world.cos_half_angle_squared,
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
        coverage.sun_threshold,
        coverage.horizon,
        coverage.cos_half_angle_squared,
        counts,
    )
    return counts


@compiled(nogil=True, error_model="numpy", fastmath={"contract"})
def _count(
    paths: Floats,
    points: Floats,
    sun_cos: Floats,
    sun_sin: Floats,
    sun_threshold: float,
    horizon: float,
    cos2: float,
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
                above = px * x + py * y + pz * z
                dx, dy, dz = px - x, py - y, pz - z
                # (p - r) . (-r) >= cos |p - r| |r|, both sides squared
                inward = squared_distance - above
                in_cone = inward * inward >= cos2 * (dx * dx + dy * dy + dz * dz) * squared_distance
                lit = px * sun_cos[k] + py * sun_sin[k] > sun_threshold
                seen[j] = 1.0 if lit & in_cone & (inward > 0.0) & (above >= horizon) else seen[j]
        counts[path] = int(np.sum(seen))
