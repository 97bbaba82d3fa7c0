"""The points that can be inspected: those that are lit at some time of the flight."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from pipeline.array_types import Booleans
from pipeline.flight.cases.cases import Starts
from pipeline.flight.fly.workspace import beyond_of, make_workspace, optics_in_use
from pipeline.flight.period.look.optics import note_inspectable, note_lit_and_seen, note_lit_at_samples
from pipeline.flight.state.arrays import World
from pipeline.flight.state.log import FlightLog
from pipeline.physics.quaternion import dcm_b_from_h


def inspectable_points(
    world: World, starts: Starts, note: Callable[..., None] = note_inspectable
) -> NDArray[np.uint8]:
    """Return which points are lit at some sample of each case's flight, shape (m, P padded) of 0 or 1."""
    found = np.empty((len(starts), world.points.shape[2]), dtype=np.uint8)
    note(world, optics_in_use(world, starts), make_workspace(world), starts, found)
    return found


def lit_at_samples(world: World, starts: Starts) -> NDArray[np.bool_]:
    """Return which points are lit at each sample of one case's flight, shape (K+1, P)."""
    found = np.empty((world.num_controls + 1, world.points.shape[2]), dtype=np.uint8)
    note_lit_at_samples(world, optics_in_use(world, starts), make_workspace(world), starts, found)
    return np.ascontiguousarray(found[:, : world.num_points] > 0)


def lit_and_seen(
    world: World, log: FlightLog, note: Callable[..., None] = note_lit_and_seen
) -> tuple[Booleans, Booleans]:
    """Return which points not inspected are lit, and which dark ones are in view, at each sample."""
    angles, num_points = (log.sun_angle_rad, log.sun_elevation_rad), world.num_points
    left = np.zeros((len(log.position_m), world.points.shape[2]), dtype=np.uint8)
    left[:, :num_points] = ~log.is_inspected
    boresights = np.array([dcm_b_from_h(turned).T @ world.boresight for turned in log.quaternion_b_from_h])
    lit, seen = np.zeros_like(left), np.zeros_like(left)
    beyond = beyond_of(world, is_tilted=bool(np.any(log.sun_elevation_rad != 0.0)))
    suns = np.stack([turn(angle) for angle in angles for turn in (np.cos, np.sin)], axis=1)
    note(world, beyond, make_workspace(world), suns, log.position_m, boresights, left, lit, seen)
    return lit[:, :num_points] > 0, seen[:, :num_points] > 0


def counted_points(world: World, starts: Starts, inspectable: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return the points that flights count, as `inspectable_points`, or one row if they are the same for all.

    In the paper's world all points count, lit or not; in others only those that can be inspected, so
    that a deputy does not wait for the rest.
    """
    if optics_in_use(world, starts) is None:
        return np.ones((1, inspectable.shape[1]), dtype=np.uint8)
    is_paper = np.zeros(len(starts), dtype=np.bool_) if world.has_optics else starts.sun_elevation == 0.0
    return np.where(is_paper[:, np.newaxis], np.uint8(1), inspectable)
