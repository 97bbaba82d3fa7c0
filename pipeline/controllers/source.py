"""Controllers from the configuration: written out, from a file, from a table of forces, learned, or planned.

Reading one executes no code from it.
"""

import hashlib
from collections.abc import Mapping
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

from fis_tools.formats import serialize
from pipeline.controllers.played import read_played
from pipeline.controllers.policies import read_policy
from pipeline.flight.control.controller import Controller, ControllerError, PilotController, coast, from_fuzzy
from pipeline.flight.control.law import decision_stride
from pipeline.flight.state.descriptions import with_descriptions
from pipeline.run import artifacts, configuration, writing
from pipeline.settings.controllers import PLANNED, Planned, check_controller
from pipeline.settings.experiment import Experiment, Mission
from pipeline.settings.keys import choices_of
from pipeline.settings.places import conf_folder
from plain_files.file_access import read_shipped

#: endings of files, to what the group ``controller`` says of them besides the path
FILES: Mapping[str, Mapping[str, str]] = {
    ".csv": {"kind": "open_loop"},
    ".onnx": {"kind": "policy"},
    **{suffix: {} for suffix in (".json", ".yaml", ".yml")},
}
#: options of the group ``controller`` that need only a path
WITH_PATHS = ("file", "open_loop", "policy")


def load(source: Mapping[str, Any], mission: Mission) -> Controller:
    """Build the controller that the configuration describes.

    Parameters
    ----------
    source : mapping
        The group ``controller``: with ``systems``, ``path``, or ``kind``. ``attributes`` beside the path of a
        fuzzy controller take the place of its own.
    mission : Mission
        Its clock must fit the decisions, or a table to play.

    Returns
    -------
    Controller

    Raises
    ------
    ControllerError, pipeline.settings.experiment.SettingError,
    fis_tools.formats.serialize.ControllerFileError
        If it cannot be read or cannot fly.
    """
    kind = "" if "systems" in source else source.get("kind", "")
    if kind == "coast":
        return coast()
    if kind in PLANNED:
        # what flies fleets refuses by its name what plans for one deputy
        return controller_of_kind(kind, Planned(**source), mission.of_each)
    if kind == "open_loop":
        return read_played(Path(str(source["path"])), mission)
    if kind == "policy":
        return read_policy(Path(str(source["path"])))
    if "systems" in source:
        fuzzy = serialize.from_mapping(source)
    else:
        fuzzy = serialize.load(Path(str(source["path"])))
        given = {name: str(value) for name, value in source.get("attributes", {}).items()}
        attributes = tuple(sorted((dict(fuzzy.attributes) | given).items()))
        fuzzy = serialize.checked(replace(fuzzy, attributes=attributes))
    controller = from_fuzzy(with_descriptions(fuzzy))
    decision_stride(controller, mission)  # its decisions must fit the mission's clock
    return controller


def named(name: str, mission: Mission) -> Controller:
    """Return the controller with a name as in ``controller=NAME``, or from a path.

    Raises
    ------
    ControllerError, pipeline.settings.experiment.SettingError,
    fis_tools.formats.serialize.ControllerFileError
        If there is none, or it cannot be read or cannot fly.
    """
    suffix = Path(name).suffix.lower()
    if suffix in FILES:
        return load({**FILES[suffix], "path": name}, mission)
    known = sorted(path.stem for path in (conf_folder() / "controller").glob("*.yaml"))
    known = [other for other in known if other not in WITH_PATHS]
    if name not in known:
        raise ControllerError(
            f"there is no controller {name}{choices_of(name, known, 'controllers')}; another is named by the "
            "path of its file, .json, .yaml, .onnx or a .csv of forces"
        )
    path = conf_folder() / "controller" / f"{name}.yaml"
    source = configuration.parse(read_shipped(path).encode())
    if "kind" not in source:
        return load({"path": str(path)}, mission)
    check_controller(source)
    return load(source, mission)


def controller_of_run(experiment: Experiment, folder: Path) -> Controller:
    """Return the controller that a run's later stages fly.

    A fuzzy controller from a file is copied into the run's folder when it is first flown, so that later
    stages fly the same one even if the file changes.

    Raises
    ------
    pipeline.run.artifacts.ArtifactError
        If the run trains but has no champion yet.
    """
    if {"fit", "train"} & set(experiment.stages) or (folder / artifacts.CHAMPION).exists():
        champion = serialize.load(artifacts.require(folder, artifacts.CHAMPION))
        return from_fuzzy(with_descriptions(champion))
    kept = folder / artifacts.CONTROLLER
    if kept.exists():
        return from_fuzzy(with_descriptions(serialize.load(kept)))
    controller = load(experiment.controller, experiment.mission)
    if controller.fuzzy is not None and "path" in experiment.controller:
        writing.write_atomically(kept, serialize.dump_json(controller.fuzzy) + "\n")
    return controller


def sha256_of(controller: Controller) -> str | None:
    """Return the hash of a fuzzy controller's text or of a policy's file; None for others."""
    if isinstance(controller, PilotController):
        return hashlib.sha256(controller.pilot.source).hexdigest()
    return serialize.fingerprint(controller.fuzzy) if controller.fuzzy else None


def require_kept(experiment: Experiment, folder: Path) -> None:
    """Raise ControllerError if the controller's file has changed since a run's folder kept a copy.

    Raises
    ------
    ControllerError, fis_tools.formats.serialize.ControllerFileError
    """
    kept = folder / artifacts.CONTROLLER
    if not kept.exists():
        return
    configured = load(experiment.controller, experiment.mission).fuzzy
    if configured != with_descriptions(serialize.load(kept)):
        raise ControllerError(
            f"{experiment.controller.get('path')} has changed since {kept}, which this run flies, was copied "
            "from it; restore it, or start a new run"
        )


def controller_of_kind(kind: str, settings: Planned, mission: Mission) -> Controller:
    """Return the controller of a planning kind, made by the module that has its name.

    The module is imported on request: two of them need scipy, which takes longer to import than a flight
    takes.

    Raises
    ------
    SettingError
        If the settings do not fit the mission.
    """
    return import_module(f"pipeline.controllers.planned.{kind}").controller(settings, mission)
