"""Antecedents rewritten for formats that cannot nest them, or have hedges only before statements.

A complement moves inwards (De Morgan) where the two operators are duals of each other, as min and max are. A
hedge moves to the statements behind it.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import reduce

from fis_tools import model
from fis_tools.formats.exchange.vocabulary import HEDGES

#: A variable and one of its terms.
Statement = tuple[str, str]

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


def with_plain_not(
    expression: model.Expression, and_operator: model.AndOperator, or_operator: model.OrOperator
) -> model.Expression:
    """Move every `not` to a statement, and join nested conjunctions and disjunctions of one kind.

    Raises
    ------
    NotExpressible
        If a complement of several statements would have to move through operators that are not duals.
    """

    def moved(part: model.Expression, is_negated: bool) -> model.Expression:
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


def joined(
    kind: type[model.And | model.Or], operands: Sequence[model.Expression]
) -> Iterator[model.Expression]:
    """Yield operands; of one that joins by the same kind, what it joins."""
    for operand in operands:
        if isinstance(operand, kind):
            yield from operand.operands
        else:
            yield operand


def require_flat(expression: model.Expression, *, repeats: bool) -> None:
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


def in_order(expression: model.Expression, inputs: Sequence[str]) -> model.Expression:
    """Put the statements of a flat antecedent, one of each input, in the order of the inputs."""
    if isinstance(expression, model.And | model.Or):
        places = {name: place for place, name in enumerate(inputs)}
        kind = type(expression)
        return kind(tuple(sorted(expression.operands, key=lambda leaf: places[statement_of(leaf).variable])))
    return expression


def statement_of(leaf: model.Expression) -> model.Is:
    """Return the statement that an antecedent makes, denies or hedges, which must be one."""
    match leaf:
        case model.Is():
            return leaf
        case model.Not(operand) | model.Hedged(_, operand):
            return statement_of(operand)
    raise TypeError(f"{leaf} is made of several statements; expected one")


def is_leaf(expression: model.Expression) -> bool:
    """Return whether an antecedent makes one statement, denied or hedged or as it is."""
    match expression:
        case model.Not(operand) | model.Hedged(_, operand):
            return is_leaf(operand)
    return isinstance(expression, model.Is)


def operands_of(expression: model.Expression) -> tuple[model.Expression, ...]:
    """Return what a conjunction or disjunction joins; of anything else, itself."""
    return expression.operands if isinstance(expression, model.And | model.Or) else (expression,)


def renamed(rule: model.Rule, names: Mapping[Statement, Statement]) -> model.Rule:
    """Return a rule that speaks of other variables and terms.

    Parameters
    ----------
    rule : Rule
        Any rule.
    names : mapping
        Each variable and term that it mentions, with what stands in their place.
    """

    def expressed(statement: model.Is) -> model.Is:
        return model.Is(*names[statement.variable, statement.term])

    consequents = tuple(model.Consequent(*names[c.variable, c.term], c.weight) for c in rule.consequents)
    return replace(
        rule, antecedent=model.with_statements(rule.antecedent, expressed), consequents=consequents
    )


def mentions(rule: model.Rule) -> Iterator[Statement]:
    """Yield each variable and term that a rule speaks of."""
    for part in model.parts_of(rule.antecedent):
        if isinstance(part, model.Is):
            yield part.variable, part.term
    for consequent in rule.consequents:
        yield consequent.variable, consequent.term


#: Behind the number of a term in a `.fis` file, as MATLAB's and Octave's powers have them.
FRACTIONS: dict[float, tuple[model.Hedge, ...]] = {
    0.05: ("somewhat",),
    0.2: ("very",),
    0.3: ("extremely",),
    0.4: ("very", "very"),
}
#: As fuzzylite writes them, which has formulas of its own.
FUZZYLITES_FRACTIONS: dict[float, tuple[model.Hedge, ...]] = {
    **FRACTIONS,
    0.01: ("seldom",),
    0.3: ("intensely",),
}
#: fuzzylite's word for what every value belongs to, read as a term.
ANY = "any"
#: fuzzylite's words, with the hedges that they stand for.
FUZZYLITES = {word: hedge for hedge, word in HEDGES.items()}


def hedged(hedges: Sequence[model.Hedge], expression: model.Expression) -> model.Expression:
    """Put hedges before a statement, the first of them outermost."""
    return reduce(lambda inside, hedge: model.Hedged(hedge, inside), reversed(hedges), expression)


def any_term(variable: model.Variable) -> model.Term:
    """Return the term that every value of a variable belongs to."""
    low, high = variable.minimum, variable.maximum
    return model.Term(ANY, model.Trapezoidal(low, low, high, high))


def with_any(variables: Iterable[model.Variable], rules: Sequence[model.Rule]) -> tuple[model.Variable, ...]:
    """Give variables that rules call `any` a term of this name, which every value belongs to."""
    asked = {owner for rule in rules for owner, name in mentions(rule) if name == ANY}
    return tuple(
        replace(v, terms=(*v.terms, any_term(v)))
        if v.name in asked and all(term.name != ANY for term in v.terms)
        else v
        for v in variables
    )


def on_statements(
    expression: model.Expression, and_operator: model.AndOperator, or_operator: model.OrOperator
) -> model.Expression:
    """Move every hedge to a statement; minimum and maximum hand it on, because it grows.

    Raises
    ------
    NotExpressible
        If a hedge stands before several statements that other operators join.
    """

    def moved(hedge: model.Hedge, part: model.Expression) -> model.Expression:
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
            found = (on_statements(operand, and_operator, or_operator) for operand in operands)
            return type(expression)(tuple(found))
    return expression
