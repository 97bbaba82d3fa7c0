"""Tables of a run's folder: Parquet and CSV, written atomically, and read back as columns."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, suppress
from itertools import chain, islice
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from fis_tools.formats.csv import rows_as_text
from pipeline.run import artifacts, writing
from pipeline.settings.sizes import BLOCK_ROWS
from plain_files.file_access import open_regular

#: rows that a table's groups have, however many were written at a time, and rows of CSV written at a time
GROUP_ROWS, CSV_ROWS = BLOCK_ROWS, 1000
#: limits of a table's unpacked size: this much, or a multiple of the size of its file, up to the last
SMALL_BYTES, MOST_TIMES, MOST_BYTES = 256 * 1024**2, 64, 4 * 1024**3


def write_parquet(path: Path, columns: Mapping[str, Any], notes: Mapping[str, str] | None = None) -> None:
    """Write columns of equal length; a two-dimensional one becomes a list per row.

    Notes are kept in the file beside its columns, see `notes_of`.
    """
    arrays = {
        name: pa.array(list(column) if np.ndim(column) == 2 else column) for name, column in columns.items()
    }
    table = pa.table(arrays)
    with _writer(path, table.schema) as writer:
        writer.write_table(table, GROUP_ROWS)
        if notes:
            writer.add_key_value_metadata(notes)


def notes_of(path: Path) -> dict[str, str]:
    """Return the notes in a table's file; none if it cannot be read."""
    with suppress(pa.ArrowException, OSError, ValueError), open_regular(path) as stream:
        notes = pq.ParquetFile(stream).metadata.metadata or {}
        return {name.decode(): text.decode() for name, text in notes.items()}
    return {}


def join_parquet(
    path: Path,
    parts: Sequence[Path],
    check: Callable[[Path, "RunTable", Mapping[str, str]], Any] = lambda *_: None,
    num_rows: int | None = None,
) -> None:
    """Join tables into one, byte for byte as if written at once, with few rows in memory.

    A column that a part leaves out, such as the velocities of starts at rest, is 0 there.

    Parameters
    ----------
    path : Path
    parts : sequence of Path
    check : callable
        Is called with the path, the columns and the notes of each part, and raises if they are wrong.
    num_rows : int, optional
        The first rows alone; all unless given.
    """
    widest = max(map(_schema_of, parts), key=len)
    # without the metadata that reading adds
    schema = pa.schema([(field.name, field.type) for field in widest])
    left, awaited = schema.empty_table(), num_rows
    with _writer(path, schema) as writer:
        for part in parts:
            with open_regular(part) as part_stream:
                read = pq.read_table(part_stream)
            check(part, _columns_of(part, read), notes_of(part))
            read = read.slice(0, awaited)
            awaited = None if awaited is None else awaited - len(read)
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
        raise _missing(self._path, name)


def _missing(path: Path, name: str) -> artifacts.ArtifactError:
    return artifacts.ArtifactError(f"{path} has no column {name}; repeat the stage that writes it")


def _explained(path: Path) -> AbstractContextManager[None]:
    return artifacts.explained(f"{path} cannot be read", "repeat the stage that writes it", pa.ArrowException)


def _check(file: pq.ParquetFile, path: Path, only: str | None = None) -> None:
    """Raise ValueError if a table, or a column of it, unpacks to more than is read, or names stand twice."""
    if len(set(names := file.schema_arrow.names)) < len(names):
        raise ValueError("two of its columns have one name")
    claimed, most = file.metadata, min(MOST_BYTES, max(SMALL_BYTES, MOST_TIMES * path.stat().st_size))
    leaves = [file.schema.column(leaf).path.split(".")[0] for leaf in range(claimed.num_columns)]
    chosen = [leaf for leaf, name in enumerate(leaves) if only in (None, name)]
    groups = map(claimed.row_group, range(claimed.num_row_groups))
    packed = sum(group.column(leaf).total_uncompressed_size for group in groups for leaf in chosen)
    # runs of equal numbers are packed as one
    unpacked = max(packed, 8 * claimed.num_rows * len(chosen))
    if unpacked > most:
        raise ValueError(f"it unpacks to {unpacked} bytes, and at most {most} are read")


