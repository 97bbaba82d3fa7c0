"""The controller that a run flies: its champion where it trained one, else the configured controller."""

from pathlib import Path

from fis_tools.formats import serialize
from pipeline.controllers import source
from pipeline.flight.controller import Controller, from_fuzzy
from pipeline.run import artifacts
from pipeline.settings.experiment import Experiment


def controller_of_run(experiment: Experiment, folder: Path) -> Controller:
    """Return what a run's later stages fly.

    A fuzzy controller from a file is kept in the run's folder when it is first flown, so that later stages
    fly the same one whatever becomes of the file.

    Raises
    ------
    pipeline.run.artifacts.ArtifactError
        If the run trains but has no champion yet.
    """
    if "train" in experiment.stages or (folder / artifacts.CHAMPION).exists():
        return from_fuzzy(serialize.load(artifacts.require(folder, artifacts.CHAMPION)))
    kept = folder / artifacts.CONTROLLER
    if kept.exists():
        return from_fuzzy(serialize.load(kept))
    controller = source.load(experiment.controller, experiment.mission)
    if controller.fuzzy is not None and "path" in experiment.controller:
        artifacts.write_atomically(kept, serialize.dump_json(controller.fuzzy) + "\n")
    return controller
