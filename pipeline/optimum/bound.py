"""Lower bounds on the fuel of any plan, by relaxation.

*One point.* All requirements but one are dropped. To see point j at sample k, the position must move along
the point's normal by the shortfall without force, ``b_jk = radius - normal . free_k``; with the slopes
``a_jk`` of that height over all forces,

``delta_v >= delta_v_per_force max(0, b_jk)/max |a_jk|``,

and its minimum over the samples at which the point is lit is the point's cost.

*Two points.* By weak duality, weights u, w >= 0 on both requirements give
``delta_v >= delta_v_per_force (u b_jk + w b_lm)/max |u a_jk + w a_lm|``; the best over a few weights,
minimised over all pairs of samples, is the pair's cost.

*Enough points.* Of P points a plan that sees N misses at most P - N. Join two points by an edge if the
pair costs v or more (a point with itself if it does alone): if no P - N points cover all edges, every such
plan sees both ends of one, and costs v or more. The largest such v is the bound.

Distance limits, also those after the end, camera, occlusion by a mesh and the force limit are dropped, so
that the bound holds with any of them. Motion is linear here, also on a true course. It is not an estimate:
less is impossible, but the true minimum may be far above it.
"""

from bisect import bisect_left
from math import inf, pi
from typing import NamedTuple

import numpy as np

from fis_tools.compiled.decorator import compiled
from pipeline.array_types import Floats, Integers
from pipeline.optimum.problem import PlanningProblem

Edge = tuple[int, int]

#: number of points whose pairs are evaluated: those of the highest single-point cost
NUM_HARDEST = 16
#: directions of the weights, rad
WEIGHTS = np.linspace(0.0, pi / 2.0, 11)[1:-1]
#: factor on every bound, so that rounding does not make it too large
ROUNDING = 1e-9


class Sighting(NamedTuple):
    """What it takes to see one point at each of K+1 samples."""

    slopes: Floats  # (K+1, K, 3) m/N, see `slopes_of`
    missing: Floats  # (K+1,) shortfalls in height, times the delta-v of a newton, m m/s/N
    costs: Floats  # (K+1,) of seeing it alone, m/s


def delta_v_bound(problem: PlanningProblem, needed: int, ceiling: float = inf) -> float:
    """Return a lower bound of the delta-v for seeing a number of points.

    Parameters
    ----------
    problem : PlanningProblem
    needed : int
        Points to be seen.
    ceiling : float
        An achievable delta-v, m/s; limits the search.

    Returns
    -------
    float
        m/s; infinite if too few points are ever lit.
    """
    costs = sample_costs(problem)
    point_costs = costs.min(axis=0)
    bound = float(np.sort(point_costs)[needed - 1])
    spare = problem.num_points - needed
    if spare < NUM_HARDEST and bound < ceiling:
        hardest = np.argsort(-point_costs, kind="stable")[:NUM_HARDEST]
        pair_costs = _pair_costs(problem, costs, hardest, ceiling)
        bound = max(bound, unavoidable(pair_costs, spare))
    return bound * (1.0 - ROUNDING)


def unavoidable(takes: dict[Edge, float], spare: int) -> float:
    """Return the greatest cost that remains on some edge whichever `spare` vertices are removed.

    Points that may be missed remove their edges; see above.
    """
    values = sorted(set(takes.values()))

    def is_covered(value: float) -> bool:
        return can_cover([edge for edge, cost in takes.items() if cost >= value], spare)

    num_uncovered = bisect_left(values, True, key=is_covered)
    return values[num_uncovered - 1] if num_uncovered else 0.0


def can_cover(edges: list[Edge], spare: int) -> bool:
    """Return whether `spare` vertices cover all edges, by trying either end of the first."""
    if not edges:
        return True
    if spare == 0:
        return False
    return any(can_cover([edge for edge in edges if end not in edge], spare - 1) for end in set(edges[0]))


