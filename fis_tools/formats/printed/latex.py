r"""Fuzzy systems as LaTeX: terms and rule tables with booktabs, to be put into a document by ``\input``."""

import re
from collections.abc import Mapping, Sequence

from fis_tools.model import FuzzyController
from fis_tools.typing import Floats
from fis_tools.words.outline import SystemOutline, VariableOutline, outline

#: A table with more rows than this may break across pages.
LONG = 30
#: A rule table whose columns have more letters than this is set in small print.
WIDE = 50

_PREAMBLE = r"""% Put this file into a document by \input; its preamble needs
%   \usepackage{booktabs, longtable}
"""

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


def write(controller: FuzzyController, importance: Mapping[str, Floats] | None = None) -> str:
    """Write a controller as LaTeX; see `fis_tools.words.outline.outline` for the parameters."""
    told = outline(controller, importance)
    lines = [_PREAMBLE, rf"\section*{{{_escaped(told.name)}}}"]
    if told.facts:
        lines += _table("ll", [], told.facts)
    for system in told.systems:
        lines += _system_lines(system)
    return "\n".join(lines) + "\n"


def _system_lines(system: SystemOutline) -> list[str]:
    lines = ["", rf"\subsection*{{{_escaped(system.name)}}}", f"{_escaped(system.summary)}."]
    for variable in system.variables:
        lines += _variable_lines(variable)
    lines += ["", r"\subsubsection*{Rules}"]
    for title, rows in system.tables:
        lines += [f"Where {_escaped(title)}:"] if title else []
        lines += _rule_table(system, rows)
    if system.lists_rules:
        heads, *rows = system.listed
        columns = r"rrp{.7\linewidth}" if system.is_ranked else r"rp{.85\linewidth}"
        lines += _table(columns, [_row(heads)], rows)
    return lines


def _variable_lines(variable: VariableOutline) -> list[str]:
    about = f" {_escaped(variable.description)}" if variable.description else ""
    return [
        "",
        rf"\subsubsection*{{{variable.kind.capitalize()} {_escaped(variable.title)}}}",
        f"From {_escaped(variable.reach)}.{about}",
        *_table(r"lp{.6\linewidth}", [_row(["term", "membership function"])], variable.terms),
    ]


def _rule_table(system: SystemOutline, rows: Sequence[Sequence[str]]) -> list[str]:
    """Set a rule table, the name of the input that runs across above its terms."""
    first, *rest = rows
    num_terms = len(first) - 1
    head = [
        rf" & \multicolumn{{{num_terms}}}{{c}}{{{_escaped(system.across)}}} \\",
        rf"\cmidrule(l){{2-{num_terms + 1}}}",
        _row([system.down, *first[1:]]),
    ]
    width = sum(max(len(cell) for cell in column) for column in list(zip(*rows, strict=True))[1:])
    return _table("l" * (num_terms + 1), head, rest, "small" if width <= WIDE else "scriptsize")


def _table(
    columns: str, head: Sequence[str], rows: Sequence[Sequence[str]], size: str = "small"
) -> list[str]:
    """Set rows between rules; those of a long table break across pages below a repeated head."""
    heads = [r"\toprule", *head, *([r"\midrule"] if head else [])]
    body = [_row(row) for row in rows]
    if len(rows) > LONG:
        return [
            "",
            rf"\begin{{longtable}}{{{columns}}}",
            *heads,
            r"\endhead",
            r"\bottomrule",
            r"\endlastfoot",
            *body,
            r"\end{longtable}",
        ]
    tabular = [rf"\begin{{tabular}}{{{columns}}}", *heads, *body, r"\bottomrule", r"\end{tabular}"]
    return ["", rf"\begin{{center}}\{size}", *tabular, r"\end{center}"]


def _row(cells: Sequence[str]) -> str:
    # braces keep a cell that begins with [ or * from being read as an option of the line before
    texts = [f"{{{text}}}" if text.startswith(("[", "*")) else text for text in map(_escaped, cells)]
    return " & ".join(texts) + r" \\"


def _escaped(text: str) -> str:
    return _TO_ESCAPE.sub(lambda match: _SPECIAL[match[0]], text)