def read_parquet(folder: Path, name: str) -> RunTable:
    """Read the columns of a run's table.

    Raises
    ------
    pipeline.run.artifacts.ArtifactError
        If it is missing or cannot be read.
    """
    path = artifacts.require(folder, name)
    with _explained(path), open_regular(path) as stream:
        file = pq.ParquetFile(stream)
        _check(file, path)
        table = file.read()
    return _columns_of(path, table)


def _columns_of(path: Path, table: pa.Table) -> RunTable:
    return RunTable(path, {column: table[column].to_numpy() for column in table.column_names})


def _schema_of(path: Path) -> pa.Schema:
    with open_regular(path) as stream:
        return pq.read_schema(stream)


class Columns(Mapping[str, NDArray[Any]]):
    """The columns of a run's table, each read on request, so that a table may be larger than memory.

    A column that is missing raises ArtifactError.

    Parameters
    ----------
    folder : Path
        The run's.
    name : str
        Of the table in it.

    Raises
    ------
    pipeline.run.artifacts.ArtifactError
        If it is missing or cannot be read.
    """

    def __init__(self, folder: Path, name: str) -> None:
        self._path = artifacts.require(folder, name)
        with self._opened() as file:
            self._names = file.schema_arrow.names

    @contextmanager
    def _opened(self) -> Iterator[pq.ParquetFile]:
        with _explained(self._path), open_regular(self._path) as stream:
            yield pq.ParquetFile(stream)

    def __getitem__(self, name: str) -> NDArray[Any]:
        """Read a column."""
        self._require(name)
        with self._opened() as file:
            _check(file, self._path, name)
            return file.read([name])[name].to_numpy()

    def _require(self, name: str) -> None:
        if name not in self._names:
            raise _missing(self._path, name)

    def __contains__(self, name: object) -> bool:
        """Return whether there is a column."""
        return name in self._names

    def get(self, name: str, default: Any = None) -> Any:
        """Read a column; return the default if there is none."""
        return self[name] if name in self._names else default

    def __iter__(self) -> Iterator[str]:
        """Return an iterator over the names of the columns."""
        return iter(self._names)

    def __len__(self) -> int:
        """Return the number of columns."""
        return len(self._names)

    @property
    def num_rows(self) -> int:
        """The number of rows, which no column is read for."""
        with self._opened() as file:
            return int(file.metadata.num_rows)

    def at(self, name: str, rows: Sequence[int]) -> list[Any]:
        """Read a column in some rows."""
        self._require(name)
        with self._opened() as file:
            sizes = [file.metadata.row_group(group).num_rows for group in range(file.num_row_groups)]
            firsts = np.cumsum([0, *sizes])
            groups = np.searchsorted(firsts, rows, "right") - 1
            blocks = {group: _Block(self, file, int(group))[name] for group in set(groups.tolist())}
        return [blocks[group][row - firsts[group]].item() for row, group in zip(rows, groups, strict=True)]

    def blocks(self) -> Iterator[Mapping[str, NDArray[Any]]]:
        """Yield the rows in blocks, as they were written, of columns that are read on request."""
        with self._opened() as file:
            for group in range(file.num_row_groups):
                yield _Block(self, file, group)


def read_or_open(folder: Path, name: str) -> RunTable | Columns:
    """Read the columns of a run's table if it is small; return a larger one to be read on request.

    Raises
    ------
    pipeline.run.artifacts.ArtifactError
        If it is missing or cannot be read.
    """
    columns = Columns(folder, name)
    return read_parquet(folder, name) if columns.num_rows <= BLOCK_ROWS else columns


class _Block(Mapping[str, NDArray[Any]]):
    """Some rows of a table that is open."""

    def __init__(self, whole: Columns, file: pq.ParquetFile, group: int) -> None:
        self._whole, self._file, self._group = whole, file, group

    def __getitem__(self, name: str) -> NDArray[Any]:
        self._whole._require(name)
        return self._file.read_row_group(self._group, columns=[name])[name].to_numpy()

    def __contains__(self, name: object) -> bool:
        return name in self._whole

    def __iter__(self) -> Iterator[str]:
        return iter(self._whole)

    def __len__(self) -> int:
        return len(self._whole)


def write_csv(path: Path, names: Sequence[str], rows: Iterable[Sequence[Any]]) -> None:
    """Write rows under a header, few of them in memory at a time."""
    left = chain([names], rows)
    with writing.beside(path) as stream:
        while block := list(islice(left, CSV_ROWS)):
            stream.write(rows_as_text(block).encode())
