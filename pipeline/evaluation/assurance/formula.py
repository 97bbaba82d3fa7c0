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
class Comparison:
    """``sum of factor times quantity + constant >= 0``, or ``> 0``; the left side is its margin."""

    factors: tuple[tuple[str, float], ...]
    constant: float
    is_strict: bool
    unit: str


@dataclass(frozen=True)
class Not:
    """The opposite."""

    part: "Formula"


@dataclass(frozen=True)
class And:
    """Both."""

    left: "Formula"
    right: "Formula"


@dataclass(frozen=True)
class Or:
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


Formula = Comparison | Not | And | Or | Always | Eventually | Until


def comparisons(formula: Formula) -> Iterator[Comparison]:
    """Return the comparisons of a formula from left to right."""
    match formula:
        case Comparison():
            yield formula
        case Not(part) | Always(_, part) | Eventually(_, part):
            yield from comparisons(part)
        case And(left, right) | Or(left, right) | Until(_, left, right):
            yield from comparisons(left)
            yield from comparisons(right)


def quantities_of(formula: Formula) -> tuple[str, ...]:
    """Return the quantities of a formula, each once."""
    return tuple(dict.fromkeys(name for one in comparisons(formula) for name, _ in one.factors))


def unit_of(formula: Formula) -> str | None:
    """Return the unit of a formula's margin; None if it compares quantities of several units."""
    units = {one.unit for one in comparisons(formula)}
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
        left = self._joined()
        return Or(Not(left), self.implication()) if self._takes("->") else left

    def _joined(self, words: tuple[str, ...] = ("or", "and")) -> Formula:
        """Read a disjunction, or what is within one: the operators from the loosest to the tightest."""
        if not words:
            return self._until()
        left = self._joined(words[1:])
        while self._takes(words[0]):
            right = self._joined(words[1:])
            left = Or(left, right) if words[0] == "or" else And(left, right)
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
            quantity_unit: str | None
            if self.kind == "number":
                value, own, _ = self._number()
                if self._takes("*"):
                    if own not in ("", RATE):
                        self.refuse(f"a factor of a quantity is a number without a unit, or in {RATE}", place)
                    place = self._place
                    name, quantity_unit = self._quantity()
                    quantity_unit += "/s" if own else ""
                    factors[name] = factors.get(name, 0.0) + sign * value
                else:
                    constant += sign * value
                    quantity_unit = own or None
            else:
                name, quantity_unit = self._quantity()
                factors[name] = factors.get(name, 0.0) + sign
            unit = self._agreed(unit, quantity_unit, place)
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
        place, unit = self._place, ""
        if self.word == "%" or (self.kind == "name" and self.word not in KEYWORDS):
            unit = self.word
            known = {*self._units.values(), "s", RATE} - {""}
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


Quantities = Mapping[str, Floats]
Atom = Callable[[Comparison, Quantities], Floats]

#: tolerance for a window's end on a sample, as a fraction of the sample period
NEAR_A_SAMPLE = 1e-9


def robustness(formula: Formula, quantities: Quantities, period_s: float) -> Floats:
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
    return _over(formula, quantities, period_s, _margin)[:, 0]


def holds(formula: Formula, quantities: Quantities, period_s: float) -> NDArray[np.bool_]:
    """Return whether each flight satisfies a formula, (n,); unlike a zero margin, this tells > from >=."""
    return _over(formula, quantities, period_s, _truth)[:, 0] > 0.0


def idle_window(formula: Formula, duration_s: float, period_s: float, now: int = 0) -> Window | None:
    """Return the first window of a formula that holds no sample of a flight, so that its part says nothing.

    Parameters
    ----------
    formula : Formula
    duration_s : float
        Of the flight.
    period_s : float
        Between two samples.
    now : int
        The first sample at which the formula is asked for.
    """
    match formula:
        case Not(part):
            asked = [(part, now)]
        case And(left, right) | Or(left, right):
            asked = [(left, now), (right, now)]
        case Always(window, part) | Eventually(window, part) | Until(window, _, part):
            first, last = _in_samples(window, period_s)
            if (last is not None and last < first) or now + first > round(duration_s / period_s):
                return window
            asked = [(part, now + first), *([(formula.left, now)] if isinstance(formula, Until) else [])]
        case _:
            asked = []
    found = (idle_window(part, duration_s, period_s, begins) for part, begins in asked)
    return next((window for window in found if window is not None), None)


def _margin(comparison: Comparison, quantities: Quantities) -> Floats:
    total = np.zeros(np.shape(quantities[comparison.factors[0][0]])) + comparison.constant
    for name, factor in comparison.factors:
        total += factor * np.asarray(quantities[name], dtype=np.float64)
    return total


def _truth(comparison: Comparison, quantities: Quantities) -> Floats:
    """Return 1 where a comparison holds and -1 where it does not."""
    margin = _margin(comparison, quantities)
    return np.where(margin > 0.0 if comparison.is_strict else margin >= 0.0, 1.0, -1.0)


def _over(  # noqa: PLR0911 - one for each kind of formula
    formula: Formula, quantities: Quantities, period_s: float, atom: Atom
) -> Floats:
    """Return the value of a formula at all samples, (n, S)."""

    def value(part: Formula) -> Floats:
        return _over(part, quantities, period_s, atom)

    match formula:
        case Comparison():
            return atom(formula, quantities)
        case Not(part):
            return -value(part)
        case And(left, right):
            return np.minimum(value(left), value(right))
        case Or(left, right):
            return np.maximum(value(left), value(right))
        case Always(window, part):
            return _least_ahead(value(part), *_in_samples(window, period_s))
        case Eventually(window, part):
            return -_least_ahead(-value(part), *_in_samples(window, period_s))
        case Until(window, left, right):
            return _until(value(left), value(right), *_in_samples(window, period_s))


def _in_samples(window: Window, period_s: float) -> tuple[int, int | None]:
    """Return the first and the last sample of a window, counted from now; None for the flight's last."""
    first = ceil(window.first_s / period_s - NEAR_A_SAMPLE)
    return first, None if isinf(window.last_s) else floor(window.last_s / period_s + NEAR_A_SAMPLE)


def _least_ahead(values: Floats, first: int, last: int | None) -> Floats:
    """Return at each sample the minimum from `first` to `last` samples ahead; infinity without any."""
    num_samples = values.shape[1]
    ahead = _ahead(values, first, np.inf)
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
    found = right.copy()
    for k in range(right.shape[1] - 2, -1, -1):
        found[:, k] = np.maximum(right[:, k], np.minimum(left[:, k], found[:, k + 1]))
    found = _ahead(found, first, -np.inf)
    if first > 0:
        found = np.minimum(found, _least_ahead(left, 0, first - 1))
    # a window ends by what must come within it (Donzé, Ferrère and Maler, CAV 2013)
    return found if last is None else np.minimum(found, -_least_ahead(-right, first, last))


def _ahead(values: Floats, count: int, beyond: float) -> Floats:
    """Return the values `count` samples later, with `beyond` after the last."""
    if count == 0:
        return values
    later = np.full_like(values, beyond)
    later[:, :-count] = values[:, count:]
    return later
