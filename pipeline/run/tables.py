"""Tables of a run's folder: Parquet and CSV, written atomically, and read back as columns."""

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from fis_tools.file_access import open_regular
from fis_tools.formats.csv import rows_as_text
from pipeline.run import artifacts, writing

#: rows that a table's groups have, however many were written at a time
GROUP_ROWS: Final = 65536
#: limits of a table's unpacked size: this much, or a multiple of the size of its file, up to the last
SMALL_BYTES, MOST_TIMES, MOST_BYTES = 256 * 1024**2, 64, 4 * 1024**3


def write_parquet(path: Path, columns: Mapping[str, Any]) -> None:
    """Write columns of equal length; a two-dimensional one becomes a list per row."""
    arrays = {
        name: pa.array(list(column) if np.ndim(column) == 2 else column) for name, column in columns.items()
    }
    table = pa.table(arrays)
    with _writer(path, table.schema) as writer:
        writer.write_table(table, GROUP_ROWS)


def join_parquet(path: Path, parts: Sequence[Path]) -> None:
    """Join tables into one, byte for byte as if written at once, with few rows in memory.

    A column that a part leaves out, such as the velocities of starts at rest, is 0 there.
    """
    widest = max(map(_schema_of, parts), key=len)
    # without the metadata that reading adds
    schema = pa.schema([(field.name, field.type) for field in widest])
    left = schema.empty_table()
    with _writer(path, schema) as writer:
        for part in parts:
            with open_regular(part) as part_stream:
                read = pq.read_table(part_stream)
            zeros = np.zeros(len(read))
            columns = {name: read[name] if name in read.column_names else zeros for name in schema.names}
            left = pa.concat_tables([left, pa.table(columns, schema=schema)]).combine_chunks()
            whole = len(left) - len(left) % GROUP_ROWS
            if whole:
                writer.write_table(left.slice(0, whole).combine_chunks(), GROUP_ROWS)
            left = left.slice(whole)
        if len(left):
            writer.write_table(left.combine_chunks(), GROUP_ROWS)


@contextmanager
def _writer(path: Path, schema: pa.Schema) -> Iterator[pq.ParquetWriter]:
    """Open a Parquet file that replaces a path once it is complete."""
    # measured numbers hardly repeat: dictionary encoding would take six times as long and more space
    with writing.beside(path) as stream:
        made = pq.ParquetWriter(stream, schema, compression="zstd", use_dictionary=False, store_schema=False)
        with made as writer:
            yield writer


class RunTable(dict[str, NDArray[Any]]):
    """The columns of a run's table by name; a missing one raises ArtifactError.

    Parameters
    ----------
    path : Path
        The file that they are of, for errors.
    columns : mapping of str to ndarray
        Each of shape (rows,).
    """

    def __init__(self, path: Path, columns: Mapping[str, NDArray[Any]]) -> None:
        super().__init__(columns)
        self._path = path

    def __missing__(self, name: str) -> NDArray[Any]:
        raise artifacts.ArtifactError(f"{self._path} has no column {name}; repeat the stage that writes it")


def read_parquet(folder: Path, name: str) -> RunTable:
    """Read the columns of a run's table.

    Raises
    ------
    pipeline.run.artifacts.ArtifactError
        If it is missing or cannot be read.
    """
    path = artifacts.require(folder, name)
    explained = artifacts.explained(
        f"{path} cannot be read", "repeat the stage that writes it", pa.ArrowException
    )
    with explained, open_regular(path) as stream:
        file, size = pq.ParquetFile(stream), os.fstat(stream.fileno()).st_size
        claimed = file.metadata
        groups = map(claimed.row_group, range(claimed.num_row_groups))
        # runs of equal numbers are packed as one
        unpacked = max(
            sum(group.total_byte_size for group in groups), 8 * claimed.num_rows * claimed.num_columns
        )
        most = min(MOST_BYTES, max(SMALL_BYTES, MOST_TIMES * size))
        if unpacked > most:
            raise ValueError(f"it unpacks to {unpacked} bytes, and at most {most} are read")
        table = file.read()
    return RunTable(path, {column: table[column].to_numpy() for column in table.column_names})


def _schema_of(path: Path) -> pa.Schema:
    with open_regular(path) as stream:
        return pq.read_schema(stream)


def _column(path: Path, name: str) -> NDArray[Any]:
    with open_regular(path) as stream:
        return pq.read_table(stream, columns=[name])[name].to_numpy()


class Columns(Mapping[str, NDArray[Any]]):
    """The columns of a table in one or more files, each read on request.

    Parameters
    ----------
    paths : sequence of Path
        Parquet files of ours with the same columns, in the order of their rows.
    """

    def __init__(self, paths: Sequence[Path]) -> None:
        self._paths = paths
        self._names = _schema_of(paths[0]).names

    def __getitem__(self, name: str) -> NDArray[Any]:
        """Read a column."""
        if name not in self._names:
            raise KeyError(name)
        return np.concatenate([_column(path, name) for path in self._paths])

    def __iter__(self) -> Iterator[str]:
        """Return an iterator over the names of the columns."""
        return iter(self._names)

    def __len__(self) -> int:
        """Return the number of columns."""
        return len(self._names)


def write_csv(path: Path, names: Sequence[str], rows: Sequence[Sequence[Any]]) -> None:
    """Write rows under a header."""
    writing.write_atomically(path, rows_as_text([names, *rows]))
