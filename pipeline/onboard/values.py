"""What a function works on while it is translated: C expressions, arrays, records of the state.

Everything else that a function of the flight works on, such as the mission's numbers, is known while it is
translated, and stays Python.
"""

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from fis_tools.formats.c.text import exact

#: "lane" is a double of one point of the chief, where the flight works on a vector of points
Kind = Literal["double", "lane", "int", "bool"]
C_TYPES: dict[Kind, str] = {"double": "double", "lane": "double", "int": "int", "bool": "bool"}


class TranslationError(Exception):
    """Something that has no translation; the message names the file and the line."""


class LaneConstant(float):
    """A number in every lane of a vector of points."""


def number_text(value: float) -> str:
    """Return a double as an operand of C."""
    if math.isnan(value):
        raise TranslationError("a number is NaN")
    text = exact(float(value))
    return f"({text})" if text.startswith("-") else text


def is_whole(text: str) -> bool:
    """Return whether a text is one operand: a name, an element, a call or something in brackets."""
    return bare(text) != text or re.fullmatch(r"(?:\(int\))?[\w.>\-]+(?:\[\w+\])*", text) is not None


def kind_of(value: Any) -> Kind:
    """Return the kind of a scalar.

    Raises
    ------
    TranslationError
        For anything else.
    """
    if isinstance(value, Expression):
        return value.kind
    if isinstance(value, bool | np.bool_):
        return "bool"
    if isinstance(value, int | np.integer):
        return "int"
    if isinstance(value, LaneConstant):
        return "lane"
    if isinstance(value, float | np.floating):
        return "double"
    raise TranslationError(f"{type(value).__name__} is no number")


def is_scalar(value: Any) -> bool:
    """Return whether a value is a number, known or not."""
    return isinstance(value, Expression | int | float | np.number | np.bool_)


def text_of(value: Any, c_type: str | None = None) -> str:
    """Return a scalar as C, as a double, an int or a bool if one is given."""
    if isinstance(value, Expression):
        if c_type == "double" and value.kind in ("int", "bool"):
            return f"(double){value.text}"
        if c_type == "int" and value.kind == "bool":
            return f"({value.text} ? 1 : 0)"
        return value.text
    if isinstance(value, bool | np.bool_) and c_type in (None, "bool"):
        return "true" if value else "false"
    if c_type == "int" or (c_type is None and isinstance(value, int | np.integer)):
        if float(value) != int(value):
            raise TranslationError(f"{value} stands where a whole number is needed")
        return str(int(value)) if value >= 0 else f"({int(value)})"
    return number_text(float(value))


def bare(text: str) -> str:
    """Return an expression without the pair of brackets around all of it."""
    if not (text.startswith("(") and text.endswith(")")):
        return text
    depth = 0
    for index, letter in enumerate(text):
        depth += (letter == "(") - (letter == ")")
        if depth == 0 and index < len(text) - 1:
            return text
    return text[1:-1]


#: least and greatest value of a whole number; None where it is not known
Range = tuple[int, int] | None


