"""Conclusions of rules that are numbers instead of fuzzy sets: constant, linear in the inputs, or a formula.

Outputs with such terms are weighted averages or sums. Takagi and Sugeno, *Fuzzy identification of systems and
its applications to modeling and control*, IEEE Transactions on Systems, Man, and Cybernetics 15 (1985).
Formulas are those of fuzzylite's `Function`: numbers, names of inputs and of outputs before its own,
parentheses, the functions and the operators below, parsed and never executed. Powers bind tighter than
products, these tighter than sums.
"""

import re
from abc import abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, Any

import numpy as np

from fis_tools.array_types import Floats
from fis_tools.model import fuzzylite_shapes  # noqa: F401 - those stand before numbers in the registry
from fis_tools.model.membership import Location, MembershipFunction, shape


@dataclass(frozen=True, slots=True)
class Number(MembershipFunction):
    """A term that is a number, of a weighted output; it has no degrees of membership."""

    def at(self, x: Floats) -> Floats:
        """Raise TypeError: a number has no membership function.

        Raises
        ------
        TypeError
            Always.
        """
        raise TypeError(f"{type(self).__name__} is a number, and no membership function")

    @abstractmethod
    def row(self, num_inputs: int) -> tuple[float, ...]:
        """Return the factor of each input, then the constant."""


@shape("constant", "{value}", fll=("Constant",), fis=("constant",))
class Constant(Number):
    """The number `value`, in the unit of the output."""

    value: Location

    def row(self, num_inputs: int) -> tuple[float, ...]:
        """Return the factor of each input, then the constant."""
        return (*(0.0,) * num_inputs, self.value)


@shape("linear", "{coefficients} times the inputs plus {constant}", fll=("Linear",), fis=("linear",))
class Linear(Number):
    """The inputs, clipped to their universes, times `coefficients`, in their order, plus `constant`."""

    coefficients: tuple[float, ...]
    constant: Location

    def row(self, num_inputs: int) -> tuple[float, ...]:
        """Return the factor of each input, then the constant."""
        return (*self.coefficients, self.constant)


#: Tokens of a formula, and how deep its parts may be nested.
MOST_WORDS = 300
DEEPEST = 50

_UNARY = (
    "abs acos acosh asin asinh atan atanh ceil cos cosh exp fabs floor log log10 log1p sin sinh sqrt tan tanh"
)
_BINARY = {"atan2": np.arctan2, "fmod": np.fmod, "max": np.fmax, "min": np.fmin, "pow": np.float_power}
#: How many arguments each function takes, and the function.
FUNCTIONS: Mapping[str, tuple[int, Callable[..., Any]]] = {
    **{name: (1, getattr(np, name)) for name in _UNARY.split()},
    **{name: (2, function) for name, function in _BINARY.items()},
}
_OPERATORS: Mapping[str, Callable[..., Any]] = dict(
    zip("+-*/%^", (np.add, np.subtract, np.multiply, np.divide, np.fmod, np.float_power), strict=True)
)
#: How tightly operators bind, and what follows a sign; fuzzylite's own sign binds tightest.
_POWER = 4
_BINDING = {"+": 1, "-": 1, "*": 2, "/": 2, "%": 2, "^": _POWER, "**": _POWER}
_SIGNS = {"+": 3, "-": 3, "~": 5}
_TOKEN = re.compile(
    r"\s*(?:(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)|(?P<name>[^\W\d]\w*)|(?P<sign>\*\*|[-+*/%^~(),]))"
)


class NotAFormula(ValueError):  # noqa: N818 - the sentence is the message
    """Raised for a text that is not a formula; it says why."""


@dataclass(frozen=True, slots=True)
class Part:
    """A part of a formula: a number, a name, or an operation on other parts.

    Parameters
    ----------
    word : str
        The name, operator or function; empty for a number.
    parts : tuple of Part
        Arguments of an operator or function.
    number : float
        Value of a number.
    """

    word: str
    parts: tuple["Part", ...] = ()
    number: float = 0.0

    @property
    def is_name(self) -> bool:
        """Whether it is the name of a variable."""
        return bool(self.word) and not self.parts

    def names(self) -> Iterator[str]:
        """Yield the names of variables in it."""
        if self.is_name:
            yield self.word
        for part in self.parts:
            yield from part.names()

    def value(self, values: Mapping[str, Floats]) -> Any:
        """Return its value for given variables; NaN or infinite where undefined."""
        if not self.word:
            return np.float64(self.number)
        if self.is_name:
            return values[self.word]
        function = _OPERATORS[self.word] if self.word in _OPERATORS else FUNCTIONS[self.word][1]
        return function(*(part.value(values) for part in self.parts))

    def text(self, names: Mapping[str, str]) -> str:
        """Return it as text, with variables renamed."""
        if not self.word:
            return repr(self.number)
        if self.is_name:
            return names[self.word]
        texts = [part.text(names) for part in self.parts]
        if self.word in _OPERATORS:
            return f"({f' {self.word} '.join(texts)})"
        return f"{self.word}({', '.join(texts)})"


