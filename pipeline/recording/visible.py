"""Which points of the chief were lit, and which dark ones were in view, during a logged flight."""

from collections.abc import Callable

import numpy as np

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.three import load_at, three_of
from fis_tools.compiled.vectors import load, select, store
from pipeline.array_types import Booleans, Bytes, Floats
from pipeline.flight.fly.workspace import make_workspace, optics_in_use
from pipeline.flight.period.look.guidance import POINTS
from pipeline.flight.period.look.optics import beam_from, eye_at, note_lit, seen_points
from pipeline.flight.state.arrays import Beyond, Workspace, World
from pipeline.flight.state.log import FlightLog
from pipeline.physics.quaternion import dcm_b_from_h


@compiled(nogil=True, error_model="numpy")
def note_lit_and_seen(
    world: World,
    optics: Beyond | None,
    work: Workspace,
    suns: Floats,
    places: Floats,
    boresights: Floats,
    left: Bytes,
    lit: Bytes,
    seen: Bytes,
) -> None:
    """Write which of the points left are lit at the samples of a flight, and which dark ones are in view.

    Suns, (K+1, 4), are cosine and sine of the Sun's angle and of its elevation; places (m) and boresights of
    the camera, (K+1, 3), are in Hill axes; `left`, `lit` and `seen`, (K+1, P padded), are 0 or 1.
    """
    for k in range(len(places)):
        beam = beam_from(world, optics, k, (suns[k, 0], suns[k, 1]), (suns[k, 2], suns[k, 3]))
        eye = eye_at(world, optics, beam, three_of(places[k]), three_of(boresights[k]))
        for j in range(len(work.ahead)):
            work.ahead[j] = left[k, j]
        note_lit(world, optics, work, beam)
        for j in range(0, len(work.ahead), POINTS):
            dark, points = load(work.ahead, j, POINTS) > 0.0, load_at(world.points, beam.sample, 0, j, POINTS)
            seen_dark = seen_points(world, optics, work, j, points, dark, eye)
            store(work.ahead, j, select(seen_dark, 1.0, 0.0))
        for j in range(len(work.ahead)):
            lit[k, j], seen[k, j] = work.lit[j] > 0.0, work.ahead[j] > 0.0 and not eye.is_blind


def lit_and_seen(
    world: World, log: FlightLog, note: Callable[..., None] = note_lit_and_seen
) -> tuple[Booleans, Booleans]:
    """Return which points not inspected are lit, and which dark ones are in view, at each sample."""
    angles, num_points = (log.sun_angle_rad, log.sun_elevation_rad), world.num_points
    left = np.zeros((len(log.position_m), world.points.shape[2]), dtype=np.uint8)
    left[:, :num_points] = ~log.is_inspected
    boresights = np.array([dcm_b_from_h(turned).T @ world.boresight for turned in log.quaternion_b_from_h])
    lit, seen = np.zeros_like(left), np.zeros_like(left)
    beyond = optics_in_use(world, log.sun_elevation_rad)
    suns = np.stack([turn(angle) for angle in angles for turn in (np.cos, np.sin)], axis=1)
    note(world, beyond, make_workspace(world), suns, log.position_m, boresights, left, lit, seen)
    return lit[:, :num_points] > 0, seen[:, :num_points] > 0
