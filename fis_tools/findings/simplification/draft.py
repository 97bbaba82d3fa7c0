"""A partly simplified system: rules dropped, terms merged, numbers rounded, and the next steps possible."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from fis_tools import model
from fis_tools.analysis.arrays import distinguishability
from fis_tools.analysis.contribution import contributions
from fis_tools.analysis.measures import centre
from fis_tools.array_types import Floats
from fis_tools.engines.compiler import compile
from fis_tools.findings.simplification.report import Bench, Kind
from fis_tools.model import FuzzySystem, Rule, Term, Variable, shape_values
from fis_tools.model.shape_problems import parameter_problems
from fis_tools.words.text import listed, percent, sentence


@dataclass(frozen=True)
class Merger:
    """Two terms of a variable that may be merged.

    Parameters
    ----------
    variable : str
    kept, dropped : str
        The name that is kept, and the name that is dropped.
    membership : MembershipFunction
        The membership function of the kept name.
    is_mean : bool
        Whether this is the mean of the two, and not one of them.
    similarity : float
        Jaccard: the area that the two share over the area that they cover.
    """

    variable: str
    kept: str
    dropped: str
    membership: model.MembershipFunction
    is_mean: bool
    similarity: float


def mergers(system: FuzzySystem, look_alike: float) -> Iterator[Merger]:
    """Yield the ways to merge similar terms: into the first, into the second, into their mean."""
    for variable in system.variables:
        similarity = distinguishability(variable).similarity
        for first, second in zip(*np.nonzero(np.triu(similarity >= look_alike, 1)), strict=True):
            a, b = variable.terms[first], variable.terms[second]
            alike = float(similarity[first, second])
            yield Merger(variable.name, a.name, b.name, a.membership, False, alike)
            yield Merger(variable.name, b.name, a.name, b.membership, False, alike)
            if type(a.membership) is type(b.membership) and not isinstance(a.membership, model.Sampled):
                mean = _mean(a.membership, b.membership)
                nearer_first = _likeness(variable, a, mean) >= _likeness(variable, b, mean)
                names = (a.name, b.name) if nearer_first else (b.name, a.name)
                yield Merger(variable.name, *names, mean, True, alike)


def _mean(a: model.MembershipFunction, b: model.MembershipFunction) -> model.MembershipFunction:
    """Return the shape whose numbers are the means of two of one kind."""
    return replace(a, **{f.name: 0.5 * (getattr(a, f.name) + getattr(b, f.name)) for f in fields(a)})


def _likeness(variable: Variable, term: Term, membership: model.MembershipFunction) -> float:
    """Return the Jaccard similarity of a term and another membership function."""
    pair = replace(variable, terms=(term, Term("mean", membership)))
    return float(distinguishability(pair).similarity[0, 1])


def merged(system: FuzzySystem, merger: Merger, importance: Floats) -> tuple[FuzzySystem, list[int]]:
    """Merge two terms; of rules whose antecedents become equal keep the most important.

    Parameters
    ----------
    system : FuzzySystem
    merger : Merger
    importance : (num_rules,)
        The importance of each rule.

    Returns
    -------
    FuzzySystem
    list of int
        Indices of the rules that are kept.
    """
    names = {(merger.variable, merger.dropped): merger.kept}
    rules = tuple(_without_repeats(system, model.with_terms(rule, names)) for rule in system.rules)
    kept = _without_rivals(system.rules, rules, importance)

    def shorter(variable: Variable) -> Variable:
        if variable.name != merger.variable:
            return variable
        kept = (term for term in variable.terms if term.name != merger.dropped)
        terms = (Term(t.name, merger.membership) if t.name == merger.kept else t for t in kept)
        return replace(variable, terms=tuple(terms))

    simpler = model.with_variables(system, shorter)
    return replace(simpler, rules=tuple(rules[index] for index in kept)), kept


def _without_repeats(system: FuzzySystem, rule: Rule) -> Rule:
    """Return a rule without repeated statements, unless repeating changes its strength."""
    plain = {model.And: system.and_operator_of(rule) == "min", model.Or: system.or_operator_of(rule) == "max"}

    def once(part: model.Expression) -> model.Expression:
        if not isinstance(part, model.And | model.Or) or not plain[type(part)]:
            return part
        operands = tuple(dict.fromkeys(part.operands))
        return operands[0] if len(operands) == 1 < len(part.operands) else type(part)(operands)

    antecedent = model.rebuilt(rule.antecedent, once)
    return replace(rule, antecedent=antecedent, consequents=tuple(dict.fromkeys(rule.consequents)))


def _without_rivals(before: Sequence[Rule], after: Sequence[Rule], importance: Floats) -> list[int]:
    """Return the indices of the rules to keep: of rules with equal antecedents only the most important."""
    asking: dict[object, list[int]] = {}
    for index, rule in enumerate(after):
        concluded = tuple(consequent.variable for consequent in rule.consequents)
        key = (rule.antecedent, rule.and_operator, rule.or_operator, concluded)
        asking.setdefault(key, []).append(index)
    kept: list[int] = []
    for rivals in asking.values():
        is_new = any(before[index].antecedent != after[index].antecedent for index in rivals)
        kept += [max(rivals, key=lambda index: importance[index])] if is_new else rivals
    return sorted(kept)


def without_input(system: FuzzySystem, name: str, term: str) -> tuple[FuzzySystem, list[int]] | None:
    """Leave out an input, as though it always were one of its terms.

    Rules lose their statement on this term; rules that ask for another of its terms are dropped.

    Parameters
    ----------
    system : FuzzySystem
    name, term : str
        Of the input and of its term.

    Returns
    -------
    FuzzySystem
    list of int
        Indices of the rules that are kept. None instead of both if a rule is not a plain conjunction, or has
        no other statement, or if an output would be left without a rule.
    """
    kept: list[Rule] = []
    remaining: list[int] = []
    for index, rule in enumerate(system.rules):
        operands = rule.antecedent.operands if isinstance(rule.antecedent, model.And) else (rule.antecedent,)
        others = tuple(s for s in operands if not (isinstance(s, model.Is) and s.variable == name))
        if not others or not all(isinstance(s, model.Is) for s in others):
            return None
        if all(s == model.Is(name, term) for s in operands if s not in others):
            kept.append(replace(rule, antecedent=others[0] if len(others) == 1 else model.And(others)))
            remaining.append(index)
    if {c.variable for rule in kept for c in rule.consequents} != {v.name for v in system.outputs}:
        return None
    inputs = tuple(variable for variable in system.inputs if variable.name != name)
    return replace(system, inputs=inputs, rules=tuple(kept)), remaining


def without_rule(system: FuzzySystem, index: int) -> FuzzySystem | None:
    """Drop a rule; None where it is the last one, or the last that concludes on an output."""
    rules = system.rules[:index] + system.rules[index + 1 :]
    concluded = {consequent.variable for rule in rules for consequent in rule.consequents}
    if any(c.variable not in concluded for c in system.rules[index].consequents):
        return None
    return replace(system, rules=rules)


def pruned(system: FuzzySystem) -> FuzzySystem:
    """Drop terms that no rule uses; a variable without any used term keeps its first."""
    used = model.used_terms(system.rules)

    def kept(variable: Variable) -> Variable:
        terms = tuple(term for term in variable.terms if (variable.name, term.name) in used)
        return replace(variable, terms=terms or variable.terms[:1])

    return model.with_variables(system, kept)


#: What is rounded together: the numbers of a term, by variable and term, or the ends of a range ("").
Unit = tuple[str, str]
#: The most digits of a rounded number; beyond, it is not rounded.
MOST_DIGITS = 6


def units(system: FuzzySystem) -> list[Unit]:
    """List the units that can be rounded: for each variable the ends of its range, and each of its terms."""
    units_of: list[Unit] = []
    for variable in system.variables:
        shaped = [term for term in variable.terms if not isinstance(term.membership, model.Sampled)]
        if len(shaped) == len(variable.terms) and variable.points is None:
            units_of.append((variable.name, ""))
        units_of += [(variable.name, term.name) for term in shaped]
    return units_of


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
    return model.with_variables(system, lambda variable: _rounded_variable(variable, digits))


def _rounded_variable(variable: Variable, digits: Mapping[Unit, int]) -> Variable:
    """Return a variable with rounded numbers; more digits where terms would otherwise cross."""
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
        for index in (crossed, crossed + 1):
            kept[index] = min(kept[index] + 1, MOST_DIGITS + 1)
            terms[index] = _rounded_term(bare, variable, variable.terms[index], kept[index], ends)
        if kept[crossed] == kept[crossed + 1] == MOST_DIGITS + 1:
            break
    return replace(bare, terms=tuple(terms))


def _to_place(variable: Variable, value: float, digits: int | None) -> float:
    """Round a number to so many significant digits of its variable's largest end."""
    if digits is None or digits > MOST_DIGITS:
        return value
    largest = max(abs(variable.minimum), abs(variable.maximum))
    return round(value, digits - 1 - math.floor(math.log10(largest))) + 0.0