@shape("formula", "{text}", fll=("Function",))
class Formula(Number):
    """The value of a formula of the inputs, clipped to their universes, and of earlier outputs."""

    text: Annotated[str, None]

    @property
    def parsed(self) -> Part:
        """The formula.

        Raises
        ------
        NotAFormula
            If the text is not a formula.
        """
        return parse(self.text)

    def value(self, values: Mapping[str, Floats]) -> Any:
        """Return its value for given variables, by their names."""
        with np.errstate(all="ignore"):
            return self.parsed.value(values)

    def row(self, num_inputs: int) -> tuple[float, ...]:
        """Raise TypeError: a formula is not linear.

        Raises
        ------
        TypeError
            Always.
        """
        raise TypeError(f"the formula {self.text!r} has no factors of {num_inputs} inputs")


@lru_cache(maxsize=1000)
def parse(text: str) -> Part:
    """Parse a formula.

    Raises
    ------
    NotAFormula
        If the text is not a formula.
    """
    tokens, position = [], 0
    while text[position:].strip():
        match = _TOKEN.match(text, position)
        if match is None:
            raise NotAFormula(
                f"the formula {text[:40]!r} has {text[position:].strip()[0]!r}, which is not read"
            )
        tokens.append((str(match.lastgroup), match[match.lastgroup or 0]))
        if len(tokens) > MOST_WORDS:
            raise NotAFormula(f"the formula has more than {MOST_WORDS} numbers, names and signs")
        position = match.end()
    parser = _FormulaParser(text, tokens)
    whole = parser.expression(0)
    parser.expect("")
    return whole


#: A linear form: the factor of each input, and the constant.
Form = tuple[Floats, float]


def linear(part: Part, inputs: Sequence[str]) -> Form | None:
    """Return the factor of each input, and the constant, of a linear formula; None for any other."""
    if not part.word:
        return np.zeros(len(inputs)), part.number
    if part.is_name:
        return (np.eye(len(inputs))[inputs.index(part.word)], 0.0) if part.word in inputs else None
    if part.word not in {"+", "-", "*", "/"}:
        return None
    operands = [linear(each, inputs) for each in part.parts]
    return (
        None if operands[0] is None or operands[1] is None else _combined(part.word, operands[0], operands[1])
    )


def _combined(word: str, left: Form, right: Form) -> Form | None:
    """Return two linear forms joined by an operator; None where the result is not linear."""
    (coefficients, constant), (other, factor) = left, right
    match word:
        case "+":
            return coefficients + other, constant + factor
        case "-":
            return coefficients - other, constant - factor
        case "*" if not other.any():
            return coefficients * factor, constant * factor
        case "*" if not coefficients.any():
            return other * constant, factor * constant
        case "/" if not other.any() and factor:
            return coefficients / factor, constant / factor
    return None


class _FormulaParser:
    """Parser of a formula, from left to right."""

    def __init__(self, text: str, tokens: Sequence[tuple[str, str]]) -> None:
        self.text = text
        self.tokens = [*tokens, ("end", "")]
        self.place = 0

    @property
    def next(self) -> str:
        return self.tokens[self.place][1]

    def take(self) -> str:
        self.place += 1
        return self.tokens[self.place - 1][1]

    def expect(self, sign: str) -> None:
        """Take the given sign, or raise NotAFormula."""
        if self.next != sign:
            raise NotAFormula(
                f"the formula {self.text[:40]!r} has {self.next or 'its end'!r} where {sign or 'its end'!r} "
                "must be"
            )
        self.place += 1

    def expression(self, depth: int, least: int = 1) -> Part:
        """Parse what operators join that bind as tightly as `least` or tighter."""
        if depth > DEEPEST:
            raise NotAFormula(f"the formula {self.text[:40]!r} is nested more than {DEEPEST} deep")
        left = self.operand(depth)
        while _BINDING.get(self.next, 0) >= least:
            word = self.take()
            if _BINDING[word] == _POWER:  # from right to left
                left = Part("^", (left, self.expression(depth + 1, _POWER)))
            else:
                left = Part(word, (left, self.expression(depth, _BINDING[word] + 1)))
        return left

    def operand(self, depth: int) -> Part:
        """Parse an operand: a number, a name, a call, a sign before an operand, or parentheses."""
        kind, word = self.tokens[self.place]
        if kind in {"number", "name"}:
            self.take()
            if kind == "number":
                return Part("", number=float(word))
            return self.call(word, depth) if self.next == "(" and word in FUNCTIONS else Part(word)
        if word in _SIGNS:
            self.take()
            signed = self.expression(depth + 1, _SIGNS[word])
            return signed if word == "+" else Part("*", (Part("", number=-1.0), signed))
        self.expect("(")
        inside = self.expression(depth + 1)
        self.expect(")")
        return inside

    def call(self, word: str, depth: int) -> Part:
        """Parse the arguments of a function."""
        arguments: list[Part] = []
        for index in range(FUNCTIONS[word][0]):
            self.expect("," if index else "(")
            arguments.append(self.expression(depth + 1))
        self.expect(")")
        return Part(word, tuple(arguments))
