"""What is lit and what is seen where light or camera are not the paper's: shadow, incidence, range, a mesh.

Where they are the paper's, `pipeline.physics.sight` says it in a line, and nothing of this is compiled.
Written out plainly in `pipeline.flight.reference.sight`.
"""

from math import cos, sin, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fis_tools.engines.compiled import compiled
from fis_tools.engines.vectors import Mask, Vector, borrowed, count, load, select, some, splat, store
from pipeline.flight.kernel.arrays import POINTS, Workspace, World
from pipeline.physics.occlusion import cell_of
from pipeline.physics.sight import HEIGHT, NORMAL, SQUARE, is_lit, is_resolved, is_sunlit, sunlight

Floats = NDArray[np.float64]

#: spacings of samples at which points not yet found lit are looked for: coarse first, for most are soon found
SPACINGS = (32, 8, 1)


@compiled(error_model="numpy", forceinline=True, fastmath={"contract"})
def sun_after(world: World, start_x: float, start_y: float, k: int) -> tuple[float, float]:
    """Return cosine and sine of the Sun's angle at a sample from those at the start."""
    turned = world.mean_motion * world.control_period * k
    turned_x, turned_y = cos(turned), sin(turned)
    return start_x * turned_x + start_y * turned_y, start_y * turned_x - start_x * turned_y


@compiled(error_model="numpy", forceinline=True, fastmath={"contract"})
def light_at(
    world: World, work: Workspace, lane: int, sun_x: float, sun_y: float
) -> tuple[float, float, float]:
    """Return the direction to a lane's Sun from that of its angle in the plane; zeros in shadow."""
    lanes = work.lanes
    return sunlight(world.optics, sun_x, sun_y, lanes.sun_height[0, lane], lanes.sun_height[1, lane])


@compiled(error_model="numpy", fastmath={"contract"})
def note_lit(world: World, work: Workspace, k: int, wanted: Floats, lx: float, ly: float, lz: float) -> bool:
    """Mark in `work.lit` which wanted points are lit at a sample; tell whether any is.

    The light comes from the direction (lx, ly, lz), zeros in shadow.
    """
    surface, occlusion = world.optics.surface, world.optics.occlusion
    sample, has_some = (k if len(surface) > 1 else 0), False
    # what lies beyond its own tangent plane, as in a dish, is not lit by no light either
    shines = lx * lx + ly * ly + lz * lz
    for j in range(0, len(wanted), POINTS):
        lit = load(wanted, j, POINTS) * shines > 0.0
        along = lx * load(surface, (sample, NORMAL, j), POINTS)
        along += ly * load(surface, (sample, NORMAL + 1, j), POINTS)
        along += lz * load(surface, (sample, NORMAL + 2, j), POINTS)
        lit &= is_sunlit(along, load(surface, (sample, HEIGHT, j), POINTS))
        store(work.lit, j, select(lit, 1.0, 0.0))
        has_some |= some(lit)
    if has_some and occlusion.edge > 0:
        axes = world.optics.chief_axes[sample]
        cell = cell_of(
            occlusion.edge,
            axes[0, 0] * lx + axes[0, 1] * ly + axes[0, 2] * lz,
            axes[1, 0] * lx + axes[1, 1] * ly + axes[1, 2] * lz,
            axes[2, 0] * lx + axes[2, 1] * ly + axes[2, 2] * lz,
        )
        for j in range(world.num_points):
            work.lit[j] *= occlusion.is_free[cell, j]
    return has_some


