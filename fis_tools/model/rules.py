"""Rules: a statement about the inputs, and its consequents on the outputs."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from fis_tools.model.operators import AndOperator, Hedge, OrOperator


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

    operands: tuple["Expression", ...]


@dataclass(frozen=True, slots=True)
class Or:
    """The disjunction of statements, combined from left to right."""

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


def with_statements(expression: Expression, change: Callable[[Is], Expression]) -> Expression:
    """Return an antecedent with each of its statements replaced."""
    match expression:
        case Is():
            return change(expression)
        case Not(operand):
            return Not(with_statements(operand, change))
        case Hedged(hedge, operand):
            return Hedged(hedge, with_statements(operand, change))
        case And(operands) | Or(operands):
            return type(expression)(tuple(with_statements(operand, change) for operand in operands))


@dataclass(frozen=True, slots=True)
class Consequent:
    """A rule's consequent: ``variable is term``, with its strength multiplied by `weight`."""

    variable: str
    term: str
    weight: float = 1.0


@dataclass(frozen=True, slots=True)
class Rule:
    """If `antecedent` then all of `consequents`.

    A rule may have its own operators instead of its system's.
    """

    antecedent: Expression
    consequents: tuple[Consequent, ...]
    label: str = ""
    and_operator: AndOperator | None = None
    or_operator: OrOperator | None = None

    @property
    def has_own_operators(self) -> bool:
        """Whether it has its own operators."""
        return self.and_operator is not None or self.or_operator is not None
