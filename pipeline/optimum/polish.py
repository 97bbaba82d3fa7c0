"""Polishing by the convex-concave procedure: one linear program per step, until the fuel stops falling.

A point must be above its horizon at one of many samples, and the deputy outside a sphere: both require a
convex function of the forces to be large. Such a function lies above its tangent, so a step requires it of
the tangent at the last plan: each point at the sample where it was seen best, the spheres by their tangent
planes. This is stricter than necessary, the last plan still satisfies it, and fuel cannot increase (Lipp and
Boyd, Variations and extension of the convex-concave procedure, Optimization and Engineering 17, 2016). Slacks
with a high price allow a start from a plan that sees too little. The outer limit is convex, and tangent
planes are too permissive for it: where a solution exceeds it, planes are added and the program is solved
again.

The linear program, which HiGHS solves, is ``min delta_v_per_force sum |f| + PRICE_OF_SLACK sum s`` with
``rows f - s <= most``, ``|f| <= max_force`` and ``s >= 0``. HiGHS minimises a linear objective: each force is
the difference of two nonnegative parts. SciPy's `linprog` and `milp` pass the same programs to the same
solver, but spend more time on that than the solver does, and hold Python's global lock throughout; `highspy`
releases it while it solves.
"""

import threading
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipeline.array_types import Floats, Integers
from pipeline.optimum.problem import PlanningProblem, margins_along, path_after, path_of, sight_demands

Constraint = tuple[Floats, int, float]
#: holds a solver for each thread
OF_THREAD = threading.local()

#: m by which constraints are tightened: for rounding, and more for the outer limit, as planes are rough there
SIGHT_MARGIN, CURVED_MARGIN, NEAR_MARGIN, FAR_MARGIN = 1e-6, 0.02, 1e-3, 0.05
#: tangent planes are set where the last path is nearer than this to a limit, m
NEAR_REACH, FAR_REACH = 40.0, 60.0
#: most times that planes are added
CUT_ROUNDS = 5
#: constraints that are turned into rows at once
ROWS_AT_ONCE = 32

#: m/s for a metre of violation: many times the highest price of a metre
PRICE_OF_SLACK = 0.05
#: forces below this are rounding, N
LEAST_FORCE = 1e-9


@dataclass(frozen=True)
class PolishedPlan:
    """The solution of one linear program.

    Parameters
    ----------
    forces : (K, 3)
        N, Hill axes.
    delta_v : float
        m/s.
    slack : float
        Total violation of its constraints, m.
    prices : (P,)
        Price of a metre of each point's constraint, m/s; zero for points not required.
    """

    forces: Floats
    delta_v: float
    slack: float
    prices: Floats

    @property
    def is_feasible(self) -> bool:
        """Whether all constraints are met."""
        return self.slack < 1e-6


def step(problem: PlanningProblem, last: Floats, needed: int, prices: Floats, stride: int) -> PolishedPlan:
    """Solve the linear program about a plan.

    Parameters
    ----------
    problem : PlanningProblem
    last : (K, 3)
        The last plan's forces, N.
    needed : int
        Points to be seen.
    prices : (P,)
        Of the last step; of more points than needed, the most expensive are dropped.
    stride : int
        Forces are free at every stride-th control period and zero elsewhere.
    """
    path = path_of(problem, last)
    margins = margins_along(problem, path)
    best = margins.argmax(axis=0)
    chosen = choose(margins.max(axis=0), needed, prices)
    periods = np.arange(0, problem.num_controls, stride)
    required = [(int(best[j]), sight_demands(problem, path, int(best[j]), int(j))) for j in chosen]
    # tangents to curved limits need a margin, as planes are a little off
    margin = SIGHT_MARGIN if problem.is_flat else CURVED_MARGIN
    demands = [(direction, k, least + margin) for k, ((direction, least), *_) in required]
    bars = [(direction, k, least + margin) for k, (_, *others) in required for direction, least in others]
    bars += _bars(problem, _whole(problem, path, last), {int(best[j]) for j in chosen})
    for _ in range(CUT_ROUNDS):
        done = _solve(problem, [*demands, *bars], periods)
        cuts = list(_far_planes(problem, _whole(problem, path_of(problem, done.forces), done.forces), 0.0))
        if not cuts:
            break
        bars += cuts
    new_prices = np.zeros(problem.num_points)
    new_prices[chosen] = done.prices[: len(chosen)]
    return replace(done, prices=new_prices)


