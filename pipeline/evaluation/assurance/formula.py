"""Formulas of signal temporal logic: their elements, their text form, and by how much flights satisfy them.

Maler and Nickovic, "Monitoring temporal properties of continuous signals", FORMATS 2004. A formula compares
sums of recorded quantities and numbers, these with or without units, and joins comparisons::

    always (distance >= 15 m)
    eventually[0:1800] (inspection_rate >= 50 %)
    always[0:3000] (distance > 150 m -> eventually[0:600] distance <= 150 m)
    not (speed > 0.3 m/s) until[0:600] distance < 60 m
    always (speed <= 0.2 m/s + 0.002 per_s * distance)

``->`` binds least, then ``or``, ``and``, ``until``, and closest ``not``, ``always``, ``eventually``. Windows
are in seconds, from now, both ends included; without one the rest of the flight counts.

Robustness: Fainekos and Pappas, "Robustness of temporal logic specifications for continuous-time signals",
Theoretical Computer Science 410, 2009; Donze and Maler, FORMATS 2010. A comparison's is its margin, ``and``
and ``always`` take the minimum, ``or`` and ``eventually`` the maximum. A formula holds above zero and fails
below, and this remains so while no comparison's value changes by as much as the margin. Windows are cut at
the end of a flight, as in rtamt: beyond it ``always`` requires nothing, and ``eventually`` finds nothing.
"""

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from math import ceil, floor, inf, isfinite, isinf
from typing import Final, NoReturn

import numpy as np
from numpy.typing import NDArray

from pipeline.array_types import Floats
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
    reader = _Parser(text, units)
    try:
        formula = reader.implication()
    except RecursionError:
        raise FormulaError(f"{text[:60]} …\n^ formulas within formulas without end; write less") from None
    if reader.word != _END:
        reader.refuse("expected and, or, until, -> or the end")
    return formula


class _Parser:
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
        left = self._single()
        return Until(self._window(), left, self._single()) if self._accept("until") else left

    def _single(self) -> Formula:
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
        value, unit, position = self._number()
        if unit not in ("", "s"):
            self.refuse(f"windows are in s, not in {unit}", position)
        return value

    def _comparison(self) -> Predicate:
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
        if unit is not None and other_unit is not None and unit != other_unit:
            self.refuse(
                f"{other_unit or 'a pure number'} does not go with {unit or 'a pure number'}", position
            )
        return other_unit if unit is None else unit

    def _accept(self, word: str) -> bool:
        is_next = self.word == word
        if is_next:
            self._advance()
        return is_next

    def _expect(self, word: str) -> None:
        if not self._accept(word):
            self.refuse(f"expected {word}")

    def _advance(self) -> None:
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


Samples = Mapping[str, Floats]
Atom = Callable[[Predicate, Samples], Floats]

#: tolerance for a window's end on a sample, as a fraction of the sample period
NEAR_A_SAMPLE = 1e-9


def robustness(formula: Formula, quantities: Samples, period_s: float) -> Floats:
    """Return the margin by which each flight satisfies a formula at its first sample.

    Parameters
    ----------
    formula : Formula
    quantities : mapping of str to (n, S) array
        Samples of each quantity, one row per flight.
    period_s : float
        Between two samples.

    Returns
    -------
    (n,) array
        In the formula's unit; infinite if the flight does not determine it.
    """
    return _evaluate(formula, quantities, period_s, _margin)[:, 0]


def holds(formula: Formula, quantities: Samples, period_s: float) -> NDArray[np.bool_]:
    """Return whether each flight satisfies a formula, (n,); unlike a zero margin, this tells > from >=."""
    return _evaluate(formula, quantities, period_s, _truth)[:, 0] > 0.0


