"""Train from a controller that flies, and compare what is handed back: ``python -m benchmarks never_worse``.

Small trainings by an evolution strategy, a genetic algorithm and a front, with steps from small to absurd.
Each begins with a controller of `KINDS`; it and what is handed back fly starts that no training has seen. A
row tells how often the second succeeds where the first fails, and the other way, with the p of the exact sign
test; worse is what that test tells from chance at one in a thousand.
"""

import argparse
import tempfile
from collections.abc import Sequence
from contextlib import redirect_stderr
from io import StringIO
from pathlib import Path

import numpy as np
from scipy.stats import binomtest

from pipeline.command_line.config import compose_experiment
from pipeline.controllers import source
from pipeline.flight.goals.flights import fly_all
from pipeline.run import artifacts, configuration
from pipeline.scenarios import evaluation_scenarios
from pipeline.stages import train

#: optimizers, and the controllers that they begin with
KINDS = {"tour": "champion_27", "rules": "paper_champion", "front": "champion_27"}
STEPS = (0.01, 0.1, 1.0)
#: of a training that takes a second
SMALL = ("population_size=16", "generations=4", "rounds=1", "validation_cases=200")
#: chance by which one that is no worse is called so
RISK = 0.001


def trained(optimizer: str, step: float, seed: int, num_cases: int) -> tuple[int, int, bool]:
    """Return how many flights only the trained controller, and only the given one, succeeds in.

    The last tells whether the training says that it has improved on it.
    """
    words = ["+experiment=train_readable_late", f"controller={KINDS[optimizer]}", f"optimizer={optimizer}"]
    words += [f"optimizer.{setting}" for setting in SMALL]
    words += [f"optimizer.initial_step={step}", f"seed={seed}", "starts.num_cases=32", "stages=[train]"]
    job = compose_experiment([*words, "optimizer.workers=1"])
    mission = job.experiment.mission
    with tempfile.TemporaryDirectory() as name, redirect_stderr(StringIO()):
        folder = Path(name)
        configuration.write(folder, job.config)
        is_improved = train.run(job.experiment, folder) is None
        controllers = (job.experiment.controller, {"path": str(folder / artifacts.CHAMPION)})
        given, after = (source.load(controller, mission) for controller in controllers)
    starts = evaluation_scenarios(job.experiment, range(num_cases))
    succeeds = [
        fly_all(mission, controller, starts, 1).is_success(mission.inspection_threshold_percent)
        for controller in (given, after)
    ]
    return int(np.sum(succeeds[1] & ~succeeds[0])), int(np.sum(succeeds[0] & ~succeeds[1])), is_improved


def main(given: Sequence[str]) -> int:
    """Print a row for each training, and the number that handed back worse."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks never_worse", description=__doc__)
    parser.add_argument("--seeds", type=int, default=20, help="trainings of each kind; 20 unless given")
    parser.add_argument("--cases", type=int, default=1000, help="unseen starts; 1000 unless given")
    options = parser.parse_args(given)
    num_worse = num_trained = 0
    for seed in range(1, options.seeds + 1):
        for optimizer in KINDS:
            for step in STEPS:
                better, worse, is_improved = trained(optimizer, step, seed, options.cases)
                chance = binomtest(worse, better + worse).pvalue if better + worse else 1.0
                is_worse = worse > better and chance < RISK
                num_worse, num_trained = num_worse + is_worse, num_trained + 1
                words = "improved" if is_improved else "given handed back"
                row = f"{optimizer:6} step {step:<5g} seed {seed:<3d} +{better} -{worse} p {chance:.2g}"
                print(f"{row} {words}{'  WORSE' if is_worse else ''}", flush=True)
    print(f"{num_trained} trainings, {num_worse} handed back worse than they were given")
    return 1 if num_worse else 0
