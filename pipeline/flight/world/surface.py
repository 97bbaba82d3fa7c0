"""The chief's surface: its points, its normals there, and which of its parts hide one another."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from pipeline.array_types import Floats
from pipeline.flight.world.mesh import read_mesh, spread_points
from pipeline.physics.inspection_points import fibonacci_placement, regular_placement
from pipeline.physics.occlusion import Occlusion, nothing_hidden, occlusion_of
from pipeline.settings.experiment import Chief, Mission, SettingError

#: least visibility of an inspectable point: seen from a smaller share of all directions it lies in a crevice
LEAST_FREE = 0.01


class Surface(NamedTuple):
    """Inspection points, in chief axes, m."""

    points: Floats  # (P, 3)
    normals: Floats  # (P, 3) unit vectors out of the body
    occlusion: Occlusion  # what parts of a mesh hide; empty for a sphere
    corners: Floats  # (T, 3, 3) triangles of a mesh; no rows for a sphere


def surface_of(mission: Mission) -> Surface:
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
def _surface(chief: Chief) -> Surface:
    if chief.shape == "mesh":
        corners = read_mesh(chief.path)
        points, normals = spread_points(corners, chief.num_points)
        occlusion = occlusion_of(points, normals, corners)
        is_open = occlusion.is_free.mean(axis=0) >= LEAST_FREE
        free = Occlusion(np.ascontiguousarray(occlusion.is_free[:, is_open]), occlusion.edge)
        return Surface(points[is_open], normals[is_open], free, corners)
    place = regular_placement if chief.placement == "deserno" else fibonacci_placement
    points = np.asarray(place(chief.num_points, chief.inspection_radius_m), dtype=np.float64)
    return Surface(points, points / chief.inspection_radius_m, nothing_hidden(), np.zeros((0, 3, 3)))
