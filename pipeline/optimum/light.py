"""Which points of the chief are lit at the samples of a case, and which its parts hide from a path."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.three import lane_of, three_of, times
from pipeline.array_types import Bytes, Floats
from pipeline.flight.cases.starts import StartRows
from pipeline.flight.fly.workspace import make_workspace, optics_in_use
from pipeline.flight.period.look.optics import beam_of_case, note_lit, want_all
from pipeline.flight.state.arrays import Beyond, Workspace, World
from pipeline.physics.sight import Occlusion, cell_of


def lit_at_samples(world: World, starts: StartRows) -> NDArray[np.bool_]:
    """Return which points are lit at each sample of one case's flight, shape (K+1, P)."""
    found = np.empty((world.num_controls + 1, world.points.shape[2]), dtype=np.uint8)
    note_lit_at_samples(
        world, optics_in_use(world, starts.sun_elevation), make_workspace(world), starts, found
    )
    return np.ascontiguousarray(found[:, : world.num_points] > 0)


@compiled(nogil=True, error_model="numpy")
def note_lit_at_samples(
    world: World, optics: Beyond | None, work: Workspace, cases: Any, found: Bytes
) -> None:
    """Write which points are lit at each sample of the first case's flight, shape (K+1, P padded), 0 or 1."""
    for k in range(len(found)):
        want_all(world, work)
        note_lit(world, optics, work, beam_of_case(world, optics, cases[0], k))
        for j in range(len(work.lit)):
            found[k, j] = work.lit[j] > 0.0


@compiled(nogil=True, error_model="numpy")
def note_free_along(
    occlusion: Occlusion, axes: Floats, path: Floats, points: Floats, is_granted: NDArray[np.bool_]
) -> None:
    """Make `is_granted`, (K+1, P), false for points that the body hides from the places of a path.

    The path has the shape (K+1, 3), points (K+1, 3, P), m, and axes (K+1 or 1, 3, 3), from the path's to the
    body's.
    """
    for k in range(len(path)):
        turn = axes[k if len(axes) > 1 else 0]
        for j in range(points.shape[2]):
            if is_granted[k, j]:
                to_path = three_of(path[k]) - lane_of(points[k], 0, j)
                cell = cell_of(occlusion.edge, times(turn, to_path))
                is_granted[k, j] = occlusion.is_free[cell, j] > 0
