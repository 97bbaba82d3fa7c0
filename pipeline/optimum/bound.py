"""What no plan can do without: lower bounds by relaxation.

*One point.* All demands but one are dropped. To see point j at sample k, the position must move along the
point's normal by what is missing without force, ``b_jk = radius - normal . free_k``; with the slopes
``a_jk`` of that height over all forces,

``delta_v >= delta_v_per_force max(0, b_jk)/max |a_jk|``,

and the least of it over the samples at which the point is lit is what the point takes.

*Two points.* By weak duality, weights u, w >= 0 on both demands give
``delta_v >= delta_v_per_force (u b_jk + w b_lm)/max |u a_jk + w a_lm|``; the best of a few weights, and the
least of that over all pairs of samples, is what the pair takes.

*Enough points.* Of P points a plan that sees N misses at most P - N. Join two points by an edge where the
pair takes v or more (a point with itself where it does alone): if no P - N points touch all edges, every such
plan sees both ends of one, and takes v or more. The greatest such v is the bound.

Distance limits, camera, what a mesh hides and the greatest force are dropped, so that the bound holds with
any of them. It is no estimate: it says what is impossible, and may be far below what is possible.
"""

from math import inf, pi

import numpy as np
from numpy.typing import NDArray

from fis_tools.engines.compiled import compiled
from pipeline.optimum.problem import Problem

Floats = NDArray[np.float64]
Edge = tuple[int, int]

#: points whose pairs are looked at: those that take most alone
NUM_HARDEST = 16
#: directions of the weights, rad
WEIGHTS = np.linspace(0.0, pi / 2.0, 11)[1:-1]
#: of every bound, so that rounding does not make it too great
ROUNDING = 1e-9


def delta_v_bound(problem: Problem, needed: int, ceiling: float = inf) -> float:
    """Return a delta-v without which so many points cannot be seen.

    Parameters
    ----------
    problem : Problem
    needed : int
        Points to be seen.
    ceiling : float
        A delta-v that is known to do, m/s; it saves looking for more.

    Returns
    -------
    float
        m/s; infinite where so many points are never lit.
    """
    costs = sample_costs(problem)
    alone = costs.min(axis=0)
    bound = float(np.sort(alone)[needed - 1])
    spare = problem.num_points - needed
    if spare < NUM_HARDEST and bound < ceiling:
        hardest = np.argsort(-alone, kind="stable")[:NUM_HARDEST]
        takes = _pair_costs(problem, costs, hardest, ceiling)
        bound = max(bound, unavoidable(takes, spare))
    return bound * (1.0 - ROUNDING)


def unavoidable(takes: dict[Edge, float], spare: int) -> float:
    """Return the greatest cost that stays with some edge, whichever `spare` vertices are taken away."""
    values = sorted(set(takes.values()))
    low, high = 0, len(values)
    # the edges of the low-th value cannot be covered (none is asked of zero), those of the high-th can
    while low < high:
        middle = (low + high) // 2
        if can_cover([edge for edge, cost in takes.items() if cost >= values[middle]], spare):
            high = middle
        else:
            low = middle + 1
    return values[low - 1] if low > 0 else 0.0


def can_cover(edges: list[Edge], spare: int) -> bool:
    """Tell whether so many vertices touch all edges, by trying either end of the first."""
    if not edges:
        return True
    if spare == 0:
        return False
    return any(can_cover([edge for edge in edges if end not in edge], spare - 1) for end in set(edges[0]))


def _pair_costs(
    problem: Problem, costs: Floats, points: NDArray[np.int64], ceiling: float
) -> dict[Edge, float]:
    """Return what each pair takes, m/s, and each point with itself; no more than the ceiling."""
    takes: dict[Edge, float] = {}
    slopes = {int(j): slopes_of(problem.gain, problem.normals[:, :, j]) for j in points}
    missing = _missing(problem) * problem.delta_v_per_force
    for place, j in enumerate(points.tolist()):
        takes[j, j] = min(float(costs[:, j].min()), ceiling)
        for other in points[:place].tolist():
            takes[other, j] = price_pair(
                slopes[j], slopes[other], missing[:, j], missing[:, other], costs[:, j], costs[:, other],
                WEIGHTS, ceiling,
            )  # fmt: skip
    return takes


def _missing(problem: Problem) -> Floats:
    """Return how far each point is below its horizon without force, shape (K+1, P), m."""
    below: Floats = problem.heights - np.einsum("ka,kaj->kj", problem.free, problem.normals)
    return below


def sample_costs(problem: Problem) -> Floats:
    """Return what seeing each point alone takes at each sample, shape (K+1, P), m/s; infinite in the dark."""
    missing = _missing(problem) * problem.delta_v_per_force
    costs = np.where(missing <= 0.0, 0.0, inf)
    for k in range(1, len(missing)):
        slopes = np.einsum("aj,mab->mbj", problem.normals[k], problem.gain[1 : k + 1])
        steepest = np.abs(slopes).max(axis=(0, 1))
        costs[k] = np.divide(np.maximum(missing[k], 0.0), steepest, out=costs[k], where=steepest > 0.0)
    lit: Floats = np.where(problem.is_lit, costs, inf)
    return lit


@compiled(nogil=True, error_model="numpy")
def slopes_of(gain: Floats, normals: Floats) -> Floats:
    """Return the slopes of a point's height at every sample, shape (K+1, K, 3), m/N.

    Parameters
    ----------
    gain : (K+1, 3, 3)
        Of the `Problem`.
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
def price_pair(
    one_slopes: Floats,
    other_slopes: Floats,
    one_missing: Floats,
    other_missing: Floats,
    one_costs: Floats,
    other_costs: Floats,
    weights: Floats,
    ceiling: float,
) -> float:
    """Return what seeing two points takes, or the ceiling where that is less, m/s.

    Parameters
    ----------
    one_slopes, other_slopes : (K+1, K, 3)
        m/N.
    one_missing, other_missing : (K+1,)
        Heights that are missing, times the delta-v of a newton, m m/s/N.
    one_costs, other_costs : (K+1,)
        What each takes alone, m/s.
    weights : (n,)
        Directions to try, rad.
    ceiling : float
    """
    least, place = ceiling, 0
    cosines, sines = np.cos(weights), np.sin(weights)
    for k in range(len(one_costs)):
        if one_costs[k] >= least:
            continue
        for m in range(len(other_costs)):
            cost = max(one_costs[k], other_costs[m])
            # in any order: the direction that told enough of the last samples is likely to of these
            for _ in range(len(weights)):
                if cost >= least:
                    break
                u, w = cosines[place], sines[place]
                asked = u * one_missing[k] + w * other_missing[m]
                steepest = 0.0
                for i in range(max(k, m) if asked > 0.0 else 0):
                    for axis in range(3):
                        slope = u * one_slopes[k, i, axis] + w * other_slopes[m, i, axis]
                        steepest = max(steepest, abs(slope))
                    # what moves it more can only make it take less
                    if steepest > 0.0 and asked / steepest <= cost:
                        break
                if steepest > 0.0:
                    cost = max(cost, asked / steepest)
                if cost < least:
                    place = (place + 1) % len(weights)
            least = min(least, cost)
    return least
