"""A champion, its mission, and flights of it."""

from functools import cache

import numpy as np

from pipeline.command_line.config import compose_experiment
from pipeline.controllers.source import named
from pipeline.evaluation.assurance import judgements
from pipeline.evaluation.assurance.formula import parse
from pipeline.evaluation.assurance.quantities import UNITS, TrackFacts
from pipeline.evaluation.assurance.requirements import Requirement
from pipeline.flight.control.controller import Controller
from pipeline.flight.state.log import Scenario
from pipeline.scenarios import evaluation_scenarios
from pipeline.settings.experiment import Experiment, Mission

REQUIREMENT = Requirement(
    *("R1", "keep out", "The deputy stays away.", "a collision", "critical", "because", "nobody"),
    *(("cases", "search", "safety_layer"), "always distance >= 15"),
    parse("always distance >= 15", UNITS),
    0.99,
    0.9,
)


@cache
def experiment(*overrides: str) -> Experiment:
    layer = [] if any(override.startswith("safety=") for override in overrides) else ["safety=none"]
    flown = ["+experiment=assure", "controller=champion_any_sun", "sun=random", *layer, *overrides]
    return compose_experiment(flown).experiment


@cache
def champion() -> Controller:
    return named("champion_any_sun", experiment().mission)


def scenarios(count: int) -> list[Scenario]:
    return evaluation_scenarios(experiment())[:count]


def cases(num_failed: int, num_cases: int = 1000, probability: float = 0.99) -> judgements.Judgement:
    """Judge cases of which some fail."""
    margins = np.r_[-np.ones(num_failed), np.ones(num_cases - num_failed)]
    return judgements.judge(margins, margins > 0, probability, 0.9)


def facts_of(mission: Mission) -> TrackFacts:
    """What tracks do not hold, where cases draw nothing of free motion."""
    return TrackFacts(99, np.full(1, 99), mission)
