"""Hedges in the words of other programs: read, written, and made terms of where a format has no word."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import reduce

from fis_tools.formats.exchange.antecedents import NotExpressible, is_leaf, mentions, with_plain_not
from fis_tools.formats.exchange.methods import HEDGES, meanings
from fis_tools.model import (
    And,
    AndOperator,
    Expression,
    FuzzySystem,
    Hedge,
    Hedged,
    Is,
    Not,
    Or,
    OrOperator,
    Rule,
    Sampled,
    Term,
    Trapezoidal,
    Variable,
)
from fis_tools.model import operators as model_operators
from fis_tools.model.variables import sample
from fis_tools.words.text import before

#: Behind the number of a term in a `.fis` file, as MATLAB's and Octave's powers have them.
FRACTIONS: dict[float, tuple[Hedge, ...]] = {
    0.05: ("somewhat",),
    0.2: ("very",),
    0.3: ("extremely",),
    0.4: ("very", "very"),
}
#: As fuzzylite writes them, which has formulas of its own.
FUZZYLITES_FRACTIONS: dict[float, tuple[Hedge, ...]] = {
    **FRACTIONS,
    0.01: ("seldom",),
    0.3: ("intensely",),
}
#: fuzzylite's word for what every value belongs to, read as a term.
ANY = "any"
#: fuzzylite's words, with the hedges that they stand for.
FUZZYLITES = {word: hedge for word, hedge in meanings(HEDGES, "fll").items() if word}


def hedged(hedges: Sequence[Hedge], expression: Expression) -> Expression:
    """Put hedges before a statement, the first of them outermost."""
    return reduce(lambda inside, hedge: Hedged(hedge, inside), reversed(hedges), expression)


def any_term(variable: Variable) -> Term:
    """Return the term that every value of a variable belongs to."""
    low, high = variable.minimum, variable.maximum
    return Term(ANY, Trapezoidal(low, low, high, high))


def with_any(variables: Iterable[Variable], rules: Sequence[Rule]) -> tuple[Variable, ...]:
    """Give variables that rules call `any` a term of this name, which every value belongs to."""
    asked = {owner for rule in rules for owner, name in mentions(rule) if name == ANY}
    return tuple(
        replace(v, terms=(*v.terms, any_term(v)))
        if v.name in asked and all(term.name != ANY for term in v.terms)
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
        if is_leaf(part):
            return Hedged(hedge, part)
        match part:
            case And(operands) | Or(operands):
                operator = and_operator if isinstance(part, And) else or_operator
                if operator not in {"min", "max"} and len(operands) > 1:
                    raise NotExpressible(
                        f"{hedge!r} stands before several statements, and {operator} does not hand it on to "
                        "each of them"
                    )
                return type(part)(tuple(moved(hedge, operand) for operand in operands))
        return moved(hedge, with_plain_not(part, and_operator, or_operator))

    match expression:
        case Hedged(hedge, operand):
            return moved(hedge, on_statements(operand, and_operator, or_operator))
        case Not(operand):
            return Not(on_statements(operand, and_operator, or_operator))
        case And(operands) | Or(operands):
            found = (on_statements(operand, and_operator, or_operator) for operand in operands)
            return type(expression)(tuple(found))
    return expression


class Terms:
    """The terms that are made of hedged statements for which a format has no words.

    Parameters
    ----------
    system : FuzzySystem
        Whose rules are said.
    words : frozenset of str
        The hedges that the format has a word for.
    most_words : int
        How many words it can have before a term, with `not`.
    """

    def __init__(self, system: FuzzySystem, words: Iterable[Hedge], most_words: int) -> None:
        self.inputs = {variable.name: variable for variable in system.inputs}
        self.words = frozenset(words)
        self.most_words = most_words
        self._made: dict[tuple[str, ...], str] = {}

    def expressed(self, expression: Expression) -> Expression:
        """Return an antecedent, whose hedges stand before statements, in the words of the format."""
        match expression:
            case And(operands) | Or(operands):
                return type(expression)(tuple(map(self.expressed, operands)))
        words, statement = before(expression)
        if not isinstance(statement, Is) or not set(words) - {"not"}:
            return expression
        if len(words) <= self.most_words and set(words) <= {*self.words, "not"}:
            return expression
        if isinstance(expression, Not):
            return Not(Is(statement.variable, self._term(words[1:], statement)))
        return Is(statement.variable, self._term(words, statement))

    def _term(self, words: Sequence[str], statement: Is) -> str:
        """Return the name of a term that says what a hedged statement does, made if need be."""
        variable, expressed = self.inputs[statement.variable], (*words, statement.term)
        if (variable.name, *expressed) not in self._made:
            name = " ".join(expressed)
            while any(term.name == name for term in variable.terms):
                name += " hedged"
            degrees = sample(variable, variable.terms[variable.term_index(statement.term)])
            for word in reversed(words):
                degrees = 1.0 - degrees if word == "not" else _CHANGES[word](degrees)
            made = Term(name, Sampled(tuple(degrees.tolist())))
            self.inputs[variable.name] = replace(variable, terms=(*variable.terms, made))
            self._made[variable.name, *expressed] = name
        return self._made[variable.name, *expressed]


_CHANGES = {str(hedge): change for hedge, change in model_operators.HEDGES.items()}
