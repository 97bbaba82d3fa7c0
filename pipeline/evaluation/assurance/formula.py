"""Formulas of signal temporal logic: their elements and their text form.

Maler and Nickovic, "Monitoring temporal properties of continuous signals", FORMATS 2004. A formula compares
sums of recorded quantities and numbers, these with or without units, and joins comparisons::

    always (distance >= 15 m)
    eventually[0:1800] (inspection_rate >= 50 %)
    always[0:3000] (distance > 150 m -> eventually[0:600] distance <= 150 m)
    not (speed > 0.3 m/s) until[0:600] distance < 60 m
    always (speed <= 0.2 m/s + 0.002 per_s * distance)
    always (coasting_distance[3600] >= 15 m)

``->`` binds least, then ``or``, ``and``, ``until``, and closest ``not``, ``always``, ``eventually``. Windows
are in seconds, from now, both ends included; without one the rest of the flight counts.
"""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from math import inf, isfinite
from typing import Final, NoReturn

from pipeline.constants import DAY_S
from pipeline.settings.keys import did_you_mean


@dataclass(frozen=True)
class Window:
    """First and last second ahead, both included; without a last, the rest of the flight."""

    first_s: float = 0.0
    last_s: float = inf


@dataclass(frozen=True)
class Predicate:
    """``sum of factor times quantity + constant >= 0``, or ``> 0``; the left side is its margin."""

    factors: tuple[tuple[str, float], ...]
    constant: float
    is_strict: bool
    unit: str


@dataclass(frozen=True)
class Negation:
    """The opposite."""

    part: "Formula"


@dataclass(frozen=True)
class Conjunction:
    """Both."""

    left: "Formula"
    right: "Formula"


@dataclass(frozen=True)
class Disjunction:
    """One of two or both."""

    left: "Formula"
    right: "Formula"


@dataclass(frozen=True)
class Always:
    """At all samples of a window."""

    window: Window
    part: "Formula"


@dataclass(frozen=True)
class Eventually:
    """At some sample of a window."""

    window: Window
    part: "Formula"


@dataclass(frozen=True)
class Until:
    """The right operand at some sample of a window, and the left from now to the sample before that."""

    window: Window
    left: "Formula"
    right: "Formula"


Formula = Predicate | Negation | Conjunction | Disjunction | Always | Eventually | Until


def predicates(formula: Formula) -> Iterator[Predicate]:
    """Return the comparisons of a formula from left to right."""
    match formula:
        case Predicate():
            yield formula
        case Negation(part) | Always(_, part) | Eventually(_, part):
            yield from predicates(part)
        case Conjunction(left, right) | Disjunction(left, right) | Until(_, left, right):
            yield from predicates(left)
            yield from predicates(right)


def quantities_of(formula: Formula) -> tuple[str, ...]:
    """Return the quantities of a formula, each once."""
    return tuple(dict.fromkeys(name for predicate in predicates(formula) for name, _ in predicate.factors))


def unit_of(formula: Formula) -> str | None:
    """Return the unit of a formula's margin; None if it compares quantities of several units."""
    units = {predicate.unit for predicate in predicates(formula)}
    return units.pop() if len(units) == 1 else None


KEYWORDS: Final = ("always", "eventually", "until", "and", "or", "not")
_TOKEN: Final = re.compile(
    r"\s*(?:(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)|(?P<name>[A-Za-z_]\w*(?:/[A-Za-z]+)?)"
    r"|(?P<sign>->|>=|<=|[-+*><()\[\]:,%]))"
)
_END: Final = "the end"
#: the unit of a factor that makes a speed of a distance
RATE: Final = "per_s"
#: quantities that may be of a time ahead, in brackets: how near free motion comes, and how far it goes
COASTING, COASTING_FARTHEST = "coasting_distance", "coasting_farthest"
OF_COASTING: Final = (COASTING, COASTING_FARTHEST)
#: of fleets: how near two deputies are to each other, and how near free motion would lead any two
NEAREST_PAIR, COASTING_PAIR = "nearest_pair", "coasting_pair"
#: a day's free motion; beyond it the linear equations say nothing
MOST_COASTED_S: Final = DAY_S


def seconds_of(name: str) -> float | None:
    """Return the seconds in the brackets after a quantity's name; None without."""
    _, bracket, rest = name.partition("[")
    return float(rest.removesuffix("]")) if bracket else None


def kind_of(name: str) -> str:
    """Return a quantity's name without the brackets."""
    return name.partition("[")[0]


class FormulaError(ValueError):
    """A formula that cannot be parsed; the text shows where."""


def parse(text: str, units: Mapping[str, str]) -> Formula:
    """Parse a formula.

    Parameters
    ----------
    text : str
    units : mapping of str to str
        The quantities that may be used, and their units; empty if dimensionless.

    Raises
    ------
    FormulaError
        If the text is not a formula, a quantity is unknown or units do not agree.
    """
    reader = _RequirementParser(text, units)
    try:
        formula = reader.implication()
    except RecursionError:
        raise FormulaError(f"{text[:60]} …\n^ formulas within formulas without end; write less") from None
    if reader.word != _END:
        reader.refuse("expected and, or, until, -> or the end")
    return formula