def _whole(problem: PlanningProblem, path: Floats, forces: Floats) -> Floats:
    """Return a path with what follows its end, (K+1+J, 3), m: a constraint may be on any of these samples."""
    return np.concatenate([path, path_after(problem, forces)]) if len(problem.free_after) else path


def _solve(problem: PlanningProblem, rows: Sequence[Constraint], periods: Integers) -> PolishedPlan:
    """Solve one linear program; the prices are those of its constraints, those after the end last."""
    end = len(problem.free)
    matrix, least = _rows(problem, [row for row in rows if row[1] < end], periods)
    if after := [(direction, k - end, bound) for direction, k, bound in rows if k >= end]:
        more, beyond = _rows_after(problem, after, periods)
        matrix, least = np.concatenate([matrix, more]), np.concatenate([least, beyond])
    forces = np.zeros((problem.num_controls, 3))
    max_force = problem.mission.deputy.max_force_n
    # few forces are free: presolving the program takes longer than solving it
    solved = least_forces(-matrix, -least, problem.delta_v_per_force, max_force, presolves=False)
    forces[periods] = solved.forces.reshape(-1, 3)
    spent = float(np.abs(forces).sum() * problem.delta_v_per_force)
    return PolishedPlan(forces, spent, solved.slack, solved.prices)


def choose(best: Floats, needed: int, prices: Floats) -> Integers:
    """Return the points to require: those seen best, or, if enough are seen, the cheapest."""
    is_seen = best >= -SIGHT_MARGIN
    if is_seen.sum() >= needed:
        order = np.lexsort((-best, prices, ~is_seen))
    else:
        order = np.argsort(-best, kind="stable")
    return np.asarray(order[:needed], dtype=np.int64)


def _bars(problem: PlanningProblem, path: Floats, samples: set[int]) -> Iterable[Constraint]:
    """Yield tangent planes of the distance limits where a path is close to one: stay on their safe side."""
    deputy = problem.mission.deputy
    distances = np.linalg.norm(path, axis=1)
    for k in range(1, len(path)):
        outward = path[k] / distances[k]
        # nothing is seen after the end, whose samples are none of these
        sight = problem.sight[k] + SIGHT_MARGIN if k in samples and np.isfinite(problem.sight[k]) else 0.0
        least = max(sight, deputy.min_distance_m + NEAR_MARGIN)
        if distances[k] < least + NEAR_REACH:
            yield outward, k, least
    yield from _far_planes(problem, path, FAR_REACH)


def _far_planes(problem: PlanningProblem, path: Floats, reach: float) -> Iterable[Constraint]:
    """Yield tangent planes of the outer limit at the samples of a path within `reach` of it, m."""
    farthest = problem.mission.deputy.max_distance_m
    distances = np.linalg.norm(path, axis=1)
    for k in np.flatnonzero(distances[1:] > farthest - reach) + 1:
        yield -path[k] / distances[k], int(k), FAR_MARGIN - farthest


