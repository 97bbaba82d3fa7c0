"""A triangle mesh from a file, and points spread over it; the only place that imports trimesh."""

import numpy as np

from pipeline.settings.experiment import SettingError
from pipeline.settings.places import conf_folder
from pipeline.typing import Floats

#: most triangles; beyond this, looking from every point in every direction takes minutes
MOST_TRIANGLES = 20_000
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
        loaded = trimesh.load_mesh(place, process=False)
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


def _crossed(corners: Floats) -> Floats:
    """Return the cross product of two edges of each triangle, pointing out of the body."""
    out: Floats = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return out


def spread_points(corners: Floats, num_points: int) -> tuple[Floats, Floats]:
    """Spread points over triangles, evenly by area and on both sides of thin parts.

    Of many places, drawn by a sequence that fills each triangle evenly (M. Roberts' R2), each point is the
    one farthest from those before (T. Gonzalez, Theoretical Computer Science 38, 1985), with opposite faces a
    mean spacing apart. The result is deterministic.

    Returns
    -------
    points, normals : (P, 3)
        m, and unit vectors; in the order in which they were chosen.
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