@compiled(error_model="numpy", fastmath={"contract"})
def note_seen(
    world: World,
    work: Workspace,
    k: int,
    rx: float,
    ry: float,
    rz: float,
    bx: float,
    by: float,
    bz: float,
    lx: float,
    ly: float,
    lz: float,
) -> None:
    """Mark in `work.seen` which points of `work.lit` a camera at r sees that looks along b, a unit vector."""
    optics, points = world.optics, world.points
    surface, occlusion = optics.surface, optics.occlusion
    sample = k if len(surface) > 1 else 0
    squared_range, along_boresight = rx * rx + ry * ry + rz * rz, rx * bx + ry * by + rz * bz
    is_blind = bx * lx + by * ly + bz * lz > optics.most_sunward
    for j in range(0, len(work.lit), POINTS):
        lit = load(work.lit, j, POINTS) > 0.0
        if is_blind or not some(lit):
            store(work.seen, j, splat(0.0, POINTS))
            continue
        px, py = load(points, (sample, 0, j), POINTS), load(points, (sample, 1, j), POINTS)
        pz = load(points, (sample, 2, j), POINTS)
        above = rx * load(surface, (sample, NORMAL, j), POINTS)
        above += ry * load(surface, (sample, NORMAL + 1, j), POINTS)
        above += rz * load(surface, (sample, NORMAL + 2, j), POINTS)
        above -= load(surface, (sample, HEIGHT, j), POINTS)
        towards = (px * bx + py * by + pz * bz) - along_boresight
        squared = load(surface, (sample, SQUARE, j), POINTS) + squared_range
        squared -= 2.0 * (px * rx + py * ry + pz * rz)
        seen = lit & is_resolved(optics, above, towards, squared)
        store(work.seen, j, select(seen, 1.0, 0.0))
    if occlusion.edge > 0:
        axes = optics.chief_axes[sample]
        for j in range(world.num_points):
            if work.seen[j] > 0.0:
                x, y, z = rx - points[sample, 0, j], ry - points[sample, 1, j], rz - points[sample, 2, j]
                cell = cell_of(
                    occlusion.edge,
                    axes[0, 0] * x + axes[0, 1] * y + axes[0, 2] * z,
                    axes[1, 0] * x + axes[1, 1] * y + axes[1, 2] * z,
                    axes[2, 0] * x + axes[2, 1] * y + axes[2, 2] * z,
                )
                work.seen[j] = occlusion.is_free[cell, j]


@compiled(error_model="numpy", forceinline=True, fastmath={"contract"})
def note_seen_from(
    world: World, work: Workspace, k: int, rx: float, ry: float, rz: float, lx: float, ly: float, lz: float
) -> int:
    """Strike out of `work.ahead` what of `work.lit` a camera at r on the chief's centre sees; count it."""
    per_distance = -1.0 / sqrt(rx * rx + ry * ry + rz * rz)
    bx, by, bz = rx * per_distance, ry * per_distance, rz * per_distance
    note_seen(world, work, k, rx, ry, rz, bx, by, bz, lx, ly, lz)
    num_seen = 0
    for j in range(0, len(work.ahead), POINTS):
        seen = load(work.seen, j, POINTS) > 0.0
        store(work.ahead, j, select(seen, 0.0, load(work.ahead, j, POINTS)))
        num_seen += count(seen)
    return num_seen


@compiled(error_model="numpy", forceinline=True, fastmath={"contract"})
def lit_points(
    world: World,
    optics: bool | None,
    work: Workspace,
    j: int,
    px: Vector,
    py: Vector,
    sun_x: float,
    sun_y: float,
) -> Mask:
    """Tell which of the points from j on are lit; by `note_lit` where light or camera are not the paper's."""
    if optics is None:
        return is_lit(world.sight, px, py, sun_x, sun_y)
    return load(work.lit, j, POINTS) > 0.0


