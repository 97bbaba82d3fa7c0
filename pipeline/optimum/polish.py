"""Polishing by the convex-concave procedure: one linear program per step, until the fuel stops falling.

A point must be above its horizon at one of many samples, and the deputy outside a sphere: both ask that a
convex function of the forces be large. Such a function lies above its tangent, so a step asks that of the
tangent at the last plan: each point at the sample where it was seen best, the spheres by their tangent
planes. What is asked is then more than is needed, the last plan still fulfils it, and fuel cannot rise
(Lipp and Boyd, Variations and extension of the convex-concave procedure, Optimization and Engineering 17,
2016). Slacks with a high price let it begin from a plan that sees too little.

The far limit is convex, which tangent planes allow too much of: where a solution goes beyond it, planes are
added and the program is solved again.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pipeline.optimum.linear_program import least_forces
from pipeline.optimum.problem import Problem, margins_along, path_of, sight_demands

Floats = NDArray[np.float64]
Constraint = tuple[Floats, int, float]

#: m by which demands are set tighter: for rounding, and, as planes cut a convex limit but roughly, beyond it
SIGHT_MARGIN, CURVED_MARGIN, NEAR_MARGIN, FAR_MARGIN = 1e-6, 0.02, 1e-3, 0.05
#: tangent planes are set where the last path is nearer than this to a limit, m
NEAR_REACH, FAR_REACH = 40.0, 60.0
#: how often planes are added at most
CUT_ROUNDS = 5
#: demands that are turned into rows at once
ROWS_AT_ONCE = 32


@dataclass(frozen=True)
class Step:
    """What one linear program gave.

    Parameters
    ----------
    forces : (K, 3)
        N, Hill axes.
    delta_v : float
        m/s.
    slack : float
        By how much its demands are missed in all, m.
    prices : (P,)
        What a metre of each point's demand costs, m/s; zero for those that are not asked for.
    """

    forces: Floats
    delta_v: float
    slack: float
    prices: Floats

    @property
    def is_feasible(self) -> bool:
        """Whether all demands are met."""
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
        The last step's; of more points than needed, those that cost most are let go.
    stride : int
        Forces are free at every stride-th control period and zero elsewhere.
    """
    path = path_of(problem, last)
    margins = margins_along(problem, path)
    best = margins.argmax(axis=0)
    chosen = choose(margins.max(axis=0), needed, prices)
    periods = np.arange(0, problem.num_controls, stride)
    asked = [(int(best[j]), sight_demands(problem, path, int(best[j]), int(j))) for j in chosen]
    # those of tangents to what is curved must do with planes a little inside
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
    # a handful of forces is all that moves: preparing the program takes longer than solving it
    solved = least_forces(-matrix, -least, problem.delta_v_per_force, max_force, presolves=False)
    if solved is None:
        return Step(forces, 0.0, np.inf, np.zeros(len(least)))
    forces[periods] = solved.forces.reshape(-1, 3)
    spent = float(np.abs(forces).sum() * problem.delta_v_per_force)
    return Step(forces, spent, solved.slack, solved.prices)


def choose(best: Floats, needed: int, prices: Floats) -> NDArray[np.int64]:
    """Return the points to ask for: those seen best, or of enough that are seen those that cost least."""
    is_seen = best >= -SIGHT_MARGIN
    if is_seen.sum() >= needed:
        order = np.lexsort((-best, prices, ~is_seen))
    else:
        order = np.argsort(-best, kind="stable")
    return np.asarray(order[:needed], dtype=np.int64)


def _bars(problem: Problem, path: Floats, samples: set[int]) -> Iterable[Constraint]:
    """Yield the tangent planes of the spheres that the deputy must keep outside or inside of."""
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
    """Yield tangent planes of the far limit at the samples of a path that are within its reach, m."""
    farthest = problem.mission.deputy.max_distance_m
    distances = np.linalg.norm(path, axis=1)
    for k in np.flatnonzero(distances[1:] > farthest - reach) + 1:
        yield -path[k] / distances[k], int(k), FAR_MARGIN - farthest


def _rows(
    problem: Problem, demands: Sequence[Constraint], periods: NDArray[np.int64]
) -> tuple[Floats, Floats]:
    """Turn demands ``direction . position_k >= least`` into rows over the forces of some periods."""
    directions, samples = np.array([direction for direction, *_ in demands]), [k for _, k, _ in demands]
    gain = problem.gain.transpose(1, 0, 2).reshape(3, -1)
    # what a force leads to for each sample since; in parts, as a greater product wakes the threads of BLAS
    parts = np.array_split(directions, len(directions) // ROWS_AT_ONCE + 1)
    slopes = np.concatenate([part @ gain for part in parts]).reshape(len(demands), -1, 3)
    # a force that is fired then, or later, leads to nothing
    since = np.maximum(np.array(samples)[:, np.newaxis] - periods, 0)
    matrix = slopes[np.arange(len(demands))[:, np.newaxis], since].reshape(len(demands), -1)
    least = [bound - float(direction @ problem.free[k]) for direction, k, bound in demands]
    return matrix, np.array(least)
