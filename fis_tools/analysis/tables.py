"""Logged data as tables: the columns of a CSV or Parquet file, by their names."""

import csv
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fis_tools.array_types import Floats
from fis_tools.errors import ControllerFileError, MissingExtra, suggestion
from plain_files.file_access import open_regular, open_text

CSV, PARQUET = ".csv", ".parquet"
#: the types of words, by their names in Parquet files
WORDS = ("string", "large_string", "binary", "large_binary")
#: cells of a Parquet file that are read, a few bytes of which may stand for millions
MOST_CELLS = 10_000_000
#: letters of a cell
LONGEST_WORD = 1000
#: of a table's file
MOST_BYTES = 256 * 1024**2
#: a column of this name holds the time of each row, in seconds
TIME = "time_s"
#: a name with its unit, such as ``petal length (cm)``
WITH_UNIT = re.compile(r"(.*\S)\s*[(\[]([^()\[\]]+)[)\]]")


def name_and_unit(label: str) -> tuple[str, str]:
    """Split ``petal length (cm)`` into ``petal_length`` and ``cm``."""
    printable = "".join(letter if letter.isprintable() else " " for letter in label).strip()
    match = WITH_UNIT.fullmatch(printable)
    name, unit = match.groups() if match else (printable, "")
    return "_".join(name.split()) or "unnamed", unit.strip()


def is_table(path: Path | str) -> bool:
    """Return, from its name, whether a file is a table."""
    return Path(path).suffix.lower() in (CSV, PARQUET)


def read(
    path: Path | str, names: Sequence[str], labels: Mapping[str, str] | None = None
) -> tuple[Floats, Floats | None]:
    """Read columns of a table.

    Parameters
    ----------
    path : path
        A CSV file whose first line names the columns, or a Parquet file.
    names : sequence of str
        The columns, in the order in which they are wanted; a table may have others, of any kind.
    labels : mapping, optional
        What else the column of a name may be called, such as with its unit: ``angle (rad)``. Columns that
        are split alike by `name_and_unit` are called alike.

    Returns
    -------
    values : (n, num_names)
        All finite.
    time_s : (n,) or None
        The column `TIME`, where there is one.

    Raises
    ------
    ControllerFileError
        If the file cannot be read, a column is missing or holds something else than numbers, or time runs
        backwards.
    MissingExtra
        If it is a Parquet file and pyarrow is not installed.
    """
    path = Path(path)
    try:
        reader = _from_csv if path.suffix.lower() == CSV else _from_parquet
        known, columns = reader(path, names, labels or {})
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise ControllerFileError(f"{path} cannot be read ({error}); give a CSV or Parquet file") from error
    if not len(columns):
        raise ControllerFileError(f"{path} holds no rows; give logged data")
    _require_finite(path, known, columns)
    time_s = columns[:, known.index(TIME)] if TIME in known else None
    values = columns[:, [known.index(name) for name in names]]
    if time_s is not None and np.any(np.diff(time_s) < 0.0):
        raise ControllerFileError(f"{path}: {TIME} runs backwards; sort its rows by time")
    return values, time_s


def _wanted(
    path: Path, names_in_file: Sequence[str], names: Sequence[str], labels: Mapping[str, str]
) -> dict[str, str]:
    """Return the columns of a table to read, by the names requested."""
    splits = {column: name_and_unit(column) for column in names_in_file}
    wanted = {}
    for name in names:
        split = name_and_unit(labels.get(name, name))
        columns = [column for column in names_in_file if column == name or splits[column] == split]
        if len(columns) != 1:
            fault = f"it has no {name!r}; {suggestion(name, names_in_file)}"
            if columns:
                fault = f"it has {' and '.join(map(repr, columns))} for {name!r}; leave out one"
            raise ControllerFileError(
                f"{path}: columns go by the names of inputs ({', '.join(names)}), and {fault}"
            )
        wanted[name] = columns[0]
    return wanted | ({TIME: TIME} if TIME in names_in_file else {})


