"""A partly simplified system, and the steps that can be taken next."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from fis_tools.analysis.contribution import contributions
from fis_tools.array_types import Floats
from fis_tools.engines.compiler import compile
from fis_tools.findings.simplification.budget import Bench
from fis_tools.findings.simplification.report import Kind
from fis_tools.findings.simplification.rewriting import merged, mergers, pruned, without_rule
from fis_tools.findings.simplification.rounding import Unit, rounded, units
from fis_tools.model import FuzzySystem
from fis_tools.words.text import listed, percent, sentence


@dataclass(frozen=True)
class Draft:
    """A partly simplified system.

    Parameters
    ----------
    exact : FuzzySystem
        With the numbers not yet rounded.
    numbers : tuple of int
        Of its rules, in the original, from 1.
    digits : dict
        To how many digits `fis_tools.findings.simplification.rounding.units` are rounded.
    """

    exact: FuzzySystem
    numbers: tuple[int, ...]
    digits: Mapping[Unit, int] = field(default_factory=dict)

    @cached_property
    def system(self) -> FuzzySystem:
        """The system as it would be used."""
        return rounded(self.exact, self.digits)


@dataclass(frozen=True)
class Proposal:
    """A step that can be taken next.

    Parameters
    ----------
    key : tuple
        Identifies it, so that a rejected step is not proposed again.
    kind : str
    words : str
        The step in words.
    draft : Draft
        The result.
    """

    key: tuple[str, ...]
    kind: Kind
    words: str
    draft: Draft


def cleaned(draft: Draft) -> Draft:
    """Remove the terms that no rule uses."""
    return replace(draft, exact=pruned(draft.exact))


def unused_words(before: FuzzySystem, after: FuzzySystem) -> str:
    """List the removed terms, by variable; empty if there are none."""
    told = []
    for old, new in zip((*before.inputs, *before.outputs), (*after.inputs, *after.outputs), strict=True):
        names = {term.name for term in new.terms}
        gone = [term.name for term in old.terms if term.name not in names]
        told += [f"{listed(gone, len(gone))} of {old.name}"] if gone else []
    return listed(told, len(told))


def proposals(draft: Draft, bench: Bench) -> list[tuple[float, Proposal]]:
    """Propose steps, the cheapest first, each with the share of the budget then used."""
    importance = np.zeros(len(draft.numbers))
    found: list[tuple[float, Proposal]] = []
    for cost, moved, place in _ranked_drops(draft, bench):
        importance[place] = moved
        shorter = without_rule(draft.exact, place)
        if shorter is not None:
            number = draft.numbers[place]
            numbers = draft.numbers[:place] + draft.numbers[place + 1 :]
            words = f"drop rule {number}: {sentence(draft.exact.rules[place])}"
            after = cleaned(replace(draft, exact=shorter, numbers=numbers))
            found.append((cost, Proposal(("drop", str(number)), "drop", words, after)))
    for proposal in _merge_proposals(draft, bench, importance):
        found.append((bench.cost(bench.measure(proposal.draft.system)), proposal))
    return sorted(found, key=lambda entry: entry[0])


def _ranked_drops(draft: Draft, bench: Bench) -> Iterator[tuple[float, float, int]]:
    """Yield for each rule the cost of dropping it, how much it moves on average, and its place."""
    compiled = compile(draft.system)
    moved = {name: contributions(compiled, rows) for name, rows in bench.samples.items()}
    outputs = {name: compiled(rows) for name, rows in bench.samples.items()}
    for place in range(len(draft.numbers)):
        changes = {name: bench.change(name, outputs[name] - moved[name][:, place]) for name in moved}
        importance = max(float((np.abs(part[:, place]) / bench.spans).mean()) for part in moved.values())
        yield bench.cost(changes), importance, place


def _merge_proposals(draft: Draft, bench: Bench, importance: Floats) -> Iterator[Proposal]:
    for merger in mergers(draft.exact, bench.budget.look_alike):
        exact, places = merged(draft.exact, merger, importance)
        gone = [str(number) for place, number in enumerate(draft.numbers) if place not in places]
        words = (
            f"merge {merger.dropped} of {merger.variable} into {merger.kept}"
            f"{', halfway between the two' * merger.is_mean}; they shared {percent(merger.similarity)} of "
            "their areas"
        )
        if gone:
            words += f"; rule{'s' if len(gone) > 1 else ''} {listed(gone, len(gone))} went with it"
        after = cleaned(Draft(exact, tuple(draft.numbers[place] for place in places), draft.digits))
        shape = repr(merger.membership)
        yield Proposal(("merge", merger.variable, merger.kept, merger.dropped, shape), "merge", words, after)


def rounded_draft(draft: Draft, count: int, only: Unit | None = None) -> Draft:
    """Round all numbers of a draft, or one unit of them, to so many digits, unless they have fewer."""
    chosen = units(draft.exact) if only is None else [only]
    finer = {unit: count for unit in chosen if draft.digits.get(unit, count + 1) > count}
    return replace(draft, digits={**draft.digits, **finer})
