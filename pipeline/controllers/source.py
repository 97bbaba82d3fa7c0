"""Controllers from the configuration: written out, from a file, from a table of forces, learned, or planned.

Reading one executes no code from it.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from fis_tools.formats import serialize
from pipeline.controllers.planned.planner import controller_of_kind
from pipeline.controllers.played import read_played
from pipeline.controllers.policies import read_policy
from pipeline.flight.control.controller import Controller, ControllerError, coast, decision_stride, from_fuzzy
from pipeline.run.artifacts import parse_config
from pipeline.settings.controllers import PLANNED, check_controller, planned_settings
from pipeline.settings.experiment import Mission
from pipeline.settings.keys import choices_of
from pipeline.settings.places import conf_folder

CONTROLLER_SUFFIXES = (".json", ".yaml", ".yml")
#: options of the group ``controller`` that need only a path
WITH_PATHS = ("file", "open_loop", "policy")


def load(source: Mapping[str, Any], mission: Mission) -> Controller:
    """Build the controller that the configuration describes.

    Parameters
    ----------
    source : mapping
        The group ``controller``: with ``systems``, ``path``, or ``kind``.
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
    if "systems" in source:
        return _in_time(from_fuzzy(serialize.from_mapping(source)), mission)
    if source.get("kind") == "coast":
        return coast()
    if source.get("kind") in PLANNED:
        return controller_of_kind(source["kind"], planned_settings(source), mission)
    path = Path(str(source["path"]))
    if source.get("kind") == "open_loop":
        return read_played(path, mission)
    if source.get("kind") == "policy":
        return read_policy(path)
    return _in_time(from_fuzzy(serialize.load(path)), mission)


def _in_time(controller: Controller, mission: Mission) -> Controller:
    """Return a controller after checking that its decisions fit the mission's clock."""
    decision_stride(controller, mission)
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
    if suffix == ".csv":
        return load({"kind": "open_loop", "path": name}, mission)
    if suffix == ".onnx":
        return load({"kind": "policy", "path": name}, mission)
    if suffix in CONTROLLER_SUFFIXES:
        return load({"path": name}, mission)
    known = sorted(path.stem for path in (conf_folder() / "controller").glob("*.yaml"))
    known = [other for other in known if other not in WITH_PATHS]
    if name not in known:
        raise ControllerError(
            f"there is no controller {name}{choices_of(name, known, 'controllers')}; another is named by the "
            "path of its file, .json, .yaml, .onnx or a .csv of forces"
        )
    path = conf_folder() / "controller" / f"{name}.yaml"
    source = parse_config(path.read_bytes())
    if "kind" not in source:
        return load({"path": str(path)}, mission)
    check_controller(source)
    return load(source, mission)
