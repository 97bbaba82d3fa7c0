"""Write the starts of all flights of the experiment: scenarios.csv."""

from pathlib import Path
from typing import Any

from pipeline.flight.state.log import Scenario
from pipeline.run import artifacts, tables
from pipeline.scenarios import evaluation_scenarios, training_scenarios
from pipeline.settings.experiment import Experiment
from pipeline.settings.start_table import COLUMNS, EVALUATION, TRAINING


def run(experiment: Experiment, folder: Path) -> None:
    """Draw and write the starts of each round of training and of the evaluation."""
    rounds = experiment.optimizer.rounds if experiment.starts.is_redrawn else 1
    sets: dict[str, list[Scenario]] = {}
    if "train" in experiment.stages or experiment.telemetry.record_training:
        for index in range(rounds):
            sets[f"{TRAINING}{index}"] = training_scenarios(experiment, index)
    if "evaluate" in experiment.stages:
        sets[EVALUATION] = evaluation_scenarios(experiment)
    rows: list[list[Any]] = []
    for name, scenarios in sets.items():
        for case, at in enumerate(scenarios):
            suns = at.sun_angle_rad, at.sun_elevation_rad
            rows.append([name, case, *at.position_m.tolist(), *at.velocity_m_s.tolist(), *suns])
    tables.write_csv(folder / artifacts.SCENARIOS, COLUMNS, rows)
