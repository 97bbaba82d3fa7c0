"""Fuzzy systems as plain text: the rules as sentences, or the whole controller for a terminal."""

from collections.abc import Mapping

from fis_tools.model import FuzzyController
from fis_tools.typing import Floats
from fis_tools.words.outline import SystemOutline, VariableOutline, outline
from fis_tools.words.text import aligned


def write(controller: FuzzyController, importance: Mapping[str, Floats] | None = None) -> str:
    """Write every rule as a sentence; see `fis_tools.words.outline.outline` for the parameters."""
    lines: list[str] = []
    for system in outline(controller, importance).systems:
        lines += [f"{system.name}: {system.summary}", "", *_listed(system), ""]
    return "\n".join(lines[:-1]) + "\n"


def describe(controller: FuzzyController, importance: Mapping[str, Floats] | None = None) -> str:
    """Write variables, terms and rule tables for a terminal, ranked rules below; parameters as of `write`."""
    told = outline(controller, importance)
    lines = [told.name, *aligned(told.facts, 2)]
    for system in told.systems:
        lines += ["", f"{system.name}: {system.summary}"]
        for variable in system.variables:
            lines += ["", *_variable_lines(variable)]
        lines += ["", *_rule_lines(system)]
        if system.is_ranked:
            head = "  rules by importance: how far an output moves on average without the rule, of its range"
            lines += ["", head, *(f"    {line}" for line in _listed(system))]
    return "\n".join(lines) + "\n"


def _listed(system: SystemOutline) -> list[str]:
    return [
        f"{importance:>8}  " * system.is_ranked + f"{number:>3}. {sentence}."
        for number, importance, sentence in system.rules
    ]


def _variable_lines(variable: VariableOutline) -> list[str]:
    default = f", {variable.default}" if variable.default else ""
    about = f". {variable.description}" if variable.description else ""
    head = f"  {variable.kind} {variable.title}: {variable.extent}{default}{about}"
    return [head, *aligned(variable.terms, 4)]


def _rule_lines(system: SystemOutline) -> list[str]:
    if not system.tables:
        in_order = sorted(system.rules, key=lambda rule: int(rule[0]))
        return ["  rules", *(f"    {number}. {sentence}" for number, _, sentence in in_order)]
    lines = [f"  rules for {system.output}"]
    for title, rows in system.tables:
        lines += [f"    where {title}"] if title else []
        lines += aligned(rows, 6 if title else 4)
    return lines
