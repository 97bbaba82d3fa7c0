"""Plans of forces: from the deputy's knowledge at each decision, or by a linear law.

A planner is plain Python, and the state at a decision is known only after flying up to there. So
flights are flown up to a decision, their forces are planned, and they are flown again up to the
next one. Flights are reproducible to the last digit, so the final flight is a closed loop.
"""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from pipeline.flight.control.controller import Planner, Regulator, played
from pipeline.flight.state.arrays import Plans
from pipeline.flight.state.log import Scenario

#: flies plans for a number of control periods
Fly = Callable[[int, Plans], object]


def regulated(regulator: Regulator, scenarios: list[Scenario]) -> Plans:
    """Return the plans of flights under a linear law: feedforward forces and the path to track."""
    paths = np.array([regulator.path(scenario) for scenario in scenarios], dtype=np.float64)
    forces = np.array([regulator.forces(scenario) for scenario in scenarios], dtype=np.float64)
    return played(forces)._replace(paths=paths, gain=regulator.gain, least_answer=regulator.dead_band_n)


def planned(
    planner: Planner, num_controls: int, scenarios: list[Scenario], fly: Fly, workers: int | None
) -> Plans:
    """Return the plans of flights whose forces are planned during the flight, of so many control periods.

    `fly` flies plans from these starts; `workers` threads plan, one per processor unless given.
    """
    plans = played(np.zeros((len(scenarios), num_controls, 3)))
    noted = plans._replace(known=np.zeros((len(scenarios), num_controls, 6)))
    decisions = list(planner.decisions)
    pool = ThreadPoolExecutor(workers or os.cpu_count() or 1)
    try:
        for decision, following in zip(decisions, [*decisions[1:], num_controls], strict=True):
            fly(decision + 1, noted)

            def plan(case: int, decision: int = decision, following: int = following) -> None:
                forces = planner(scenarios[case], decision, noted.known[case, decision].copy())
                kept = forces[: following - decision]
                plans.forces[case, decision : decision + len(kept)] = kept

            for _ in pool.map(plan, range(len(scenarios))):
                pass
    finally:
        pool.shutdown(cancel_futures=True)
    return plans
