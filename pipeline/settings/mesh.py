"""A chief's mesh, read from the file that the configuration names: STL or OBJ."""

import io
from typing import Final

import numpy as np

from pipeline.array_types import Floats
from pipeline.settings.checks import SettingError
from pipeline.settings.places import conf_folder
from plain_files.file_access import read_bytes

#: most triangles; beyond this, looking from every point in every direction takes minutes
MOST_TRIANGLES = 20_000
#: of a file
MOST_BYTES = 16 << 20


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
        raise SettingError("chief.shape is mesh, which needs trimesh; run: pip install trimesh") from error
    mesh_path = str(conf_folder() / "chief" / "satellite.obj") if path is None else path
    try:
        kind = "." + mesh_path.rpartition(".")[2].lower()
        if kind not in _count:  # archives, which may hold anything, among them
            raise ValueError("it is neither .stl nor .obj")
        content = read_bytes(mesh_path, MOST_BYTES)
        _count[kind](content)
        loaded = trimesh.load_mesh(
            io.BytesIO(content), file_type=kind[1:], process=False, skip_materials=True
        )
        corners = np.ascontiguousarray(loaded.triangles, dtype=np.float64)
    except Exception as error:  # whatever trimesh's readers raise
        reason = " ".join(str(error).split()) or type(error).__name__
        raise SettingError(
            f"chief.path is {mesh_path}, which cannot be read ({reason}); give an STL or OBJ file"
        ) from error
    if not 0 < len(corners) <= MOST_TRIANGLES or not np.isfinite(corners).all():
        raise SettingError(
            f"chief.path is {mesh_path}, with {len(corners)} triangles; it must have from 1 to "
            f"{MOST_TRIANGLES:,}, of finite numbers: simplify the mesh"
        )
    twice_areas = np.linalg.norm(outward_of(corners), axis=1)
    kept: Floats = corners[twice_areas > 1e-12 * float(twice_areas.max(initial=0.0))]
    if len(kept) == 0:
        raise SettingError(f"chief.path is {mesh_path}, whose triangles have no area; give a body's mesh")
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


def outward_of(corners: Floats) -> Floats:
    """Return the cross product of two edges of each triangle, pointing out of the body."""
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
