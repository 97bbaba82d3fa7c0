"""Solving a case: a search with several restarts, polishing, and a flight by the simulator.

The reported results of a plan are those of its flight, never of the linear model.
"""

from dataclasses import dataclass

import numpy as np

from pipeline.array_types import Floats
from pipeline.flight.state.log import FlightLog, Scenario, points_needed
from pipeline.optimum.bound import delta_v_bound
from pipeline.optimum.polish import PolishedPlan, step
from pipeline.optimum.problem import PlanningProblem, flown, flown_after, flown_as, problem_of
from pipeline.optimum.search import LATEST, search
from pipeline.settings.experiment import Mission, Optimum

#: spacing of the forces, in control periods, in the first, coarse polishing
COARSE_STRIDE = 4
COARSE_STEPS, FINE_STEPS = 12, 15
#: relative decrease of the fuel at which polishing ends
TOLERANCE = 1e-4
#: fewest restarts, and how many must agree
LEAST_RESTARTS, AGREEING = 8, 3
#: burns added by a kick, and the standard deviation of their components, m/s
BURNS_PER_KICK, KICK_M_S = 2, 0.08
#: least gain of a kick for others to follow, m/s
WORTH_M_S = 5e-4
#: number of drafts that are polished finely
NUM_FINALISTS = 3
#: restarts whose plans cost the same to this tolerance, m/s, count as having found the same
SAME_M_S = 1e-3


@dataclass(frozen=True)
class FlownPlan:
    """A plan as it was flown.

    Parameters
    ----------
    forces : (K, 3)
        N, Hill axes.
    delta_v : float
        m/s.
    num_inspected : int
    mean_distance, min_distance, max_distance : float
        Over all samples, m.
    outside : float
        Largest distance of samples 1 … K, and of what counts after the end, outside the limits, m; zero
        inside.
    """

    forces: Floats
    delta_v: float
    num_inspected: int
    mean_distance: float
    min_distance: float
    max_distance: float
    outside: float

    def rank(self, needed: int) -> tuple[float, int, float]:
        """Return a key that sorts flights from best to worst: within limits, enough points, little fuel."""
        return self.outside, max(0, needed - self.num_inspected), self.delta_v

    def is_feasible(self, needed: int) -> bool:
        """Return whether it kept all limits and inspected enough."""
        return self.outside == 0.0 and self.num_inspected >= needed


@dataclass(frozen=True)
class CasePlan:
    """The best plan of a case, and indicators of its quality.

    Parameters
    ----------
    flight : FlownPlan
    restart_delta_v : (R,)
        After coarse polishing, m/s, ascending; infinite if constraints were violated.
    bound : float
        Lower bound for inspecting as many points, m/s.
    needed : int
        Required points.
    inspectable : int
        Points that can be inspected.
    """

    flight: FlownPlan
    restart_delta_v: Floats
    bound: float
    needed: int
    inspectable: int


def solve(mission: Mission, scenario: Scenario, settings: Optimum, seed: np.random.SeedSequence) -> CasePlan:
    """Find a low-fuel plan that inspects enough points within all limits.

    Restarts go on until `AGREEING` of them have found the best; kicks then try to improve it.

    Parameters
    ----------
    mission, scenario
        The case.
    settings : Optimum
        Points to inspect; most restarts; kicks; most burns of the global search.
    seed : numpy.random.SeedSequence
        Of all randomness.

    Returns
    -------
    CasePlan
        Its flight is the best one found, which may still miss points or leave the limits.
    """
    problem = problem_of(mission, scenario)
    inspectable = int(problem.is_lit.any(axis=0).sum())
    needed = settings.points or points_needed(inspectable, mission.inspection_threshold_percent)
    kick_seed, *seeds = seed.spawn(1 + settings.restarts)
    drafts: list[PolishedPlan] = []
    for restart, child in enumerate(seeds):
        num_burns = 2 + restart % (settings.burns - 1)
        forces = search(problem, needed, num_burns, np.random.default_rng(child))
        drafts.append(descend(problem, forces, needed))
        if restart + 1 >= LEAST_RESTARTS and num_agreeing(_costs(drafts)) >= AGREEING:
            break
    restarts = np.sort(_costs(drafts))
    drafts.append(
        kick(problem, min(drafts, key=total), needed, settings.kicks, np.random.default_rng(kick_seed))
    )
    drafts.sort(key=total)
    best = min(
        (finish(problem, draft.forces, needed) for draft in _distinct(drafts)[:NUM_FINALISTS]),
        key=lambda flight: flight.rank(needed),
    )
    known = best.delta_v if best.is_feasible(needed) else np.inf
    bound = delta_v_bound(problem, needed, known)
    return CasePlan(best, restarts, bound, needed, inspectable)