def _rows(
    problem: PlanningProblem, demands: Sequence[Constraint], periods: Integers
) -> tuple[Floats, Floats]:
    """Turn constraints ``direction . position_k >= least`` into rows over the forces of some periods."""
    directions, samples = np.array([direction for direction, *_ in demands]), [k for _, k, _ in demands]
    least = np.array([bound - float(direction @ problem.free[k]) for direction, k, bound in demands])
    if problem.is_on_course:
        constants = np.einsum("ra,raq->rq", directions, problem.rows[samples])
        slopes = np.einsum("rq,iqf->rif", constants, problem.kicks[periods])
        slopes[np.array(samples)[:, np.newaxis] <= periods] = 0.0
        return slopes.reshape(len(demands), -1), least
    gain = problem.gain.transpose(1, 0, 2).reshape(3, -1)
    # effect of a force on later samples; in parts, as a larger product wakes the threads of BLAS
    parts = np.array_split(directions, len(directions) // ROWS_AT_ONCE + 1)
    slopes = np.concatenate([part @ gain for part in parts]).reshape(len(demands), -1, 3)
    # a force fired at that sample or later has no effect
    since = np.maximum(np.array(samples)[:, np.newaxis] - periods, 0)
    matrix = slopes[np.arange(len(demands))[:, np.newaxis], since].reshape(len(demands), -1)
    return matrix, least


def _rows_after(
    problem: PlanningProblem, demands: Sequence[Constraint], periods: Integers
) -> tuple[Floats, Floats]:
    """Turn constraints ``direction . position >= least`` on instants after the end into rows, as `_rows`."""
    directions, instants = np.array([direction for direction, *_ in demands]), [j for _, j, _ in demands]
    least = np.array([bound - float(direction @ problem.free_after[j]) for direction, j, bound in demands])
    slopes = np.einsum("ra,rakb->rkb", directions, problem.gain_after[instants][:, :, periods])
    return slopes.reshape(len(demands), -1), least


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
) -> LeastForces:
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
    LeastForces
        No forces, and infinite slack, if there is none: slacks make a program feasible and prices bounded, so
        that only numbers that are not finite, or a numerical failure, prevent a solution.
    """
    num_rows, num_forces = rows.shape
    unsolved = LeastForces(np.zeros(num_forces), np.inf, np.zeros(num_rows))
    if not (np.isfinite(rows).all() and np.isfinite(most).all()):
        return unsolved
    num_parts = 2 * num_forces
    cost = np.repeat([delta_v_per_force, PRICE_OF_SLACK], [num_parts, num_rows])
    upper = np.repeat([max_force, np.inf], [num_parts, num_rows])
    solved = _solved_by_highs(cost, upper, rows, most, "on" if presolves else "off")
    if solved is None:
        return unsolved
    parts, prices = solved
    forces = parts[:num_forces] - parts[num_forces:num_parts]
    forces[np.abs(forces) < LEAST_FORCE] = 0.0
    return LeastForces(forces, float(parts[num_parts:].sum()), prices)


def _solved_by_highs(
    cost: Floats, upper: Floats, rows: Floats, most: Floats, presolve: str
) -> tuple[Floats, Floats] | None:
    """Return the solution between zero and `upper`, and the prices of the rows; None if there is none."""
    import highspy  # noqa: PLC0415 - slow to import, and reports do not need it

    starts, indices, values = _columns(rows)
    if not hasattr(OF_THREAD, "solver"):  # a solver is a reference cycle: a new one each time would pile up
        OF_THREAD.solver = highspy.Highs()
    solver = OF_THREAD.solver
    solver.clear()
    solver.setOptionValue("output_flag", False)
    solver.setOptionValue("presolve", presolve)
    solver.setOptionValue("threads", 1)  # callers have their own threads
    solver.passModel(
        len(cost), len(most), len(values),
        int(highspy.MatrixFormat.kColwise), int(highspy.ObjSense.kMinimize), 0.0,
        cost, np.zeros(len(cost)), upper, np.full(len(most), -np.inf), most,
        starts, indices, values, np.zeros(len(cost), dtype=np.int32),
    )  # fmt: skip
    solver.run()
    if solver.getModelStatus() != highspy.HighsModelStatus.kOptimal:
        return None
    solution = solver.getSolution()
    return np.array(solution.col_value), -np.array(solution.row_dual)


def _columns(rows: Floats) -> tuple[NDArray[np.int32], NDArray[np.int32], Floats]:
    """Return the matrix ``[rows, -rows, -1]`` by columns: column starts, row indices and values."""
    by_force, row_indices = np.ascontiguousarray(rows.T), np.arange(len(rows), dtype=np.int32)
    is_set = by_force != 0.0
    indices, values = np.broadcast_to(row_indices, by_force.shape)[is_set], by_force[is_set]
    counts = np.count_nonzero(is_set, axis=1)
    starts = np.cumsum(np.concatenate([[0], counts, counts, np.ones_like(row_indices)]))
    all_values = np.concatenate([values, -values, np.full(len(rows), -1.0)])
    return starts.astype(np.int32), np.concatenate([indices, indices, row_indices]), all_values