@compiled(nogil=True, error_model="numpy", fastmath={"contract"})
def note_inspectable(
    world: World, optics: bool | None, work: Workspace, cases: Any, found: NDArray[np.uint8]
) -> None:
    """Write which points are lit at some sample of each case's flight, shape (m, P padded) of 0 or 1."""
    world, work, cases, found = borrowed((world, work, cases, found))
    ahead, points, num_samples = work.ahead, world.points, world.num_controls + 1
    for row in range(len(cases)):
        case, num_left = cases[row], world.num_points
        start_x, start_y = cos(case.sun_angle), sin(case.sun_angle)
        high, low = cos(case.sun_elevation), sin(case.sun_elevation)
        found[row] = 0
        for j in range(len(ahead)):
            ahead[j] = 1.0 if j < world.num_points else 0.0
        for spacing in SPACINGS:
            for k in range(0, num_samples if num_left > 0 else 0, spacing):
                turned = world.mean_motion * world.control_period * k
                turned_x, turned_y = cos(turned), sin(turned)
                sun_x, sun_y = (
                    start_x * turned_x + start_y * turned_y,
                    start_y * turned_x - start_x * turned_y,
                )
                sample = k if len(points) > 1 else 0
                if optics is not None:
                    lx, ly, lz = sunlight(world.optics, sun_x, sun_y, high, low)
                    note_lit(world, work, k, ahead, lx, ly, lz)
                num_left = 0
                for j in range(0, len(ahead), POINTS):
                    missing = load(ahead, j, POINTS) > 0.0
                    px, py = load(points, (sample, 0, j), POINTS), load(points, (sample, 1, j), POINTS)
                    lit = missing & lit_points(world, optics, work, j, px, py, sun_x, sun_y)
                    left = missing ^ lit
                    store(ahead, j, select(left, 1.0, 0.0))
                    num_left += 1 if some(left) else 0
                if num_left == 0:
                    break
        for j in range(world.num_points):
            found[row, j] = 1 if ahead[j] == 0.0 else 0


@compiled(nogil=True, error_model="numpy", fastmath={"contract"})
def note_lit_at_samples(
    world: World, optics: bool | None, work: Workspace, cases: Any, found: NDArray[np.uint8]
) -> None:
    """Write which points are lit at each sample of the first case's flight, shape (K+1, P padded), 0 or 1."""
    case, points = cases[0], world.points
    start_x, start_y = cos(case.sun_angle), sin(case.sun_angle)
    high, low = cos(case.sun_elevation), sin(case.sun_elevation)
    for j in range(len(work.ahead)):
        work.ahead[j] = 1.0 if j < world.num_points else 0.0
    for k in range(len(found)):
        sun_x, sun_y = sun_after(world, start_x, start_y, k)
        sample = k if len(points) > 1 else 0
        if optics is not None:
            lx, ly, lz = sunlight(world.optics, sun_x, sun_y, high, low)
            note_lit(world, work, k, work.ahead, lx, ly, lz)
        for j in range(world.num_points):
            if optics is None:
                found[k, j] = is_lit(world.sight, points[sample, 0, j], points[sample, 1, j], sun_x, sun_y)
            else:
                found[k, j] = work.lit[j] > 0.0


@compiled(nogil=True, error_model="numpy", fastmath={"contract"})
def note_seen_along(
    world: World, work: Workspace, cases: Any, paths: Floats, stride: int, counts: NDArray[np.int64]
) -> None:
    """Write how many points a camera on the chief's centre inspects along each path, (n, samples, 3), m.

    Places are `stride` control periods apart, from the first case's start on.
    """
    case, ahead = cases[0], work.ahead
    start_x, start_y = cos(case.sun_angle), sin(case.sun_angle)
    high, low = cos(case.sun_elevation), sin(case.sun_elevation)
    for path in range(len(paths)):
        for j in range(len(ahead)):
            ahead[j] = 1.0 if j < world.num_points else 0.0
        for place in range(paths.shape[1]):
            sun_x, sun_y = sun_after(world, start_x, start_y, place * stride)
            lx, ly, lz = sunlight(world.optics, sun_x, sun_y, high, low)
            if note_lit(world, work, place * stride, ahead, lx, ly, lz):
                rx, ry, rz = paths[path, place, 0], paths[path, place, 1], paths[path, place, 2]
                counts[path] += note_seen_from(world, work, place * stride, rx, ry, rz, lx, ly, lz)
