"""What every case draws alike counts as what is set: in flights, and in all that is told of them."""

from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np
import pytest

from pipeline.command_line.config import compose_experiment
from pipeline.controllers.source import load
from pipeline.evaluation.assurance.quantities import facts_of_flown, of_tracks
from pipeline.evaluation.fitting import tally_of
from pipeline.evaluation.monte_carlo import episode_columns, fly_followed, fly_tracked
from pipeline.scenarios import evaluation_scenarios
from pipeline.settings.checks import SettingError
from pipeline.settings.experiment import Experiment

pytestmark = pytest.mark.slow

MISSIONS = (
    ("controller=champion_27_parking", "duration_s=1500"),
    ("controller=champion_leo", "world=leo", "duration_s=1200"),
    ("controller=champion_docking", "problem=docking"),
)
FEW = ("+experiment=evaluate", "monte_carlo.num_cases=8")


def keys(node: Any, prefix: str = "") -> Iterator[tuple[str, float]]:
    """Every number of a mission that is not zero, which a case may draw unless the mission refuses it."""
    for field in fields(node):
        value = getattr(node, field.name)
        if is_dataclass(value):
            yield from keys(value, f"{prefix}{field.name}.")
        elif type(value) is float and value != 0.0:
            yield f"{prefix}{field.name}", value


def pair(words: tuple[str, ...], key: str, value: float) -> list[Experiment]:
    """Experiments in which a setting is set, and drawn from next to nothing; none where it may not be."""
    low, high = sorted((0.8 * value, 0.8 * value * (1 + 1e-10)))
    drawn = f"+dispersions.{key}={{kind:uniform,low:{low!r},high:{high!r}}}"
    try:
        return [compose_experiment([*FEW, *words, word]).experiment for word in (f"{key}={low!r}", drawn)]
    except SettingError:
        return []


def judged(experiment: Experiment) -> dict[str, Any]:
    """Return the columns of an evaluation, and how near and far flights of an inspection coast."""
    mission, scenarios = experiment.mission, evaluation_scenarios(experiment)
    controller = load(experiment.controller, mission)
    columns = episode_columns(mission, scenarios, *fly_followed(mission, controller, scenarios, 1))
    if mission.problem.kind == "reach":
        return columns
    outcomes, tracks = fly_tracked(mission, controller, scenarios, 1)
    facts = facts_of_flown(mission, scenarios, outcomes.inspectable_count)
    return columns | of_tracks(tracks, facts, ("coasting_distance", "coasting_farthest"))


@pytest.mark.parametrize("words", MISSIONS, ids=" ".join)
def test_what_is_drawn_alike_counts_as_what_is_set(words):
    mission = compose_experiment([*FEW, *words]).experiment.mission
    both = {key: pair(words, key, value) for key, value in keys(mission)}
    compared = {key: experiments for key, experiments in both.items() if experiments}
    assert len(compared) > 5
    for key, (given, drawn) in compared.items():
        expected, columns = judged(given), judged(drawn)
        assert columns.keys() == expected.keys() | {key}
        for name, values in expected.items():
            np.testing.assert_allclose(columns[name], values, 1e-4, 1e-5, err_msg=f"{key}: {name}")


def test_a_fit_counts_what_reaches_the_threshold_that_is_drawn():
    tallies = []
    for experiment in pair(MISSIONS[0], "inspection_threshold_percent", 50.0):
        fuzzy = load(experiment.controller, experiment.mission).fuzzy
        tallies.append(tally_of(experiment.mission, fuzzy, evaluation_scenarios(experiment), 95.0, 1))
    given, drawn = tallies
    assert drawn == given
    assert given.success.count > 0
