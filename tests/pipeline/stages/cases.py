"""Runs in miniature, stage by stage."""

from functools import cache
from pathlib import Path

from pipeline.command_line.config import Job, compose_experiment
from pipeline.run import configuration
from pipeline.run.runner import run_stages
from tests.state import unchanged

MINIATURE = ("monte_carlo.num_cases=5", "monte_carlo.workers=1", "duration_s=300.0")
MINIATURE += ("optimizer.population_size=6", "optimizer.generations=3", "optimizer.workers=1")


@cache
def composed(*overrides: str, experiment: str = "train_paper") -> Job:
    return compose_experiment([f"+experiment={experiment}", *MINIATURE, *overrides])


def prepared(folder: Path, *overrides: str, experiment: str = "train_paper") -> Job:
    """A run's folder as the stages find it, and what they are to do there."""
    run = composed(*overrides, experiment=experiment)
    configuration.write(folder, run.config)
    return run


def carried_out(run: Job, folder: Path, *stages: str) -> Job:
    """Run stages in a folder, by default all; return what was to be done."""
    with unchanged():
        run_stages(run.experiment, run.config, folder, stages or None)
    return run
