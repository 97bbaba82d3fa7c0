"""Minimum-fuel forces under linear constraints: a linear program, solved by HiGHS.

``min delta_v_per_force sum |f| + PRICE_OF_SLACK sum s``,

with ``rows f - s <= most``, ``|f| <= max_force`` and ``s >= 0``.

HiGHS minimises a linear objective: each force is the difference of two nonnegative parts. SciPy's `linprog`
and `milp` pass the same programs to the same solver, but spend more time on that than the solver does, and
hold Python's global lock throughout; `highspy` releases it while it solves.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipeline.array_types import Floats

#: m/s for a metre of violation: many times the highest price of a metre
PRICE_OF_SLACK = 0.05
#: forces below this are rounding, N
LEAST_FORCE = 1e-9


class LeastForces(NamedTuple):
    """The solution of a linear program of F forces and R constraints.

    Attributes
    ----------
    forces : (F,)
        N.
    slack : float
        Total violation of the constraints, m.
    prices : (R,)
        Shadow price of each constraint, m/s per m.
    """

    forces: Floats
    slack: float
    prices: Floats


def least_forces(
    rows: Floats, most: Floats, delta_v_per_force: float, max_force: float, *, presolves: bool
) -> LeastForces | None:
    """Return the minimum-fuel forces that meet constraints as far as possible.

    Parameters
    ----------
    rows : (R, F)
        m/N.
    most : (R,)
        Upper bounds of ``rows forces``, m.
    delta_v_per_force : float
        m/s for 1 N held over a period.
    max_force : float
        N.
    presolves : bool
        Whether HiGHS presolves the program.

    Returns
    -------
    LeastForces, optional
        None if there is none: slacks make a program feasible and prices bounded, so that only numbers
        that are not finite, or a numerical failure, prevent a solution.
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
    """Return the solution between zero and `upper`, and the prices of the rows; None if there is none."""
    import highspy  # noqa: PLC0415 - slow to import, and reports do not need it

    starts, places, values = _columns(rows)
    solver = highspy._Highs()  # `Highs` is the same with callbacks, which create a reference cycle
    solver.setOptionValue("output_flag", False)
    solver.setOptionValue("presolve", presolve)
    solver.setOptionValue("threads", 1)  # callers have their own threads
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
    """Return the matrix ``[rows, -rows, -1]`` by columns: column starts, row indices and values."""
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
