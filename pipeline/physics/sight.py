"""Whether points of the chief are lit, in view, and not hidden by its parts.

The conditions are the paper's (Choi, Kim and Leeghim, AAS 25-727), without square roots, for floats or for
vectors of points.
"""

from math import atan, pi, sqrt, tan
from typing import NamedTuple

import numpy as np

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.elementary import whole_within
from fis_tools.compiled.three import Three, cross, dot, three_of
from fis_tools.compiled.vectors import Mask, Vector, most
from pipeline.array_types import Bytes, Floats
from pipeline.constants import ASTRONOMICAL_UNIT_M

#: cells along an edge of the cube
EDGE_CELLS = 32
#: height above its own face at which a ray begins, as a share of the body's size
LIFT = 1e-6


class Occlusion(NamedTuple):
    """The directions from which points of a body are visible, past its other parts.

    From a point on the body a ray to a far place passes the same parts as to infinity if the place lies
    beyond all of them, so that only the direction matters. Directions are sorted into the cells of a cube
    about the body, each face of it divided into squares of equal angles; a cell has the result of its
    centre, which is off by at most half its diagonal: 2.1 deg with 32 cells along an edge. Rays are
    intersected with triangles as by T. Moller and B. Trumbore (Fast, minimum storage ray-triangle
    intersection, Journal of Graphics Tools 2, 1997).
    """

    is_free: Bytes  # (6 n^2, P) of 0 or 1, one row per cell; no rows if nothing is hidden
    edge: int  # cells along an edge of the cube, n


@compiled(error_model="numpy", forceinline=True)
def _square_of(edge: int, slope: float) -> int:
    """Return the square along an edge, 0 to n - 1, of a slope from -1 to 1, whatever rounding does."""
    return whole_within((atan(slope) * (4.0 / pi) + 1.0) * 0.5 * edge, edge - 1)


@compiled(error_model="numpy")
def cell_of(edge: int, direction: Three) -> int:
    """Return the cell that a direction of any length falls into, for `edge` cells along an edge."""
    x, y, z = direction
    ax, ay, az = abs(x), abs(y), abs(z)
    if ax >= ay and ax >= az:
        face, most, u, v = 0 if x > 0.0 else 1, ax, y, z
    elif ay >= az:
        face, most, u, v = 2 if y > 0.0 else 3, ay, z, x
    else:
        face, most, u, v = 4 if z > 0.0 else 5, az, x, y
    if most == 0.0:
        return 0
    return (face * edge + _square_of(edge, u / most)) * edge + _square_of(edge, v / most)


