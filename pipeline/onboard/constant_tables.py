"""A constant table of the source, as far as the program reads it."""

import re
from collections.abc import Iterable

import numpy as np

from fis_tools.formats.c.text import table
from pipeline.onboard.arrays import Array
from pipeline.onboard.functions import Line

#: lanes of vectors are bytes of a double; of whole numbers there are four
BYTES = {"double": 8, "int": 4, "unsigned int": 4, "unsigned char": 1}


class ConstantTable:
    """A constant table; where the last indices are always known, it holds only what is read.

    Parameters
    ----------
    array : Array
    lines : iterable of Line
        All that may read it.
    """

    def __init__(self, array: Array, lines: Iterable[Line]) -> None:
        self.name, self.kind = array.name, array.kind
        self.c_type = "unsigned char" if np.asarray(array.data).dtype == np.uint8 else array.kind
        index = r"\[[^\[\]]*(?:\[[^\[\]]*\][^\[\]]*)*\]"
        accesses = re.compile(rf"(?<![\w>.]){self.name}((?:{index})+)")
        naming = (line.text for line in lines if self.name in line.text)  # cheaper than the expression
        texts = [text for line in naming for text in accesses.findall(line)]
        data = np.asarray(array.data)
        self.data = data.reshape([length for length in data.shape if length != 1] or [1])
        self.is_used, self._columns, self._pattern = bool(texts), [], None
        strides = [re.match(r"\[(\d+) \* (\w+)\]", text) for text in texts]
        self._stride = 1
        if (
            self.data.ndim > 1
            and texts
            and all(strides)
            and len({match[1] for match in strides if match}) == 1
        ):
            self._stride = int(strides[0][1])  # type: ignore[index]
            self.data = self.data[:: self._stride]
        if self.data.ndim == 1:
            return
        last = r"\[(\d+)\]" * (self.data.ndim - 1)
        keys = [re.fullmatch(rf"(?:{index}){last}", text) for text in texts]
        if texts and all(keys):
            self._columns = sorted({tuple(map(int, key.groups())) for key in keys if key})
            self._pattern = re.compile(rf"(?<![\w>.]){self.name}({index}){last}")
            columns = [self.data[(slice(None), *column)] for column in self._columns]  # type: ignore[arg-type]
            self.data = np.stack(columns, axis=1)

    @property
    def num_bytes(self) -> int:
        """What it takes."""
        return int(self.data.size) * BYTES[self.c_type]

    def renamed(self, line: Line) -> Line:
        """Return a line that reads the columns that are kept."""
        if self._pattern is None:
            return line

        def rename(match: re.Match[str]) -> str:
            column = self._columns.index(tuple(map(int, match.groups()[1:])))
            return f"{self.name}{self._row(match[1])}[{column}]"

        text = self._pattern.sub(rename, line.text)
        return Line(text, line.file, line.number)

    def _row(self, index: str) -> str:
        """Return a first index, of the rows that are kept."""
        return index.replace(f"[{self._stride} * ", "[") if self._stride > 1 else index

    def definition(self) -> list[str]:
        """Return its definition in C."""
        values = self.data.astype(int if self.kind == "int" else float)
        return table(self.c_type, self.name, values.tolist()).split("\n")
