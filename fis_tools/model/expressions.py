"""Antecedents of rules: statements, and their negations, conjunctions and disjunctions."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from itertools import chain
from typing import Any, ClassVar

from fis_tools.model.operators import Hedge


@dataclass(frozen=True, slots=True)
class Is:
    """The statement ``variable is term``."""

    variable: str
    term: str


@dataclass(frozen=True, slots=True)
class Not:
    """The complement of a statement."""

    operand: "Expression"


@dataclass(frozen=True, slots=True)
class Hedged:
    """A statement, or several, preceded by a hedge: ``variable is very term``."""

    hedge: Hedge
    operand: "Expression"


@dataclass(frozen=True, slots=True)
class And:
    """The conjunction of statements, combined from left to right."""

    word: ClassVar[str] = "and"
    operands: tuple["Expression", ...]


@dataclass(frozen=True, slots=True)
class Or:
    """The disjunction of statements, combined from left to right."""

    word: ClassVar[str] = "or"
    operands: tuple["Expression", ...]


Expression = Is | Not | Hedged | And | Or


def parts_of(expression: Expression) -> Iterator[Expression]:
    """Yield an antecedent and all its parts, from left to right."""
    yield expression
    match expression:
        case Not(operand) | Hedged(_, operand):
            yield from parts_of(operand)
        case And(operands) | Or(operands):
            for operand in operands:
                yield from parts_of(operand)


def statements_of(expression: Expression) -> Iterator[Is]:
    """Yield the statements of an antecedent, from left to right."""
    return (part for part in parts_of(expression) if isinstance(part, Is))


def rebuilt(expression: Expression, change: Callable[[Expression], Expression]) -> Expression:
    """Return an antecedent with each of its parts replaced, the inner ones first."""
    match expression:
        case Not(operand):
            return change(Not(rebuilt(operand, change)))
        case Hedged(hedge, operand):
            return change(Hedged(hedge, rebuilt(operand, change)))
        case And(operands) | Or(operands):
            return change(type(expression)(tuple(rebuilt(operand, change) for operand in operands)))
    return change(expression)


def with_statements(expression: Expression, change: Callable[[Is], Expression]) -> Expression:
    """Return an antecedent with each of its statements replaced."""
    return rebuilt(expression, lambda part: change(part) if isinstance(part, Is) else part)


@lru_cache(maxsize=4096)
def canonical(expression: Expression) -> tuple[Any, ...]:
    """Return the same for antecedents that differ in the order and grouping of statements alone."""
    match expression:
        case Not(Not(operand)):
            return canonical(operand)
        case Not(operand):
            return (Not, canonical(operand))
        case Hedged(hedge, operand):
            return (hedge, canonical(operand))
        case And(operands) | Or(operands):
            kind, parts = type(expression), [canonical(operand) for operand in operands]
            inner = sorted(chain(*(part[1] if part[0] is kind else [part] for part in parts)), key=repr)
            return inner[0] if len(inner) == 1 else (kind, tuple(inner))
        case Is(variable, term):
            return (Is, variable, term)
