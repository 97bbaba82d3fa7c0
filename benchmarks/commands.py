"""Durations of whole commands: Monte Carlo, start-up, and a full-size training."""

import os
import re
import subprocess
import sys
import tempfile
import time

from benchmarks.timing import best_wall_seconds, line
from pipeline.command_line.config import compose_experiment
from pipeline.controllers import source
from pipeline.evaluation.monte_carlo import fly_cases
from pipeline.flight.starts import evaluation_scenarios

PROCESSORS = os.cpu_count() or 1


def run_monte_carlo(controller: str) -> None:
    """Print the duration of the evaluation's flights."""
    experiment = compose_experiment(["+experiment=evaluate", f"controller={controller}"]).experiment
    flown = source.load(experiment.controller, experiment.mission)
    scenarios = evaluation_scenarios(experiment.monte_carlo, experiment.sun, experiment.seed)
    seconds = best_wall_seconds(lambda: fly_cases(experiment.mission, flown, scenarios, None))
    print(f"Monte Carlo: {len(scenarios)} cases of {controller}, trajectories kept, {PROCESSORS} threads")
    line("seconds", f"{seconds:.3f}")


def run_start() -> None:
    """Print the command's duration before its work begins, with compiled kernels."""
    with tempfile.TemporaryDirectory() as folder:
        command = [
            sys.executable, "-m", "pipeline", "+experiment=evaluate", "controller=paper",
            "monte_carlo.num_cases=1", "stages=[scenario,evaluate]", f"hydra.run.dir={folder}/run",
        ]  # fmt: skip
        seconds = best_wall_seconds(
            lambda: subprocess.run(command, check=True, capture_output=True),  # noqa: S603
            repeats=3,
        )
    print("Start: python -m pipeline with one flight to evaluate, start to end, kernels compiled before")
    line("seconds", f"{seconds:.2f}")


def run_training(generations: int | None) -> None:
    """Print the duration of a training on the paper's eight starts; 500 generations by default."""
    number = 500 if generations is None else generations
    with tempfile.TemporaryDirectory() as folder:
        command = [
            sys.executable, "-m", "pipeline", "+experiment=train", f"optimizer.generations={number}",
            "stages=[scenario,train]", f"hydra.run.dir={folder}/run",
        ]  # fmt: skip
        started = time.perf_counter()
        done = subprocess.run(command, check=True, capture_output=True, text=True)  # noqa: S603
        seconds = time.perf_counter() - started
    last = re.findall(r"fitness .*", done.stderr)[-1]
    print(f"Training: population 200, {number} generations, 8 starts, {PROCESSORS} threads, start to end")
    line("seconds", f"{seconds:.1f}")
    line("last line", last.split(", 0 s left")[0])