@dataclass(frozen=True, eq=False)
class Expression:
    """A C expression; `is_name` where it is a constant of its function, `range` of whole numbers."""

    text: str
    kind: Kind = "double"
    is_name: bool = False
    range: Range = None
    #: of a count: the condition under which it is 1
    mask: str = ""
    #: of a whole number: the sum of its addends that are known
    offset: int = 0
    #: of a condition: "&&", "||" or "!", and what it joins
    joins: tuple[str, tuple["Expression", ...]] = ("", ())
    #: of a condition: whether it compares constants of its function
    is_fixed: bool = False

    __array_ufunc__ = None  # so that NumPy's numbers leave arithmetic to it
    __hash__ = None  # type: ignore[assignment]

    def __bool__(self) -> bool:
        """Refuse: a branch on what is not known is translated, not taken."""
        raise TranslationError(f"whether {self.text} holds is not known")

    def _arithmetic(self, other: Any, operator: str, is_right: bool = False) -> Any:
        if not is_scalar(other):
            return NotImplemented
        left, right = (other, self) if is_right else (self, other)
        kinds = {kind_of(left), kind_of(right)}
        kind: Kind = "double"
        if "lane" in kinds:
            kind = "lane"
        elif operator != "/" and kinds <= {"int", "bool"}:
            kind = "int"
        elif operator in ("//", "%"):
            raise TranslationError(f"{operator} of doubles")
        c_type = "int" if kind == "int" else "double"
        # of doubles nothing is left out: adding zero changes the sign of zero
        if kind == "int" and isinstance(right, int) and not isinstance(right, bool):
            if (operator in "+-" and right == 0) or (operator == "*" and right == 1):
                return left
            match = re.fullmatch(r"\((\d+) ([+-]) (.*)\)", text_of(left))
            if isinstance(left, Expression) and match and operator in "+-":  # known numbers are added up
                known = int(match[1]) + (right if operator == "+" else -right)
                shown = str(known) if known >= 0 else f"({known})"
                is_left_out = known == 0 and match[2] == "+" and is_whole(match[3])
                text = match[3] if is_left_out else f"({shown} {match[2]} {match[3]})"
                offset = left.offset + known - int(match[1])
                return Expression(text, "int", range=_range_of(operator, left, right), offset=offset)
        if kind == "int" and isinstance(left, int | np.integer) and operator + str(left) in ("*1", "+0"):
            return right
        symbol = "/" if operator == "//" else operator
        text = f"({text_of(left, c_type)} {symbol} {text_of(right, c_type)})"
        if kind != "int":
            return Expression(text, kind)
        offset = _offset_of(left) + (_offset_of(right) if operator == "+" else -_offset_of(right))
        return Expression(
            text, kind, range=_range_of(operator, left, right), offset=offset if operator in "+-" else 0
        )

    def __add__(self, other: Any) -> Any:
        return self._arithmetic(other, "+")

    def __radd__(self, other: Any) -> Any:
        return self._arithmetic(other, "+", True)

    def __sub__(self, other: Any) -> Any:
        return self._arithmetic(other, "-")

    def __rsub__(self, other: Any) -> Any:
        return self._arithmetic(other, "-", True)

    def __mul__(self, other: Any) -> Any:
        return self._arithmetic(other, "*")

    def __rmul__(self, other: Any) -> Any:
        return self._arithmetic(other, "*", True)

    def __truediv__(self, other: Any) -> Any:
        return self._arithmetic(other, "/")

    def __rtruediv__(self, other: Any) -> Any:
        return self._arithmetic(other, "/", True)

    def __floordiv__(self, other: Any) -> Any:
        return self._arithmetic(other, "//")

    def __mod__(self, other: Any) -> Any:
        return self._arithmetic(other, "%")

    def __neg__(self) -> "Expression":
        reversed_range = (-self.range[1], -self.range[0]) if self.range else None
        return Expression(f"(-{self.text})", self.kind, range=reversed_range)

    def __pos__(self) -> "Expression":
        return self

    def __invert__(self) -> "Expression":
        symbol, joined = self.joins
        if symbol == "!" and not self.is_name:
            return joined[0]
        return Expression(f"(!{self.text})", "bool", joins=("!", (self,)))

    def __abs__(self) -> "Expression":
        if self.kind == "int":
            raise TranslationError("the absolute value of a whole number")
        return Expression(f"fabs({bare(self.text)})", self.kind)

    def _compared(self, other: Any, operator: str) -> Any:
        if not is_scalar(other):
            return NotImplemented
        is_decided = _decided(operator, range_of(self), range_of(other))
        if is_decided is not None:
            return is_decided
        c_type = "int" if {kind_of(self), kind_of(other)} <= {"int", "bool"} else "double"
        is_fixed = self.is_name and (not isinstance(other, Expression) or other.is_name)
        text = f"({text_of(self, c_type)} {operator} {text_of(other, c_type)})"
        return Expression(text, "bool", is_fixed=is_fixed)

    def __lt__(self, other: Any) -> Any:
        return self._compared(other, "<")

    def __le__(self, other: Any) -> Any:
        return self._compared(other, "<=")

    def __gt__(self, other: Any) -> Any:
        return self._compared(other, ">")

    def __ge__(self, other: Any) -> Any:
        return self._compared(other, ">=")

    def __eq__(self, other: object) -> Any:
        return self._compared(other, "==")

    def __ne__(self, other: object) -> Any:
        return self._compared(other, "!=")

    def _joined(self, other: Any, operator: str) -> Any:
        if isinstance(other, Expression):
            joins = (operator if operator in ("&&", "||") else "", (self, other))
            return Expression(f"({self.text} {operator} {other.text})", "bool", joins=joins)
        if operator == "&&":
            return self if other else False
        if operator == "||":
            return True if other else self
        return ~self if other else self

    def __and__(self, other: Any) -> Any:
        return self._joined(other, "&&")

    __rand__ = __and__

    def __or__(self, other: Any) -> Any:
        return self._joined(other, "||")

    __ror__ = __or__

    def __xor__(self, other: Any) -> Any:
        return self._joined(other, "!=")

    __rxor__ = __xor__


