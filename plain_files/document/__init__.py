"""Documents: the content of a result in blocks, independent of the output format.

`text` writes any document as plain text, Markdown or LaTeX, `html` as a page; `as_json` writes results.
"""

import json
import math
from abc import ABC, abstractmethod
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from enum import Enum
from typing import Any, TypeAlias


@dataclass(frozen=True)
class Change:
    """A text before and after a change; both may be equal."""

    before: str
    after: str


@dataclass(frozen=True)
class Mark:
    """Text in a cell that pages style in a way of their own.

    Parameters
    ----------
    words : str
    kind : str
        The class of their style, such as "refuted".
    link : str
        To the id of a heading or a fold of the same document.
    note : str
        A remark below them.
    value : float, optional
        The number that the words round.
    """

    words: str
    kind: str = ""
    link: str = ""
    note: str = ""
    value: float | None = None

    def __str__(self) -> str:
        return f"{self.words} ({self.note})" if self.note else self.words


#: what stands in a cell of a table
Cell: TypeAlias = str | Change | Mark


@dataclass(frozen=True)
class Heading:
    """A heading, of level 1 (the whole document) to 4; with an id it can be linked to."""

    words: str
    level: int = 2
    id: str = ""


@dataclass(frozen=True)
class Paragraph:
    """One or more sentences."""

    words: str


@dataclass(frozen=True)
class Items:
    """A list without numbers; what follows a line break in an item belongs to it on a line of its own."""

    items: Sequence[str]


@dataclass(frozen=True)
class Table:
    """A table whose first column names its rows.

    Parameters
    ----------
    heads : sequence of str
        One for each column; empty where the rows speak for themselves.
    rows : sequence of sequences of Cell
        As long as one another, and as the heads.
    numbers : collection of int
        The columns whose cells are numbers.
    across : str
        What the columns but the first stand for, where all are values of one variable.
    caption : str
        What it shows.
    """

    heads: Sequence[str]
    rows: Sequence[Sequence[Cell]]
    numbers: Collection[int] = ()
    across: str = ""
    caption: str = ""


@dataclass(frozen=True)
class Code:
    """Text to be copied as it is, such as a command."""

    words: str


@dataclass(frozen=True)
class Figure:
    """A picture for pages, left out elsewhere: HTML or SVG that is safe as it stands."""

    markup: str


@dataclass(frozen=True)
class Fold:
    """Blocks that a page folds away; other formats show them below a heading."""

    words: str
    blocks: "Sequence[Block]"
    id: str = ""


Block: TypeAlias = Heading | Paragraph | Items | Table | Code | Figure | Fold


@dataclass(frozen=True)
class Document:
    """Blocks in the order of reading."""

    blocks: Sequence[Block]

    @property
    def unfolded(self) -> Iterator[Block]:
        """The blocks without folds and figures, which only pages have."""
        for block in self.blocks:
            if isinstance(block, Fold):
                yield Heading(block.words, 4)
                yield from Document(block.blocks).unfolded
            elif not isinstance(block, Figure):
                yield block

    @property
    def title(self) -> str:
        """The text of the first heading or paragraph."""
        return next((block.words for block in self.blocks if isinstance(block, Heading | Paragraph)), "")


def plain(value: Any) -> Any:
    """Return plain data for JSON: dataclasses as objects by their fields' names, arrays as lists."""
    if is_dataclass(value):
        return {field.name: plain(getattr(value, field.name)) for field in fields(value)}
    if isinstance(value, Enum):
        return value.name.lower()
    if isinstance(value, Mapping):
        return {key: plain(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [plain(entry) for entry in value]
    return value.tolist() if hasattr(value, "tolist") else value


def as_json(schema: str, version: int, content: Mapping[str, Any]) -> str:
    """Write data as JSON that says which schema it follows; keys may be added to a version, not changed.

    JSON has no infinite numbers, and none that are not a number: they become null.
    """
    entries = _plain({"schema": schema, "schema_version": version, **content})
    return json.dumps(entries, indent=2, allow_nan=False, ensure_ascii=False) + "\n"


def _plain(value: Any) -> Any:
    """Return data of Python's own types, with None for numbers that JSON does not have."""
    if isinstance(value, Mapping):
        return {key: _plain(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(part) for part in value]
    value = value.item() if hasattr(value, "item") else value  # of NumPy, which this package does without
    return None if isinstance(value, float) and not math.isfinite(value) else value


class Result(ABC):
    """A result that displays itself in a terminal and in notebooks."""

    @abstractmethod
    def document(self) -> Document:
        """Return the content as a document."""

    def text(self, **options: Any) -> str:
        """Render it for a terminal; options are those of `document`."""
        from plain_files.document import text  # noqa: PLC0415 - a result is shown in one form or another

        return text.write(self.document(**options))

    def __repr__(self) -> str:
        return self.text()

    def _repr_markdown_(self) -> str:
        from plain_files.document import text  # noqa: PLC0415

        return text.write_markdown(self.document())
