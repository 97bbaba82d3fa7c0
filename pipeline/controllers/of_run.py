"""The controller of a run: its champion if it trained one, else the configured controller."""

from pathlib import Path

from fis_tools.formats import serialize
from pipeline.controllers import source
from pipeline.flight.control.controller import Controller, from_fuzzy
from pipeline.run import artifacts
from pipeline.settings.experiment import Experiment


def controller_of_run(experiment: Experiment, folder: Path) -> Controller:
    """Return the controller that a run's later stages fly.

    A fuzzy controller from a file is copied into the run's folder when it is first flown, so that later
    stages fly the same one even if the file changes.

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
