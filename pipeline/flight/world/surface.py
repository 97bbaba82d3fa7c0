"""The chief's surface: points spread evenly over it, normals there, and which parts hide one another."""

from functools import lru_cache
from math import cos, floor, pi, sin, sqrt
from typing import NamedTuple

import numpy as np

from pipeline.array_types import Floats
from pipeline.flight.world.mesh import read_mesh, spread_points
from pipeline.physics.occlusion import Occlusion, nothing_hidden, occlusion_of
from pipeline.settings.experiment import Mission, SettingError
from pipeline.settings.mission_parts import Chief


def regular_placement(num_points: int, radius_m: float) -> Floats:
    """Place points on rings of constant latitude at nearly equal distances.

    Deserno's regular placement (M. Deserno, How to generate equidistributed points on the surface of a
    sphere, 2004). It returns about the requested number of points, 99 for 100: ring by ring from +k to -k,
    inside a ring from +i towards +j.
    """
    area = 4.0 * pi / num_points
    num_rings = max(1, floor(pi / sqrt(area) + 0.5))
    azimuth_spacing = area * num_rings / pi
    points = []
    for ring in range(num_rings):
        polar = pi * (ring + 0.5) / num_rings
        num_on_ring = max(1, floor(2.0 * pi * sin(polar) / azimuth_spacing + 0.5))
        for place in range(num_on_ring):
            azimuth = 2.0 * pi * place / num_on_ring
            points.append((sin(polar) * cos(azimuth), sin(polar) * sin(azimuth), cos(polar)))
    return radius_m * np.array(points)


def fibonacci_placement(num_points: int, radius_m: float) -> Floats:
    """Place exactly so many points on a spiral that turns by the golden angle from one to the next.

    They go from +k to -k, the first at azimuth zero (R. Swinbank and R. J. Purser, Quarterly Journal of the
    Royal Meteorological Society 132, 2006).
    """
    place = np.arange(num_points)
    height = 1.0 - (2.0 * place + 1.0) / num_points
    azimuth = place * (pi * (3.0 - sqrt(5.0)))
    across = np.sqrt(1.0 - height * height)
    return radius_m * np.column_stack((across * np.cos(azimuth), across * np.sin(azimuth), height))


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
