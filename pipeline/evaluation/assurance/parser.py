"""Parser of formulas in text form; error messages point at the mistake.

A formula compares sums of recorded quantities and numbers, these with or without units, and joins
comparisons::

    always (distance >= 15 m)
    eventually[0:1800] (inspection_rate >= 50 %)
    always[0:3000] (distance > 150 m -> eventually[0:600] distance <= 150 m)
    not (speed > 0.3 m/s) until[0:600] distance < 60 m

``->`` binds least, then ``or``, ``and``, ``until``, and closest ``not``, ``always``, ``eventually``. Windows
are in seconds, from now, both ends included; without one the rest of the flight counts.
"""

import re
from collections.abc import Mapping
from typing import Final, NoReturn

from pipeline.evaluation.assurance.formula import (
    Always,
    And,
    Comparison,
    Eventually,
    Formula,
    Not,
    Or,
    Until,
    Window,
)
from pipeline.settings.keys import did_you_mean

KEYWORDS: Final = ("always", "eventually", "until", "and", "or", "not")
_TOKEN: Final = re.compile(
    r"\s*(?:(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)|(?P<name>[A-Za-z_]\w*(?:/[A-Za-z]+)?)"
    r"|(?P<sign>->|>=|<=|[-+*><()\[\]:,%]))"
)
_END: Final = "the end"


class FormulaError(ValueError):
    """A formula that cannot be parsed; the text shows the place."""


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
    reader = _Reader(text, units)
    try:
        formula = reader.implication()
    except RecursionError:
        raise FormulaError(f"{text[:60]} …\n^ formulas within formulas without end; write less") from None
    if reader.word != _END:
        reader.refuse("expected and, or, until, -> or the end")
    return formula


class _Reader:
    """Parser of a formula, word by word from left to right."""

    def __init__(self, text: str, units: Mapping[str, str]) -> None:
        self._text, self._units = text, units
        self._place = self._next = 0
        self.kind = self.word = ""
        self._advance()

    def refuse(self, words: str, place: int | None = None) -> NoReturn:
        """Raise a FormulaError that points at a place, by default the present word."""
        raise FormulaError(f"{self._text}\n{' ' * (self._place if place is None else place)}^ {words}")

    def implication(self) -> Formula:
        left = self._disjunction()
        return Or(Not(left), self.implication()) if self._takes("->") else left

    def _disjunction(self) -> Formula:
        left = self._conjunction()
        while self._takes("or"):
            left = Or(left, self._conjunction())
        return left

    def _conjunction(self) -> Formula:
        left = self._until()
        while self._takes("and"):
            left = And(left, self._until())
        return left

    def _until(self) -> Formula:
        left = self._single()
        return Until(self._window(), left, self._single()) if self._takes("until") else left

    def _single(self) -> Formula:
        if self._takes("not"):
            return Not(self._single())
        if self._takes("always"):
            return Always(self._window(), self._single())
        if self._takes("eventually"):
            return Eventually(self._window(), self._single())
        if self._takes("("):
            inner = self.implication()
            self._must(")")
            return inner
        return self._comparison()

    def _window(self) -> Window:
        if not self._takes("["):
            return Window()
        first = self._seconds()
        if not (self._takes(":") or self._takes(",")):
            self.refuse("expected : and the window's end in seconds")
        place = self._place
        last = self._seconds()
        self._must("]")
        if last < first:
            self.refuse(f"the window ends at {last:g} s, before it begins at {first:g} s", place)
        return Window(first, last)

    def _seconds(self) -> float:
        value, unit, place = self._number()
        if unit not in ("", "s"):
            self.refuse(f"windows are in s, not in {unit}", place)
        return value

    def _comparison(self) -> Comparison:
        place = self._place
        left, left_constant, left_unit = self._sum()
        relation = self.word
        if relation not in (">=", "<=", ">", "<"):
            self.refuse("expected >=, <=, > or <")
        self._advance()
        right_place = self._place
        right, right_constant, right_unit = self._sum()
        unit = self._agreed(left_unit, right_unit, right_place)
        if not left and not right:
            self.refuse("this compares numbers with one another; name a quantity", place)
        sign = 1.0 if relation in (">=", ">") else -1.0
        factors = {
            name: sign * left.get(name, 0.0) - sign * right.get(name, 0.0) for name in {**left, **right}
        }
        if not any(factors.values()):
            self.refuse("its quantities cancel, so that it compares numbers with one another", place)
        constant = sign * (left_constant - right_constant)
        return Comparison(tuple(factors.items()), constant, relation in (">", "<"), unit or "")

    def _sum(self) -> tuple[dict[str, float], float, str | None]:
        """Read a sum: factors of quantities, constant, and the unit, None for numbers without units."""
        factors: dict[str, float] = {}
        constant, unit, sign = 0.0, None, -1.0 if self._takes("-") else 1.0
        while True:
            place = self._place
            told: str | None
            if self.kind == "number":
                value, own, _ = self._number()
                if self._takes("*"):
                    if own:
                        self.refuse("a factor of a quantity is a number without a unit", place)
                    place = self._place
                    name, told = self._quantity()
                    factors[name] = factors.get(name, 0.0) + sign * value
                else:
                    constant += sign * value
                    told = own or None
            else:
                name, told = self._quantity()
                factors[name] = factors.get(name, 0.0) + sign
            unit = self._agreed(unit, told, place)
            if self.word not in ("+", "-"):
                return factors, constant, unit
            sign = 1.0 if self.word == "+" else -1.0
            self._advance()

    def _quantity(self) -> tuple[str, str]:
        name = self.word
        if self.kind != "name" or name in KEYWORDS:
            self.refuse("expected a quantity or a number")
        if name not in self._units:
            cure = did_you_mean(name, self._units) or f"; there are {', '.join(self._units)}"
            self.refuse(f"there is no quantity {name}{cure}")
        self._advance()
        return name, self._units[name]

    def _number(self) -> tuple[float, str, int]:
        """Read a number, its unit (empty without one) and the unit's position."""
        if self.kind != "number":
            self.refuse("expected a number")
        value = float(self.word)
        self._advance()
        place, unit = self._place, ""
        if self.word == "%" or (self.kind == "name" and self.word not in KEYWORDS):
            unit = self.word
            known = {*self._units.values(), "s"} - {""}
            if unit not in known:
                self.refuse(f"{unit} is no unit here; there are {', '.join(sorted(known))}")
            self._advance()
        return value, unit, place

    def _agreed(self, one: str | None, other: str | None, place: int) -> str | None:
        if one is not None and other is not None and one != other:
            self.refuse(f"{other or 'a pure number'} does not go with {one or 'a pure number'}", place)
        return other if one is None else one

    def _takes(self, word: str) -> bool:
        found = self.word == word
        if found:
            self._advance()
        return found

    def _must(self, word: str) -> None:
        if not self._takes(word):
            self.refuse(f"expected {word}")

    def _advance(self) -> None:
        rest = self._text[self._next :]
        self._place = self._next + len(rest) - len(rest.lstrip())
        if not rest.strip():
            self.kind, self.word = "end", _END
            return
        found = _TOKEN.match(self._text, self._next)
        if found is None:
            self.refuse(f"{self._text[self._place]!r} means nothing in a formula")
        self.kind, self.word = str(found.lastgroup), found[found.lastgroup or 0]
        self._next = found.end()