def _pair_costs(
    problem: PlanningProblem, costs: Floats, points: Integers, ceiling: float
) -> dict[Edge, float]:
    """Return the cost of each pair, m/s, and of each point with itself; capped at the ceiling."""
    takes: dict[Edge, float] = {}
    missing = _missing(problem) * problem.delta_v_per_force
    sightings: dict[int, Sighting] = {}
    for j in points.tolist():
        sighting = Sighting(slopes_to(problem, j), missing[:, j], costs[:, j])
        takes[j, j] = min(float(costs[:, j].min()), ceiling)
        takes |= {(i, j): price_pair(sighting, other, WEIGHTS, ceiling) for i, other in sightings.items()}
        sightings[j] = sighting
    return takes


def _missing(problem: PlanningProblem) -> Floats:
    """Return how far each point is below its horizon without force, shape (K+1, P), m."""
    return problem.heights - np.einsum("ka,kaj->kj", problem.free, problem.normals)


def sample_costs(problem: PlanningProblem) -> Floats:
    """Return the cost of seeing each point at each sample, shape (K+1, P), m/s; infinite in the dark."""
    missing = _missing(problem) * problem.delta_v_per_force
    costs = np.where(missing <= 0.0, 0.0, inf)
    for k in range(1, len(missing)):
        slopes = np.einsum("aj,mab->mbj", problem.normals[k], problem.effects_on(k))
        steepest = np.abs(slopes).max(axis=(0, 1))
        costs[k] = np.divide(np.maximum(missing[k], 0.0), steepest, out=costs[k], where=steepest > 0.0)
    return np.where(problem.is_lit, costs, inf)


def slopes_to(problem: PlanningProblem, point: int) -> Floats:
    """Return the slopes of a point's height at every sample, shape (K+1, K, 3), m/N."""
    normals = problem.normals[:, :, point]
    if not problem.is_on_course:
        return np.asarray(slopes_of(problem.gain, normals))
    constants = np.einsum("ka,kaq->kq", normals, problem.rows)
    slopes = np.einsum("kq,iqf->kif", constants, problem.kicks)
    num_samples, num_periods = slopes.shape[:2]
    slopes[np.arange(num_samples)[:, np.newaxis] <= np.arange(num_periods)] = 0.0
    return np.asarray(slopes)


@compiled(nogil=True, error_model="numpy")
def slopes_of(gain: Floats, normals: Floats) -> Floats:
    """Return the slopes of a point's height at every sample, shape (K+1, K, 3), m/N.

    Parameters
    ----------
    gain : (K+1, 3, 3)
        Of the `PlanningProblem`.
    normals : (K+1, 3)
        To the point.
    """
    num_samples = len(gain)
    slopes = np.zeros((num_samples, num_samples - 1, 3))
    for k in range(num_samples):
        for i in range(k):
            for axis in range(3):
                for row in range(3):
                    slopes[k, i, axis] += normals[k, row] * gain[k - i, row, axis]
    return slopes


@compiled(nogil=True, error_model="numpy")
def price_pair(first: Sighting, second: Sighting, weights: Floats, ceiling: float) -> float:
    """Return the cost of seeing two points, or the ceiling if that is less, m/s.

    Parameters
    ----------
    first, second : Sighting
    weights : (n,)
        Directions to try, rad.
    ceiling : float
    """
    least, direction = ceiling, 0
    cosines, sines = np.cos(weights), np.sin(weights)
    for k in range(len(first.costs)):
        if first.costs[k] >= least:
            continue
        for m in range(len(second.costs)):
            cost = max(first.costs[k], second.costs[m])
            # in any order: the direction decisive for most of the last samples is likely to be so again
            for _ in range(len(weights)):
                if cost >= least:
                    break
                u, w = cosines[direction], sines[direction]
                shortfall = u * first.missing[k] + w * second.missing[m]
                steepest = 0.0
                for i in range(max(k, m) if shortfall > 0.0 else 0):
                    for axis in range(3):
                        slope = u * first.slopes[k, i, axis] + w * second.slopes[m, i, axis]
                        steepest = max(steepest, abs(slope))
                    # larger slopes can only reduce the cost
                    if steepest > 0.0 and shortfall / steepest <= cost:
                        break
                if steepest > 0.0:
                    cost = max(cost, shortfall / steepest)
                if cost < least:
                    direction = (direction + 1) % len(weights)
            least = min(least, cost)
    return least
