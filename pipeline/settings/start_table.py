"""Starts as a table: CSV text with the columns of ``scenarios.csv``.

A file of starts becomes part of the configuration, so that a run, its recordings and a resumed run have
the same starts even if the file changes. Of fleets it has a row for each deputy, those of a case in order.
"""

import csv
import io
import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline.settings.checks import SettingError
from pipeline.settings.keys import did_you_mean
from plain_files.file_access import read_text

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

#: columns of ``scenarios.csv``: the set of flights, the index in it, and the start itself
LABELS = ("set", "case")
#: of fleets, after these: the deputy's number, from 1
DEPUTY = "deputy"
POSITION = tuple(f"position_{axis}_m" for axis in "xyz")
VELOCITY = tuple(f"velocity_{axis}_m_s" for axis in "xyz")
SUN = ("sun_angle_rad", "sun_elevation_rad")
COLUMNS = (*LABELS, *POSITION, *VELOCITY, *SUN)
OF_FLEETS = (*LABELS, DEPUTY, *POSITION, *VELOCITY, *SUN)
#: required columns: by default starts are at rest, and the Sun is in the orbit plane
NEEDED = (*POSITION, "sun_angle_rad")
#: prefixes of the sets of training and of an evaluation
TRAINING, EVALUATION = "training-", "evaluation"


def split(text: str, key: str) -> tuple[str, str]:
    """Split a table of starts into one for training and one for the evaluation.

    These are the rows whose ``set`` begins with ``training-`` and ``evaluation``; if there are none for one
    of the two, it gets all rows.

    Raises
    ------
    SettingError
        If it is not a table; the message names the key.
    """
    columns = _columns(text, key)
    cases = columns.pop("case", None)
    labels = columns.pop("set", None) or [""] * len(columns[NEEDED[0]])
    _check_cases(labels, cases or (), columns.get(DEPUTY, ("1",) * len(labels)), key)

    def table(begin: str) -> str:
        rows = list(zip(*columns.values(), strict=True))
        chosen = [row for row, label in zip(rows, labels, strict=True) if label.startswith(begin)] or rows
        return "".join(f"{','.join(row)}\n" for row in [columns, *chosen])

    made = table(TRAINING), table(EVALUATION)
    for table_text in made:
        numbers(table_text, key)
    return made


def _check_cases(labels: Sequence[str], cases: Sequence[str], deputies: Sequence[str], key: str) -> None:
    """Raise SettingError unless the cases of each set, where given, are numbered 0, 1, 2, … in order."""
    counts: Counter[str] = Counter()
    for number, (label, case, deputy) in enumerate(zip(labels, cases, deputies, strict=False), 1):
        counts[label] += deputy == "1"
        if case != str(counts[label] - 1):
            raise SettingError(
                f"{key}: row {number} is case {case!r}, but would be flown as case {counts[label] - 1}, with "
                "the errors and settings that this one draws; drop the column, or give all cases from 0"
            )


def numbers(text: str, key: str) -> Mapping[str, "NDArray[np.float64]"]:
    """Return the columns of a table without labels, each of shape (n,).

    Raises
    ------
    SettingError
        If a column is unknown or missing, or a cell is not a number.
    """
    import numpy as np  # noqa: PLC0415 - most runs have no table, and check their settings without it

    columns = _columns(text, key)
    for name, cells in columns.items():
        for row, cell in enumerate(cells, 1):
            with suppress(ValueError):
                if math.isfinite(float(cell)):
                    continue
            raise SettingError(f"{key}: row {row} has {name} {cell!r}; write a finite number")
    read = {name: np.array(list(map(float, cells))) for name, cells in columns.items()}
    _check_deputies(read, key)
    return read


