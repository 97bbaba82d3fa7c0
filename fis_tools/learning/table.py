"""Tables of numbers: from CSV files, and from whatever goes by the names of its columns."""

import csv
import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fis_tools.analysis import tables
from fis_tools.analysis.tables import name_and_unit
from fis_tools.array_types import Floats, Integers
from fis_tools.engines.inputs import columns_of
from fis_tools.errors import Mistake, require_known
from fis_tools.learning.rules import range_of
from plain_files.file_access import open_text
from plain_files.plain_text import as_number, distinct


class UnreadableTable(Mistake):
    """Raised for a table that nothing can be learned from."""


@dataclass(frozen=True)
class TrainingTable:
    """A table to learn from: its columns, rows and target.

    Parameters
    ----------
    labels : tuple of str
        Of the columns that rules may ask for.
    rows : (n, num_columns)
    target : str
        Of the column that is to be learned.
    values : (n,)
        What stands there: numbers, or words that are classes.
    notes : tuple of str
        What of the table is left out, and why, a sentence each.
    """

    labels: tuple[str, ...]
    rows: Floats
    target: str
    values: NDArray[Any]
    notes: tuple[str, ...] = ()

    @property
    def has_classes(self) -> bool:
        """Whether the target is a word."""
        return self.values.dtype.kind != "f"


def as_table(content: Any, target: str, inputs: list[str] | None = None) -> TrainingTable:
    """Convert a mapping, data frame or structured array to a table.

    Rows with an empty cell are left out. So are columns of words and columns of one value, unless they are
    asked for.

    Parameters
    ----------
    content : Any
        Columns of numbers by their names; that of the target may hold words.
    target : str
        Which column is to be learned; of ``y (N)`` ``y`` will do where no other column is called so.
    inputs : list of str, optional
        Which columns rules may ask for, likewise; by default all others.

    Raises
    ------
    UnreadableTable
        If a column is missing, holds what is no finite number, or there are fewer than two rows.
    """
    names = columns_of(content)
    if names is None:
        raise UnreadableTable(
            "an array does not say what its columns are; pass a mapping of names to columns"
        )
    target, *input_names = (_called(name, names) for name in (target, *(inputs or ())))
    require_known((target, *input_names), names, "the table has no column", UnreadableTable)
    labels = tuple(input_names or (name for name in names if name != target))
    if not labels:
        raise UnreadableTable(f"the table has no column besides {target!r}; add what rules may ask for")
    columns = {name: np.asarray(content[name]) for name in (*labels, target)}
    notes = []
    for name in labels if inputs is None else ():
        if why := _idle(columns[name]):
            notes.append(f"column {name!r} {why} and is left out")
            del columns[name]
    labels = tuple(name for name in labels if name in columns)
    if not labels:
        raise UnreadableTable(f"no column can be asked for ({'; '.join(notes)}); add one of numbers")
    if len({len(column) for column in columns.values()}) != 1:
        raise UnreadableTable("the columns are not equally long; give a value in each for each row")
    is_whole = ~np.any([_gaps(column) for column in columns.values()], axis=0)
    if gaps := int(np.sum(~is_whole)):
        notes.append(
            f"{gaps} of {len(is_whole)} rows {'have' if gaps > 1 else 'has'} an empty cell, left out"
        )
        columns = {name: column[is_whole] for name, column in columns.items()}
    if is_whole.sum() < 2:
        raise UnreadableTable("the table has fewer than two rows without an empty cell; give two or more")
    values = columns[target]
    rows = np.stack([_numbers(name, columns[name]) for name in labels], axis=1)
    try:
        values = _numbers(target, values)
    except UnreadableTable:
        if not all(isinstance(value, str) and as_number(value) is None for value in values.tolist()):
            raise
    return TrainingTable(labels, rows, target, values, tuple(notes))


def _called(name: str, names: Collection[str]) -> str:
    """Return the column of this name, or the only one of this name with a unit."""
    if name in names:
        return name
    with_unit = [column for column in names if name_and_unit(name) == (name_and_unit(column)[0], "")]
    return with_unit[0] if len(with_unit) == 1 else name


def _idle(column: NDArray[Any]) -> str:
    """Return why a column cannot be an input; empty if it can."""
    values = column[~_gaps(column)].tolist() if column.ndim == 1 else []
    if values and all(as_number(value) is None for value in values):
        return "holds words, while rules ask for numbers,"
    if len(values) > 1 and len(set(values)) == 1:
        return f"is {values[0]} in every row"
    return ""


def _gaps(column: NDArray[Any]) -> NDArray[np.bool_]:
    """Return which cells are empty, (n,)."""
    if column.ndim != 1:
        return np.zeros(len(column), dtype=np.bool_)
    is_gap = [
        value in (None, "") or (isinstance(value, float) and math.isnan(value)) for value in column.tolist()
    ]
    return np.array(is_gap, dtype=np.bool_)


