"""An outline of a controller: what every printed form shows, in words and in order, rules ranked."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fis_tools.model import FuzzyController, FuzzySystem, Rule, Variable
from fis_tools.typing import Floats
from fis_tools.words.text import extent_words, number, rule_tables, sentences, shape_words, summary, with_unit


@dataclass(frozen=True)
class RankedRule:
    """A rule with its place.

    Parameters
    ----------
    number : int
        From 1, in the order of the system, as in every listing.
    rule : Rule
    importance : float or None
        How far it moves an output on average, as a share of the output's range; None if not asked for.
    """

    number: int
    rule: Rule
    importance: float | None

    @property
    def importance_words(self) -> str:
        """The importance in percent."""
        if self.importance is None:
            return ""
        words = f"{100 * self.importance:.2f}"
        return "< 0.01 %" if words == "0.00" and self.importance > 0 else f"{words} %"


def ranked(system: FuzzySystem, importance: Mapping[str, Floats] | None) -> list[RankedRule]:
    """Return the rules of a system, the most important first; in their own order without `importance`.

    Parameters
    ----------
    system : FuzzySystem
    importance : mapping of str to (num_rules,) or (num_rules, num_outputs), optional
        By the system's name, such as `fis_tools.analysis.contribution.importance` returns; of several outputs
        the one on which the rule has the largest effect counts. A system that is missing keeps its order.

    Raises
    ------
    ValueError
        If there are not as many numbers as rules.
    """
    given = None if importance is None else importance.get(system.name)
    if given is None:
        return [RankedRule(number, rule, None) for number, rule in enumerate(system.rules, start=1)]
    shares = np.asarray(given, dtype=np.float64)
    if shares.ndim not in (1, 2) or len(shares) != len(system.rules):
        raise ValueError(
            f"importance of {system.name!r} has shape {shares.shape}; give one number for each of its "
            f"{len(system.rules)} rules"
        )
    shares = shares if shares.ndim == 1 else shares.max(axis=1)
    order = np.argsort(-shares, kind="stable")
    return [RankedRule(int(place) + 1, system.rules[place], float(shares[place])) for place in order]


@dataclass(frozen=True)
class VariableOutline:
    """An input or output, by its kind: title, universe, default (empty for an input), description, terms."""

    kind: str
    title: str
    extent: str
    default: str
    description: str
    terms: list[list[str]]

    @property
    def reach(self) -> str:
        """The universe and the default: ``0 to 200, 101 points; 0 when no rule fires``."""
        return "; ".join(filter(None, (self.extent, self.default)))


@dataclass(frozen=True)
class SystemOutline:
    """A system: its variables, and its rules as tables, as a list, or as both.

    Parameters
    ----------
    name, summary : str
    variables : list of VariableOutline
        Inputs first.
    down, across, output : str
        What the rows, the columns and the cells of a rule table stand for.
    tables : list of (title, rows)
        As of `fis_tools.words.text.rule_tables`; empty where the rules are not a full table.
    rules : list of (number, importance, sentence)
        Those that matter most first, if the rules are ranked; else in their order, without importance.
    is_ranked : bool
    """

    name: str
    summary: str
    variables: list[VariableOutline]
    down: str
    across: str
    output: str
    tables: list[tuple[str, list[list[str]]]]
    rules: list[tuple[str, str, str]]
    is_ranked: bool

    @property
    def lists_rules(self) -> bool:
        """Whether the rules are listed: ranked ones are, and those that no table holds."""
        return self.is_ranked or not self.tables

    @property
    def listed(self) -> list[list[str]]:
        """The list of rules below its heads: importance, if they are ranked, number, sentence."""
        rows = [["importance", "rule", ""], *([share, place, told] for place, share, told in self.rules)]
        return rows if self.is_ranked else [row[1:] for row in rows]


@dataclass(frozen=True)
class Outline:
    """A controller: its name, its facts as (key, value), its systems."""

    name: str
    facts: list[list[str]]
    systems: list[SystemOutline]


def outline(controller: FuzzyController, importance: Mapping[str, Floats] | None = None) -> Outline:
    """Outline a controller.

    Parameters
    ----------
    controller : FuzzyController
        A controller without problems.
    importance : mapping, optional
        How much each rule matters, as for `fis_tools.words.outline.ranked`: ranks the rules.
    """
    facts = [*controller.attributes, *controller.provenance]
    return Outline(
        controller.name,
        [[key, _on_one_line(value)] for key, value in facts],
        [_system(system, importance) for system in controller.systems],
    )


def _system(system: FuzzySystem, importance: Mapping[str, Floats] | None) -> SystemOutline:
    told = sentences(system)
    rules = ranked(system, importance)
    *outer, last = system.inputs
    return SystemOutline(
        name=system.name,
        summary=summary(system),
        variables=[
            *(_variable("input", variable) for variable in system.inputs),
            *(_variable("output", variable) for variable in system.outputs),
        ],
        down=outer[-1].name if outer else "",
        across=last.name,
        output=system.outputs[0].name,
        tables=rule_tables(system) or [],
        rules=[(str(rule.number), rule.importance_words, told[rule.number - 1]) for rule in rules],
        is_ranked=rules[0].importance is not None,
    )


def _variable(kind: str, variable: Variable) -> VariableOutline:
    return VariableOutline(
        kind=kind,
        title=with_unit(variable),
        extent=extent_words(variable),
        default="" if variable.default is None else f"{number(variable.default)} when no rule fires",
        description=_on_one_line(variable.description),
        terms=[[term.name, shape_words(term)] for term in variable.terms],
    )


def _on_one_line(text: str) -> str:
    return " ".join(text.split())