def _check_deputies(columns: Mapping[str, "NDArray[np.float64]"], key: str) -> None:
    """Raise SettingError unless the deputies of each case stand in order, under one Sun."""
    if DEPUTY not in columns:
        return
    given = columns[DEPUTY].tolist()
    deputies = int(max(given))
    suns = list(zip(*(columns[name].tolist() for name in SUN if name in columns), strict=True))
    for row, (deputy, sun) in enumerate(zip(given, suns, strict=True)):
        first = row - row % deputies
        if deputy != row - first + 1:
            raise SettingError(
                f"{key}: row {row + 1} is of deputy {deputy:g}, and deputy {row - first + 1} of {deputies} "
                "is due; give the deputies of each case in order, each case as many"
            )
        if sun != suns[first]:
            raise SettingError(
                f"{key}: row {row + 1} has another Sun than row {first + 1}, of the same case; give all "
                "deputies of a case one Sun"
            )
    if len(given) % deputies:
        raise SettingError(
            f"{key}: the last case has {len(given) % deputies} of {deputies} deputies; give each case as many"
        )


def num_deputies(text: str) -> int:
    """Return how many deputies start in each case of a table."""
    if DEPUTY not in text.partition("\n")[0]:  # a long table is not read for nothing
        return 1
    return int(max(numbers(text, "the table of starts")[DEPUTY]))


def read_starts(config: dict[str, Any]) -> None:
    """Load the starts that a configuration names as a file into it, unless it has them.

    Raises
    ------
    SettingError
        If the file cannot be read, or contains no starts.
    """
    starts, cases = config.get("starts"), config.get("monte_carlo")
    if not isinstance(starts, dict) or not isinstance(cases, dict) or starts.get("kind") != "file":
        return
    if starts.get("path") is None or starts.get("table") is not None:
        return
    path = Path(str(starts["path"]))
    try:
        text = read_text(path, encoding="utf-8-sig")
    except (OSError, ValueError) as error:
        raise SettingError(f"{path} cannot be read ({error}); give a CSV file of starts") from error
    starts["table"], cases["table"] = split(text, str(path))
    for group in (starts, cases):
        group["num_cases"] = num_cases_in(group["table"])


def num_cases_in(text: str) -> int:
    """Return the number of cases in a table."""
    return text.strip().count("\n") // num_deputies(text)


def check_count(group: str, num_cases: int, table: str | None) -> None:
    """Raise SettingError if a table of starts is given whose length is not `num_cases`."""
    num_given = num_cases if table is None else num_cases_in(table)
    if num_cases != num_given:
        raise SettingError(
            f"{group}.num_cases is {num_cases}, but {num_given} starts are given; leave {group}.num_cases "
            "out: all starts of a file are flown"
        )


def distances(text: str, key: str) -> Iterator[tuple[str, float]]:
    """Yield in words which start of a table it is, and its distance from the chief, m.

    Raises
    ------
    SettingError
        As `numbers`.
    """
    columns = numbers(text, key)
    for row, position in enumerate(zip(*(columns[name].tolist() for name in POSITION), strict=True), 1):
        distance = math.hypot(*position)
        yield f"{key}: row {row} starts {distance:.6g} m from the chief", distance


def _columns(text: str, key: str) -> dict[str, list[str]]:
    """Return the cells of each column of a table, by its header, which is checked."""
    try:
        header, *rows = [[cell.strip() for cell in row] for row in csv.reader(io.StringIO(text)) if row]
    except (ValueError, csv.Error) as error:
        raise SettingError(f"{key} is no table of starts ({error}); give CSV with a header") from error
    for index, row in enumerate(rows):
        if len(row) != len(header):
            raise SettingError(
                f"{key}: row {index + 1} has {len(row)} cells, the header {len(header)}; give as many"
            )
    if not rows:
        raise SettingError(f"{key} has no row below its header; give at least one start")
    for name in header:
        if name not in OF_FLEETS:
            raise SettingError(
                f"{key} has a column {name!r}{did_you_mean(name, OF_FLEETS)}; the columns are "
                f"{', '.join(OF_FLEETS)}, of which {', '.join(NEEDED)} are needed"
            )
    missing = [name for name in NEEDED if name not in header]
    if missing or len(set(header)) != len(header):
        wrong = f"lacks {', '.join(missing)}" if missing else "has a column twice"
        raise SettingError(f"{key} {wrong}; its columns are {', '.join(OF_FLEETS)}, each once")
    return dict(zip(header, map(list, zip(*rows, strict=True)), strict=True))
