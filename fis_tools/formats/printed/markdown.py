"""Fuzzy systems as Markdown: terms and rule tables, for a report or a repository."""

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


def write(controller: FuzzyController, importance: Mapping[str, Floats] | None = None) -> str:
    """Write a controller as a Markdown document.

    Parameters
    ----------
    controller : FuzzyController
        A controller without problems.
    importance : mapping, optional
        How much each rule matters, as for `fis_tools.words.ranking.ranked`: adds the rules in this order.
    """
    lines = [f"# {_escaped(controller.name)}", ""]
    facts = [*controller.attributes, *controller.provenance]
    if facts:
        lines += [*_table([["", ""], *([key, " ".join(value.split())] for key, value in facts)]), ""]
    for system in controller.systems:
        lines += _system_lines(system, importance)
    return "\n".join(lines).rstrip() + "\n"


def _system_lines(system: FuzzySystem, importance: Mapping[str, Floats] | None) -> list[str]:
    lines = [f"## {_escaped(system.name)}", "", f"{_escaped(summary(system))}.", ""]
    for kind, variables in (("Input", system.inputs), ("Output", system.outputs)):
        for variable in variables:
            lines += _variable_lines(kind, variable)
    lines += ["### Rules", ""]
    tables = rule_tables(system)
    for title, rows in tables or []:
        lines += [f"Where {_escaped(title)}:", ""] if title else []
        lines += [*_table(rows), ""]
    if importance is not None and system.name in importance:
        return [*lines, "Those that matter most first:", "", *_table(_ranked_rows(system, importance)), ""]
    if tables is None:
        told = [f"{place}. {_escaped(words)}." for place, words in enumerate(sentences(system), 1)]
        return [*lines, *told, ""]
    return lines


def _ranked_rows(system: FuzzySystem, importance: Mapping[str, Floats]) -> list[list[str]]:
    told = sentences(system)
    return [
        ["importance", "rule", ""],
        *([r.importance_words, str(r.number), told[r.number - 1]] for r in ranked(system, importance)),
    ]


def _variable_lines(kind: str, variable: Variable) -> list[str]:
    about = f" {' '.join(variable.description.split())}" if variable.description else ""
    extent = f"From {extent_words(variable)}"
    default = f"; {number(variable.default)} when no rule fires" if variable.default is not None else ""
    rows = [["term", "membership function"], *([term.name, shape_words(term)] for term in variable.terms)]
    return [
        f"### {kind} {_escaped(with_unit(variable))}",
        "",
        f"{extent}{default}.{_escaped(about)}",
        "",
        *_table(rows),
        "",
    ]


def _table(rows: Sequence[Sequence[str]]) -> list[str]:
    cells = [[_escaped(cell) for cell in row] for row in rows]
    widths = [max(3, *(len(cell) for cell in column)) for column in zip(*cells, strict=True)]
    head, *body = (
        "| " + " | ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)) + " |"
        for row in cells
    )
    return [head, "|" + "|".join("-" * (width + 2) for width in widths) + "|", *body]


# What Markdown would take for markup; an underscore inside a word is none.
_MARKUP = re.compile(r"[\\|*`<\[#]|(?<!\w)_|_(?!\w)")


def _escaped(text: str) -> str:
    return _MARKUP.sub(lambda match: f"\\{match[0]}", text)
