"""A flight from elsewhere, played from a table: forces, and attitudes or torques.

A CSV file with one row per control period, from the first one on; last rows may be missing. Its first column
is ``time_s``; the others are any of these groups, complete and at most once, but only one of the first two
and one of the last two:

- ``force_x_n, force_y_n, force_z_n``: forces along Hill axes;
- ``force_body_x_n, force_body_y_n, force_body_z_n``: along body axes;
- ``torque_x_n_m, torque_y_n_m, torque_z_n_m``: about body axes, instead of the attitude law's;
- ``q1, q2, q3, q4``: attitudes from Hill to body axes, scalar last, that the attitude law seeks.
"""

import csv
import logging
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.array_types import Floats
from pipeline.flight.control.controller import ControllerError, OpenLoopController, open_loop
from pipeline.flight.state.arrays import Turns
from pipeline.settings.experiment import Mission
from plain_files.file_access import open_text

TIME = "time_s"
HILL_FORCES = ("force_x_n", "force_y_n", "force_z_n")
BODY_FORCES = ("force_body_x_n", "force_body_y_n", "force_body_z_n")
TORQUES = ("torque_x_n_m", "torque_y_n_m", "torque_z_n_m")
ATTITUDES = ("q1", "q2", "q3", "q4")
#: groups of which a table has at most one each
CHOICES = ((HILL_FORCES, BODY_FORCES), (TORQUES, ATTITUDES))
#: the columns of a table of forces alone
COLUMNS = (TIME, *HILL_FORCES)
#: of a file: a column of the longest flight takes 2 MB
MOST_BYTES = 64 * 1024**2
#: tolerance for the length of an attitude quaternion, which is then normalised
LENGTH_TOLERANCE = 1e-3

_LOG = logging.getLogger(__name__)


def read_played(path: Path, mission: Mission) -> OpenLoopController:
    """Read a flight to play.

    Forces and torques beyond the limits are clipped in flight; a warning says so.

    Raises
    ------
    ControllerError
        If the file cannot be read, or a column, a time or a number is invalid.
    """
    try:
        with open_text(path, MOST_BYTES, "utf-8-sig") as stream:
            rows = list(csv.reader(stream))
    except (OSError, ValueError, csv.Error) as error:
        raise ControllerError(f"{path} cannot be read ({error}); give a CSV file of forces") from error
    names = tuple(cell.strip() for cell in rows[0]) if rows else ()
    _check_header(path, names)
    table = np.array([_numbers(path, index, row, names) for index, row in enumerate(rows[1:], 2) if row])
    table = table.reshape(-1, len(names))
    _check_times(path, table[:, 0], mission)
    values = {name: table[:, column] for column, name in enumerate(names)}

    def group(columns: tuple[str, ...]) -> Floats:
        chosen = [values[name] for name in columns if name in values]
        return np.column_stack(chosen) if chosen else np.zeros((0, len(columns)))

    is_body = BODY_FORCES[0] in values
    forces = group(BODY_FORCES if is_body else HILL_FORCES)
    turns = Turns(_unit(path, group(ATTITUDES)), group(TORQUES))
    if len(turns.torques) and mission.attitude.mode != "flown":
        raise ControllerError(
            f"{path} has torques, but attitude.mode is {mission.attitude.mode}, in which nothing turns the "
            "deputy; choose attitude=flown, or leave them out"
        )
    deputy = mission.deputy
    clips = (forces, deputy.max_force_n, "N"), (turns.torques, deputy.max_torque_n_m, "N m")
    for numbers, most, unit in clips:
        clipped = int(np.sum(np.abs(numbers) > most))
        if clipped:
            _LOG.warning("%s: %d components beyond %g %s are clipped", path, clipped, most, unit)
    return open_loop(path.stem, forces, "body" if is_body else "hill", turns)


