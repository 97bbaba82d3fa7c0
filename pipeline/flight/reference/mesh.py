"""Parts of a chief that hide others (docs/explanation/motion.md, a chief of real shape).

Directions fall into cells of a cube about the body, 32 x 32 of equal angles a face; a cell's answer is that
of the ray from the point through the cell's middle.
"""

import numpy as np

from pipeline.array_types import Floats

#: cells along an edge of the cube
EDGE = 32
#: a ray begins this share of the body's size above its face
LIFT = 1e-6
#: a cell: the axis of its face, whether that is the positive one, row and column
Cell = tuple[int, bool, int, int]


class Mesh:
    """A body's triangles, (T, 3, 3), and what is known of rays from its points; chief axes, m."""

    def __init__(self, points: Floats, normals: Floats, corners: Floats) -> None:
        self.origins = points + LIFT * np.linalg.norm(corners, axis=2).max() * normals
        self.normals, self.first = normals, corners[:, 0]
        self.edge, self.other_edge = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        self.known: dict[tuple[int, Cell], bool] = {}

    def is_free(self, point: int, direction: Floats) -> bool:
        """Return whether no part hides a point in a direction, chief axes."""
        ray = point, cell_of(direction)
        if ray not in self.known:
            self.known[ray] = self._is_free(point, middle_of(ray[1]))
        return self.known[ray]

    def _is_free(self, point: int, ray: Floats) -> bool:
        """Return whether a ray meets no triangle: Moller and Trumbore, Ray-triangle intersection, 1997."""
        if self.normals[point] @ ray <= 0.0:
            return False
        across = np.cross(ray, self.other_edge)
        volume = np.sum(self.edge * across, axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            from_first = self.origins[point] - self.first
            u = np.sum(from_first * across, axis=1) / volume
            turned = np.cross(from_first, self.edge)
            v, distance = turned @ ray / volume, np.sum(self.other_edge * turned, axis=1) / volume
            meets = (volume != 0.0) & (u >= 0.0) & (v >= 0.0) & (u <= 1.0) & (u + v <= 1.0) & (distance > 0.0)
        return not meets.any()


def cell_of(direction: Floats) -> Cell:
    """Return the cell that a direction points to."""
    axis = int(np.argmax(np.abs(direction)))
    across = np.roll(direction, -axis)[1:] / abs(direction[axis])
    row, column = np.minimum(EDGE - 1, (np.arctan(across) * 4.0 / np.pi + 1.0) * 0.5 * EDGE).astype(int)
    return axis, bool(direction[axis] > 0.0), int(row), int(column)


def middle_of(cell: Cell) -> Floats:
    """Return the direction through the middle of a cell."""
    axis, is_positive, row, column = cell
    u, v = np.tan((2.0 * np.array([row, column]) + 1.0 - EDGE) / EDGE * 0.25 * np.pi)
    direction = np.roll([1.0 if is_positive else -1.0, u, v], axis)
    return np.asarray(direction / np.linalg.norm(direction), dtype=np.float64)
