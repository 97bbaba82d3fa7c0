"""The texts in a file of any kind that a run leaves, replaced by others."""

import csv
import io
import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import yaml

from tests.hostile.damage import rewritten

#: gives the text that takes the place of another
Other = Callable[[str], str]


def of_data(data: Any, other: Other) -> Any:
    """Plain data with other texts, keys aside."""
    if isinstance(data, dict):
        return {key: of_data(value, other) for key, value in data.items()}
    if isinstance(data, list):
        return [of_data(value, other) for value in data]
    return other(data) if isinstance(data, str) else data


def _of_json(content: bytes, other: Other) -> bytes:
    return json.dumps(of_data(json.loads(content), other)).encode()


def _of_lines(content: bytes, other: Other) -> bytes:
    return b"".join(_of_json(line, other) + b"\n" for line in content.splitlines())


def _of_yaml(content: bytes, other: Other) -> bytes:
    return yaml.safe_dump(of_data(yaml.safe_load(content), other)).encode()


def _of_csv(content: bytes, other: Other) -> bytes:
    """Headings, and cells that are no numbers; of a table of numbers alone its first row, too."""
    heading, *rows = list(csv.reader(io.StringIO(content.decode())))
    sink = io.StringIO()
    csv.writer(sink, lineterminator="\n").writerows(
        [[other(cell) for cell in row] for row in (heading, *rows)]
    )
    return sink.getvalue().encode()


def _of_words(content: bytes, other: Other) -> bytes:
    lines = content.decode(errors="replace").splitlines()
    return "\n".join(" ".join(map(other, line.split(" "))) for line in lines).encode(errors="replace")


def _of_parquet(content: bytes, other: Other) -> bytes:
    """Cells of text, names of columns, and what the file says of itself."""
    table = pq.read_table(io.BytesIO(content))
    columns = [
        pa.array([other(cell) for cell in column.to_pylist()]) if pa.types.is_string(column.type) else column
        for column in table.columns
    ]
    notes = {key: other(value.decode()) for key, value in (table.schema.metadata or {}).items()}
    names, sink = map(other, table.column_names), io.BytesIO()
    pq.write_table(pa.table(columns, names=list(names)).replace_schema_metadata(notes), sink)
    return sink.getvalue()


def _of_checkpoint(content: bytes, other: Other) -> bytes:
    with np.load(io.BytesIO(content)) as archive:
        arrays = {name: archive[name] for name in archive.files}
    note = _of_json(arrays["note"].tobytes(), other)
    sink = io.BytesIO()
    np.savez(sink, **arrays | {"note": np.frombuffer(note, np.uint8)})
    return sink.getvalue()


def _of_recording(content: bytes, other: Other) -> bytes:
    """Metadata and the names of topics; attachments are files of other kinds."""
    return rewritten(
        content,
        entries=lambda _, kept: {key: other(value) for key, value in kept.items()},
        attachment=lambda attached: with_texts(Path(attached.name), attached.data, other),
    )


_WAYS: Final[dict[str, Callable[[bytes, Other], bytes]]] = {
    **dict.fromkeys((".json", ".ending", ".lock"), _of_json),
    ".jsonl": _of_lines,
    ".yaml": _of_yaml,
    ".csv": _of_csv,
    ".log": _of_words,
    ".parquet": _of_parquet,
    ".npz": _of_checkpoint,
    ".mcap": _of_recording,
}
#: what no command reads: pages and pictures, and the notes of tensorboard
UNREAD: Final = (".html", ".png")


def kind_of(path: Path) -> str:
    """The ending of a file, or all of its name."""
    return path.suffix or path.name


def with_texts(path: Path, content: bytes, other: Other) -> bytes:
    """The content of a file with other texts."""
    if not content:
        return content
    if path.name == "journal.log":
        return _of_lines(content, other)
    return _WAYS[kind_of(path)](content, other)


def count_of(path: Path, content: bytes) -> int:
    """How many texts are in it."""
    count = 0

    def same(text: str) -> str:
        nonlocal count
        count += 1
        return text

    with_texts(path, content, same)
    return count


def replaced(path: Path, content: bytes, text: str, index: int | None = None) -> bytes:
    """The content of a file with a text in place of the one of a number, or of all."""
    numbers: Iterator[int] = iter(range(2**40))

    def other(before: str) -> str:
        return text if index in (None, next(numbers)) else before

    return with_texts(path, content, other)