class _RequirementParser:
    """Parser of a formula, word by word from left to right."""

    def __init__(self, text: str, units: Mapping[str, str]) -> None:
        self._text, self._units = text, units
        self._position = self._next = 0
        self.kind = self.word = ""
        self._advance()

    def refuse(self, words: str, position: int | None = None) -> NoReturn:
        """Raise a FormulaError that points at a position, by default that of the present word."""
        raise FormulaError(
            f"{self._text}\n{' ' * (self._position if position is None else position)}^ {words}"
        )

    def implication(self) -> Formula:
        left = self._binary()
        return Disjunction(Negation(left), self.implication()) if self._accept("->") else left

    def _binary(self, words: tuple[str, ...] = ("or", "and")) -> Formula:
        """Read operands joined by binary operators, the loosest first."""
        if not words:
            return self._until()
        left = self._binary(words[1:])
        while self._accept(words[0]):
            right = self._binary(words[1:])
            left = Disjunction(left, right) if words[0] == "or" else Conjunction(left, right)
        return left

    def _until(self) -> Formula:
        """Parse an operand, perhaps ``until`` another."""
        left = self._single()
        return Until(self._window(), left, self._single()) if self._accept("until") else left

    def _single(self) -> Formula:
        """Parse one operand: a negation, a temporal operator, a formula in parentheses, or a comparison."""
        if self._accept("not"):
            return Negation(self._single())
        if self._accept("always"):
            return Always(self._window(), self._single())
        if self._accept("eventually"):
            return Eventually(self._window(), self._single())
        if self._accept("("):
            inner = self.implication()
            self._expect(")")
            return inner
        return self._comparison()

    def _window(self) -> Window:
        """Parse ``[first:last]``, s; without brackets the window is the whole flight."""
        if not self._accept("["):
            return Window()
        first = self._seconds()
        if not (self._accept(":") or self._accept(",")):
            self.refuse("expected : and the window's end in seconds")
        position = self._position
        last = self._seconds()
        self._expect("]")
        if last < first:
            self.refuse(f"the window ends at {last:g} s, before it begins at {first:g} s", position)
        return Window(first, last)

    def _seconds(self) -> float:
        """Parse a time, s."""
        value, unit, position = self._number()
        if unit not in ("", "s"):
            self.refuse(f"windows are in s, not in {unit}", position)
        return value

    def _comparison(self) -> Predicate:
        """Parse a comparison of two sums, and bring all quantities to its left side."""
        position = self._position
        left, left_constant, left_unit = self._sum()
        relation = self.word
        if relation not in (">=", "<=", ">", "<"):
            self.refuse("expected >=, <=, > or <")
        self._advance()
        right_place = self._position
        right, right_constant, right_unit = self._sum()
        unit = self._common_unit(left_unit, right_unit, right_place)
        if not left and not right:
            self.refuse("this compares numbers with one another; name a quantity", position)
        sign = 1.0 if relation in (">=", ">") else -1.0
        factors = {
            name: sign * left.get(name, 0.0) - sign * right.get(name, 0.0) for name in {**left, **right}
        }
        if not any(factors.values()):
            self.refuse("its quantities cancel, so that it compares numbers with one another", position)
        constant = sign * (left_constant - right_constant)
        return Predicate(tuple(factors.items()), constant, relation in (">", "<"), unit or "")

    def _sum(self) -> tuple[dict[str, float], float, str | None]:
        """Read a sum: factors of quantities, constant, and the unit, None for numbers without units."""
        factors: dict[str, float] = {}
        constant, unit, sign = 0.0, None, -1.0 if self._accept("-") else 1.0
        while True:
            position = self._position
            quantity_unit: str | None
            if self.kind == "number":
                value, number_unit, _ = self._number()
                if self._accept("*"):
                    if number_unit not in ("", RATE):
                        self.refuse(
                            f"a factor of a quantity is a number without a unit, or in {RATE}", position
                        )
                    position = self._position
                    name, quantity_unit = self._quantity()
                    quantity_unit += "/s" if number_unit else ""
                    factors[name] = factors.get(name, 0.0) + sign * value
                else:
                    constant += sign * value
                    quantity_unit = number_unit or None
            else:
                name, quantity_unit = self._quantity()
                factors[name] = factors.get(name, 0.0) + sign
            unit = self._common_unit(unit, quantity_unit, position)
            if self.word not in ("+", "-"):
                return factors, constant, unit
            sign = 1.0 if self.word == "+" else -1.0
            self._advance()

    def _quantity(self) -> tuple[str, str]:
        """Parse the name of a quantity; return it with its unit."""
        name = self.word
        if self.kind != "name" or name in KEYWORDS:
            self.refuse("expected a quantity or a number")
        if name not in self._units:
            cure = did_you_mean(name, self._units) or f"; there are {', '.join(self._units)}"
            self.refuse(f"there is no quantity {name}{cure}")
        self._advance()
        unit = self._units[name]
        if name in (*OF_COASTING, COASTING_PAIR) and self._accept("["):
            position, seconds = self._position, self._seconds()
            if not 0.0 < seconds <= MOST_COASTED_S:
                self.refuse(f"it looks ahead by more than 0 s and up to {MOST_COASTED_S:g} s", position)
            self._expect("]")
            name = f"{name}[{_number(seconds)}]"
        return name, unit

    def _number(self) -> tuple[float, str, int]:
        """Read a number, its unit (empty without one) and the unit's position."""
        if self.kind != "number":
            self.refuse("expected a number")
        value = float(self.word)
        if not isfinite(value):
            self.refuse("this number is too large")
        self._advance()
        position, unit = self._position, ""
        if self.word == "%" or (self.kind == "name" and self.word not in KEYWORDS):
            unit = self.word
            known = {*self._units.values(), "s", RATE} - {""}
            if unit not in known:
                self.refuse(f"{unit} is no unit here; there are {', '.join(sorted(known))}")
            self._advance()
        return value, unit, position

    def _common_unit(self, unit: str | None, other_unit: str | None, position: int) -> str | None:
        """Return the unit of two terms, of which either may have none; refuse two that differ."""
        if unit is not None and other_unit is not None and unit != other_unit:
            self.refuse(
                f"{other_unit or 'a pure number'} does not go with {unit or 'a pure number'}", position
            )
        return other_unit if unit is None else unit

    def _accept(self, word: str) -> bool:
        """Skip a word if it is the next one; return whether it was."""
        is_next = self.word == word
        if is_next:
            self._advance()
        return is_next

    def _expect(self, word: str) -> None:
        if not self._accept(word):
            self.refuse(f"expected {word}")

    def _advance(self) -> None:
        """Move to the next word of the text."""
        rest = self._text[self._next :]
        self._position = self._next + len(rest) - len(rest.lstrip())
        if not rest.strip():
            self.kind, self.word = "end", _END
            return
        token = _TOKEN.match(self._text, self._next)
        if token is None:
            self.refuse(f"{self._text[self._position]!r} means nothing in a formula")
        self.kind, self.word = str(token.lastgroup), token[token.lastgroup or 0]
        self._next = token.end()