def read(path: Path | str) -> Mapping[str, Any]:
    """Read the columns of a CSV or Parquet file.

    Raises
    ------
    UnreadableTable, ControllerFileError
        If it cannot be read.
    MissingExtra
        If it is a Parquet file and pyarrow is not installed.
    """
    is_parquet = Path(path).suffix.lower() == tables.PARQUET
    return tables.read_parquet(Path(path), list) if is_parquet else read_csv(path)


def read_csv(path: Path | str) -> dict[str, list[str]]:
    """Read the columns of a CSV file whose first line names them, as texts.

    Raises
    ------
    UnreadableTable
        If it cannot be read, or a line is longer or shorter than the first.
    """
    try:
        with open_text(path, tables.MOST_BYTES, "utf-8-sig") as stream:
            reader = csv.reader(stream)
            (_, head), *lines = [(reader.line_num, cells) for cells in reader if cells] or [(1, [""])]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        is_csv = isinstance(error, csv.Error)  # a word may be too long
        why = getattr(error, "strerror", None) or (f"no CSV: {error}" if is_csv else "no CSV in UTF-8")
        raise UnreadableTable(f"{path}: cannot be read ({why}); give a CSV file") from error
    names = [name.strip() for name in head]
    if len(set(names)) != len(names) or not all(names):
        raise UnreadableTable(f"{path}: two columns have one name, or one has none; name each in line 1")
    for number, cells in lines:
        if any(len(cell) > tables.LONGEST_WORD for cell in cells):
            raise UnreadableTable(
                f"{path}, line {number} has a cell of more than {tables.LONGEST_WORD} letters; leave it out"
            )
        if len(cells) != len(names):
            raise UnreadableTable(
                f"{path}, line {number} has {len(cells)} cells, but line 1 names {len(names)} columns; make "
                "them equal"
            )
    return {name: [cells[column].strip() for _, cells in lines] for column, name in enumerate(names)}


def _numbers(name: str, values: NDArray[Any]) -> Floats:
    """Return a column as numbers, (n,)."""
    if values.ndim != 1:
        raise UnreadableTable(f"column {name!r} has shape {values.shape}; give one number a row")
    if values.dtype.kind in "iufb":
        numbers = values.astype(np.float64)
    else:
        numbers = np.array([as_number(value) for value in values.tolist()], dtype=np.float64)
    if not np.isfinite(numbers).all():
        row = int(np.argmin(np.isfinite(numbers)))
        raise UnreadableTable(
            f"column {name!r} has {values[row]!s} in row {row + 1}, which is no finite number; leave such "
            "rows or the column out"
        )
    return numbers


@dataclass(frozen=True)
class Column:
    """A column of a table.

    Parameters
    ----------
    name, unit : str
    low, high : float
        The range that is learned; values beyond it count as its ends.
    """

    name: str
    unit: str
    low: float
    high: float


@dataclass(frozen=True)
class Samples:
    """Rows to learn from.

    Parameters
    ----------
    columns : sequence of Column
        What rules may ask for.
    rows : (n, num_columns)
        Two or more.
    counts : (n,)
        As how many equal rows each counts; above zero.
    """

    columns: Sequence[Column]
    rows: Floats
    counts: Floats

    def of(self, columns: Sequence[int]) -> "Samples":
        """Return the samples with some of the columns."""
        return Samples([self.columns[column] for column in columns], self.rows[:, list(columns)], self.counts)

    def at(self, rows: Integers) -> "Samples":
        """Return some of the samples."""
        return Samples(self.columns, self.rows[rows], self.counts[rows])


def samples_of(rows: Floats, labels: Sequence[str], counts: Floats | None = None) -> Samples:
    """Return the samples of a table, (n, num_columns), over the ranges of its rows; each counts once."""
    encoded = []
    for label, values in zip(labels, rows.T, strict=True):
        name, unit = name_and_unit(label)
        encoded.append(Column(name, unit, *range_of(values)))
    names = distinct(column.name for column in encoded)
    columns = [replace(column, name=name) for column, name in zip(encoded, names, strict=True)]
    return Samples(columns, rows, np.ones(len(rows)) if counts is None else counts)


def columns_within(ranges: Mapping[str, tuple[float, float]]) -> list[Column]:
    """Return columns over given ranges, by their names.

    Raises
    ------
    ValueError
        If a range is empty or not finite.
    """
    for name, (low, high) in ranges.items():
        if not -np.inf < low < high < np.inf:
            raise ValueError(f"the range of {name!r} is ({low}, {high}); give two finite numbers that ascend")
    return [Column(*name_and_unit(name), float(low), float(high)) for name, (low, high) in ranges.items()]
