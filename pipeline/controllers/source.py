"""Controllers from the configuration: written out, from a file of ours, from a table of forces, or planned.

Reading one executes nothing.
"""

import csv
import logging
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from fis_tools.formats import serialize
from pipeline.controllers.planned.planner import controller_of_kind
from pipeline.flight.controller import (
    Controller,
    ControllerError,
    coast,
    decision_stride,
    from_fuzzy,
    open_loop,
)
from pipeline.settings.controllers import PLANNED, check_controller, planned_settings
from pipeline.settings.experiment import Mission
from pipeline.settings.nearest import choices_of
from pipeline.settings.places import conf_folder

Floats = NDArray[np.float64]

CONTROLLER_SUFFIXES = (".json", ".yaml", ".yml")
#: options of the group ``controller`` that are complete with a path alone
WITH_PATHS = ("file", "open_loop")

COLUMNS = ("time_s", "force_x_n", "force_y_n", "force_z_n")

_LOG = logging.getLogger(__name__)


def load(source: Mapping[str, Any], mission: Mission) -> Controller:
    """Build the controller that the configuration describes.

    Parameters
    ----------
    source : mapping
        The group ``controller``: with ``systems``, ``path``, or ``kind``.
    mission : Mission
        Whose clock the decisions, or a table of forces, must keep.

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
        return open_loop(path.stem, read_forces(path, mission))
    return _in_time(from_fuzzy(serialize.load(path)), mission)


def _in_time(controller: Controller, mission: Mission) -> Controller:
    """Return a controller whose decisions keep the mission's clock."""
    decision_stride(controller, mission)
    return controller


def named(name: str, mission: Mission) -> Controller:
    """Return the controller of a name as in ``controller=NAME``, or of a path.

    Raises
    ------
    ControllerError, pipeline.settings.experiment.SettingError,
    fis_tools.formats.serialize.ControllerFileError
        If there is none, or it cannot be read or cannot fly.
    """
    suffix = Path(name).suffix.lower()
    if suffix == ".csv":
        return load({"kind": "open_loop", "path": name}, mission)
    if suffix in CONTROLLER_SUFFIXES:
        return load({"path": name}, mission)
    known = sorted(path.stem for path in (conf_folder() / "controller").glob("*.yaml"))
    known = [other for other in known if other not in WITH_PATHS]
    if name not in known:
        raise ControllerError(
            f"there is no controller {name}{choices_of(name, known, 'controllers')}; another is named by the "
            "path of its file, .json, .yaml or a .csv of forces"
        )
    path = conf_folder() / "controller" / f"{name}.yaml"
    source = yaml.safe_load(path.read_text(encoding="utf-8"))
    if "kind" not in source:
        return load({"path": str(path)}, mission)
    check_controller(source)
    return load(source, mission)


def read_forces(path: Path, mission: Mission) -> Floats:
    """Read a table of forces in Hill axes.

    A CSV file with the columns ``time_s, force_x_n, force_y_n, force_z_n`` and one row a control period, at
    its beginning; last rows may be missing. Components beyond the greatest force are clipped in flight; a
    warning says so.

    Returns
    -------
    (rows, 3) array
        In newtons.

    Raises
    ------
    ControllerError
        If the file cannot be read, or a time or a number is not what it must be.
    """
    try:
        with path.open(encoding="utf-8-sig", newline="") as stream:
            rows = list(csv.reader(stream))
    except (OSError, ValueError, csv.Error) as error:
        raise ControllerError(f"{path} cannot be read ({error}); give a CSV file of forces") from error
    if not rows or tuple(cell.strip() for cell in rows[0]) != COLUMNS:
        raise ControllerError(f"{path} does not begin with the header {','.join(COLUMNS)}; add it")
    table = np.array([_numbers(path, index, row) for index, row in enumerate(rows[1:], start=2) if row])
    table = table.reshape(-1, len(COLUMNS))
    if len(table) > mission.num_controls:
        raise ControllerError(
            f"{path} has {len(table)} rows, the flight {mission.num_controls} control periods; drop the last "
            "rows or lengthen duration_s"
        )
    expected = np.arange(len(table)) * mission.control_period_s
    wrong = np.flatnonzero(np.abs(table[:, 0] - expected) > 1e-6 * mission.control_period_s)
    if wrong.size:
        row = int(wrong[0])
        raise ControllerError(
            f"{path}: data row {row + 1} has time_s {table[row, 0]:g}, expected {expected[row]:g}; give one "
            f"row for each control period of {mission.control_period_s:g} s, from 0 on"
        )
    clipped = int(np.sum(np.abs(table[:, 1:]) > mission.deputy.max_force_n))
    if clipped:
        _LOG.warning("%s: %d components beyond %g N are clipped", path, clipped, mission.deputy.max_force_n)
    return table[:, 1:].copy()


def _numbers(path: Path, line: int, cells: list[str]) -> list[float]:
    """Read one row."""
    try:
        numbers = [float(cell) for cell in cells]
    except ValueError as error:
        raise ControllerError(f"{path}: line {line} is {','.join(cells)!r}; write four numbers") from error
    if len(numbers) != len(COLUMNS) or not all(math.isfinite(number) for number in numbers):
        raise ControllerError(f"{path}: line {line} is {','.join(cells)!r}; write four finite numbers")
    return numbers
