r"""Fuzzy systems as LaTeX: terms and rule tables with booktabs, to be put into a document by ``\input``."""

import re
from collections.abc import Mapping, Sequence

from fis_tools.model import FuzzyController, FuzzySystem, Variable
from fis_tools.words.ranking import Floats, ranked
from fis_tools.words.text import (
    extent_words,
    number,
    rule_tables,
    sentences,
    shape_words,
    summary,
    with_unit,
)

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
    """Write a controller as sections and tables of a LaTeX document.

    Parameters
    ----------
    controller : FuzzyController
        A controller without problems.
    importance : mapping, optional
        How much each rule matters, as for `fis_tools.words.ranking.ranked`: adds the rules in this order.
    """
    lines = [_PREAMBLE, rf"\section*{{{_escaped(controller.name)}}}"]
    facts = [*controller.attributes, *controller.provenance]
    if facts:
        lines += _table("ll", [], [[key, " ".join(value.split())] for key, value in facts])
    for system in controller.systems:
        lines += _system_lines(system, importance)
    return "\n".join(lines) + "\n"


def _system_lines(system: FuzzySystem, importance: Mapping[str, Floats] | None) -> list[str]:
    lines = ["", rf"\subsection*{{{_escaped(system.name)}}}", f"{_escaped(summary(system))}."]
    for kind, variables in (("Input", system.inputs), ("Output", system.outputs)):
        for variable in variables:
            lines += _variable_lines(kind, variable)
    lines += ["", r"\subsubsection*{Rules}"]
    tables = rule_tables(system)
    for title, rows in tables or []:
        lines += [f"Where {_escaped(title)}:"] if title else []
        lines += _rule_table(system, rows)
    is_ranked = importance is not None and system.name in importance
    if tables is None or is_ranked:
        lines += _rule_list(system, importance if is_ranked else None)
    return lines


def _variable_lines(kind: str, variable: Variable) -> list[str]:
    about = f" {' '.join(variable.description.split())}" if variable.description else ""
    extent = f"From {extent_words(variable)}"
    default = f"; {number(variable.default)} when no rule fires" if variable.default is not None else ""
    rows = [[term.name, shape_words(term)] for term in variable.terms]
    return [
        "",
        rf"\subsubsection*{{{kind} {_escaped(with_unit(variable))}}}",
        f"{_escaped(extent + default)}.{_escaped(about)}",
        *_table(r"lp{.6\linewidth}", [_row(["term", "membership function"])], rows),
    ]


def _rule_table(system: FuzzySystem, rows: Sequence[Sequence[str]]) -> list[str]:
    """Set a rule table, the name of the input that runs across above its terms."""
    *outer, across = system.inputs
    num_terms = len(across.terms)
    first, *rest = rows
    head = [
        rf" & \multicolumn{{{num_terms}}}{{c}}{{{_escaped(across.name)}}} \\",
        rf"\cmidrule(l){{2-{num_terms + 1}}}",
        _row([outer[-1].name if outer else "", *first[1:]]),
    ]
    width = sum(max(len(cell) for cell in column) for column in list(zip(*rows, strict=True))[1:])
    return _table("l" * (num_terms + 1), head, rest, "small" if width <= WIDE else "scriptsize")


def _rule_list(system: FuzzySystem, importance: Mapping[str, Floats] | None) -> list[str]:
    told = sentences(system)
    entries = ranked(system, importance)
    if importance is None:
        rows = [[str(entry.number), told[entry.number - 1]] for entry in entries]
        return _table(r"rp{.85\linewidth}", [_row(["rule", ""])], rows)
    rows = [[entry.importance_words, str(entry.number), told[entry.number - 1]] for entry in entries]
    return _table(r"rrp{.7\linewidth}", [_row(["importance", "rule", ""])], rows)


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
