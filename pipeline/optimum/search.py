"""Global search over a few burns: differential evolution (Storn and Price, 1997) with a smoothed coverage.

A plan is one burn at the start and others at later samples, each held for one control period. Its cost is the
price that a deputy with foresight knows it by, see `pipeline.flight.fly.foresight`.
"""

from typing import Any

import numpy as np

from pipeline.array_types import Floats
from pipeline.flight.fly.drift import drift_from, tail_along
from pipeline.flight.fly.foresight import NO_TAIL, Outlook, Tail
from pipeline.flight.fly.prices import price_pushes
from pipeline.optimum.problem import PlanningProblem

#: largest component of a burn, m/s: twice the most that any case is known to need
REACH_M_S = 0.15
#: share of the flight after which no burn begins; later burns come too late to show anything
LATEST = 0.75
POPULATION_PER_GENE, GENERATIONS = 8, 100


def priced(
    problem: PlanningProblem, genes: Floats, num_burns: int, needed: int, limits_m: tuple[float, float]
) -> Floats:
    """Return the costs of n plans, m/s, by `price_pushes`, for genes of shape (4 num_burns - 1, n)."""
    columns, costs = np.ascontiguousarray(genes), np.empty(genes.shape[1])
    price_pushes(columns, num_burns, needed, outlook_of(problem, limits_m), costs)
    return costs


def outlook_of(problem: PlanningProblem, limits_m: tuple[float, float]) -> Outlook:
    """Return the fields of the planning problem by which plans are priced, and the limits."""
    # the linear program that polishes plans keeps the limit on force
    burns: dict[str, Any] = {"least_force": 0.0, "most_force": np.inf, "held": np.zeros((3, 1, 3)), "step": 1}
    shared = {name: getattr(problem, name) for name in Outlook._fields if hasattr(problem, name)}
    nearest, farthest = limits_m
    limits: dict[str, Any] = {"nearest": nearest, "farthest": farthest, "longest_way": np.inf}
    return Outlook(**shared, **burns, **limits, required=0, tail=tail_of(problem))


def tail_of(problem: PlanningProblem) -> Tail:
    """Return what prices what follows a plan's end, where its mission counts that."""
    mission, scenario = problem.mission, problem.scenario
    if mission.after_s == 0.0:
        return NO_TAIL
    drift = drift_from(mission, 0, mission.after_s)
    state = np.r_[scenario.position_m, scenario.velocity_m_s] - drift.rest
    return tail_along(mission, drift, drift.constants @ state, after_s=mission.after_s)


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
