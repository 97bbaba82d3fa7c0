"""A simplified controller, the steps that led to it, and their report."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal

from fis_tools.document import Block, Document, Heading, Paragraph, Result, Table
from fis_tools.document.data import plain
from fis_tools.findings.simplification.budget import FLOWN, SPREAD, Budget, Change
from fis_tools.model import FuzzyController, FuzzySystem
from fis_tools.words.text import amount, span

Kind = Literal["input", "drop", "merge", "terms", "round"]


@dataclass(frozen=True)
class Step:
    """One simplification step.

    Parameters
    ----------
    kind : str
        ``input`` left out, ``drop`` of rules, ``merge`` of two terms, ``terms`` that no rule uses, or
        ``round`` of numbers.
    sentence : str
        The step in words.
    rules : tuple of int
        The numbers, in the original, of the removed rules.
    num_rules, num_terms : int
        How many there are afterwards.
    changes : dict of str to Change
        How far outputs then deviate from the original's, along ``flights`` and over the ``ranges``.
    """

    kind: Kind
    sentence: str
    rules: tuple[int, ...]
    num_rules: int
    num_terms: int
    changes: Mapping[str, Change]


@dataclass(frozen=True)
class SimplifiedSystem:
    """A system before and after.

    Parameters
    ----------
    original, simplified : FuzzySystem
    num_flown : int
        Inferences on flights that were looked at.
    steps : tuple of Step
    changes : dict of str to Change
        How far the simplified system deviates from the original.
    """

    original: FuzzySystem
    simplified: FuzzySystem
    num_flown: int
    steps: tuple[Step, ...]
    changes: Mapping[str, Change]


@dataclass(frozen=True, repr=False)
class Simplification(Result):
    """The result of simplifying a controller.

    Parameters
    ----------
    original, controller : FuzzyController
        Before, and after: an ordinary controller.
    budget : Budget
    systems : tuple of SimplifiedSystem
    """

    original: FuzzyController
    controller: FuzzyController
    budget: Budget
    systems: tuple[SimplifiedSystem, ...]

    @property
    def summary(self) -> str:
        """The result in a sentence."""
        rules = [sum(len(s.rules) for s in c.systems) for c in (self.original, self.controller)]
        terms = [sum(map(num_terms, c.systems)) for c in (self.original, self.controller)]
        return (
            f"{self.original.name}: {rules[0]} rules to {rules[1]}, {terms[0]} terms to {terms[1]}, at "
            f"{budget_words(self.budget, flown=any(system.num_flown for system in self.systems))}"
        )

    def document(self) -> Document:
        """List the steps, in one table per system."""
        blocks: list[Block] = [Heading(self.summary)]
        for system in self.systems:
            blocks += [*map(Paragraph, _heads(system)), *_table(system)]
        return Document(blocks)

    def plain(self) -> dict[str, Any]:
        """Return the steps as plain JSON data.

        Keys are ``controller`` (its name), ``budget`` and ``systems``; of each its ``name``, how many
        ``rules`` and ``terms`` it had and has, its ``changes``, and its ``steps`` as in `Step`. ``changes``
        hold, along ``flights`` and over ``ranges``, the ``largest`` and the ``mean`` for each output, as
        shares of its range.
        """
        return {
            "controller": self.original.name,
            "budget": plain(self.budget),
            "systems": [
                {
                    "name": system.original.name,
                    "rules": [len(system.original.rules), len(system.simplified.rules)],
                    "terms": [num_terms(system.original), num_terms(system.simplified)],
                    "changes": plain(system.changes),
                    "steps": plain(system.steps),
                }
                for system in self.systems
            ],
        }


def num_terms(system: FuzzySystem) -> int:
    """Count the terms of all variables."""
    return sum(len(variable.terms) for variable in (*system.inputs, *system.outputs))


def budget_words(budget: Budget, *, flown: bool) -> str:
    """Return a budget in words."""
    where = "along the logs" if flown else "over the ranges of the inputs"
    if flown and not budget.flights_only:
        where += " and over the ranges of the inputs"
    return (
        f"a change of {100.0 * budget.max_change:g} % of an output's range at most and "
        f"{100.0 * budget.mean_change:g} % on average, {where}"
    )


_PLACES = {FLOWN: "along the logs", SPREAD: "over the ranges"}


def _heads(system: SimplifiedSystem) -> list[str]:
    """Say in the units of the outputs how far a system departs."""
    if not system.steps:
        return [f"{system.original.name}: nothing can be made simpler within the budget"]
    lines = []
    for place, output in enumerate(system.original.outputs):
        changes = []
        for name, change in system.changes.items():
            most, mean = (part[place] * span(output) for part in (change.largest, change.mean))
            changes.append(
                f"{amount(output, most)} at most and {amount(output, mean)} on average {_PLACES[name]}"
            )
        lines.append(f"{system.original.name}: {output.name} departs by {'; by '.join(changes)}")
    return lines


def _table(system: SimplifiedSystem) -> Iterator[Table]:
    if not system.steps:
        return
    sets = list(system.changes)
    heads = [f"{word} {_PLACES[name].split()[-1]}" for name in sets for word in ("max,", "mean,")]
    original = [str(len(system.original.rules)), str(num_terms(system.original))]
    rows = [[*original, *[""] * len(heads), "the original"]]
    for step in system.steps:
        changes = [
            f"{100.0 * value:.2f} %"
            for name in sets
            for value in (max(step.changes[name].largest), max(step.changes[name].mean))
        ]
        rows.append([str(step.num_rules), str(step.num_terms), *changes, step.sentence])
    yield Table(["rules", "terms", *heads, "step"], rows, numbers=range(2 + len(heads)))
