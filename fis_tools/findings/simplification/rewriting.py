"""Rewriting of rules and terms: rules dropped, terms merged, unused terms removed."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from fis_tools.analysis.arrays import distinguishability
from fis_tools.array_types import Floats
from fis_tools.model import (
    And,
    Expression,
    FuzzySystem,
    Hedged,
    Is,
    MembershipFunction,
    Not,
    Or,
    Rule,
    Sampled,
    Term,
    Variable,
    statements_of,
)


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
    membership: MembershipFunction
    is_mean: bool
    similarity: float


def mergers(system: FuzzySystem, look_alike: float) -> Iterator[Merger]:
    """Yield how similar terms can be merged: as the first, as the second, as their mean."""
    for variable in (*system.inputs, *system.outputs):
        similarity = distinguishability(variable).similarity
        for first, second in zip(*np.nonzero(np.triu(similarity >= look_alike, 1)), strict=True):
            a, b = variable.terms[first], variable.terms[second]
            alike = float(similarity[first, second])
            yield Merger(variable.name, a.name, b.name, a.membership, False, alike)
            yield Merger(variable.name, b.name, a.name, b.membership, False, alike)
            if type(a.membership) is type(b.membership) and not isinstance(a.membership, Sampled):
                mean = _mean(a.membership, b.membership)
                nearer_first = _likeness(variable, a, mean) >= _likeness(variable, b, mean)
                names = (a.name, b.name) if nearer_first else (b.name, a.name)
                yield Merger(variable.name, *names, mean, True, alike)


def _mean(a: MembershipFunction, b: MembershipFunction) -> MembershipFunction:
    return replace(a, **{f.name: 0.5 * (getattr(a, f.name) + getattr(b, f.name)) for f in fields(a)})


def _likeness(variable: Variable, term: Term, membership: MembershipFunction) -> float:
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
        Places of the rules that are kept.
    """
    rules = tuple(_renamed(system, rule, merger) for rule in system.rules)
    places = _without_rivals(system.rules, rules, importance)
    variables = [
        tuple(_with_merged(variable, merger) for variable in side) for side in (system.inputs, system.outputs)
    ]
    inputs, outputs = variables
    kept = tuple(rules[place] for place in places)
    return replace(system, inputs=inputs, outputs=outputs, rules=kept), places


def _with_merged(variable: Variable, merger: Merger) -> Variable:
    if variable.name != merger.variable:
        return variable
    terms = [
        Term(term.name, merger.membership) if term.name == merger.kept else term
        for term in variable.terms
        if term.name != merger.dropped
    ]
    return replace(variable, terms=tuple(terms))


def _renamed(system: FuzzySystem, rule: Rule, merger: Merger) -> Rule:
    consequents = tuple(
        dict.fromkeys(
            replace(c, term=merger.kept) if (c.variable, c.term) == (merger.variable, merger.dropped) else c
            for c in rule.consequents
        )
    )
    plain: dict[type[Expression], bool] = {
        And: system.and_operator_of(rule) == "min",
        Or: system.or_operator_of(rule) == "max",
    }
    return replace(rule, antecedent=_renamed_in(rule.antecedent, merger, plain), consequents=consequents)


def _renamed_in(expression: Expression, merger: Merger, plain: dict[type[Expression], bool]) -> Expression:
    """Rename a term; what is then said twice is said once where that means the same (`plain`)."""
    match expression:
        case Is(variable, term):
            is_dropped = (variable, term) == (merger.variable, merger.dropped)
            return Is(variable, merger.kept) if is_dropped else expression
        case Not(operand):
            return Not(_renamed_in(operand, merger, plain))
        case Hedged(hedge, operand):
            return Hedged(hedge, _renamed_in(operand, merger, plain))
        case And(operands) | Or(operands):
            renamed = tuple(_renamed_in(operand, merger, plain) for operand in operands)
            if renamed != operands and plain[type(expression)]:
                renamed = tuple(dict.fromkeys(renamed))
            return renamed[0] if len(renamed) == 1 < len(operands) else type(expression)(renamed)


def _without_rivals(before: Sequence[Rule], after: Sequence[Rule], importance: Floats) -> list[int]:
    """Return the places of rules; of those whose antecedents became equal, only the most important."""
    asking: dict[object, list[int]] = {}
    for place, rule in enumerate(after):
        concluded = tuple(consequent.variable for consequent in rule.consequents)
        key = (rule.antecedent, rule.and_operator, rule.or_operator, concluded)
        asking.setdefault(key, []).append(place)
    kept: list[int] = []
    for places in asking.values():
        is_new = any(before[place].antecedent != after[place].antecedent for place in places)
        kept += [max(places, key=lambda place: importance[place])] if is_new else places
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
        Places of the rules that are kept. None instead of both if a rule is not a plain conjunction, or has
        no other statement, or if an output would be left without a rule.
    """
    kept: list[Rule] = []
    places: list[int] = []
    for place, rule in enumerate(system.rules):
        asked = rule.antecedent.operands if isinstance(rule.antecedent, And) else (rule.antecedent,)
        others = tuple(s for s in asked if not (isinstance(s, Is) and s.variable == name))
        if not others or not all(isinstance(s, Is) for s in others):
            return None
        if all(s == Is(name, term) for s in asked if s not in others):
            kept.append(replace(rule, antecedent=others[0] if len(others) == 1 else And(others)))
            places.append(place)
    if {c.variable for rule in kept for c in rule.consequents} != {v.name for v in system.outputs}:
        return None
    inputs = tuple(variable for variable in system.inputs if variable.name != name)
    return replace(system, inputs=inputs, rules=tuple(kept)), places


def without_rule(system: FuzzySystem, place: int) -> FuzzySystem | None:
    """Drop a rule; None where it is the last one, or the last that concludes on an output."""
    rules = system.rules[:place] + system.rules[place + 1 :]
    concluded = {consequent.variable for rule in rules for consequent in rule.consequents}
    if any(c.variable not in concluded for c in system.rules[place].consequents):
        return None
    return replace(system, rules=rules)


def pruned(system: FuzzySystem) -> FuzzySystem:
    """Drop terms that no rule uses; a variable without any used term keeps its first."""
    used = {(s.variable, s.term) for rule in system.rules for s in statements_of(rule.antecedent)}
    used |= {(c.variable, c.term) for rule in system.rules for c in rule.consequents}

    def kept(variable: Variable) -> Variable:
        terms = tuple(term for term in variable.terms if (variable.name, term.name) in used)
        return replace(variable, terms=terms or variable.terms[:1])

    return replace(
        system,
        inputs=tuple(kept(variable) for variable in system.inputs),
        outputs=tuple(kept(variable) for variable in system.outputs),
    )
