"""Interval type-2 systems: sets between a lower and an upper membership function, and their type-1 twins.

A statement about such a set holds to a degree between two bounds. Operators and hedges rise with degrees, a
complement exchanges the bounds; so the bounds of a rule's strength are the strengths of two type-1 rules. The
twin of a system has both: its first half concludes lower sets, its second half upper ones. How both become a
number is the type reduction: N. N. Karnik and J. M. Mendel (Information Sciences 132, 2001), the middle
between the least and the greatest centroid of all sets between; M. Nie and W. W. Tan (FUZZ-IEEE 2008), the
centroid of the sum of both.
"""

from collections.abc import Iterable
from dataclasses import replace
from functools import lru_cache
from typing import Literal

import numpy as np

from fis_tools.array_types import Floats
from fis_tools.errors import Mistake
from fis_tools.model.expressions import And, Expression, Hedged, Is, Not, Or
from fis_tools.model.membership import MembershipFunction
from fis_tools.model.shapes import Between
from fis_tools.model.systems import FuzzySystem, Rule, with_variables
from fis_tools.model.variables import Term, Variable, sample

#: What a twin's names end with.
LOWER, UPPER = " (lower)", " (upper)"


def has_intervals(system: FuzzySystem) -> bool:
    """Return whether a term of a system is an interval type-2 set."""
    return any(
        isinstance(term.membership, Between) for variable in system.variables for term in variable.terms
    )


def require_type_1(systems: Iterable[FuzzySystem], what: str) -> None:
    """Raise Mistake for systems with interval type-2 sets; `what` begins the sentence."""
    for system in systems:
        if has_intervals(system):
            raise Mistake(
                f"{what} is for type-1 sets, and {system.name!r} has interval type-2 ones, which show, "
                "surface, bounds, compile, explain, diff, edit and YAML take; import --sets upper makes them "
                "type-1"
            )


def sampled_bounds(variable: Variable, term: Term) -> Floats:
    """Return a term's lower and upper memberships on the universe, (2, num_points); equal ones of type-1."""
    bounds = (bound_of(term.membership, ending) for ending in (LOWER, UPPER))
    return np.stack([sample(variable, replace(term, membership=bound)) for bound in bounds])


def with_bounds(system: FuzzySystem, bound: Literal["lower", "upper"]) -> FuzzySystem:
    """Return a type-1 system that has the lower or the upper functions of interval type-2 sets alone."""
    ending = LOWER if bound == "lower" else UPPER
    return with_variables(
        system,
        lambda variable: replace(
            variable,
            terms=tuple(Term(term.name, bound_of(term.membership, ending)) for term in variable.terms),
        ),
    )


@lru_cache(maxsize=64)
def twin(system: FuzzySystem) -> FuzzySystem:
    """Return a type-1 system with two rules, two terms and two outputs for each, the lower ones first."""
    rules = tuple(_bound_rule(rule, ending) for ending in (LOWER, UPPER) for rule in system.rules)
    outputs = (_bound_output(output, ending) for output in system.outputs for ending in (LOWER, UPPER))
    return replace(
        system, inputs=tuple(map(_bound_input, system.inputs)), outputs=tuple(outputs), rules=rules
    )


def bound_of(shape: MembershipFunction, ending: str) -> MembershipFunction:
    """Return the lower or upper membership function of a set; of a type-1 set, itself."""
    if not isinstance(shape, Between):
        return shape
    return shape.lower if ending == LOWER else shape.upper


def _bound_input(variable: Variable) -> Variable:
    """Return an input with two terms for each: its lower and its upper set."""
    terms = (
        Term(term.name + ending, bound_of(term.membership, ending))
        for term in variable.terms
        for ending in (LOWER, UPPER)
    )
    return replace(variable, terms=tuple(terms))


def _bound_output(variable: Variable, ending: str) -> Variable:
    """Return an output in terms of its lower or upper sets, under a name of its own."""
    terms = (Term(term.name, bound_of(term.membership, ending)) for term in variable.terms)
    return replace(variable, name=variable.name + ending, terms=tuple(terms))


def _bound_rule(rule: Rule, ending: str) -> Rule:
    """Return a rule that asks for and concludes the lower or the upper sets."""
    consequents = (replace(c, variable=c.variable + ending) for c in rule.consequents)
    return replace(rule, antecedent=_bound(rule.antecedent, ending), consequents=tuple(consequents), label="")


def _bound(expression: Expression, ending: str) -> Expression:
    """Return an antecedent in terms of the lower or the upper sets; below `not` it is the other."""
    match expression:
        case Is(variable, term):
            return Is(variable, term + ending)
        case Not(operand):
            return Not(_bound(operand, UPPER if ending == LOWER else LOWER))
        case Hedged(hedge, operand):
            return Hedged(hedge, _bound(operand, ending))
        case And(operands) | Or(operands):
            return type(expression)(tuple(_bound(operand, ending) for operand in operands))