def _costs(drafts: list[PolishedPlan]) -> Floats:
    """Return the delta-v of drafts, infinite if constraints are violated."""
    return np.array([draft.delta_v if draft.is_feasible else np.inf for draft in drafts])


def num_agreeing(costs: Floats) -> int:
    """Return the number of restarts within `SAME_M_S` of the best; zero if none is feasible."""
    return int(np.sum(costs <= costs.min() + SAME_M_S)) if np.isfinite(costs.min()) else 0


def kick(
    problem: PlanningProblem, best: PolishedPlan, needed: int, num_kicks: int, generator: np.random.Generator
) -> PolishedPlan:
    """Perturb a plan by random burns and polish it again; keep improvements (iterated local search).

    It ends after `num_kicks` kicks in a row without improvement.
    """
    latest, reach = int(LATEST * problem.num_controls), problem.mission.deputy.max_force_n
    in_vain = 0
    while in_vain < num_kicks:
        forces = best.forces.copy()
        begins = generator.integers(0, max(1, latest), size=BURNS_PER_KICK)
        pushes = generator.normal(0.0, KICK_M_S / problem.delta_v_per_force, (BURNS_PER_KICK, 3))
        forces[begins] += pushes * generator.integers(0, 2, (BURNS_PER_KICK, 3))
        draft = descend(problem, np.clip(forces, -reach, reach), needed)
        in_vain = 0 if total(draft) < total(best) - WORTH_M_S else in_vain + 1
        best = min(best, draft, key=total)
    return best


def _distinct(drafts: list[PolishedPlan]) -> list[PolishedPlan]:
    """Drop drafts that cost the same as the one before."""
    kept = drafts[:1]
    for draft in drafts[1:]:
        if abs(draft.delta_v - kept[-1].delta_v) > SAME_M_S:
            kept.append(draft)
    return kept


def descend(problem: PlanningProblem, forces: Floats, needed: int) -> PolishedPlan:
    """Polish on a coarse grid of periods until the fuel no longer falls."""
    prices = np.zeros(problem.num_points)
    last = step(problem, forces, needed, prices, COARSE_STRIDE)
    for _ in range(COARSE_STEPS):
        after = step(problem, last.forces, needed, last.prices, COARSE_STRIDE)
        has_settled = total(after) > (1.0 - TOLERANCE) * total(last)
        last = after if total(after) <= total(last) else last
        if has_settled:
            break
    return last


def total(done: PolishedPlan) -> float:
    """Return the cost by which drafts are compared: delta-v, and 1 m/s for each metre of slack."""
    return done.delta_v + done.slack


def finish(problem: PlanningProblem, forces: Floats, needed: int) -> FlownPlan:
    """Polish on all periods, with camera and course as in each step's flight; return the best flight."""
    log = flown(problem, forces)
    best = judge(problem, forces, log)
    prices, last = np.zeros(problem.num_points), np.inf
    for _ in range(FINE_STEPS):
        problem = flown_as(problem, forces, log)
        done = step(problem, forces, needed, prices, 1)
        forces, prices = done.forces, done.prices
        log = flown(problem, forces)
        best = min(best, judge(problem, forces, log), key=lambda flight: flight.rank(needed))
        if done.is_feasible and abs(last - done.delta_v) <= TOLERANCE * done.delta_v:
            break
        last = done.delta_v
    return best


def judge(problem: PlanningProblem, forces: Floats, log: FlightLog) -> FlownPlan:
    """Return a plan's flight with its results."""
    deputy = problem.mission.deputy
    distances = np.linalg.norm(log.position_m, axis=1)
    counted = np.r_[distances[1:], np.linalg.norm(flown_after(problem, log), axis=1)]
    outside = np.maximum(deputy.min_distance_m - counted, counted - deputy.max_distance_m)
    return FlownPlan(
        forces=forces,
        delta_v=float(log.delta_v_m_s[-1]),
        num_inspected=int(log.is_inspected[-1].sum()),
        mean_distance=float(distances.mean()),
        min_distance=float(distances.min()),
        max_distance=float(distances.max()),
        outside=max(0.0, float(outside.max())),
    )
