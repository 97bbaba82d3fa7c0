"""State and workspace of one thread, parts of a flight that are compiled when used, and points that count."""

from typing import Any

import numpy as np

from fis_tools.compiled.decorator import plain
from fis_tools.engines.kernel import LANES, make_scratch
from pipeline.array_types import Bytes
from pipeline.flight.cases.starts import Cases, StartRows
from pipeline.flight.period.act.safety import MOST_CUTS
from pipeline.flight.period.look.guidance import num_clusters
from pipeline.flight.period.look.optics import note_inspectable
from pipeline.flight.state.arrays import FlightState, FullOptics, Workspace, World, allocated
from pipeline.flight.state.errors import ModelErrors

#: what `fly_many` is compiled for: light, clusters, errors of the deputies' model
Parts = tuple[FullOptics | None, bool | None, ModelErrors | None]


def make_states(world: World, errors: ModelErrors | None, lanes: int, count: int) -> FlightState:
    """Allocate states of `lanes` flights side by side; every array has a further first axis of `count`."""
    sizes = {"L": lanes, "P": world.points.shape[2], "C": plain(num_clusters)(world.num_points)}
    sizes |= {"F": 0, "K": 0, "3K+3": 3, "N": 0}
    if errors is not None:
        sizes |= {"K": world.num_controls, "3K+3": 3 * world.num_controls + 3}
        sizes |= {"F": errors.fixes.errors.of_fixes.shape[1], "N": len(errors.firing.thrusters.table)}
    states: FlightState = allocated(FlightState, sizes, (count,))
    states.has_fired[:] = 1.0
    return states._replace(belief=states.truth) if errors is None else states


def make_state(world: World, errors: ModelErrors | None, lanes: int = LANES) -> FlightState:
    """Allocate the state of one thread, for `lanes` flights side by side."""
    return FlightState(*(field[0] for field in make_states(world, errors, lanes, 1)))


def make_workspace(world: World, lanes: int = LANES) -> Workspace:
    """Allocate the workspace of one thread, for `lanes` flights side by side."""
    sizes = {"L": lanes, "P": world.points.shape[2], "C": plain(num_clusters)(world.num_points)}
    sizes |= {"S": world.num_attitude_steps, "cuts": MOST_CUTS}
    work: Workspace = allocated(Workspace, sizes, scratch=make_scratch(lanes))
    return work


def optics_in_use(world: World, elevations: Any) -> FullOptics | None:
    """Return the light and camera if they are not the paper's; None if they are.

    Of all Suns the elevations over the orbit plane, or whether any is out of it.
    """
    if not (world.has_optics or np.any(elevations) or world.course.is_on):
        return None
    is_rectangle = world.optics.tan_across < np.inf
    return FullOptics(by_point=world.occlusion.edge > 0 or world.reflection.is_on or is_rectangle or None)


def parts_in_use(world: World, cases: Cases) -> Parts:
    """Return the parts of a flight that are compiled only when used; None for unused ones.

    Light and camera beyond the paper's, clusters, and errors of the deputies' model.
    """
    optics = optics_in_use(world, cases.starts.sun_elevation)
    return optics, world.has_clusters or None, cases.model_errors(world.course)


def points_of_cases(world: World, starts: StartRows, work: Workspace | None = None) -> tuple[Bytes, Bytes]:
    """Return which points can be inspected in each case's flight, and which it counts, of 0 or 1.

    Points that are lit at some sample can be inspected. In the paper's world all points count, lit or not; in
    others only those that can be inspected, so that a deputy does not wait for the rest. A workspace that is
    given spares making one.

    Returns
    -------
    inspectable : (m, P padded)
    counted : (m or 1, P padded)
        One row if flights count the same.
    """
    inspectable = np.empty((len(starts), world.points.shape[2]), dtype=np.uint8)
    optics = optics_in_use(world, starts.sun_elevation)
    work = work or make_workspace(world)
    note_inspectable(world, optics, work.ahead, work.lit, starts, inspectable)
    if optics is None:
        return inspectable, np.ones((1, inspectable.shape[1]), dtype=np.uint8)
    is_paper = np.zeros(len(starts), dtype=np.bool_) if world.has_optics else starts.sun_elevation == 0.0
    return inspectable, np.where(is_paper[:, np.newaxis], np.uint8(1), inspectable)
