"""Forces of least fuel under linear demands: a linear program, solved by HiGHS.

``min delta_v_per_force sum |f| + PRICE_OF_SLACK sum s``,

with ``rows f - s <= most``, ``|f| <= max_force`` and ``s >= 0``.

HiGHS minimises what is linear: each force is the difference of two parts that are not below zero. SciPy's
`linprog` and `milp` give the same programs to the same solver, but take longer about it than the solver does,
and hold Python's lock all the while; `highspy` lets go of it while it solves.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

#: m/s for a metre by which a demand is missed: many times what a metre ever costs
PRICE_OF_SLACK = 0.05
#: forces below this are rounding, N
LEAST_FORCE = 1e-9


class LeastForces(NamedTuple):
    """The solution of a linear program of F forces and R demands.

    Attributes
    ----------
    forces : (F,)
        N.
    slack : float
        By how much the demands are missed in all, m.
    prices : (R,)
        What a metre of each demand costs, m/s.
    """

    forces: Floats
    slack: float
    prices: Floats


def least_forces(
    rows: Floats, most: Floats, delta_v_per_force: float, max_force: float, *, presolves: bool
) -> LeastForces | None:
    """Return the forces of least fuel that meet demands as far as can be.

    Parameters
    ----------
    rows : (R, F)
        m/N.
    most : (R,)
        What ``rows forces`` is to be at most, m.
    delta_v_per_force : float
        m/s for 1 N held over a period.
    max_force : float
        N.
    presolves : bool
        Whether HiGHS makes the program smaller before it solves it.

    Returns
    -------
    LeastForces, optional
        None where there is none: slacks make a program feasible and prices bounded, so that only numbers
        that are not finite, or a numerical failure, leave no solution.
    """
    if not (np.isfinite(rows).all() and np.isfinite(most).all()):
        return None
    num_rows, num_forces = rows.shape
    num_parts = 2 * num_forces
    cost = np.repeat([delta_v_per_force, PRICE_OF_SLACK], [num_parts, num_rows])
    upper = np.repeat([max_force, np.inf], [num_parts, num_rows])
    solved = _solve(cost, upper, rows, most, "on" if presolves else "off")
    if solved is None:
        return None
    parts, prices = solved
    forces = parts[:num_forces] - parts[num_forces:num_parts]
    forces[np.abs(forces) < LEAST_FORCE] = 0.0
    return LeastForces(forces, float(parts[num_parts:].sum()), prices)


def _solve(
    cost: Floats, upper: Floats, rows: Floats, most: Floats, presolve: str
) -> tuple[Floats, Floats] | None:
    """Return what is found between zero and `upper`, and the prices of the rows; None where nothing is."""
    import highspy  # noqa: PLC0415 - a report, which solves none, would wait for it

    starts, places, values = _columns(rows)
    solver = highspy._Highs()  # `Highs` is the same with callbacks, which tie it to itself
    solver.setOptionValue("output_flag", False)
    solver.setOptionValue("presolve", presolve)
    solver.setOptionValue("threads", 1)  # callers have threads of their own
    solver.passModel(
        len(cost), len(most), len(values),
        int(highspy.MatrixFormat.kColwise), int(highspy.ObjSense.kMinimize), 0.0,
        cost, np.zeros(len(cost)), upper, np.full(len(most), -np.inf), most,
        starts, places, values, np.zeros(len(cost), dtype=np.int32),
    )  # fmt: skip
    solver.run()
    if solver.getModelStatus() != highspy.HighsModelStatus.kOptimal:
        return None
    solution = solver.getSolution()
    return np.array(solution.col_value), -np.array(solution.row_dual)


def _columns(rows: Floats) -> tuple[NDArray[np.int32], NDArray[np.int32], Floats]:
    """Return the matrix ``[rows, -rows, -1]`` column by column: where each begins, rows and numbers."""
    by_force, own = np.ascontiguousarray(rows.T), np.arange(len(rows), dtype=np.int32)
    is_set = by_force != 0.0
    places, values = np.broadcast_to(own, by_force.shape)[is_set], by_force[is_set]
    counts = np.count_nonzero(is_set, axis=1)
    starts = np.cumsum(np.concatenate([[0], counts, counts, np.ones_like(own)]))
    return (
        starts.astype(np.int32),
        np.concatenate([places, places, own]),
        np.concatenate([values, -values, np.full(len(rows), -1.0)]),
    )
