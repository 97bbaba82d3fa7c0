"""Polishing by the convex-concave procedure: one linear program per step, until the fuel stops falling.

A point must be above its horizon at one of many samples, and the deputy outside a sphere: both require a
convex function of the forces to be large. Such a function lies above its tangent, so a step requires it of
the tangent at the last plan: each point at the sample where it was seen best, the spheres by their tangent
planes. This is stricter than necessary, the last plan still satisfies it, and fuel cannot increase (Lipp and
Boyd, Variations and extension of the convex-concave procedure, Optimization and Engineering 17, 2016). Slacks
with a high price allow a start from a plan that sees too little. The outer limit is convex, and tangent
planes are too permissive for it: where a solution exceeds it, planes are added and the program is solved
again.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pipeline.array_types import Floats
from pipeline.optimum.linear_program import least_forces
from pipeline.optimum.problem import Problem, margins_along, path_of, sight_demands

Constraint = tuple[Floats, int, float]

#: m by which constraints are tightened: for rounding, and more for the outer limit, as planes are rough there
SIGHT_MARGIN, CURVED_MARGIN, NEAR_MARGIN, FAR_MARGIN = 1e-6, 0.02, 1e-3, 0.05
#: tangent planes are set where the last path is nearer than this to a limit, m
NEAR_REACH, FAR_REACH = 40.0, 60.0
#: most times that planes are added
CUT_ROUNDS = 5
#: constraints that are turned into rows at once
ROWS_AT_ONCE = 32


@dataclass(frozen=True)
class Step:
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


def step(problem: Problem, last: Floats, needed: int, prices: Floats, stride: int) -> Step:
    """Solve the linear program about a plan.

    Parameters
    ----------
    problem : Problem
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
    asked = [(int(best[j]), sight_demands(problem, path, int(best[j]), int(j))) for j in chosen]
    # tangents to curved limits need a margin, as planes are a little off
    margin = SIGHT_MARGIN if problem.is_flat else CURVED_MARGIN
    demands = [(direction, k, least + margin) for k, ((direction, least), *_) in asked]
    bars = [(direction, k, least + margin) for k, (_, *others) in asked for direction, least in others]
    bars += _bars(problem, path, {int(best[j]) for j in chosen})
    for _ in range(CUT_ROUNDS):
        done = _solve(problem, [*demands, *bars], periods)
        cuts = list(_far_planes(problem, path_of(problem, done.forces), 0.0))
        if not cuts:
            break
        bars += cuts
    new_prices = np.zeros(problem.num_points)
    new_prices[chosen] = done.prices[: len(chosen)]
    return replace(done, prices=new_prices)


def _solve(problem: Problem, rows: Sequence[Constraint], periods: NDArray[np.int64]) -> Step:
    """Solve one linear program; its prices are those of the rows."""
    matrix, least = _rows(problem, rows, periods)
    forces = np.zeros((problem.num_controls, 3))
    max_force = problem.mission.deputy.max_force_n
    # few forces are free: presolving the program takes longer than solving it
    solved = least_forces(-matrix, -least, problem.delta_v_per_force, max_force, presolves=False)
    if solved is None:
        return Step(forces, 0.0, np.inf, np.zeros(len(least)))
    forces[periods] = solved.forces.reshape(-1, 3)
    spent = float(np.abs(forces).sum() * problem.delta_v_per_force)
    return Step(forces, spent, solved.slack, solved.prices)


def choose(best: Floats, needed: int, prices: Floats) -> NDArray[np.int64]:
    """Return the points to require: those seen best, or, if enough are seen, the cheapest."""
    is_seen = best >= -SIGHT_MARGIN
    if is_seen.sum() >= needed:
        order = np.lexsort((-best, prices, ~is_seen))
    else:
        order = np.argsort(-best, kind="stable")
    return np.asarray(order[:needed], dtype=np.int64)


def _bars(problem: Problem, path: Floats, samples: set[int]) -> Iterable[Constraint]:
    """Yield the tangent planes of the spheres that the deputy must stay outside or inside of."""
    deputy = problem.mission.deputy
    distances = np.linalg.norm(path, axis=1)
    for k in range(1, len(path)):
        outward = path[k] / distances[k]
        sight = problem.sight[k] + SIGHT_MARGIN if k in samples and np.isfinite(problem.sight[k]) else 0.0
        least = max(sight, deputy.min_distance_m + NEAR_MARGIN)
        if distances[k] < least + NEAR_REACH:
            yield outward, k, least
    yield from _far_planes(problem, path, FAR_REACH)


def _far_planes(problem: Problem, path: Floats, reach: float) -> Iterable[Constraint]:
    """Yield tangent planes of the outer limit at the samples of a path within `reach` of it, m."""
    farthest = problem.mission.deputy.max_distance_m
    distances = np.linalg.norm(path, axis=1)
    for k in np.flatnonzero(distances[1:] > farthest - reach) + 1:
        yield -path[k] / distances[k], int(k), FAR_MARGIN - farthest


def _rows(
    problem: Problem, demands: Sequence[Constraint], periods: NDArray[np.int64]
) -> tuple[Floats, Floats]:
    """Turn constraints ``direction . position_k >= least`` into rows over the forces of some periods."""
    directions, samples = np.array([direction for direction, *_ in demands]), [k for _, k, _ in demands]
    gain = problem.gain.transpose(1, 0, 2).reshape(3, -1)
    # effect of a force on later samples; in parts, as a larger product wakes the threads of BLAS
    parts = np.array_split(directions, len(directions) // ROWS_AT_ONCE + 1)
    slopes = np.concatenate([part @ gain for part in parts]).reshape(len(demands), -1, 3)
    # a force fired at that sample or later has no effect
    since = np.maximum(np.array(samples)[:, np.newaxis] - periods, 0)
    matrix = slopes[np.arange(len(demands))[:, np.newaxis], since].reshape(len(demands), -1)
    least = [bound - float(direction @ problem.free[k]) for direction, k, bound in demands]
    return matrix, np.array(least)