def render(formula: Formula, units: Mapping[str, str]) -> str:  # noqa: PLR0911 - one for each kind of formula
    """Return the text of a formula, which `parse` reads back with the same units."""
    match formula:
        case Predicate():
            return _rendered(formula, units)
        case Negation(part):
            return f"not {_inner(part, units)}"
        case Conjunction(left, right):
            return f"{_inner(left, units)} and {_inner(right, units)}"
        case Disjunction(Negation(left), right):
            return f"{_inner(left, units)} -> {_inner(right, units)}"
        case Disjunction(left, right):
            return f"{_inner(left, units)} or {_inner(right, units)}"
        case Always(window, part):
            return f"always{_bounds(window)} {_inner(part, units)}"
        case Eventually(window, part):
            return f"eventually{_bounds(window)} {_inner(part, units)}"
        case Until(window, left, right):
            return f"{_inner(left, units)} until{_bounds(window)} {_inner(right, units)}"


def _inner(formula: Formula, units: Mapping[str, str]) -> str:
    """Return an operand as text, in parentheses unless it is a comparison."""
    text = render(formula, units)
    return text if isinstance(formula, Predicate) else f"({text})"


def _bounds(window: Window) -> str:
    """Return a window as text; nothing for the whole flight."""
    if window == Window():
        return ""
    return f"[{_number(window.first_s)}:{_number(window.last_s)}]"


def _rendered(predicate: Predicate, units: Mapping[str, str]) -> str:
    """Return the text of a predicate: a quantity against a number, or a sum of quantities against one."""
    unit, strict = f" {predicate.unit}".rstrip(), "" if predicate.is_strict else "="
    if len(predicate.factors) == 1 and abs(predicate.factors[0][1]) == 1.0:
        ((name, factor),) = predicate.factors
        return f"{name} {'>' if factor > 0.0 else '<'}{strict} {_number(-predicate.constant * factor)}{unit}"
    terms = []
    for name, factor in predicate.factors:
        rate = f" {RATE}" if units[kind_of(name)] != predicate.unit else ""
        terms.append(f"{'-' if factor < 0.0 else '+'} {_number(abs(factor))}{rate} * {name}")
    total = " ".join(terms).removeprefix("+ ")
    return f"{total} >{strict} {_number(-predicate.constant)}{unit}"


def _number(value: float) -> str:
    """Return the shortest text of a number that `parse` reads as the same number."""
    return repr(value + 0.0).removesuffix(".0")