def _rounded_term(
    bare: Variable, variable: Variable, term: Term, digits: int, ends: Mapping[float, float]
) -> Term:
    """Round a term, with more digits if it would lose its shape."""
    if isinstance(term.membership, model.Sampled):
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
    for index, ((a, b), (c, d)) in enumerate(zip(pairwise(before), pairwise(after), strict=True)):
        if a < b and not c < d:
            return index
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
    """A possible next step.

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
    for old, new in zip(before.variables, after.variables, strict=True):
        names = {term.name for term in new.terms}
        removed = [term.name for term in old.terms if term.name not in names]
        unused += [f"{listed(removed, len(removed))} of {old.name}"] if removed else []
    return listed(unused, len(unused))


def proposals(draft: Draft, bench: Bench) -> list[tuple[float, Proposal]]:
    """Propose steps, the cheapest first, each with the share of the budget then used."""
    importance = np.zeros(len(draft.numbers))
    ranked: list[tuple[float, Proposal]] = []
    for cost, moved, index in _ranked_drops(draft, bench):
        importance[index] = moved
        shorter = without_rule(draft.exact, index)
        if shorter is not None:
            number = draft.numbers[index]
            numbers = draft.numbers[:index] + draft.numbers[index + 1 :]
            words = f"drop rule {number}: {sentence(draft.exact.rules[index])}"
            after = cleaned(replace(draft, exact=shorter, numbers=numbers))
            ranked.append((cost, Proposal(("drop", str(number)), "drop", words, after)))
    for proposal in _merge_proposals(draft, bench, importance):
        ranked.append((bench.cost(bench.measure(proposal.draft.system)), proposal))
    return sorted(ranked, key=lambda entry: entry[0])


def _ranked_drops(draft: Draft, bench: Bench) -> Iterator[tuple[float, float, int]]:
    """Yield for each rule the cost of dropping it, how much it moves on average, and its index."""
    compiled = compile(draft.system)
    moved = {name: contributions(compiled, rows) for name, rows in bench.samples.items()}
    outputs = {name: compiled(rows) for name, rows in bench.samples.items()}
    for index in range(len(draft.numbers)):
        changes = {name: bench.change(name, outputs[name] - moved[name][:, index]) for name in moved}
        importance = max(float((np.abs(part[:, index]) / bench.spans).mean()) for part in moved.values())
        yield bench.cost(changes), importance, index


def _merge_proposals(draft: Draft, bench: Bench, importance: Floats) -> Iterator[Proposal]:
    """Yield a proposal for each pair of similar terms that can be merged."""
    for merger in mergers(draft.exact, bench.budget.look_alike):
        exact, kept = merged(draft.exact, merger, importance)
        removed = [str(number) for index, number in enumerate(draft.numbers) if index not in kept]
        words = (
            f"merge {merger.dropped} of {merger.variable} into {merger.kept}"
            f"{', halfway between the two' * merger.is_mean}; they shared {percent(merger.similarity)} of "
            "their areas"
        )
        if removed:
            words += f"; rule{'s' if len(removed) > 1 else ''} {listed(removed, len(removed))} went with it"
        after = cleaned(Draft(exact, tuple(draft.numbers[index] for index in kept), draft.digits))
        shape = repr(merger.membership)
        yield Proposal(("merge", merger.variable, merger.kept, merger.dropped, shape), "merge", words, after)


def rounded_draft(draft: Draft, count: int, only: Unit | None = None) -> Draft:
    """Round all numbers of a draft, or one unit of them, to so many digits, unless they have fewer."""
    chosen = units(draft.exact) if only is None else [only]
    finer = {unit: count for unit in chosen if draft.digits.get(unit, count + 1) > count}
    return replace(draft, digits={**draft.digits, **finer})
