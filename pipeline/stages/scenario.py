"""Write the starts of the experiment's flights: scenarios.csv."""

import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from pipeline.flight.state.log import Scenario
from pipeline.run import artifacts, tables
from pipeline.run.progress import Progress
from pipeline.scenarios import evaluation_scenarios, training_scenarios
from pipeline.settings.experiment import Experiment
from pipeline.settings.sizes import MOST_LISTED
from pipeline.settings.start_table import COLUMNS, EVALUATION, OF_FLEETS, TRAINING

#: starts that are drawn between two lines of progress
BLOCK = 5000


def run(experiment: Experiment, folder: Path) -> None:
    """Draw and write the starts of each round of training and of the evaluation.

    Those of an evaluation with more than `MOST_LISTED` cases are drawn only where they are flown.
    """
    num_cases = len(experiment.monte_carlo.cases) if "evaluate" in experiment.stages else 0
    has_training = "train" in experiment.stages or experiment.telemetry.record_training
    if num_cases > MOST_LISTED:
        sys.stderr.write(
            f"  the {num_cases:,} starts of the evaluation are drawn where they are flown, and kept in "
            f"{artifacts.EPISODES}; {artifacts.SCENARIOS} lists at most {MOST_LISTED:,}\n"
        )
        if not has_training:
            (folder / artifacts.SCENARIOS).unlink(missing_ok=True)
            return
    is_listed = 0 < num_cases <= MOST_LISTED
    columns = OF_FLEETS if experiment.mission.has_fleet else COLUMNS
    tables.write_csv(folder / artifacts.SCENARIOS, columns, _rows(experiment, has_training, is_listed))


def _rows(experiment: Experiment, has_training: bool, is_listed: bool) -> Iterator[list[Any]]:
    """Yield the rows of training, then those of the evaluation, drawn as they are asked for."""
    rounds = experiment.optimizer.rounds if experiment.starts.is_redrawn else 1
    for index in range(rounds if has_training else 0):
        yield from _rows_of(f"{TRAINING}{index}", 0, training_scenarios(experiment, index))
    if not is_listed:
        return
    cases = experiment.monte_carlo.cases
    with Progress("start:", len(cases), 0) as progress:
        for begin in range(0, len(cases), BLOCK):
            block = cases[begin : begin + BLOCK]
            yield from _rows_of(EVALUATION, block[0], evaluation_scenarios(experiment, block))
            if len(cases) > BLOCK:
                progress.show(begin + len(block))


def _rows_of(name: str, first: int, scenarios: Sequence[Scenario]) -> Iterator[list[Any]]:
    """Yield the rows of some cases of a set, from a first one; of fleets a row each deputy, from 1."""
    for case, scenario in enumerate(scenarios, first):
        for deputy, at in enumerate(scenario.fleet, 1):
            labels = [name, case, deputy] if scenario.others else [name, case]
            suns = at.sun_angle_rad, at.sun_elevation_rad
            yield [*labels, *at.position_m.tolist(), *at.velocity_m_s.tolist(), *suns]