def idle_window(formula: Formula, duration_s: float, period_s: float, now: int = 0) -> Window | None:
    """Return the first window of a formula that contains no sample of a flight, None without one.

    Parameters
    ----------
    formula : Formula
    duration_s : float
        Of the flight.
    period_s : float
        Between two samples.
    now : int
        The first sample at which the formula is evaluated.
    """
    match formula:
        case Negation(part):
            parts = [(part, now)]
        case Conjunction(left, right) | Disjunction(left, right):
            parts = [(left, now), (right, now)]
        case Always(window, part) | Eventually(window, part) | Until(window, _, part):
            first, last = _in_samples(window, period_s)
            if (last is not None and last < first) or now + first > round(duration_s / period_s):
                return window
            parts = [(part, now + first), *([(formula.left, now)] if isinstance(formula, Until) else [])]
        case _:
            parts = []
    idle = (idle_window(part, duration_s, period_s, begins) for part, begins in parts)
    return next((window for window in idle if window is not None), None)


def _margin(comparison: Predicate, quantities: Samples) -> Floats:
    total = np.zeros(np.shape(quantities[comparison.factors[0][0]])) + comparison.constant
    for name, factor in comparison.factors:
        total += factor * np.asarray(quantities[name], dtype=np.float64)
    return total


def _truth(comparison: Predicate, quantities: Samples) -> Floats:
    """Return 1 where a comparison holds and -1 where it does not."""
    margin = _margin(comparison, quantities)
    return np.where(margin > 0.0 if comparison.is_strict else margin >= 0.0, 1.0, -1.0)


def _evaluate(  # noqa: PLR0911 - one for each kind of formula
    formula: Formula, quantities: Samples, period_s: float, atom: Atom
) -> Floats:
    """Return the value of a formula at all samples, (n, S)."""

    def value(part: Formula) -> Floats:
        return _evaluate(part, quantities, period_s, atom)

    match formula:
        case Predicate():
            return atom(formula, quantities)
        case Negation(part):
            return -value(part)
        case Conjunction(left, right):
            return np.minimum(value(left), value(right))
        case Disjunction(left, right):
            return np.maximum(value(left), value(right))
        case Always(window, part):
            return _window_minimum(value(part), *_in_samples(window, period_s))
        case Eventually(window, part):
            return -_window_minimum(-value(part), *_in_samples(window, period_s))
        case Until(window, left, right):
            return _until(value(left), value(right), *_in_samples(window, period_s))


def _in_samples(window: Window, period_s: float) -> tuple[int, int | None]:
    """Return the first and the last sample of a window, counted from now; None for the flight's last."""
    first = ceil(window.first_s / period_s - NEAR_A_SAMPLE)
    return first, None if isinf(window.last_s) else floor(window.last_s / period_s + NEAR_A_SAMPLE)


def _window_minimum(values: Floats, first: int, last: int | None) -> Floats:
    """Return at each sample the minimum from `first` to `last` samples ahead; infinity without any."""
    num_samples = values.shape[1]
    ahead = _shift(values, first, np.inf)
    if last is not None and last < first:
        return np.full_like(values, np.inf)
    if last is None or last - first >= num_samples - 1:
        return np.minimum.accumulate(ahead[:, ::-1], axis=1)[:, ::-1]
    from scipy.ndimage import minimum_filter1d  # noqa: PLC0415 - slow to import, and few windows end

    width = last - first + 1
    least: Floats = minimum_filter1d(ahead, width, axis=1, mode="constant", cval=np.inf, origin=-(width // 2))
    return least


def _until(left: Floats, right: Floats, first: int, last: int | None) -> Floats:
    """Return the value of `Until` at each sample."""
    value = right.copy()
    for k in range(right.shape[1] - 2, -1, -1):
        value[:, k] = np.maximum(right[:, k], np.minimum(left[:, k], value[:, k + 1]))
    value = _shift(value, first, -np.inf)
    if first > 0:
        value = np.minimum(value, _window_minimum(left, 0, first - 1))
    # a window ends by what must come within it (Donzé, Ferrère and Maler, CAV 2013)
    return value if last is None else np.minimum(value, -_window_minimum(-right, first, last))


def _shift(values: Floats, count: int, beyond: float) -> Floats:
    """Return the values `count` samples later, with `beyond` after the last."""
    if count == 0:
        return values
    later = np.full_like(values, beyond)
    later[:, :-count] = values[:, count:]
    return later
