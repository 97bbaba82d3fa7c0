"""Documents as plain text: what stands below a heading is indented, tables are aligned."""

import textwrap
from collections.abc import Collection, Iterator, Sequence

from fis_tools.document import Block, Cell, Change, Code, Document, Heading, Items, Paragraph, Table

#: Sentences are wrapped at this column, and tables of changes that are wider are listed instead.
WIDTH = 110
TO = "→"
#: in a table of changes, stands for what did not change
SAME = "·"


def write(document: Document, width: int = WIDTH) -> str:
    """Write a document; sentences are wrapped, rows of tables are not."""
    lines: list[str] = []
    indent, goes_on = 0, True
    for block in document.unfolded:
        is_heading = isinstance(block, Heading)
        if isinstance(block, Heading):
            indent = 2 * max(0, block.level - 2)
        if lines and (is_heading or not goes_on):
            lines.append("")
        lines += _lines(block, indent, width)
        indent += 2 * is_heading
        goes_on = is_heading or (isinstance(block, Paragraph) and block.words.endswith(":"))
    return "\n".join(lines) + "\n"


def _lines(block: Block, indent: int, width: int) -> Iterator[str]:
    match block:
        case Heading(words) | Paragraph(words):
            yield from _wrapped(words, width, indent)
        case Items(items):
            for item in items:
                first, *others = item.split("\n")
                yield from _wrapped(first, width, indent)
                for words in others:
                    yield from _wrapped(words, width, indent + 2)
        case Code(words):
            yield from (" " * (indent + 4) + line for line in words.splitlines())
        case Table():
            yield from _wrapped(block.caption, width, indent)
            yield from ((" " * indent + line).rstrip() for line in _table(block, width - indent))


def _wrapped(words: str, width: int, indent: int) -> list[str]:
    kept = words.replace(" %", "\N{NO-BREAK SPACE}%")
    lines = textwrap.wrap(
        kept,
        width,
        initial_indent=" " * indent,
        subsequent_indent=" " * (indent + 2),
        break_on_hyphens=False,
        break_long_words=False,
    )
    return [line.replace("\N{NO-BREAK SPACE}", " ") for line in lines]


def _table(table: Table, width: int) -> list[str]:
    has_changes = any(isinstance(cell, Change) for row in table.rows for cell in row)
    rows = [[_cell(cell) for cell in row] for row in table.rows]
    lines = aligned([table.heads, *rows] if table.heads else rows, table.numbers)
    if not (has_changes and table.across) or max(map(len, lines)) <= width:
        return lines
    changes = [
        [str(head), column, _cell(cell)]
        for head, *cells in table.rows
        for column, cell in zip(table.heads[1:], cells, strict=True)
        if isinstance(cell, Change) and cell.before != cell.after
    ]
    return aligned([[table.heads[0], "", ""], *changes])


def _cell(cell: Cell) -> str:
    if not isinstance(cell, Change):
        return str(cell)
    return SAME if cell.before == cell.after else f"{cell.before} {TO} {cell.after}"


def aligned(rows: Sequence[Sequence[str]], numbers: Collection[int] = (), between: str = "  ") -> list[str]:
    """Return rows as lines whose cells stand below one another, those of numbers at the right."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        between.join(
            cell.rjust(width) if place in numbers else cell.ljust(width)
            for place, (cell, width) in enumerate(zip(row, widths, strict=True))
        )
        for row in rows
    ]
