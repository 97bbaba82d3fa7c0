"""Durations of Monte Carlo, and of a full-size training."""

import os
import re
import subprocess
import sys
import tempfile
import time
from dataclasses import replace

from benchmarks.timing import best_wall_seconds, line
from pipeline.command_line.config import compose_experiment
from pipeline.controllers import source
from pipeline.evaluation.monte_carlo import fly_cases
from pipeline.flight.state.log import Scenario
from pipeline.scenarios import evaluation_scenarios

PROCESSORS = os.cpu_count() or 1
NUM_CASES, TURNS = (1_000, 10_000), 4


def run_monte_carlo(controller: str) -> None:
    """Print how long the evaluation's flights take on one thread and on all, measured by turns."""
    experiment = compose_experiment(["+experiment=evaluate", f"controller={controller}"]).experiment
    flown = source.load(experiment.controller, experiment.mission)

    def flying(scenarios: list[Scenario], workers: int) -> float:
        return best_wall_seconds(lambda: fly_cases(experiment.mission, flown, scenarios, workers), repeats=3)

    for num_cases in NUM_CASES:
        cases = replace(experiment.monte_carlo, num_cases=num_cases)
        scenarios = evaluation_scenarios(replace(experiment, monte_carlo=cases))
        times = [(flying(scenarios, 1), flying(scenarios, PROCESSORS)) for _ in range(TURNS)]
        single, many = (min(column) for column in zip(*times, strict=True))
        print(f"Monte Carlo: {num_cases:,} cases of {controller}, trajectories kept")
        line("seconds, one thread", f"{single:.3f}")
        line(f"seconds, {PROCESSORS} threads", f"{many:.3f}, {single / many:.2f} times as fast")


def run_training(generations: int | None) -> None:
    """Print the duration of a training on the paper's eight starts; 500 generations by default."""
    number = 500 if generations is None else generations
    with tempfile.TemporaryDirectory() as folder:
        command = [
            sys.executable, "-m", "pipeline", "+experiment=train_paper", f"optimizer.generations={number}",
            "stages=[scenario,train]", f"hydra.run.dir={folder}/run",
        ]  # fmt: skip
        started = time.perf_counter()
        done = subprocess.run(command, check=True, capture_output=True, text=True)  # noqa: S603
        seconds = time.perf_counter() - started
    last = re.findall(r"fitness .*", done.stderr)[-1]
    print(f"Training: population 200, {number} generations, 8 starts, {PROCESSORS} threads, start to end")
    line("seconds", f"{seconds:.1f}")
    line("last line", last.split(", 0 s left")[0])