def count_of(condition: Any, most: int) -> Any:
    """Return what a count goes up by for a condition, which holds up to so many times."""
    if isinstance(condition, Expression):
        text = f"({condition.text} ? 1 : 0)"
        return Expression(text, "int", range=(0, most), mask=bare(condition.text))
    return Expression("1", "int", range=(0, most), mask="true") if condition else 0


def conclusions(condition: Expression, *, holds: bool) -> dict[str, bool]:
    """Return what else holds, or does not, where a condition does or does not: constants of the function."""
    known = {condition.text: holds} if condition.is_name or condition.is_fixed else {}
    symbol, joined = condition.joins
    if symbol == "!" or (symbol and holds == (symbol == "&&")):
        for part in joined:
            known |= conclusions(part, holds=holds != (symbol == "!"))
    return known


def range_of(value: Any) -> Range:
    """Return the least and the greatest value of a whole number; None where it is not known."""
    if isinstance(value, Expression):
        return (0, 1) if value.kind == "bool" else value.range
    return (int(value), int(value)) if isinstance(value, int | np.integer) else None


def _decided(operator: str, a: Range, b: Range) -> bool | None:
    """Return how numbers from one range compare with those from another; None where it depends on them."""
    if a is None or b is None:
        return None
    if operator in ("<", ">="):
        is_less = True if a[1] < b[0] else False if a[0] >= b[1] else None
        return is_less if operator == "<" or is_less is None else not is_less
    if operator in (">", "<="):
        return _decided("<" if operator == ">" else ">=", b, a)
    return operator == "!=" if a[1] < b[0] or b[1] < a[0] else None


def _offset_of(value: Any) -> int:
    return value.offset if isinstance(value, Expression) else int(value)


