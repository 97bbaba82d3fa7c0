"""What no plan can do without: a lower bound by relaxation.

All but one demand are dropped. To see one point at one sample, its position must move along the point's
normal by what is missing without force; 1 m/s does most where the response is greatest, so that

``delta_v >= max(0, radius - normal . free_k)/max over periods and axes of |normal . gain|/delta_v_per_force``

is needed, and the least of it over all samples at which the point is lit. Of P points P - N may be missed:
the N-th least of these numbers is a bound for N points. Neither limit, camera nor other point makes it less.
"""

import numpy as np
from numpy.typing import NDArray

from pipeline.optimum.problem import Problem

Floats = NDArray[np.float64]


def delta_v_bound(problem: Problem, needed: int) -> float:
    """Return a delta-v, m/s, without which so many points cannot be seen; infinite if they never can."""
    return float(np.sort(point_bounds(problem))[needed - 1])


def point_bounds(problem: Problem) -> Floats:
    """Return what seeing each point alone takes, shape (P,), m/s; infinite for those never lit."""
    missing = problem.radius - np.einsum("ka,kaj->kj", problem.free, problem.normals)
    costs = np.full(missing.shape, np.inf)
    costs[missing <= 0.0] = 0.0
    for k in range(1, len(missing)):
        reach = np.abs(np.einsum("aj,mab->mbj", problem.normals[k], problem.gain[1 : k + 1])).max(axis=(0, 1))
        needed = np.maximum(missing[k], 0.0) * problem.delta_v_per_force
        costs[k] = np.divide(needed, reach, out=costs[k], where=reach > 0.0)
    least: Floats = np.where(problem.is_lit, costs, np.inf).min(axis=0)
    return least
