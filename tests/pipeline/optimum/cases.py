"""Missions and problems that the tests of the optimum share."""

from functools import cache

import numpy as np

from pipeline.array_types import Floats
from pipeline.command_line.config import Job, compose_experiment
from pipeline.optimum.problem import PlanningProblem, problem_of
from pipeline.scenarios import evaluation_scenarios


@cache
def composed(*overrides: str) -> Job:
    return compose_experiment(["+experiment=optimum", "monte_carlo.num_cases=2", *overrides])


@cache
def problem(case: int, *overrides: str) -> PlanningProblem:
    experiment = composed(*overrides).experiment
    return problem_of(experiment.mission, evaluation_scenarios(experiment)[case])


def random_forces(num_controls: int, scale: float, seed: int = 0) -> Floats:
    """A few burns, N."""
    generator = np.random.default_rng(seed)
    forces = np.zeros((num_controls, 3))
    forces[generator.integers(0, num_controls // 2, 4)] = generator.normal(0.0, scale, (4, 3))
    return forces


#: from 35,000 km down to a perigee, beside which Clohessy and Wiltshire's equations err by hundreds of metres
TRANSFER = (
    "dynamics=two_body",
    "orbit=elements",
    "orbit.semi_major_axis_m=24478137",
    "orbit.eccentricity=0.725",
    "orbit.true_anomaly_deg=290",
    "sun=random",
)
