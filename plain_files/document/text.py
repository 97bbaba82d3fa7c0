"""Documents as plain text, as Markdown and as LaTeX."""

import re
import textwrap
from collections.abc import Collection, Iterator, Sequence

from plain_files.document import Block, Cell, Change, Code, Document, Heading, Items, Paragraph, Table

#: Sentences are wrapped at this column, and tables of changes that are wider are listed instead.
WIDTH = 110
TO = "→"
#: in a table of changes, stands for what did not change
SAME = "·"


def write(document: Document, width: int = WIDTH) -> str:
    """Write a document as plain text; what stands below a heading is indented, sentences are wrapped."""
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
    """Yield the lines of a block as plain text."""
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
    """Return words as indented lines; a number stays on a line with its per cent sign."""
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
    """Return a table as aligned lines; one that is too wide becomes a list of its changed cells."""
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


def _cell(cell: Cell, same: str = SAME) -> str:
    if not isinstance(cell, Change):
        return str(cell)
    return (same or cell.after) if cell.before == cell.after else f"{cell.before} {TO} {cell.after}"


def aligned(rows: Sequence[Sequence[str]], numbers: Collection[int] = (), between: str = "  ") -> list[str]:
    """Return rows as lines whose cells stand below one another, those of numbers at the right."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        between.join(
            cell.rjust(width) if column in numbers else cell.ljust(width)
            for column, (cell, width) in enumerate(zip(row, widths, strict=True))
        )
        for row in rows
    ]


# What Markdown would take for markup; an underscore inside a word is none.
_MARKUP = re.compile(r"[\\|*`<\[#]|(?<!\w)_|_(?!\w)")


def write_markdown(document: Document) -> str:
    """Write a document as Markdown; tables have a row of heads, which may be empty."""
    blocks = ("\n".join(_markdown_lines(block)) for block in document.unfolded)
    return "\n\n".join(blocks) + "\n"


def _markdown_lines(block: Block) -> Iterator[str]:
    """Yield the lines of a block in Markdown."""
    match block:
        case Heading(words, level):
            yield f"{'#' * level} {_markdown(words)}"
        case Paragraph(words):
            yield _markdown(words)
        case Items(items):
            for item in items:
                yield "- " + "  \n  ".join(map(_markdown, item.split("\n")))
        case Code(words):
            yield from ("```", words, "```")
        case Table(heads, rows, numbers, _, caption):
            if caption:
                yield from (_markdown(caption), "")
            width = len(heads or rows[0])
            rule = ["--:" if column in numbers else "---" for column in range(width)]
            cells = [[_markdown_cell(cell) for cell in row] for row in (heads or [""] * width, *rows)]
            yield from (f"| {line} |" for line in aligned([cells[0], rule, *cells[1:]], numbers, " | "))


def _markdown_cell(cell: Cell) -> str:
    """Return a cell in Markdown; a change shows the old value struck through."""
    if not isinstance(cell, Change):
        return _markdown(str(cell))
    before, after = map(_markdown, (cell.before, cell.after))
    return after if before == after else f"~~{before}~~ → {after}"


def _markdown(words: str) -> str:
    return _MARKUP.sub(lambda match: f"\\{match[0]}", words)


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
    **{sign: f"\\{sign}" for sign in "{}$&#%_"},
    "^": r"\textasciicircum{}",
    "~": r"\textasciitilde{}",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
    "|": r"\textbar{}",
    '"': "''",
}
_TO_ESCAPE = re.compile("[" + re.escape("".join(_SPECIAL)) + "]")


def write_latex(document: Document) -> str:
    r"""Write a document as LaTeX with booktabs, to be put into another by ``\input``."""
    lines = [line for block in document.unfolded for line in ("", *_latex_lines(block))]
    return "\n".join([_PREAMBLE, *lines[1:]]) + "\n"


def _latex_lines(block: Block) -> Iterator[str]:
    """Yield the lines of a block in LaTeX."""
    match block:
        case Heading(words, level):
            yield rf"\{_SECTIONS[level]}*{{{_latex(words)}}}"
        case Paragraph(words):
            yield _latex(words)
        case Items(items):
            yield r"\begin{itemize}"
            yield from (r"\item " + r" \\ ".join(map(_latex, item.split("\n"))) for item in items)
            yield r"\end{itemize}"
        case Code(words):
            yield from (r"\begin{verbatim}", words, r"\end{verbatim}")
        case Table():
            yield from ([_latex(block.caption), ""] if block.caption else [])
            yield from _latex_table(block)


def _latex_table(table: Table) -> list[str]:
    """Set rows between rules; those of a long table break across pages below a repeated head."""
    rows = [[_cell(cell, same="") for cell in row] for row in table.rows]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    columns = ["r" if column in table.numbers else "l" for column in range(len(widths))]
    if widths[-1] > SENTENCE and not table.across:
        columns[-1] = rf"p{{{max(0.4, 0.95 - 0.1 * len(widths)):.2f}\linewidth}}"
    top = [r"\toprule", *_latex_heads(table), *([r"\midrule"] if table.heads else [])]
    body = [_latex_row(row) for row in rows]
    spec = "".join(columns)
    if len(rows) > LONG:
        end = [r"\endhead", r"\bottomrule", r"\endlastfoot"]
        return [rf"\begin{{longtable}}{{{spec}}}", *top, *end, *body, r"\end{longtable}"]
    size = "scriptsize" if table.across and sum(widths[1:]) > WIDE else "small"
    tabular = [rf"\begin{{tabular}}{{{spec}}}", *top, *body, r"\bottomrule", r"\end{tabular}"]
    return [rf"\begin{{center}}\{size}", *tabular, r"\end{center}"]


def _latex_heads(table: Table) -> list[str]:
    """Return the row of heads, what all columns stand for above them."""
    heads = [_latex_row(table.heads)] if table.heads else []
    if not table.across:
        return heads
    last = len(table.heads)
    above = rf" & \multicolumn{{{last - 1}}}{{c}}{{{_latex(table.across)}}} \\"
    return [above, rf"\cmidrule(l){{2-{last}}}", *heads]


def _latex_row(cells: Sequence[str]) -> str:
    # braces keep a cell that begins with [ or * from being read as an option of the line before
    texts = [f"{{{text}}}" if text.startswith(("[", "*")) else text for text in map(_latex, cells)]
    return " & ".join(texts) + r" \\"


def _latex(words: str) -> str:
    return _TO_ESCAPE.sub(lambda match: _SPECIAL[match[0]], words)
