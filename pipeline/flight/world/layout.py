"""A layout of thrusters that are bolted to the body: how it divides a force among them."""

from functools import cache

import numpy as np

from pipeline.array_types import Floats


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
