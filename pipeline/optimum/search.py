"""Global search over a few burns: differential evolution (Storn and Price, 1997) with a smoothed coverage.

A plan is one burn at the start and others at later samples, each held for one control period. Its cost is its
delta-v, plus a price for each metre by which points fall short of being seen, summed over the
nearest ones, plus one for each metre outside the distance limits.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.vectors import least, load, most, store
from pipeline.array_types import Floats
from pipeline.optimum.problem import PlanningProblem

#: price of a metre by which a point falls short, and of a metre outside the limits, m/s
PRICE_OF_HEIGHT, PRICE_OF_DISTANCE = 0.01, 0.05
#: largest component of a burn, m/s: twice the most that any case is known to need
REACH_M_S = 0.15
#: share of the flight after which no burn begins; later burns come too late to show anything
LATEST = 0.75
POPULATION_PER_GENE, GENERATIONS = 8, 100
#: shortfall of a point that is never lit while the camera works, m
NEVER = -1e3
#: plans that are evaluated side by side
PLANS = 16


@compiled(error_model="numpy")
def lead_along(genes: Floats, num_burns: int, free: Floats, effects: Floats, path: Floats) -> float:
    """Write the positions of a plan at all samples into `path`; return the sum of its forces, N.

    Parameters
    ----------
    genes : (4 num_burns - 1,)
        The plan.
    num_burns : int
    free, path : (3K+3,)
        Positions without force and with it, m.
    effects : (3, 3K+3)
        Effect of 1 N along each axis from the sample at which it is fired on, m/N.
    """
    path[:] = free
    spent = 0.0
    for burn in range(num_burns):
        begin = 0 if burn == 0 else int(genes[3 * num_burns + burn - 1])
        f, g, h = genes[3 * burn], genes[3 * burn + 1], genes[3 * burn + 2]
        spent = spent + abs(f) + abs(g) + abs(h)
        after = path[3 * begin :]
        for i in range(len(after)):
            after[i] = after[i] + effects[0, i] * f + effects[1, i] * g + effects[2, i] * h
    return spent


@compiled(error_model="numpy")
def missed(best: Floats, needed: int) -> float:
    """Return the total shortfall of the `needed` points nearest to being seen, m."""
    short = 0.0
    shortfalls = np.sort(-best)
    for j in range(needed):
        short += max(0.0, shortfalls[j])
    return short


@compiled(nogil=True, error_model="numpy")
def price_burns(
    genes: Floats,
    num_burns: int,
    needed: int,
    free: Floats,
    gain: Floats,
    normals: Floats,
    is_lit: NDArray[np.bool_],
    sight: Floats,
    heights: Floats,
    points: Floats,
    cos_incidence: float,
    max_range: float,
    limits: tuple[float, float],
    delta_v_per_force: float,
    costs: Floats,
) -> None:
    """Compute the cost of each plan, m/s.

    Parameters
    ----------
    genes : (4 num_burns - 1, n)
        Forces in N, burn by burn, then the samples of all burns but the first; one column per plan.
    num_burns, needed : int
        Number of burns, and of points to see.
    free, gain, normals, is_lit, sight, heights, points, cos_incidence, max_range, delta_v_per_force
        Of the `PlanningProblem`.
    limits : (float, float)
        Distance limits, m.
    costs : (n,)
        Filled.
    """
    num_samples, num_points, num_plans = len(free), normals.shape[2], genes.shape[1]
    starts, effects = free.ravel(), np.ascontiguousarray(gain.transpose(2, 0, 1)).reshape(3, -1)
    path, spent, outside = np.empty(3 * num_samples), np.empty(PLANS), np.empty(PLANS)
    positions, best = np.empty((num_samples, 3, PLANS)), np.empty((num_points, PLANS))
    is_flat = cos_incidence == 0.0 and max_range == np.inf
    for first in range(0, num_plans, PLANS):
        for lane in range(PLANS):
            # spare lanes repeat the last plan
            plan = min(first + lane, num_plans - 1)
            spent[lane] = lead_along(genes[:, plan], num_burns, starts, effects, path)
            positions[:, :, lane] = path.reshape(-1, 3)
        best[:], outside[:] = NEVER, 0.0
        for k in range(num_samples):
            x, y = load(positions, (k, 0, 0), PLANS), load(positions, (k, 1, 0), PLANS)
            z = load(positions, (k, 2, 0), PLANS)
            distance = np.sqrt(x * x + y * y + z * z)
            if k > 0:
                beyond = most(limits[0] - distance, distance - limits[1])
                store(outside, 0, most(beyond, load(outside, 0, PLANS)))
            room = distance - sight[k]
            for j in range(num_points if sight[k] < np.inf else 0):
                if is_lit[k, j]:
                    height = normals[k, 0, j] * x + normals[k, 1, j] * y + normals[k, 2, j] * z - heights[j]
                    if not is_flat:
                        dx, dy, dz = x - points[k, 0, j], y - points[k, 1, j], z - points[k, 2, j]
                        apart = np.sqrt(dx * dx + dy * dy + dz * dz)
                        height = least(height - cos_incidence * apart, max_range - apart)
                    store(best, (j, 0), most(least(height, room), load(best, (j, 0), PLANS)))
        for lane in range(min(PLANS, num_plans - first)):
            cost = spent[lane] * delta_v_per_force + PRICE_OF_HEIGHT * missed(best[:, lane], needed)
            costs[first + lane] = cost + PRICE_OF_DISTANCE * outside[lane]


def priced(
    problem: PlanningProblem, genes: Floats, num_burns: int, needed: int, limits_m: tuple[float, float]
) -> Floats:
    """Return the costs of n plans, m/s, by `price_burns`, for genes of shape (4 num_burns - 1, n)."""
    columns, costs = np.ascontiguousarray(genes), np.empty(genes.shape[1])
    price_burns(
        columns, num_burns, needed, problem.free, problem.gain, problem.normals, problem.is_lit,
        problem.sight, problem.heights, problem.points, problem.cos_incidence, problem.max_range,
        limits_m, problem.delta_v_per_force, costs,
    )  # fmt: skip
    return costs


def search(problem: PlanningProblem, needed: int, num_burns: int, generator: np.random.Generator) -> Floats:
    """Search for a few burns that see the points at low cost.

    Parameters
    ----------
    problem : PlanningProblem
    needed : int
        Points to be seen.
    num_burns : int
        Number of burns, the first at the start.
    generator : numpy.random.Generator
        Of all randomness.

    Returns
    -------
    (K, 3) array
        Forces, N, Hill axes.
    """
    from scipy.optimize import Bounds, differential_evolution  # noqa: PLC0415 - as in `polish`

    deputy = problem.mission.deputy
    reach = min(REACH_M_S / problem.delta_v_per_force, deputy.max_force_n)
    last = max(1, int(LATEST * problem.num_controls)) - 0.5
    num_forces, num_later = 3 * num_burns, num_burns - 1
    lowest = np.r_[np.full(num_forces, -reach), np.zeros(num_later)]
    highest = np.r_[np.full(num_forces, reach), np.full(num_later, last)]

    def costs_of(genes: Floats) -> Any:
        limits = deputy.min_distance_m, deputy.max_distance_m
        return priced(problem, genes.reshape(len(lowest), -1), num_burns, needed, limits)

    result = differential_evolution(
        costs_of,
        Bounds(lowest, highest),
        maxiter=GENERATIONS,
        popsize=POPULATION_PER_GENE,
        tol=0.0,
        rng=generator,
        polish=False,
        updating="deferred",
        vectorized=True,
    )
    forces = np.zeros((problem.num_controls, 3))
    for burn in range(num_burns):
        begin = 0 if burn == 0 else int(result.x[num_forces + burn - 1])
        forces[begin] += result.x[3 * burn : 3 * burn + 3]
    return np.clip(forces, -deputy.max_force_n, deputy.max_force_n)
