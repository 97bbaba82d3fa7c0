"""The chief's surface: points spread evenly over it, normals there, and which parts hide one another."""

from functools import lru_cache
from math import cos, floor, pi, sin, sqrt
from typing import NamedTuple

import numpy as np

from pipeline.array_types import Floats
from pipeline.physics.sight import Occlusion, occlusion_of
from pipeline.settings.experiment import Mission, SettingError
from pipeline.settings.mesh import outward_of, read_mesh
from pipeline.settings.mission import ChiefSettings

#: candidate places on the faces per point
CHOICES = 50


def spread_points(corners: Floats, num_points: int) -> tuple[Floats, Floats]:
    """Spread points over triangles, evenly by area and on both sides of thin parts.

    Of many places, drawn by a sequence that fills each triangle evenly (M. Roberts' R2), each point is the
    one farthest from those before (T. Gonzalez, Theoretical Computer Science 38, 1985), with opposite faces a
    mean spacing apart. The result is deterministic: points (m) and normals, shape (P, 3), in the order in
    which they were chosen.
    """
    crossed = outward_of(corners)
    areas = 0.5 * np.linalg.norm(crossed, axis=1)
    normals = crossed / (2.0 * areas)[:, np.newaxis]
    count = CHOICES * num_points
    edges = np.cumsum(areas) / areas.sum()
    chosen = np.searchsorted(edges, (np.arange(count) + 0.5) / count)
    chosen = np.minimum(chosen, len(corners) - 1)
    ratio = 1.324717957244746  # the plastic number
    u, v = np.modf(np.arange(1, count + 1) / ratio)[0], np.modf(np.arange(1, count + 1) / ratio**2)[0]
    u, v = np.where(u + v > 1.0, 1.0 - u, u), np.where(u + v > 1.0, 1.0 - v, v)
    triangles = corners[chosen]
    positions = triangles[:, 0] + u[:, np.newaxis] * (triangles[:, 1] - triangles[:, 0])
    positions += v[:, np.newaxis] * (triangles[:, 2] - triangles[:, 0])
    spacing = float(np.sqrt(areas.sum() / num_points))
    apart = np.hstack([positions, 0.5 * spacing * normals[chosen]])
    taken, nearest = [0], np.sum((apart - apart[0]) ** 2, axis=1)
    while len(taken) < num_points:
        taken.append(int(nearest.argmax()))
        nearest = np.minimum(nearest, np.sum((apart - apart[taken[-1]]) ** 2, axis=1))
    return positions[taken], normals[chosen[taken]]


def regular_placement(num_points: int, radius_m: float) -> Floats:
    """Place points on rings of constant latitude at nearly equal distances.

    Deserno's regular placement (M. Deserno, How to generate equidistributed points on the surface of a
    sphere, 2004). It returns about the requested number of points, 99 for 100: ring by ring from +k to -k,
    inside a ring from +i towards +j.
    """
    angles = regular_angles(num_points)
    points = [(sin(polar) * cos(turned), sin(polar) * sin(turned), cos(polar)) for polar, turned in angles]
    return radius_m * np.array(points)


def regular_angles(num_points: int) -> list[tuple[float, float]]:
    """Return the angles of these points from +k, and about it from +i towards +j, rad."""
    area = 4.0 * pi / num_points
    num_rings = max(1, floor(pi / sqrt(area) + 0.5))
    azimuth_spacing = area * num_rings / pi
    angles = []
    for ring in range(num_rings):
        polar = pi * (ring + 0.5) / num_rings
        num_on_ring = max(1, floor(2.0 * pi * sin(polar) / azimuth_spacing + 0.5))
        angles += [(polar, 2.0 * pi * step / num_on_ring) for step in range(num_on_ring)]
    return angles


def fibonacci_placement(num_points: int, radius_m: float) -> Floats:
    """Place exactly this number of points on a spiral that turns by the golden angle from one to the next.

    They go from +j to -j, with a point on either pole, as in AFRL's safe-autonomy-simulation.
    """
    index = np.arange(num_points)
    height = 1.0 - 2.0 * index / max(num_points - 1, 1)
    azimuth = index * (pi * (3.0 - sqrt(5.0)))
    across = np.sqrt(1.0 - height * height)
    return radius_m * np.column_stack((across * np.cos(azimuth), height, across * np.sin(azimuth)))


#: least visibility of an inspectable point: seen from a smaller share of all directions it lies in a crevice
LEAST_FREE = 0.01


class ChiefSurface(NamedTuple):
    """Inspection points, in chief axes, m."""

    points: Floats  # (P, 3)
    normals: Floats  # (P, 3) unit vectors out of the body
    occlusion: Occlusion  # what parts of a mesh hide; empty for a sphere
    corners: Floats  # (T, 3, 3) triangles of a mesh; no rows for a sphere


def surface_of(mission: Mission) -> ChiefSurface:
    """Return the points of a mission's chief.

    Raises
    ------
    SettingError
        If its mesh cannot be read, or extends beyond the deputy's least distance.
    """
    surface = _surface(mission.chief)
    reach = float(np.linalg.norm(surface.corners, axis=2).max()) if len(surface.corners) else 0.0
    if reach > mission.deputy.min_distance_m:
        raise SettingError(
            f"chief.path is a mesh that reaches {reach:.3g} m from its origin, beyond deputy.min_distance_m="
            f"{mission.deputy.min_distance_m:g}; scale it, move it, or raise that distance (m)"
        )
    return surface


@lru_cache(maxsize=4)
def _surface(chief: ChiefSettings) -> ChiefSurface:
    """Return a chief's points and normals: of a mesh, or of a sphere with placed points."""
    if chief.shape == "mesh":
        corners = read_mesh(chief.path)
        points, normals = spread_points(corners, chief.num_points)
        occlusion = occlusion_of(points, normals, corners)
        is_open = occlusion.is_free.mean(axis=0) >= LEAST_FREE
        free = Occlusion(np.ascontiguousarray(occlusion.is_free[:, is_open]), occlusion.edge)
        return ChiefSurface(points[is_open], normals[is_open], free, corners)
    placement = regular_placement if chief.placement == "deserno" else fibonacci_placement
    points = np.asarray(placement(chief.num_points, chief.inspection_radius_m), dtype=np.float64)
    convex = Occlusion(np.zeros((0, 0), dtype=np.uint8), 0)
    return ChiefSurface(points, points / chief.inspection_radius_m, convex, np.zeros((0, 3, 3)))
