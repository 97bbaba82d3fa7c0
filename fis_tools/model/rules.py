"""Rules: a statement about the inputs, and its consequents on the outputs.

Chained rules use other rules' conclusions; `unchained` says them of the inputs. scikit-fuzzy and fuzzylite
pass on a degree of truth, not a number: if a rule uses a term of an output, they take the height at which
that term is cut by the rules computed so far. So the antecedents of those rules, joined by `or`, replace it.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

from fis_tools.model.operators import AndOperator, Hedge, OrOperator
from fis_tools.model.variables import Variable


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


_Name = TypeVar("_Name", bound=str)

#: Most statements in one antecedent; chains can double their number from link to link.
MOST_STATEMENTS = 10_000


class NotResolvable(ValueError):  # noqa: N818 - the sentence is the message
    """Raised for a chain that cannot be expressed by the inputs alone."""


@dataclass(frozen=True)
class Named:
    """A rule, and its name in messages."""

    name: str
    rule: Rule


def unchained(rules: Sequence[Named], outputs: Mapping[str, Variable]) -> list[Rule]:
    """Return rules in terms of the inputs only, given in the order in which they are computed.

    Raises
    ------
    NotResolvable
        If no antecedent can replace what a rule uses.
    """
    concluded: dict[Is, list[tuple[Named, Consequent]]] = {}
    found: list[Rule] = []
    for each in rules:
        rule = _inlined(each, concluded, outputs) if _asks(each.rule, outputs) else each.rule
        if sum(1 for _ in statements_of(rule.antecedent)) > MOST_STATEMENTS:
            raise NotResolvable(
                f"{each.name} comes to more than {MOST_STATEMENTS} statements; shorten its chain"
            )
        found.append(rule)
        for consequent in rule.consequents:
            key = Is(consequent.variable, consequent.term)
            concluded.setdefault(key, []).append((Named(each.name, rule), consequent))
    return found


def _inlined(
    each: Named, concluded: Mapping[Is, list[tuple[Named, Consequent]]], outputs: Mapping[str, Variable]
) -> Rule:
    and_operators, or_operators = [each.rule.and_operator], [each.rule.or_operator]

    def replaced(statement: Is) -> Expression:
        if statement.variable not in outputs:
            return statement
        sources = concluded.get(statement, [])
        _require_plain(each, statement, sources, outputs[statement.variable])
        and_operators.extend(source.rule.and_operator for source, _ in sources)
        or_operators.extend(source.rule.or_operator for source, _ in sources)
        if len(sources) > 1:
            or_operators.append("max")
        parts = tuple(source.rule.antecedent for source, _ in sources)
        return parts[0] if len(parts) == 1 else Or(parts)

    antecedent = with_statements(each.rule.antecedent, replaced)
    return replace(
        each.rule,
        antecedent=antecedent,
        and_operator=_one(each, "and", and_operators),
        or_operator=_one(each, "or", or_operators),
    )


def _require_plain(
    each: Named, asked: Is, sources: Sequence[tuple[Named, Consequent]], output: Variable
) -> None:
    if not sources:
        raise NotResolvable(
            f"{each.name} asks for {asked.variable!r} {asked.term!r}, which no rule before it concludes; put "
            "the rule that does so before it"
        )
    for source, consequent in sources:
        if consequent.weight != 1.0:
            raise NotResolvable(
                f"{each.name} asks for {asked.variable!r} {asked.term!r}, which {source.name} concludes with "
                f"weight {consequent.weight:g}, and no antecedent says that; conclude it with weight 1"
            )
    if len(sources) > 1 and not output.counts_strongest:
        joins = output.accumulation if output.accumulation != "max" else output.aggregation
        raise NotResolvable(
            f"{each.name} asks for {asked.variable!r} {asked.term!r}, where {joins} joins {len(sources)} "
            "rules, and only the maximum can be said in an antecedent; join them by the maximum"
        )


def _one(each: Named, word: str, operators: Sequence[_Name | None]) -> _Name | None:
    found = sorted({operator for operator in operators if operator is not None})
    if len(found) > 1:
        raise NotResolvable(
            f"{each.name} and the rules before it in its chain combine by {' and '.join(found)}, and one "
            f"antecedent has one {word!r}; give them the same"
        )
    return found[0] if found else None


def _asks(rule: Rule, outputs: Mapping[str, Variable]) -> bool:
    return any(statement.variable in outputs for statement in statements_of(rule.antecedent))
