"""A champion, its mission, and flights of it."""

from functools import cache

from pipeline.command_line.config import compose_experiment
from pipeline.controllers.source import named
from pipeline.flight.control.controller import Controller
from pipeline.flight.state.log import Scenario
from pipeline.scenarios import evaluation_scenarios
from pipeline.settings.experiment import Experiment


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
