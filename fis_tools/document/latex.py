r"""Documents as LaTeX with booktabs, to be put into another by ``\input``."""

import re
from collections.abc import Iterator, Sequence

from fis_tools.document import Block, Cell, Change, Code, Document, Heading, Items, Paragraph, Table

#: A table with more rows than this may break across pages.
LONG = 30
#: A table whose columns but the first have more letters than this is set in small print.
WIDE = 50
#: A last column with more letters than this in a cell is set in lines.
SENTENCE = 40

_PREAMBLE = r"""% Put this file into a document by \input; its preamble needs
%   \usepackage{booktabs, longtable}
"""
_SECTIONS = {1: "section", 2: "subsection", 3: "subsubsection", 4: "paragraph"}
_SPECIAL = {
    "\\": r"\textbackslash{}",
    "{": r"\{",
    "}": r"\}",
    "$": r"\$",
    "&": r"\&",
    "#": r"\#",
    "%": r"\%",
    "_": r"\_",
    "^": r"\textasciicircum{}",
    "~": r"\textasciitilde{}",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
    "|": r"\textbar{}",
    '"': "''",
}
_TO_ESCAPE = re.compile("[" + re.escape("".join(_SPECIAL)) + "]")


def write(document: Document) -> str:
    """Write a document; pictures are left out."""
    lines = [line for block in document.unfolded for line in ("", *_lines(block))]
    return "\n".join([_PREAMBLE, *lines[1:]]) + "\n"


def _lines(block: Block) -> Iterator[str]:
    match block:
        case Heading(words, level):
            yield rf"\{_SECTIONS[level]}*{{{_escaped(words)}}}"
        case Paragraph(words):
            yield _escaped(words)
        case Items(items):
            yield r"\begin{itemize}"
            yield from (r"\item " + r" \\ ".join(map(_escaped, item.split("\n"))) for item in items)
            yield r"\end{itemize}"
        case Code(words):
            yield from (r"\begin{verbatim}", words, r"\end{verbatim}")
        case Table():
            yield from ([_escaped(block.caption), ""] if block.caption else [])
            yield from _table(block)


def _table(table: Table) -> list[str]:
    """Set rows between rules; those of a long table break across pages below a repeated head."""
    rows = [[_cell(cell) for cell in row] for row in table.rows]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    columns = ["r" if place in table.numbers else "l" for place in range(len(widths))]
    if widths[-1] > SENTENCE and not table.across:
        columns[-1] = rf"p{{{max(0.4, 0.95 - 0.1 * len(widths)):.2f}\linewidth}}"
    top = [r"\toprule", *_heads(table), *([r"\midrule"] if table.heads else [])]
    body = [_row(row) for row in rows]
    spec = "".join(columns)
    if len(rows) > LONG:
        end = [r"\endhead", r"\bottomrule", r"\endlastfoot"]
        return [rf"\begin{{longtable}}{{{spec}}}", *top, *end, *body, r"\end{longtable}"]
    size = "scriptsize" if table.across and sum(widths[1:]) > WIDE else "small"
    tabular = [rf"\begin{{tabular}}{{{spec}}}", *top, *body, r"\bottomrule", r"\end{tabular}"]
    return [rf"\begin{{center}}\{size}", *tabular, r"\end{center}"]


def _heads(table: Table) -> list[str]:
    """Return the row of heads, what all columns stand for above them."""
    heads = [_row(table.heads)] if table.heads else []
    if not table.across:
        return heads
    last = len(table.heads)
    above = rf" & \multicolumn{{{last - 1}}}{{c}}{{{_escaped(table.across)}}} \\"
    return [above, rf"\cmidrule(l){{2-{last}}}", *heads]


def _row(cells: Sequence[str]) -> str:
    # braces keep a cell that begins with [ or * from being read as an option of the line before
    texts = [f"{{{text}}}" if text.startswith(("[", "*")) else text for text in map(_escaped, cells)]
    return " & ".join(texts) + r" \\"


def _cell(cell: Cell) -> str:
    if not isinstance(cell, Change):
        return str(cell)
    return cell.after if cell.before == cell.after else f"{cell.before} → {cell.after}"


def _escaped(words: str) -> str:
    return _TO_ESCAPE.sub(lambda match: _SPECIAL[match[0]], words)