def to_mapping(controller: OpenLoopController) -> dict[str, Any]:
    """Return a flight to play as plain data, which `from_mapping` reads."""
    return {
        "kind": "open_loop",
        "name": controller.name,
        "force_axes": controller.force_axes,
        "forces_n": np.asarray(controller.plan).tolist(),
        "attitudes": controller.turns.attitudes.tolist(),
        "torques_n_m": controller.turns.torques.tolist(),
    }


def from_mapping(entries: Mapping[str, Any]) -> OpenLoopController:
    """Return the flight to play from the data of `to_mapping`.

    Raises
    ------
    ControllerError
        If the data have another form.
    """
    try:
        forces, attitudes, torques = (
            np.array(entries[key], dtype=np.float64).reshape(-1, width)
            for key, width in (("forces_n", 3), ("attitudes", 4), ("torques_n_m", 3))
        )
    except (KeyError, TypeError, ValueError) as error:
        raise ControllerError(f"what was played is not given as numbers ({error})") from error
    axes = "body" if entries.get("force_axes") == "body" else "hill"
    return open_loop(str(entries.get("name")), forces, axes, Turns(attitudes, torques))


def _check_header(path: Path, names: tuple[str, ...]) -> None:
    """Raise ControllerError for incomplete, conflicting or repeated groups of columns."""
    if names[:1] != (TIME,) or len(names) == 1:
        raise ControllerError(f"{path} does not begin with the header {','.join(COLUMNS)}; add it")
    left = list(names[1:])
    for choice in CHOICES:
        present = [group for group in choice if any(name in left for name in group)]
        if len(present) > 1:
            raise ControllerError(
                f"{path} has both {present[0][0]} and {present[1][0]}; keep one of the two groups"
            )
        for name in present[0] if present else ():
            if left.count(name) != 1:
                raise ControllerError(f"{path} has {left.count(name)} columns {name}; give it one")
            left.remove(name)
    if left:
        known = "; ".join(", ".join(group) for choice in CHOICES for group in choice)
        raise ControllerError(f"{path} has a column {left[0]!r}; besides {TIME} the columns are {known}")


def _numbers(path: Path, line: int, cells: list[str], names: tuple[str, ...]) -> list[float]:
    """Read one row."""
    try:
        numbers = [float(cell) for cell in cells]
    except ValueError:
        numbers = []
    if len(numbers) != len(names) or not all(math.isfinite(number) for number in numbers):
        raise ControllerError(
            f"{path}: line {line} is {','.join(cells)!r}; write {len(names)} finite numbers"
        )
    return numbers


def _check_times(path: Path, times: Floats, mission: Mission) -> None:
    """Raise ControllerError for rows that do not match the mission's clock."""
    if len(times) > mission.num_controls:
        raise ControllerError(
            f"{path} has {len(times)} rows, the flight {mission.num_controls} control periods; drop the last "
            "rows or lengthen duration_s"
        )
    expected = np.arange(len(times)) * mission.control_period_s
    wrong = np.flatnonzero(np.abs(times - expected) > 1e-6 * mission.control_period_s)
    if wrong.size:
        row = int(wrong[0])
        raise ControllerError(
            f"{path}: data row {row + 1} has time_s {times[row]:g}, expected {expected[row]:g}; give one "
            f"row for each control period of {mission.control_period_s:g} s, from 0 on"
        )


def _unit(path: Path, attitudes: Floats) -> Floats:
    """Return attitudes of unit length, or raise ControllerError for those that are far from it."""
    lengths = np.linalg.norm(attitudes, axis=1, keepdims=True)
    wrong = np.flatnonzero(np.abs(lengths - 1.0) > LENGTH_TOLERANCE)
    if wrong.size:
        row = int(wrong[0])
        raise ControllerError(
            f"{path}: data row {row + 1} has an attitude of length {lengths[row, 0]:.6g}; it must be 1: "
            "divide q1, q2, q3 and q4 by it"
        )
    return np.asarray(attitudes / lengths)
