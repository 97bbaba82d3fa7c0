"""Antecedents rewritten for formats that cannot nest: the same meaning in flat conjunctions and disjunctions.

Two laws are used. A complement moves inwards (De Morgan) where the two operators are duals of each other, as
min and max are. A conjunction distributes over a disjunction that is the maximum, because every t-norm is
monotone; one rule then becomes several with the same conclusion, and rules with the same conclusion meet at
their maximum again.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import product
from math import prod

from fis_tools.model import (
    And,
    AndOperator,
    Consequent,
    Expression,
    Hedged,
    Is,
    Not,
    Or,
    OrOperator,
    Rule,
    parts_of,
    with_statements,
)

#: A variable and one of its terms.
Statement = tuple[str, str]

#: Rules that one rule may become.
MOST_ALTERNATIVES = 64

_DUALS = {
    ("min", "max"),
    ("product", "probabilistic_sum"),
    ("bounded_difference", "bounded_sum"),
    ("einstein_product", "einstein_sum"),
    ("hamacher_product", "hamacher_sum"),
    ("drastic_product", "drastic_sum"),
    ("nilpotent_minimum", "nilpotent_maximum"),
}


class NotExpressible(ValueError):  # noqa: N818
    """What a format cannot express without changing its meaning, told in a sentence."""


def with_plain_not(expression: Expression, and_operator: AndOperator, or_operator: OrOperator) -> Expression:
    """Move every `not` to a statement, and join nested conjunctions and disjunctions of one kind.

    Raises
    ------
    NotExpressible
        If a complement of several statements would have to move through operators that are not duals.
    """

    def moved(part: Expression, is_negated: bool) -> Expression:
        match part:
            case Is() | Hedged():
                return Not(part) if is_negated else part
            case Not(operand):
                return moved(operand, not is_negated)
            case And(operands) | Or(operands):
                if len(operands) == 1:
                    return moved(operands[0], is_negated)
                if is_negated and (and_operator, or_operator) not in _DUALS:
                    raise NotExpressible(
                        f"'not' stands before several statements, and {and_operator} and {or_operator} are "
                        "no duals, so it cannot be moved to each of them"
                    )
                kind = And if isinstance(part, And) is not is_negated else Or
                return kind(tuple(_joined(kind, [moved(operand, is_negated) for operand in operands])))

    return moved(expression, False)


def _joined(kind: type[And | Or], operands: Sequence[Expression]) -> Iterator[Expression]:
    for operand in operands:
        if isinstance(operand, kind):
            yield from operand.operands
        else:
            yield operand


def flat_antecedents(
    expression: Expression, and_operator: AndOperator, or_operator: OrOperator, *, repeats_inputs: bool
) -> list[Expression]:
    """Say an antecedent as one or several without nesting; the strongest of them is the antecedent.

    Parameters
    ----------
    expression : And, Or, Not, Is
        Any antecedent.
    and_operator, or_operator : str
        How its statements combine.
    repeats_inputs : bool
        Whether one antecedent may say two things of one input.

    Returns
    -------
    list
        Statements, complements of statements, and conjunctions or disjunctions of these.

    Raises
    ------
    NotExpressible
        If its meaning would change.
    """
    plain = with_plain_not(expression, and_operator, or_operator)
    is_flat = all(map(is_leaf, operands_of(plain)))
    if is_flat and (repeats_inputs or not _has_repeated_input(operands_of(plain))):
        return [plain]
    if or_operator != "max" and any(isinstance(part, Or) for part in parts_of(plain)):
        raise NotExpressible(f"'and' and 'or' are nested, and {or_operator} does not distribute")
    found = [_conjunction(leaves, and_operator) for leaves in _alternatives(plain)]
    if not repeats_inputs and any(_has_repeated_input(operands_of(part)) for part in found):
        raise NotExpressible("it says two things of one input")
    return list(dict.fromkeys(found))


def in_order(expression: Expression, inputs: Sequence[str]) -> Expression:
    """Put the statements of a flat antecedent, one of each input, in the order of the inputs."""
    if isinstance(expression, And | Or):
        places = {name: place for place, name in enumerate(inputs)}
        kind = type(expression)
        return kind(tuple(sorted(expression.operands, key=lambda leaf: places[statement_of(leaf).variable])))
    return expression


def _has_repeated_input(leaves: Sequence[Expression]) -> bool:
    names = [statement_of(leaf).variable for leaf in leaves if is_leaf(leaf)]
    return len(set(names)) != len(names)


def statement_of(leaf: Expression) -> Is:
    """Return the statement that an antecedent makes, denies or hedges, which must be one."""
    match leaf:
        case Is():
            return leaf
        case Not(operand) | Hedged(_, operand):
            return statement_of(operand)
    raise TypeError(f"{leaf} is made of several statements; expected one")


def is_leaf(expression: Expression) -> bool:
    """Return whether an antecedent makes one statement, denied or hedged or as it is."""
    match expression:
        case Not(operand) | Hedged(_, operand):
            return is_leaf(operand)
    return isinstance(expression, Is)


def operands_of(expression: Expression) -> tuple[Expression, ...]:
    """Return what a conjunction or disjunction joins; of anything else, itself."""
    return expression.operands if isinstance(expression, And | Or) else (expression,)


def _conjunction(leaves: tuple[Expression, ...], and_operator: AndOperator) -> Expression:
    kept = tuple(dict.fromkeys(leaves)) if and_operator == "min" else leaves
    return kept[0] if len(kept) == 1 else And(kept)


def _alternatives(expression: Expression) -> list[tuple[Expression, ...]]:
    """List the conjunctions whose disjunction an antecedent is."""
    match expression:
        case Or(operands):
            found = [leaves for operand in operands for leaves in _alternatives(operand)]
        case And(operands):
            choices = [_alternatives(operand) for operand in operands]
            if prod(map(len, choices)) > MOST_ALTERNATIVES:
                raise NotExpressible(f"it would become more than {MOST_ALTERNATIVES} rules")
            found = [tuple(leaf for leaves in chosen for leaf in leaves) for chosen in product(*choices)]
        case _:
            found = [(expression,)]
    if len(found) > MOST_ALTERNATIVES:
        raise NotExpressible(f"it would become more than {MOST_ALTERNATIVES} rules")
    return found


def renamed(rule: Rule, names: Mapping[Statement, Statement]) -> Rule:
    """Return a rule that speaks of other variables and terms.

    Parameters
    ----------
    rule : Rule
        Any rule.
    names : mapping
        Each variable and term that it mentions, with what stands in their place.
    """

    def expressed(statement: Is) -> Is:
        return Is(*names[statement.variable, statement.term])

    consequents = tuple(Consequent(*names[c.variable, c.term], c.weight) for c in rule.consequents)
    return replace(rule, antecedent=with_statements(rule.antecedent, expressed), consequents=consequents)


def mentions(rule: Rule) -> Iterator[Statement]:
    """Yield each variable and term that a rule speaks of."""
    for part in parts_of(rule.antecedent):
        if isinstance(part, Is):
            yield part.variable, part.term
    for consequent in rule.consequents:
        yield consequent.variable, consequent.term
