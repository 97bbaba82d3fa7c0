"""The points that a camera aimed at the chief's centre inspects along a path, computed without a flight."""

import numpy as np
from numpy.typing import NDArray

from pipeline.array_types import Floats
from pipeline.flight.cases.cases import starts_of
from pipeline.flight.fly.workspace import make_workspace, optics_in_use
from pipeline.flight.period.look.optics import note_seen_along
from pipeline.flight.state.arrays import World
from pipeline.flight.state.log import Scenario


def count_seen(world: World, scenario: Scenario, paths: Floats, stride: int = 1) -> NDArray[np.int64]:
    """Return the number of points that are lit and in view at some sample of each path.

    Parameters
    ----------
    world : World
        Of the mission.
    scenario : Scenario
        Gives the Sun's direction.
    paths : (n, samples, 3)
        Positions, m, Hill axes.
    stride : int
        Control periods between two positions.

    Returns
    -------
    (n,) array of int
    """
    starts = starts_of([scenario])
    counts = np.zeros(len(paths), dtype=np.int64)
    note_seen_along(
        world,
        optics_in_use(world, starts),
        make_workspace(world),
        starts,
        np.ascontiguousarray(paths),
        stride,
        counts,
    )
    return counts
