"""Fuzzy systems as Markdown: terms and rule tables, for a report or a repository."""

import re
from collections.abc import Mapping, Sequence

from fis_tools.model import FuzzyController
from fis_tools.typing import Floats
from fis_tools.words.outline import SystemOutline, VariableOutline, outline
from fis_tools.words.text import padded


def write(controller: FuzzyController, importance: Mapping[str, Floats] | None = None) -> str:
    """Write a controller as Markdown; see `fis_tools.words.outline.outline` for the parameters."""
    told = outline(controller, importance)
    lines = [f"# {_escaped(told.name)}", ""]
    if told.facts:
        lines += [*_table([["", ""], *told.facts]), ""]
    for system in told.systems:
        lines += _system_lines(system)
    return "\n".join(lines).rstrip() + "\n"


def _system_lines(system: SystemOutline) -> list[str]:
    lines = [f"## {_escaped(system.name)}", "", f"{_escaped(system.summary)}.", ""]
    for variable in system.variables:
        lines += _variable_lines(variable)
    lines += ["### Rules", ""]
    for title, rows in system.tables:
        lines += [f"Where {_escaped(title)}:", ""] if title else []
        lines += [*_table(rows), ""]
    if system.is_ranked:
        lines += ["Those that matter most first:", "", *_table(system.listed), ""]
    elif system.lists_rules:
        lines += [*(f"{place}. {_escaped(sentence)}." for place, _, sentence in system.rules), ""]
    return lines


def _variable_lines(variable: VariableOutline) -> list[str]:
    about = f" {_escaped(variable.description)}" if variable.description else ""
    rows = [["term", "membership function"], *variable.terms]
    head = f"### {variable.kind.capitalize()} {_escaped(variable.title)}"
    return [head, "", f"From {variable.reach}.{about}", "", *_table(rows), ""]


def _table(rows: Sequence[Sequence[str]]) -> list[str]:
    cells = padded([[_escaped(cell).ljust(3) for cell in row] for row in rows])
    head, *body = (f"| {' | '.join(row)} |" for row in cells)
    return [head, "|" + "|".join("-" * (len(cell) + 2) for cell in cells[0]) + "|", *body]


# What Markdown would take for markup; an underscore inside a word is none.
_MARKUP = re.compile(r"[\\|*`<\[#]|(?<!\w)_|_(?!\w)")


def _escaped(text: str) -> str:
    return _MARKUP.sub(lambda match: f"\\{match[0]}", text)
