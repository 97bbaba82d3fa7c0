"""Antecedents rewritten for formats that cannot nest them, or have hedges only before statements.

A complement moves inwards (De Morgan) where the two operators are duals of each other, as min and max are. A
hedge moves to the statements behind it.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from functools import reduce
from typing import get_args

from fis_tools import model
from fis_tools.formats.exchange.vocabulary import HEDGES
from fis_tools.model import AndOperator, Expression, Hedge, OrOperator, Rule, Variable
from fis_tools.words.text import before

#: They stand at the same places in their lists.
_DUALS = set(zip(get_args(AndOperator), get_args(OrOperator), strict=True))


class NotExpressible(ValueError):  # noqa: N818
    """Raised for what a format cannot express without changing its meaning."""


def with_plain_not(expression: Expression, and_operator: AndOperator, or_operator: OrOperator) -> Expression:
    """Move every `not` to a statement, and join nested conjunctions and disjunctions of one kind.

    Raises
    ------
    NotExpressible
        If a complement of several statements would have to move through operators that are not duals.
    """

    def moved(part: Expression, is_negated: bool) -> Expression:
        """Return a part without `not` before conjunctions and disjunctions, by De Morgan's laws."""
        match part:
            case model.Is() | model.Hedged():
                return model.Not(part) if is_negated else part
            case model.Not(operand):
                return moved(operand, not is_negated)
            case model.And(operands) | model.Or(operands):
                if len(operands) == 1:
                    return moved(operands[0], is_negated)
                if is_negated and (and_operator, or_operator) not in _DUALS:
                    raise NotExpressible(
                        f"'not' stands before several statements, and {and_operator} and {or_operator} are "
                        "no duals, so it cannot be moved to each of them"
                    )
                kind = model.And if isinstance(part, model.And) is not is_negated else model.Or
                return kind(tuple(joined(kind, [moved(operand, is_negated) for operand in operands])))

    return moved(expression, False)


def joined(kind: type[model.And | model.Or], operands: Sequence[Expression]) -> Iterator[Expression]:
    """Yield operands, with nested ones of the same kind flattened."""
    for operand in operands:
        if isinstance(operand, kind):
            yield from operand.operands
        else:
            yield operand


def require_flat(expression: Expression, *, repeats: bool) -> None:
    """Refuse an antecedent that nests conjunctions and disjunctions.

    Parameters
    ----------
    expression : And, Or, Not, Is
        An antecedent with plain complements.
    repeats : bool
        Whether it may say two things of one input.

    Raises
    ------
    NotExpressible
        If it is none of statements, complements of them, and one conjunction or disjunction of these.
    """
    leaves = operands_of(expression)
    if not all(map(is_leaf, leaves)):
        raise NotExpressible("'and' and 'or' are nested")
    names = [statement_of(leaf).variable for leaf in leaves]
    if not repeats and len(set(names)) != len(names):
        raise NotExpressible("it says two things of one input")


def in_order(expression: Expression, inputs: Sequence[str]) -> Expression:
    """Put the statements of a flat antecedent, one of each input, in the order of the inputs."""
    if isinstance(expression, model.And | model.Or):
        ordered = sorted(expression.operands, key=lambda leaf: inputs.index(statement_of(leaf).variable))
        return type(expression)(tuple(ordered))
    return expression


def statement_of(leaf: Expression) -> model.Is:
    """Return the only statement of an antecedent, which may be denied or hedged."""
    (statement,) = model.statements_of(leaf)
    return statement


def is_leaf(expression: Expression) -> bool:
    """Return whether an antecedent is a single statement, denied or hedged or neither."""
    return isinstance(before(expression)[1], model.Is)


def operands_of(expression: Expression) -> tuple[Expression, ...]:
    """Return the operands of a conjunction or disjunction; of anything else, itself."""
    return expression.operands if isinstance(expression, model.And | model.Or) else (expression,)


#: Behind the number of a term in a `.fis` file, as MATLAB's and Octave's powers have them.
FRACTIONS: dict[float, tuple[Hedge, ...]] = {
    0.05: ("somewhat",),
    0.2: ("very",),
    0.3: ("extremely",),
    0.4: ("very", "very"),
}
#: As fuzzylite writes them, which has formulas of its own.
FUZZYLITES_FRACTIONS: dict[float, tuple[Hedge, ...]] = {**FRACTIONS, 0.01: ("seldom",), 0.3: ("intensely",)}
#: fuzzylite's word for what every value belongs to, read as a term.
ANY = "any"
#: fuzzylite's words, with the hedges that they stand for.
FUZZYLITES = {word: hedge for hedge, word in HEDGES.items()}


def hedged(hedges: Sequence[Hedge], expression: Expression) -> Expression:
    """Apply hedges to a statement, the first of them outermost."""
    return reduce(lambda inside, hedge: model.Hedged(hedge, inside), reversed(hedges), expression)


def any_term(variable: Variable) -> model.Term:
    """Return the term that every value of a variable belongs to."""
    return model.Term(ANY, model.Polyline((variable.minimum,), (1.0,)))


def with_any(variables: Iterable[Variable], rules: Sequence[Rule]) -> tuple[Variable, ...]:
    """Give variables that rules call `any` a term of this name, which every value belongs to."""
    with_any_term = {owner for owner, name in model.used_terms(rules) if name == ANY}
    return tuple(
        replace(v, terms=(*v.terms, any_term(v)))
        if v.name in with_any_term and all(term.name != ANY for term in v.terms)
        else v
        for v in variables
    )


def on_statements(expression: Expression, and_operator: AndOperator, or_operator: OrOperator) -> Expression:
    """Move every hedge to a statement; minimum and maximum hand it on, because it grows.

    Raises
    ------
    NotExpressible
        If a hedge stands before several statements that other operators join.
    """

    def moved(hedge: Hedge, part: Expression) -> Expression:
        """Return a part with the hedge moved to each of its statements."""
        if is_leaf(part):
            return model.Hedged(hedge, part)
        match part:
            case model.And(operands) | model.Or(operands):
                operator = and_operator if isinstance(part, model.And) else or_operator
                if operator not in {"min", "max"} and len(operands) > 1:
                    raise NotExpressible(
                        f"{hedge!r} stands before several statements, and {operator} does not hand it on to "
                        "each of them"
                    )
                return type(part)(tuple(moved(hedge, operand) for operand in operands))
        return moved(hedge, with_plain_not(part, and_operator, or_operator))

    match expression:
        case model.Hedged(hedge, operand):
            return moved(hedge, on_statements(operand, and_operator, or_operator))
        case model.Not(operand):
            return model.Not(on_statements(operand, and_operator, or_operator))
        case model.And(operands) | model.Or(operands):
            converted = (on_statements(operand, and_operator, or_operator) for operand in operands)
            return type(expression)(tuple(converted))
    return expression
