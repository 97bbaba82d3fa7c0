"""Controllers as documents: terms and rules, for every form that is for reading; rules ranked."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from fis_tools.array_types import Floats
from fis_tools.document import Block, Document, Heading, Paragraph, Table
from fis_tools.model import FuzzyController, FuzzySystem, Rule, Variable
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


def outline(controller: FuzzyController, importance: Mapping[str, Floats] | None = None) -> Document:
    """Describe a controller: its facts, and of each system variables, terms and rules.

    Parameters
    ----------
    controller : FuzzyController
        A controller without problems.
    importance : mapping, optional
        How much each rule matters, as for `ranked`: ranks the rules.
    """
    blocks: list[Block] = [Heading(controller.name, 1)]
    blocks += [Paragraph(_on_one_line(controller.purpose))] if controller.purpose else []
    facts = [[key, _on_one_line(value)] for key, value in (*controller.attributes, *controller.provenance)]
    blocks += [Table([], facts)] if facts else []
    for system in controller.systems:
        blocks += [Heading(system.name), Paragraph(f"{summary(system)}.")]
        for kind, variables in (("Input", system.inputs), ("Output", system.outputs)):
            for variable in variables:
                blocks += _variable(kind, variable)
        blocks += _rules(system, importance)
    return Document(blocks)


def rule_list(controller: FuzzyController, importance: Mapping[str, Floats] | None = None) -> Document:
    """List the rules of a controller as sentences; parameters as of `outline`."""
    blocks: list[Block] = []
    for system in controller.systems:
        blocks += [Heading(system.name), Paragraph(f"{summary(system)}."), _listed(system, importance)]
    return Document(blocks)


def _variable(kind: str, variable: Variable) -> list[Block]:
    default = "" if variable.default is None else f"; {number(variable.default)} when no rule fires"
    about = f"From {extent_words(variable)}{default}. {_on_one_line(variable.description)}".rstrip()
    rows = [[term.name, shape_words(term)] for term in variable.terms]
    terms = [Table(["term", "membership function"], rows)] if rows else []
    return [Heading(f"{kind} {with_unit(variable)}", 3), Paragraph(about), *terms]


def _rules(system: FuzzySystem, importance: Mapping[str, Floats] | None) -> Iterator[Block]:
    tables = rule_tables(system) or []
    yield Heading(f"Rules for {system.outputs[0].name}" if tables else "Rules", 3)
    for title, (heads, *rows) in tables:
        if title:
            yield Paragraph(f"Where {title}:")
        yield Table(heads, rows, across=system.inputs[-1].name)
    is_ranked = importance is not None and system.name in importance
    if is_ranked:
        yield Paragraph("By importance: how far an output moves on average without the rule, of its range.")
    if is_ranked or not tables:
        yield _listed(system, importance)


def _listed(system: FuzzySystem, importance: Mapping[str, Floats] | None) -> Table:
    lines, rules = sentences(system), ranked(system, importance)
    rows = [[rule.importance_words, str(rule.number), f"{lines[rule.number - 1]}."] for rule in rules]
    if rules[0].importance is None:
        return Table(["rule", "sentence"], [row[1:] for row in rows], numbers=(0,))
    return Table(["importance", "rule", "sentence"], rows, numbers=(0, 1))


def _on_one_line(text: str) -> str:
    return " ".join(text.split())