def _from_csv(path: Path, names: Sequence[str], labels: Mapping[str, str]) -> tuple[list[str], Floats]:
    """Read columns of numbers from a CSV file; return their names and values, (n, num_columns)."""
    with open_text(path, MOST_BYTES, "utf-8-sig") as file:
        names_in_file = [name.strip() for name in next(csv.reader(file), [])]
        wanted = _wanted(path, names_in_file, names, labels)
        positions = [names_in_file.index(column) for column in wanted.values()]
        rows = [(number, row) for number, row in enumerate(csv.reader(file), start=2) if row]
    columns = np.empty((len(rows), len(wanted)))
    for row_index, (number, row) in enumerate(rows):
        try:
            columns[row_index] = [float(row[column]) for column in positions]
        except (ValueError, IndexError):
            raise ControllerFileError(
                f"{path}, row {number}: {', '.join(row)} does not hold a number for each of "
                f"{', '.join(wanted)}; complete the row, or leave it out"
            ) from None
    return list(wanted), columns


def _from_parquet(path: Path, names: Sequence[str], labels: Mapping[str, str]) -> tuple[list[str], Floats]:
    """Read columns of numbers from a Parquet file; return their names and values, (n, num_columns)."""
    wanted: dict[str, str] = {}

    def choose(names_in_file: Sequence[str]) -> list[str]:
        wanted.update(_wanted(path, names_in_file, names, labels))
        return list(wanted.values())

    table = read_parquet(path, choose)
    try:
        columns = [np.asarray(table[column], dtype=np.float64) for column in wanted.values()]
    except (TypeError, ValueError) as error:
        raise ControllerFileError(f"{path}: {error}; give a Parquet file whose inputs are numbers") from error
    return list(wanted), np.column_stack(columns)


def read_parquet(path: Path, choose: Callable[[Sequence[str]], Sequence[str]]) -> dict[str, NDArray[Any]]:
    """Read columns of a Parquet file, of numbers or words, in bounded memory.

    Parameters
    ----------
    path : Path
    choose : callable
        Takes the names of all columns, and returns those to read.

    Raises
    ------
    ControllerFileError
        If the file cannot be read, has too many cells, or lists or groups in a column.
    MissingExtra
        If pyarrow is not installed.
    """
    try:
        import pyarrow  # noqa: PLC0415 - not a package that CSV files need
        from pyarrow import parquet  # noqa: PLC0415
    except ModuleNotFoundError as error:
        raise MissingExtra("reading Parquet files", "pyarrow", "pyarrow") from error
    try:
        with open_regular(path, MOST_BYTES) as stream:
            schema = parquet.read_schema(stream)
            names = list(choose(schema.names))
            if nested := [name for name in names if pyarrow.types.is_nested(schema.field(name).type)]:
                raise ControllerFileError(
                    f"{path}: its column {nested[0]!r} is of lists; give numbers or words"
                )
            words = [name for name in names if str(schema.field(name).type) in WORDS]
            # words stay what they are packed as, numbers of a dictionary
            file = parquet.ParquetFile(stream, read_dictionary=words)
            if file.metadata.num_rows * max(1, len(names)) > MOST_CELLS:
                raise ControllerFileError(
                    f"{path} has {file.metadata.num_rows} rows of {len(names)} columns; at most "
                    f"{MOST_CELLS:,} cells are read: give fewer rows"
                )
            table = file.read(names, use_threads=False)
        return {name: _column(f"{path}: its column {name!r}", table[name]) for name in names}
    except (OSError, ValueError, pyarrow.ArrowException) as error:
        if isinstance(error, ControllerFileError):
            raise
        problem = str(error).partition("\n")[0]
        raise ControllerFileError(f"{path}: {problem}; give a CSV or Parquet file") from error


def _column(where: str, column: Any) -> NDArray[Any]:
    """Return a column as an array; text is stored once per distinct word."""
    if not hasattr(column.type, "value_type"):
        return column.to_numpy()
    parts = [np.empty(0, dtype=object)]
    for chunk in column.chunks:
        distinct = chunk.dictionary.to_pylist()
        if any(word is not None and len(word) > LONGEST_WORD for word in distinct):
            raise ControllerFileError(f"{where} has a word of more than {LONGEST_WORD} letters; leave it out")
        words = np.append(np.array(distinct, dtype=object), [None])
        parts.append(words[chunk.indices.cast("int64").fill_null(len(words) - 1).to_numpy()])
    return np.concatenate(parts)


def _require_finite(path: Path, names: Sequence[str], columns: Floats) -> None:
    """Raise ControllerFileError for columns with missing or infinite values."""
    wrong = np.argwhere(~np.isfinite(columns))
    if len(wrong):
        row, column = wrong[0]
        raise ControllerFileError(
            f"{path}: {names[column]} is {columns[row, column]:g} in its sample {row + 1}, and missing or "
            f"infinite in {len({int(each) for each in wrong[:, 0]})} of {len(columns)}; leave these out"
        )
