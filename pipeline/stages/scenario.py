"""Write the starts of all flights of the experiment: scenarios.csv."""

import csv
import io
from pathlib import Path

from pipeline.flight.cases.starts import evaluation_scenarios, training_scenarios
from pipeline.flight.state.log import Scenario
from pipeline.run import artifacts
from pipeline.settings.experiment import Experiment
from pipeline.settings.start_table import COLUMNS


def run(experiment: Experiment, folder: Path) -> None:
    """Draw and write the starts of each round of training and of the evaluation."""
    rounds = experiment.optimizer.rounds if experiment.starts.redraw else 1
    sets: dict[str, list[Scenario]] = {}
    if "train" in experiment.stages or experiment.telemetry.record_training:
        for index in range(rounds):
            sets[f"training-{index}"] = training_scenarios(
                experiment.starts, experiment.sun, experiment.seed, index
            )
    if "evaluate" in experiment.stages:
        sets["evaluation"] = evaluation_scenarios(experiment.monte_carlo, experiment.sun, experiment.seed)
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    for name, scenarios in sets.items():
        for case, start in enumerate(scenarios):
            writer.writerow(
                [
                    name,
                    case,
                    *start.position_m.tolist(),
                    *start.velocity_m_s.tolist(),
                    start.sun_angle_rad,
                    start.sun_elevation_rad,
                ]
            )
    artifacts.write_atomically(folder / artifacts.SCENARIOS, text.getvalue())
