"""A layout of thrusters that are bolted to the body: how it divides a force among them, and what it can give.

Thrusts are linear in the force while this stays in an octant of the body's axes, so that what holds for all
directions, and thus for all attitudes, is known by its eight octants.
"""

from functools import cache
from itertools import product
from typing import NamedTuple

import numpy as np

from pipeline.array_types import Floats

#: of a newton; what a thruster gives less of, by rounding, is nothing
NOTHING = 1e-9


class Capacity(NamedTuple):
    """Bounds over all directions of a force on what a layout gives for it."""

    least_force_n: float  # greatest length up to which any force is given as it is
    thrusts_per_newton: float  # greatest sum of thrusts for a newton
    most_at_once: int  # thrusters that fire for one force


@cache
def layout_of(thrusters: tuple[tuple[float, ...], ...]) -> tuple[Floats, Floats]:
    """Return `Thrusters.table` and `Thrusters.layout` from the rows of the settings."""
    rows = np.array(thrusters, dtype=np.float64)
    directions = rows[:, 3:6]
    layout = np.column_stack([directions, np.cross(rows[:, :3], directions), rows[:, 6]])
    table = np.column_stack(
        [_thrusts_per_newton(layout, sign * axis) for sign in (1.0, -1.0) for axis in np.eye(3)]
    )
    return table, layout


def _thrusts_per_newton(layout: Floats, direction: Floats) -> Floats:
    """Return the forces of least sum that push by a newton along a direction, with the least torque."""
    from scipy.optimize import linprog  # noqa: PLC0415 - takes longer to import than a flight takes

    count = len(layout)
    # the residual torque about each axis has two nonnegative parts, priced above any thrust
    forces = np.hstack([layout[:, :3].T, np.zeros((3, 6))])
    torques = np.hstack([layout[:, 3:6].T, np.eye(3), -np.eye(3)])
    price = 1e3 / max(1e-3, float(np.abs(layout[:, 3:6]).max()))
    solved = linprog(
        np.r_[np.ones(count), np.full(6, price)],
        A_eq=np.vstack([forces, torques]),
        b_eq=np.r_[direction, np.zeros(3)],
        method="highs",
    )
    assert solved.x is not None  # noqa: S101 - settings refuse layouts that cannot push in every direction
    return np.asarray(np.maximum(0.0, solved.x[:count]))


@cache
def capacity_of(thrusters: tuple[tuple[float, ...], ...]) -> Capacity:
    """Return the bounds over all directions on what a layout, the rows of the settings, gives."""
    table, layout = layout_of(thrusters)
    least, thrusts, most = np.inf, 0.0, 0
    for columns in _octants(table):
        # no force of a newton takes more of a thruster than the length of its row
        least = min(least, float(np.min(layout[:, 6] / np.maximum(np.linalg.norm(columns, axis=1), NOTHING))))
        thrusts = max(thrusts, float(np.linalg.norm(columns.sum(axis=0))))
        most = max(most, int(np.count_nonzero((columns > NOTHING).any(axis=1))))
    return Capacity(least, thrusts, most)


@cache
def most_missed(thrusters: tuple[tuple[float, ...], ...], low: float, high: float) -> float:
    """Return the greatest force missed where each thruster that fires misses `low` to `high`, N.

    It is taken at a corner of these intervals, as a length is convex in them.
    """
    table, layout = layout_of(thrusters)
    greatest = 0.0
    for columns in _octants(table):
        directions = layout[(columns > NOTHING).any(axis=1), :3]
        corners = np.zeros((1, 3))
        for direction in directions:
            corners = np.vstack([corners + low * direction, corners + high * direction])
        greatest = max(greatest, float(np.linalg.norm(corners, axis=1).max()))
    return greatest


def _octants(table: Floats) -> list[Floats]:
    """Return the thrusts per newton along the three half-axes of each octant, (N, 3) each."""
    return [table[:, list(columns)] for columns in product((0, 3), (1, 4), (2, 5))]
