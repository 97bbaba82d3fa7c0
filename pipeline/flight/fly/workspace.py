"""The workspace of one thread, and the parts of a flight that are compiled only when used."""

import numpy as np

from fis_tools.compiled.vectors import aligned, make_rows
from fis_tools.engines.kernel import LANES, make_scratch
from pipeline.flight.cases.cases import Cases, Starts
from pipeline.flight.period.act.safety import MOST_CUTS
from pipeline.flight.period.look.guidance import num_clusters
from pipeline.flight.state.arrays import CARRIED, TURNED, Beyond, Guard, Law, Workspace, World
from pipeline.flight.state.errors import ModelErrors
from pipeline.flight.state.signals import SETTING, SIGNALS

#: what `fly_many` is compiled for: light, safety layer, clusters, pushes, model_errors
Parts = tuple[Beyond | None, Guard | None, bool | None, bool | None, ModelErrors | None]


def make_workspace(world: World, lanes: int = LANES) -> Workspace:
    """Allocate the workspace of one thread, for `lanes` flights side by side."""
    points, width, instants = world.num_points, world.points.shape[2], world.num_attitude_steps
    clusters = num_clusters(points)
    return Workspace(
        lanes=make_rows(CARRIED, lanes)[0],
        aims=make_rows(TURNED, lanes, instants),
        passed=make_rows(TURNED, lanes, instants),
        unseen=aligned((lanes, width)),
        candidate=aligned(width),
        lit=aligned(width),
        seen=aligned(width),
        ahead=aligned(width),
        deadlines=aligned((lanes, width)),
        looks=aligned((5, width)),
        signals=aligned((len(SIGNALS), lanes)),
        scratch=make_scratch(lanes),
        candidates=aligned((3, width)),
        centres=np.zeros((lanes, clusters, 3)),
        num_centres=np.zeros(lanes, dtype=np.int64),
        clustered=aligned((lanes, width)),
        labels=aligned((2, width)),
        distances=aligned(width),
        sums=np.zeros((clusters, 4)),
        cuts=np.zeros((MOST_CUTS, 4)),
    )


def optics_in_use(world: World, starts: Starts) -> Beyond | None:
    """Return the light and camera if they are not the paper's; None if they are."""
    return beyond_of(world, is_tilted=bool(np.any(starts.sun_elevation != 0.0)))


def beyond_of(world: World, *, is_tilted: bool) -> Beyond | None:
    """Return the same, given whether the Sun of some start is out of the orbit plane."""
    if not (world.has_optics or is_tilted):
        return None
    return Beyond(closely=world.num_edge_cells > 0 or world.reflection.is_on or None)


def parts_in_use(world: World, law: Law, cases: Cases, lanes: int = LANES) -> Parts:
    """Return the parts of a flight that are compiled only when used; None for unused ones.

    Light and camera beyond the paper's, the safety layer, clusters, pushes that show setting points, and
    model_errors from the deputy's model. In worlds other than the paper's the safety layer and pushes are
    always compiled, so that few variants serve many worlds.
    """
    optics, model_errors = optics_in_use(world, cases.starts), cases.model_errors(world.course, lanes)
    is_elsewhere = optics is not None or model_errors is not None
    return (
        optics,
        world.guard if world.guard.is_on or is_elsewhere else None,
        world.has_clusters or None,
        bool(law.needs & SETTING) or is_elsewhere or None,
        model_errors,
    )
