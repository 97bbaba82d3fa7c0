"""A triangle mesh from a file, and points spread over it; the only place that imports trimesh."""

import io
from typing import Final

import numpy as np

from pipeline.array_types import Floats
from pipeline.settings.experiment import SettingError
from pipeline.settings.places import conf_folder, content_of

#: most triangles; beyond this, looking from every point in every direction takes minutes
MOST_TRIANGLES = 20_000
#: of a file
MOST_BYTES = 16 << 20
#: candidate places on the faces per point
CHOICES = 50


def read_mesh(path: str | None) -> Floats:
    """Read a mesh's triangles, shape (T, 3, 3), m, chief axes; without a path the satellite that ships.

    Raises
    ------
    SettingError
        If trimesh is not installed, the file cannot be read, or the body has no sensible size.
    """
    try:
        import trimesh  # noqa: PLC0415 - only when a mesh is flown
    except ImportError as error:
        raise SettingError(
            "chief.shape is mesh, which needs the package trimesh; run: pip install trimesh"
        ) from error
    place = str(conf_folder() / "chief" / "satellite.obj") if path is None else path
    try:
        kind = "." + place.rpartition(".")[2].lower()
        if kind not in _count:  # archives, which may hold anything, among them
            raise ValueError("it is neither .stl nor .obj")
        content = content_of(place, MOST_BYTES)
        _count[kind](content)
        loaded = trimesh.load_mesh(
            io.BytesIO(content), file_type=kind[1:], process=False, skip_materials=True
        )
        corners = np.ascontiguousarray(loaded.triangles, dtype=np.float64)
    except Exception as error:  # whatever trimesh's readers raise
        reason = " ".join(str(error).split()) or type(error).__name__
        raise SettingError(
            f"chief.path is {place}, which cannot be read ({reason}); give an STL or OBJ file"
        ) from error
    if not 0 < len(corners) <= MOST_TRIANGLES or not np.isfinite(corners).all():
        raise SettingError(
            f"chief.path is {place}, with {len(corners)} triangles; it must have from 1 to "
            f"{MOST_TRIANGLES:,}, of finite numbers: simplify the mesh"
        )
    twice_areas = np.linalg.norm(_crossed(corners), axis=1)
    kept: Floats = corners[twice_areas > 1e-12 * float(twice_areas.max(initial=0.0))]
    if len(kept) == 0:
        raise SettingError(f"chief.path is {place}, whose triangles have no area; give the mesh of a body")
    return kept


def _count_obj(content: bytes) -> None:
    """Raise ValueError for faces that make too many triangles, and vertices without three coordinates."""
    num_triangles = 0
    for number, line in enumerate(content.replace(b"\\\n", b" ").splitlines(), start=1):
        key, *words = line.split() or [b""]
        num_triangles += max(0, len(words) - 2) if key == b"f" else 0
        if key == b"v" and len(words) < 3:
            raise ValueError(f"its line {number} has {len(words)} coordinates; a vertex has three")
        if num_triangles > MOST_TRIANGLES:
            raise ValueError(f"it has more than {MOST_TRIANGLES:,} triangles: simplify the mesh")


def _count_stl(content: bytes) -> None:
    """Raise ValueError for too many triangles: 50 bytes each, or one "facet" in words."""
    if max(len(content) // 50 if b"facet" not in content else 0, content.count(b"endfacet")) > MOST_TRIANGLES:
        raise ValueError(f"it has more than {MOST_TRIANGLES:,} triangles: simplify the mesh")


_count: Final = {".obj": _count_obj, ".stl": _count_stl}


def _crossed(corners: Floats) -> Floats:
    """Return the cross product of two edges of each triangle, pointing out of the body."""
    out: Floats = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return out


def spread_points(corners: Floats, num_points: int) -> tuple[Floats, Floats]:
    """Spread points over triangles, evenly by area and on both sides of thin parts.

    Of many places, drawn by a sequence that fills each triangle evenly (M. Roberts' R2), each point is the
    one farthest from those before (T. Gonzalez, Theoretical Computer Science 38, 1985), with opposite faces a
    mean spacing apart. The result is deterministic: points (m) and normals, shape (P, 3), in the order in
    which they were chosen.
    """
    crossed = _crossed(corners)
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
    places = triangles[:, 0] + u[:, np.newaxis] * (triangles[:, 1] - triangles[:, 0])
    places += v[:, np.newaxis] * (triangles[:, 2] - triangles[:, 0])
    spacing = float(np.sqrt(areas.sum() / num_points))
    apart = np.hstack([places, 0.5 * spacing * normals[chosen]])
    taken, nearest = [0], np.sum((apart - apart[0]) ** 2, axis=1)
    while len(taken) < num_points:
        taken.append(int(nearest.argmax()))
        nearest = np.minimum(nearest, np.sum((apart - apart[taken[-1]]) ** 2, axis=1))
    return places[taken], normals[chosen[taken]]
