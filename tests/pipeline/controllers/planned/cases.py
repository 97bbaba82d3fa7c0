"""Missions, starts and planners that the tests of the baselines share."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from pipeline.command_line.config import Job, compose_experiment
from pipeline.controllers.source import controller_of_kind
from pipeline.flight.cases.starts import evaluation_scenarios
from pipeline.flight.state.log import Scenario
from pipeline.settings.controllers import planned_settings
from pipeline.settings.experiment import Mission

Floats = NDArray[np.float64]

KINDS = ("natural_motion", "lqr", "receding_horizon")
MEAN_MOTION, MASS, PERIOD = 0.0011068, 12.0, 10.0
#: of the Clohessy-Wiltshire equations, states [x, y, z, x', y', z']
DERIVATIVE = np.zeros((6, 6))
DERIVATIVE[:3, 3:] = np.eye(3)
DERIVATIVE[3, 0], DERIVATIVE[3, 4] = 3.0 * MEAN_MOTION**2, 2.0 * MEAN_MOTION
DERIVATIVE[4, 3], DERIVATIVE[5, 2] = -2.0 * MEAN_MOTION, -(MEAN_MOTION**2)


@cache
def composed(controller: str, *overrides: str) -> Job:
    return compose_experiment(
        ["+experiment=evaluate", f"controller={controller}", "monte_carlo.num_cases=8", *overrides]
    )


def starts(controller: str, *overrides: str) -> tuple[Mission, list[Scenario]]:
    experiment = composed(controller, *overrides).experiment
    return experiment.mission, evaluation_scenarios(experiment.monte_carlo, experiment.sun, experiment.seed)


def planner(controller: str, *overrides: str, **changes: Any) -> Any:
    experiment = composed(controller, *overrides).experiment
    settings = planned_settings({**experiment.controller, **changes})
    controller = controller_of_kind(controller, replace(settings), experiment.mission)
    return controller.planner or controller.regulator


def planned_ahead(plan_for: Any, start: Scenario, num_periods: int = 360) -> Floats:
    """The forces of a flight in which everything comes as it is known beforehand, shape (num_periods, 3)."""
    forces = np.zeros((num_periods, 3))
    decisions = list(plan_for.decisions)
    for decision, following in zip(decisions, [*decisions[1:], num_periods], strict=True):
        known = flown(start, forces, decision + 1)[-1]
        kept = plan_for(start, decision, known)[: following - decision]
        forces[decision : decision + len(kept)] = kept
    return forces


def discrete() -> tuple[Floats, Floats]:
    """The motion over a control period by scipy's matrix exponential, apart from our closed form."""
    whole = np.zeros((9, 9))
    whole[:6, :6], whole[3:6, 6:] = DERIVATIVE, np.eye(3) / MASS
    moved = expm(whole * PERIOD)
    return moved[:6, :6], moved[:6, 6:]


def flown(start: Scenario, forces: Floats, num_samples: int = 361) -> Floats:
    """The states that held forces lead through, shape (num_samples, 6)."""
    transition, control = discrete()
    states = np.zeros((num_samples, 6))
    states[0] = np.r_[start.position_m, start.velocity_m_s]
    for k in range(1, num_samples):
        force = forces[k - 1] if k <= len(forces) else np.zeros(3)
        states[k] = transition @ states[k - 1] + control @ force
    return states


def integrated(state: Floats, seconds: Floats) -> Floats:
    """Free motion by numerical integration, shape (len(seconds), 6)."""
    solved = solve_ivp(
        lambda _, s: DERIVATIVE @ s,
        (0.0, seconds[-1]),
        state,
        method="DOP853",
        t_eval=seconds,
        rtol=1e-11,
        atol=1e-11,
    )
    return solved.y.T
