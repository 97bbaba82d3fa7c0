"""The points that a flight is about: those that are lit at some time of it."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from pipeline.flight.cases import Starts
from pipeline.flight.kernel.arrays import World
from pipeline.flight.kernel.optics import note_inspectable, note_lit_at_samples
from pipeline.flight.workspace import make_workspace, optics_in_use


def inspectable_points(
    world: World, starts: Starts, note: Callable[..., None] = note_inspectable
) -> NDArray[np.uint8]:
    """Tell which points are lit at some sample of each case's flight, shape (m, P padded) of 0 or 1."""
    found = np.empty((len(starts), world.points.shape[2]), dtype=np.uint8)
    note(world, optics_in_use(world, starts), make_workspace(world), starts, found)
    return found


def lit_at_samples(world: World, starts: Starts) -> NDArray[np.bool_]:
    """Tell which points are lit at each sample of one case's flight, shape (K+1, P)."""
    found = np.empty((world.num_controls + 1, world.points.shape[2]), dtype=np.uint8)
    note_lit_at_samples(world, optics_in_use(world, starts), make_workspace(world), starts, found)
    return np.ascontiguousarray(found[:, : world.num_points] > 0)


def counted_points(world: World, starts: Starts, inspectable: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return the points that flights are about, as `inspectable_points`, or in one row what all share.

    In the paper's world these are all, whether they are ever lit or not; in others those that can be
    inspected, so that a deputy waits for no other.
    """
    if optics_in_use(world, starts) is None:
        return np.ones((1, inspectable.shape[1]), dtype=np.uint8)
    is_paper = np.zeros(len(starts), dtype=np.bool_) if world.has_optics else starts.sun_elevation == 0.0
    return np.where(is_paper[:, np.newaxis], np.uint8(1), inspectable)