@compiled
def centre_of(edge: int, cell: int) -> Three:
    """Return the direction, a unit vector, of the centre of a cell."""
    face, rest = cell // (edge * edge), cell % (edge * edge)
    u = tan((2.0 * (rest // edge) + 1.0 - edge) / edge * 0.25 * pi)
    v = tan((2.0 * (rest % edge) + 1.0 - edge) / edge * 0.25 * pi)
    sign = 1.0 if face % 2 == 0 else -1.0
    size, axis = sqrt(1.0 + u * u + v * v), face // 2
    x, y, z = sign / size, u / size, v / size
    if axis == 1:
        x, y, z = z, x, y
    elif axis == 2:
        x, y, z = y, z, x
    return Three(x, y, z)


@compiled(error_model="numpy", forceinline=True)
def is_free(occlusion: Occlusion, cell: int, point: int) -> int:
    """Return 1 where a point is visible from the directions of a cell, else 0."""
    return occlusion.is_free[cell, point]


@compiled(error_model="numpy")
def is_above_horizon(normals: Floats, edge: int, cell: int, point: int) -> bool:
    """Return whether the centre of a cell is above the horizon of a point; on a convex body that is all."""
    return dot(three_of(normals[point]), centre_of(edge, cell)) > 0.0


@compiled(error_model="numpy")
def meets(triangle: Floats, origin: Three, direction: Three) -> bool:
    """Return whether a ray meets a triangle, given by a corner and two edges, shape (3, 3)."""
    first, second = three_of(triangle[1]), three_of(triangle[2])
    p = cross(direction, second)
    volume = dot(first, p)
    if volume == 0.0:
        return False
    s = origin - three_of(triangle[0])
    q = cross(s, first)
    u, v = dot(s, p) / volume, dot(direction, q) / volume
    return bool(0.0 <= u <= 1.0 and v >= 0.0 and u + v <= 1.0 and dot(second, q) / volume > 0.0)


@compiled(nogil=True)
def note_free(
    points: Floats, normals: Floats, triangles: Floats, lift: float, edge: int, is_free: Bytes
) -> None:
    """Write which points each cell's direction sees; `triangles` as in `meets`, shape (T, 3, 3)."""
    for cell in range(len(is_free)):
        direction = centre_of(edge, cell)
        for point in range(len(points)):
            normal = three_of(normals[point])
            origin = three_of(points[point]) + lift * normal
            is_seen = dot(normal, direction) > 0.0
            for triangle in range(len(triangles)):
                if not is_seen or meets(triangles[triangle], origin, direction):
                    is_seen = False
                    break
            is_free[cell, point] = is_seen


def occlusion_of(points: Floats, normals: Floats, corners: Floats) -> Occlusion:
    """Return the occlusion of a body, from every point in every direction, chief axes, m.

    Points and normals, unit vectors out of the body, have the shape (P, 3), the corners of its triangles (T,
    3, 3).
    """
    is_free = np.zeros((6 * EDGE_CELLS**2, len(points)), dtype=np.uint8)
    first, second, third = corners[:, 0], corners[:, 1], corners[:, 2]
    triangles = np.stack([first, second - first, third - first], axis=1)
    lift = LIFT * float(np.linalg.norm(corners, axis=2).max())
    note_free(points, normals, np.ascontiguousarray(triangles), lift, EDGE_CELLS, is_free)
    return Occlusion(is_free, EDGE_CELLS)


#: rows of data on the surface at points: the unit normal out of it, ``n . p``, ``|p|^2``
NORMAL, HEIGHT, SQUARE, NUM_SURFACE = 0, 3, 4, 5


class Sight(NamedTuple):
    """The parameters that decide whether a point of the chief is lit and in view."""

    sun_threshold: float  # a point is lit where ``p . s`` exceeds it, m
    horizon: float  # square of the radius of the sphere of points, m^2
    cos_squared: float  # of the field of view's half angle, which is below 90 deg


def sight_of(radius: float, half_angle: float) -> Sight:
    """Return the sight of a camera with a half angle in rad, of points on a sphere with a radius in m."""
    return Sight(radius * radius / ASTRONOMICAL_UNIT_M, radius * radius, float(np.cos(half_angle) ** 2))


@compiled(inline="always")
def is_lit(sight: Sight, px: Vector, py: Vector, sun_x: float, sun_y: float) -> Mask:
    """Return which points sunlight reaches; the Sun's direction lies in Hill's i-j plane."""
    return px * sun_x + py * sun_y > sight.sun_threshold


@compiled(inline="always")
def is_facing(sight: Sight, along: Vector) -> Mask:
    """Return which points are above the horizon of a place r, by ``p . r``."""
    return along >= sight.horizon


@compiled(inline="always")
def is_in_cone(sight: Sight, towards: Vector, squared: Vector) -> Mask:
    """Return which points are in the field of view along b, by ``(p - r) . b`` and ``|p - r|^2 |b|^2``."""
    return (towards > 0.0) & (towards * towards >= sight.cos_squared * squared)


@compiled(inline="always")
def fits_from(sight: Sight) -> float:
    """Return the square of the distance from which all of the chief fits into the field of view, m^2.

    The camera looks at its centre: ``sin(half angle) >= radius / distance``.
    """
    return sight.horizon / (1.0 - sight.cos_squared)


class Optics(NamedTuple):
    """Further parameters of sight in a world whose light or camera are not the paper's."""

    # of the Sun's direction along i, below which the Earth's shadow begins; at the semi-major axis
    least_height: float
    cos_squared: float  # ``c |c|`` of the cosine c of the field of view's half angle, up to 180 deg
    incidence_squared: float  # of the cosine of the largest angle from a point's normal to the deputy
    range_squared: float  # of the range limit, m^2; infinite for none
    least_range_squared: float  # of the least range, m^2
    most_sunward: float  # cosine from boresight to Sun beyond which the camera is blinded; infinite for none
    past_terminator: float  # sine of the angle by which the Sun may be below the tangent plane of a point
    # tangents of the half angles of a rectangular field of view, across and up; infinite for a cone
    tan_across: float
    tan_up: float


@compiled(inline="always")
def sunlight(
    least_height: float, sun_x: float, sun_y: float, cos_elevation: float, sin_elevation: float
) -> Three:
    """Return the direction to the Sun, Hill axes, from that of its angle in the plane; zeros in shadow."""
    x = cos_elevation * sun_x
    shines = 1.0 if x >= least_height else 0.0
    return Three(shines * x, shines * cos_elevation * sun_y, shines * sin_elevation)


@compiled(inline="always")
def is_sunlit(along_sun: Vector, height: Vector) -> Mask:
    """Return which points have the Sun above their tangent plane, by ``n . s`` and ``n . p``.

    If the plane passes behind the chief's centre, by ``n . s > 0``, which is also false without light.
    """
    return along_sun > most(height, 0.0) * (1.0 / ASTRONOMICAL_UNIT_M)


@compiled
def is_in_rectangle(optics: Optics, to_camera: Three, boresight: Three, up: Three) -> bool:
    """Return whether a point is in a rectangular field of view, by unit vectors along the camera and up."""
    ahead = -dot(to_camera, boresight)
    across, rise = abs(dot(to_camera, cross(boresight, up))), abs(dot(to_camera, up))
    return bool(ahead > 0.0 and across <= optics.tan_across * ahead and rise <= optics.tan_up * ahead)


@compiled(inline="always")
def is_resolved(optics: Optics, above: Vector, towards: Vector, squared: Vector) -> Mask:
    """Return which points a camera resolves, by height ``n . (r - p)``, ``(p - r) . b``, ``|p - r|^2``."""
    is_facing_it = (above >= 0.0) & (above * above >= optics.incidence_squared * squared)
    is_in_field = towards * abs(towards) >= optics.cos_squared * squared
    is_in_focus = (squared <= optics.range_squared) & (squared >= optics.least_range_squared)
    return is_facing_it & is_in_field & is_in_focus
