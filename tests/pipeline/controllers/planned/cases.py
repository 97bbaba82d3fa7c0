"""Missions, starts and planners that the tests of the baselines share."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from pipeline.array_types import Floats, Integers
from pipeline.command_line.config import Job, compose_experiment
from pipeline.controllers.source import controller_of_kind
from pipeline.flight.control.controller import PlanningController
from pipeline.flight.reference.motion import transition
from pipeline.flight.state.log import Scenario
from pipeline.scenarios import evaluation_scenarios
from pipeline.settings.controllers import PLANNED, Planned
from pipeline.settings.experiment import Mission

KINDS = tuple(PLANNED)
MEAN_MOTION, MASS, PERIOD = 0.0011068, 12.0, 10.0


@cache
def composed(controller: str, *overrides: str) -> Job:
    words = ("+experiment=evaluate", f"controller={controller}", "monte_carlo.num_cases=8")
    return compose_experiment([*words, *overrides])


def starts(controller: str, *overrides: str) -> tuple[Mission, list[Scenario]]:
    experiment = composed(controller, *overrides).experiment
    return experiment.mission, evaluation_scenarios(experiment)


def planner(controller: str, *overrides: str, **changes: Any) -> Any:
    experiment = composed(controller, *overrides).experiment
    settings = Planned(**{**experiment.controller, **changes})
    controller = controller_of_kind(controller, replace(settings), experiment.mission)
    return controller.planner if isinstance(controller, PlanningController) else controller.regulator


def planned_ahead(plan_for: Any, start: Scenario, num_periods: int = 360) -> Floats:
    """The forces of a flight in which everything comes as it is known beforehand, shape (num_periods, 3)."""
    forces = np.zeros((num_periods, 3))
    decisions = list(plan_for.decisions)
    for decision, following in zip(decisions, [*decisions[1:], num_periods], strict=True):
        known = flown(start, forces, decision + 1)[-1]
        kept = plan_for(start, decision, known)[: following - decision]
        forces[decision : decision + len(kept)] = kept
    return forces


def flown(start: Scenario, forces: Floats, num_samples: int = 361) -> Floats:
    """The states that held forces lead through, shape (num_samples, 6)."""
    phi, gamma = transition(MEAN_MOTION, PERIOD, MASS)
    held = np.zeros((num_samples, 3))
    states = [np.r_[start.position_m, start.velocity_m_s]]
    held[: len(forces)] = forces[:num_samples]
    for force in held[:-1]:
        states.append(phi @ states[-1] + gamma @ force)
    return np.array(states)


def ring(settings: Any, start: Scenario, samples: Integers) -> Floats:
    """The states at some samples of a deputy on the ring, in phase with the Sun, shape (n, 6)."""
    turned = MEAN_MOTION * PERIOD * np.asarray(samples)
    phase = start.sun_angle_rad - settings.ring_lead_rad - turned
    swing = turned + settings.height_lead_rad
    size = settings.ring_size_m
    most = settings.max_height_m
    height = np.clip(start.position_m[2], -most, most)
    coordinates = size * np.cos(phase), 2 * size * np.sin(phase), height * np.cos(swing)
    # the velocity is the derivative of the position: the phase falls at n
    speeds = size * np.sin(phase), -2 * size * np.cos(phase), -height * np.sin(swing)
    return np.stack([*coordinates, *(MEAN_MOTION * speed for speed in speeds)], axis=-1)
