"""The rules of an `.fll` file: sentences with and, or, not and parentheses, `and` before `or`."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from fis_tools import model
from fis_tools.errors import ControllerFileError
from fis_tools.formats.exchange import foreign
from fis_tools.formats.exchange.antecedents import ANY, FUZZYLITES, hedged, joined
from fis_tools.model import Consequent, Expression, Hedge, Rule
from fis_tools.model.chains import MOST_STATEMENTS
from fis_tools.model.validate import MAX_NESTING

#: Of a rule: those of as many statements as an antecedent may have.
MOST_WORDS = 4 * MOST_STATEMENTS
#: The operators of a block of rules; None where it has none.
Operators = tuple[model.AndOperator | None, model.OrOperator | None]
#: What a rule concludes: the hedges before the term, the variable, the term.
Concluded = tuple[tuple[Hedge, ...], str, str]


@dataclass
class _Words:
    """The words of a rule, and the position of the next one to read."""

    words: list[str]
    where: str
    hedges: Mapping[str, Hedge]
    position: int = 0

    def peek(self) -> str:
        """Return the next word, or nothing at the end."""
        return self.words[self.position] if self.position < len(self.words) else ""

    def take(self, expected: str = "") -> str:
        """Return the next word; refuse another than the one expected."""
        word = self.peek()
        if not word or (expected and word != expected):
            seen = repr(word[:40]) if word else "its end"
            raise ControllerFileError(
                f"{self.where}: the rule has {seen} where {expected or 'a name'!r} must be; correct it"
            )
        self.position += 1
        return word


def read_rules(
    where: str, text: str, operators: Operators, hedges: Mapping[str, Hedge] = FUZZYLITES
) -> list[Rule]:
    """Read a rule; where it concludes with hedges, it becomes one for each strength that it concludes with.

    fuzzylite applies a hedge before a concluded term to the strength of the rule, for this term and all that
    follow in the rule. So it is said of all that the rule asks for.

    Parameters
    ----------
    where : str
        What mistakes begin with, such as its line.
    text : str
        Such as ``if a is low or b is not high then c is up with 0.5``.
    operators : (and operator, or operator)
        Those of its block; None where that has none.
    hedges : mapping, optional
        The words for hedges, with the hedges; those of fuzzylite by default.

    Raises
    ------
    ControllerFileError
        If it is not a rule, or says what one of ours cannot.
    """
    words = _Words(re.findall(r"[()]|[^\s()]+", text), where, hedges)
    if len(words.words) > MOST_WORDS:
        raise ControllerFileError(f"{where}: the rule has more than {MOST_WORDS} words; split it")
    words.take("if")
    antecedent = _disjunction(words, operators, 0)
    words.take("then")
    concluded = [_conclusion(words)]
    while words.peek() == "and":
        words.take()
        concluded.append(_conclusion(words))
    weight = 1.0
    if words.peek() == "with":
        words.take()
        weight = foreign.number(words.take(), f"{where}: the weight")
    if words.peek():
        raise ControllerFileError(f"{where}: {words.peek()[:40]!r} follows the rule; correct it")
    return hedged_rules(antecedent, concluded, weight, where)


def hedged_rules(
    antecedent: Expression, concluded: Sequence[Concluded], weight: float, where: str
) -> list[Rule]:
    """Apply hedges before concluded terms to the antecedent, as fuzzylite computes them."""
    carried: tuple[Hedge, ...] = ()
    groups: dict[tuple[Hedge, ...], list[Consequent]] = {}
    for hedges, variable, term in concluded:
        carried = (*hedges, *carried)
        groups.setdefault(carried, []).append(Consequent(variable, term, weight))
    if weight != 1.0 and carried:
        raise ControllerFileError(
            f"{where}: the rule has the weight {weight:g} and a hedge on what it concludes, which fuzzylite "
            "applies after the weight; drop one of them"
        )
    return [Rule(hedged(hedges, antecedent), tuple(group)) for hedges, group in groups.items()]


def _disjunction(words: _Words, operators: Operators, depth: int) -> Expression:
    """Parse conjunctions joined by `or`."""

    def conjunction() -> Expression:
        return _chain(words, "and", operators[0], lambda: _proposition(words, operators, depth))

    return _chain(words, "or", operators[1], conjunction)


def _chain(words: _Words, word: str, operator: str | None, operand: Callable[[], Expression]) -> Expression:
    """Read operands joined by a word, which the block of the rule must have an operator for."""
    kind = model.And if word == "and" else model.Or
    operands = [operand()]
    while words.peek() == word:
        words.take()
        if operator is None:
            missing = "conjunction" if word == "and" else "disjunction"
            raise ControllerFileError(
                f"{words.where}: the rule says {word!r}, but its block has no {missing}; add it"
            )
        operands.append(operand())
    return operands[0] if len(operands) == 1 else kind(tuple(joined(kind, operands)))


def _proposition(words: _Words, operators: Operators, depth: int) -> Expression:
    """Parse one operand: a negation, a condition in parentheses, or a statement."""
    if words.peek() == "(":
        if depth >= MAX_NESTING:
            raise ControllerFileError(f"{words.where}: nested more than {MAX_NESTING} deep; split the rule")
        words.take()
        inner = _disjunction(words, operators, depth + 1)
        words.take(")")
        return inner
    if words.peek() == "not":  # before parentheses and statements
        words.take()
        return model.Not(_proposition(words, operators, depth))
    variable = words.take()
    words.take("is")
    return _hedged_term(words, variable)


def _hedged_term(words: _Words, variable: str) -> Expression:
    """Parse what follows ``is``: any number of `not` and hedges, and a term."""
    if words.peek() == "not":
        words.take()
        inside = _hedged_term(words, variable)
        return inside.operand if isinstance(inside, model.Not) else model.Not(inside)
    if words.peek() in words.hedges:
        return model.Hedged(words.hedges[words.take()], _hedged_term(words, variable))
    return model.Is(variable, words.take())


def _conclusion(words: _Words) -> Concluded:
    """Parse a conclusion: its hedges, variable and term."""
    variable = words.take()
    words.take("is")
    hedges: list[Hedge] = []
    while words.peek() in words.hedges:
        hedges.append(words.hedges[words.take()])
    if words.peek() in {"not", ANY}:
        raise ControllerFileError(foreign.denied_conclusion(words.where, words.peek(), "fuzzylite"))
    return tuple(hedges), variable, words.take()