def _range_of(operator: str, left: Any, right: Any) -> Range:
    a, b = range_of(left), range_of(right)
    if a is None or b is None:
        return None
    if operator == "+":
        return a[0] + b[0], a[1] + b[1]
    if operator == "-":
        return a[0] - b[1], a[1] - b[0]
    if operator == "*":
        products = [x * y for x in a for y in b]
        return min(products), max(products)
    # Python and C agree on quotients and rests of what is not negative
    if a[0] < 0 or b[0] <= 0:
        raise TranslationError(f"{operator} of numbers that may be negative")
    return (a[0] // b[1], a[1] // b[0]) if operator == "//" else (0, min(a[1], b[1] - 1))


@dataclass(frozen=True, eq=False)
class Accumulator:
    """A C array with a number for each lane of a vector of points, in which they add up in vectors."""

    name: str


@dataclass(frozen=True, eq=False)
class Array:
    """An array of C, or the part of it that the indices so far lead to.

    Axes of length 1 are left out in C. Of a table `data` holds what stands in it.
    """

    name: str
    shape_whole: tuple[int, ...]
    kind: Kind = "double"
    data: Any = None
    indices: tuple[Any, ...] = ()
    first: Any = 0  # of the next axis, where the array is a slice

    @property
    def shape(self) -> tuple[int, ...]:
        """The lengths of the axes that are left."""
        length, *others = self.shape_whole[len(self.indices) :]
        return (length - (self.first if isinstance(self.first, int) else 0), *others)

    @property
    def ndim(self) -> int:
        """The number of axes that are left."""
        return len(self.shape_whole) - len(self.indices)

    def at(self, key: Any) -> "Array":
        """Return what an index leads to, or several."""
        keys = key if isinstance(key, tuple) else (key,)
        if any(isinstance(each, slice) for each in keys):
            (part,) = keys
            if part.stop is not None or part.step is not None:
                raise TranslationError("a slice with an end")
            return replace(self, first=self.first + (part.start or 0))
        head, *others = keys
        left = self.shape_whole[len(self.indices) :]
        if isinstance(self.first, Expression) or self.first != 0:
            head = head + self.first
        for number, (index, length) in enumerate(zip((head, *others), left, strict=False)):
            if not isinstance(index, Expression) and not 0 <= index < length:
                raise TranslationError(f"index {index} of axis {number} of {self.name}, which has {length}")
        return replace(self, indices=(*self.indices, head, *others), first=0)

    @property
    def is_element(self) -> bool:
        """Whether the indices lead to a number."""
        return len(self.indices) == len(self.shape_whole)

    @property
    def known(self) -> Any:
        """What stands there, where it is known; else None."""
        if self.data is None or any(isinstance(index, Expression) for index in self.indices):
            return None
        value = self.data[self.indices]
        return value.item() if np.ndim(value) == 0 else None


@dataclass(frozen=True)
class Transpose:
    """The transpose of an array: `at` returns a column of it."""

    array: Array
    ndim: int = 2
    used: Sequence[str] = ()

    def at(self, writer: Any, index: Any) -> list[Any]:
        """Return the numbers of a column."""
        return [writer.element(self.array, (row, index)) for row in range(self.array.shape[0])]


@dataclass(frozen=True)
class Record:
    """A record of the state: `member` finds its fields."""

    member: Callable[[str, tuple[Any, ...]], Any]
    fields: Sequence[str]
    indices: tuple[Any, ...] = ()

    def __getattr__(self, name: str) -> Any:
        """Return a field."""
        if name.startswith("__") or name not in self.fields:
            raise AttributeError(name)
        return self.member(name, self.indices)

    def at(self, key: Any) -> "Record":
        """Return one record of an array of them."""
        return replace(self, indices=(*self.indices, key))


def leaves(value: Any) -> list[Any]:
    """Return the numbers, arrays and others in a value of nested tuples."""
    if isinstance(value, tuple):
        return [leaf for item in value for leaf in leaves(item)]
    return [value]


def map_leaves(value: Any, change: Callable[[Any, str], Any], name: str = "") -> Any:
    """Return nested tuples of the same types, with each leaf changed; it is given a name, too."""
    if not isinstance(value, tuple):
        return change(value, name)
    names = getattr(value, "_fields", [str(index) for index in range(len(value))])
    items = [
        map_leaves(item, change, f"{name}_{part}" if name else part)
        for item, part in zip(value, names, strict=True)
    ]
    return type(value)(*items) if hasattr(value, "_fields") else tuple(items)


def is_known(value: Any) -> bool:
    """Return whether nothing in a value depends on what is known on board alone."""
    return not any(
        isinstance(leaf, Expression | Accumulator | Record)
        or (isinstance(leaf, Array) and leaf.known is None)
        or (isinstance(leaf, np.ndarray) and leaf.dtype == object)
        for leaf in leaves(value)
    )
