"""A partly simplified system, its numbers rounded, and the steps that can be taken next."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from fis_tools.analysis.contribution import contributions
from fis_tools.analysis.measures import centre
from fis_tools.array_types import Floats
from fis_tools.engines.compiler import compile
from fis_tools.findings.simplification.budget import Bench
from fis_tools.findings.simplification.report import Kind
from fis_tools.findings.simplification.rewriting import merged, mergers, pruned, without_rule
from fis_tools.model import FuzzySystem, Sampled, Term, Variable
from fis_tools.model.validate import parameter_problems
from fis_tools.model.variables import shape_values
from fis_tools.words.text import listed, percent, sentence

#: What is rounded together: the numbers of a term, by variable and term, or the ends of a range ("").
Unit = tuple[str, str]
#: The most digits of a rounded number; beyond, it is not rounded.
MOST_DIGITS = 6


def units(system: FuzzySystem) -> list[Unit]:
    """List what can be rounded: for each variable the ends of its range, and each of its terms."""
    found: list[Unit] = []
    for variable in (*system.inputs, *system.outputs):
        is_sampled = any(isinstance(term.membership, Sampled) for term in variable.terms)
        found += [] if is_sampled or variable.points is not None else [(variable.name, "")]
        found += [
            (variable.name, term.name) for term in variable.terms if not isinstance(term.membership, Sampled)
        ]
    return found


def rounded(system: FuzzySystem, digits: Mapping[Unit, int]) -> FuzzySystem:
    """Round the numbers of a system.

    Digits count from the first one of the variable's largest end, so that all numbers of a variable are
    rounded to the same places: 2 digits of a range from 0 to 200 are tens. Slopes have digits of their own.
    A number that equals an end of the range stays equal to it. A term keeps more digits where it would
    vanish, lose its shape or change its place among its neighbours.

    Parameters
    ----------
    system : FuzzySystem
        A system without problems.
    digits : mapping
        How many, for some of `units`; the others are not rounded.
    """
    inputs = tuple(_rounded_variable(variable, digits) for variable in system.inputs)
    outputs = tuple(_rounded_variable(variable, digits) for variable in system.outputs)
    return replace(system, inputs=inputs, outputs=outputs)


def _rounded_variable(variable: Variable, digits: Mapping[Unit, int]) -> Variable:
    range_digits = digits.get((variable.name, ""))
    ends = {end: _to_place(variable, end, range_digits) for end in (variable.minimum, variable.maximum)}
    while range_digits is not None and not ends[variable.minimum] < ends[variable.maximum]:
        range_digits += 1
        ends = {end: _to_place(variable, end, range_digits) for end in ends}
    bare = replace(variable, minimum=ends[variable.minimum], maximum=ends[variable.maximum])
    kept = [digits.get((variable.name, term.name), MOST_DIGITS + 1) for term in variable.terms]
    terms = [
        _rounded_term(bare, variable, term, count, ends)
        for term, count in zip(variable.terms, kept, strict=True)
    ]
    while (crossed := _first_crossed(variable, bare, terms)) is not None:
        for place in (crossed, crossed + 1):
            kept[place] = min(kept[place] + 1, MOST_DIGITS + 1)
            terms[place] = _rounded_term(bare, variable, variable.terms[place], kept[place], ends)
        if kept[crossed] == kept[crossed + 1] == MOST_DIGITS + 1:
            break
    return replace(bare, terms=tuple(terms))


def _to_place(variable: Variable, value: float, digits: int | None) -> float:
    if digits is None or digits > MOST_DIGITS:
        return value
    largest = max(abs(variable.minimum), abs(variable.maximum))
    return round(value, digits - 1 - math.floor(math.log10(largest))) + 0.0


def _rounded_term(
    bare: Variable, variable: Variable, term: Term, digits: int, ends: Mapping[float, float]
) -> Term:
    """Round a term, with more digits if it would lose its shape."""
    if isinstance(term.membership, Sampled):
        return term
    for count in range(digits, MOST_DIGITS + 2):
        numbers: dict[str, Any] = {}
        for name, kind in term.membership.entry.kinds.items():
            value = getattr(term.membership, name)
            if kind in {"slope", "exponent"}:
                numbers[name] = float(f"{value:.{count}g}") if count <= MOST_DIGITS else value
            else:
                numbers[name] = ends.get(value, _to_place(variable, value, count))
        candidate = Term(term.name, replace(term.membership, **numbers))
        if _keeps_shape(bare, term, candidate):
            return candidate
    return term


def _keeps_shape(variable: Variable, before: Term, after: Term) -> bool:
    """Return whether a rounded shape is valid, keeps its flanks, and is nowhere below zero."""
    old, shape = before.membership, after.membership
    if any(parameter_problems(shape)):
        return False
    for left, right in pairwise(shape.entry.ascending):
        if getattr(old, left) < getattr(old, right) and getattr(shape, left) == getattr(shape, right):
            return False
    return bool(shape_values(variable.universe, shape).min() >= 0.0)


def _first_crossed(variable: Variable, bare: Variable, terms: list[Term]) -> int | None:
    """Find the first term that was below the next one and no longer is."""
    before = [centre(variable, term) for term in variable.terms]
    after = [centre(bare, term) for term in terms]
    for place, ((a, b), (c, d)) in enumerate(zip(pairwise(before), pairwise(after), strict=True)):
        if a < b and not c < d:
            return place
    return None


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
        To how many digits `fis_tools.findings.simplification.draft.units` are rounded.
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
    unused = []
    for old, new in zip((*before.inputs, *before.outputs), (*after.inputs, *after.outputs), strict=True):
        names = {term.name for term in new.terms}
        gone = [term.name for term in old.terms if term.name not in names]
        unused += [f"{listed(gone, len(gone))} of {old.name}"] if gone else []
    return listed(unused, len(unused))


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
