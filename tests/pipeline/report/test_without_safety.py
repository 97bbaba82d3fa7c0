"""What a report says of the safety layer: the flights that would have been outside without it."""

from dataclasses import fields

import numpy as np

from pipeline.command_line.config import compose_experiment
from pipeline.controllers.source import load
from pipeline.flight.cases.dispersions import drawn
from pipeline.flight.state.log import Outcomes
from pipeline.report import comparisons
from pipeline.scenarios import evaluation_scenarios
from tests.pipeline.command_line.cases import EVALUATE

LIMITED = "+dispersions.deputy.max_distance_m={kind: uniform, low: 150, high: 250}"


def test_what_is_farthest_outside_is_told_by_the_limits_that_cases_draw(monkeypatch):
    """All come equally far: the one with the least limit is farthest outside, whatever the mission's own."""
    experiment = compose_experiment([*EVALUATE, "controller=coast", "safety=filter", LIMITED]).experiment
    cases = list(range(20))
    limits = [drawn(experiment.mission, start)[0][1] for start in evaluation_scenarios(experiment, cases)]

    def flown(mission, controller, scenarios, workers):
        same = np.full(len(scenarios), 200.0)
        return Outcomes(**dict.fromkeys((field.name for field in fields(Outcomes)), same))

    monkeypatch.setattr(comparisons, "fly_all", flown)
    monkeypatch.setattr(comparisons, "fly_logged", lambda mission, controller, start: mission.safety.kind)
    episodes = {"case": np.array(cases), "safety_periods": np.ones(20)}
    controller = load(experiment.controller, experiment.mission)
    without = comparisons.fly_without(experiment, controller, episodes)
    assert without.case == int(np.argmin(limits)) != 0
    assert (without.guarded, without.unguarded) == ("filter", "none")
