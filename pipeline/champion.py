"""The controller that a run flies: its champion where it trained one, else the configured controller."""

from pathlib import Path

from fis_tools import serialize
from pipeline import artifacts, controller_source
from pipeline.controllers import Controller, from_fuzzy
from pipeline.settings import Experiment


def controller_of_run(experiment: Experiment, folder: Path) -> Controller:
    """Return what a run's later stages fly.

    Raises
    ------
    pipeline.artifacts.ArtifactError
        If the run trains but has no champion yet.
    """
    if "train" in experiment.stages or (folder / artifacts.CHAMPION).exists():
        return from_fuzzy(serialize.load(artifacts.require(folder, artifacts.CHAMPION)))
    return controller_source.load(experiment.controller, experiment.mission)
