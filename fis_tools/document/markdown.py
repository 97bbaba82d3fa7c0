"""Documents as Markdown, for a repository, a report or a notebook."""

import re
from collections.abc import Iterator

from fis_tools.document import Block, Cell, Change, Code, Document, Heading, Items, Paragraph, Table
from fis_tools.document.text import aligned

# What Markdown would take for markup; an underscore inside a word is none.
_MARKUP = re.compile(r"[\\|*`<\[#]|(?<!\w)_|_(?!\w)")


def write(document: Document) -> str:
    """Write a document; tables have a row of heads, which may be empty."""
    blocks = ("\n".join(_lines(block)) for block in document.unfolded)
    return "\n\n".join(blocks) + "\n"


def _lines(block: Block) -> Iterator[str]:
    match block:
        case Heading(words, level):
            yield f"{'#' * level} {_escaped(words)}"
        case Paragraph(words):
            yield _escaped(words)
        case Items(items):
            for item in items:
                yield "- " + "  \n  ".join(map(_escaped, item.split("\n")))
        case Code(words):
            yield from ("```", words, "```")
        case Table(heads, rows, numbers, _, caption):
            if caption:
                yield from (_escaped(caption), "")
            width = len(heads or rows[0])
            rule = ["--:" if place in numbers else "---" for place in range(width)]
            cells = [[_cell(cell) for cell in row] for row in (heads or [""] * width, *rows)]
            yield from (f"| {line} |" for line in aligned([cells[0], rule, *cells[1:]], numbers, " | "))


def _cell(cell: Cell) -> str:
    if not isinstance(cell, Change):
        return _escaped(str(cell))
    before, after = map(_escaped, (cell.before, cell.after))
    return after if before == after else f"~~{before}~~ → {after}"


def _escaped(words: str) -> str:
    return _MARKUP.sub(lambda match: f"\\{match[0]}", words)
