"""What a function works on while it is translated: C expressions; see `pipeline.onboard.arrays` for the rest.

Everything else that a function of the flight works on, such as the mission's numbers, is known while it is
translated, and stays Python.
"""

import math
import re
from dataclasses import dataclass
from typing import Any

import numpy as np

from fis_tools.formats.c.text import exact
from pipeline.onboard.allowed import (
    Kind,
    Range,
    TranslationError,
    check_compared,
    checked_range,
    common_kind,
    decided,
    negative_of,
    range_of_result,
    result_of,
)


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
        checked_range((int(value), int(value)))
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


@dataclass(frozen=True, eq=False)
class Expression:
    """A C expression; `is_name` where it is a constant of its function, `range` of whole numbers."""

    text: str
    kind: Kind = "double"
    is_name: bool = False
    range: Range = None
    #: of a whole number whose range is not known: what it is not beyond, one of them an end of C's int
    limits: Range = None
    #: of a count: the condition under which it is 1
    mask: str = ""
    #: of a whole number: the sum of its addends that are known
    offset: int = 0
    #: of a condition: "&&", "||" or "!", and what it joins
    joins: tuple[str, tuple["Expression", ...]] = ("", ())
    #: of a whole number or a condition: whether it is computed of constants of its function
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
        kind = result_of(operator, kind_of(left), kind_of(right))
        span = range_of_result(operator, range_of(left), range_of(right)) if kind == "int" else None
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
                return Expression(text, "int", range=span, offset=offset, is_fixed=is_fixed(left))
        if kind == "int" and isinstance(left, int | np.integer) and operator + str(left) in ("*1", "+0"):
            return right
        symbol = "/" if operator == "//" else operator
        text = f"({text_of(left, c_type)} {symbol} {text_of(right, c_type)})"
        if kind != "int":
            return Expression(text, kind)
        offset = _offset_of(left) + (_offset_of(right) if operator == "+" else -_offset_of(right))
        offset = offset if operator in "+-" else 0
        return Expression(text, kind, range=span, offset=offset, is_fixed=is_fixed(left) and is_fixed(right))

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
        span = checked_range((-self.range[1], -self.range[0])) if self.range else None
        return Expression(f"(-{self.text})", negative_of(self.kind), range=span)

    def __pos__(self) -> "Expression":
        negative_of(self.kind)
        return self

    def opposite(self) -> "Expression":
        """Return the condition that holds where this one does not."""
        condition_of(self)
        symbol, joined = self.joins
        if symbol == "!" and not self.is_name:
            return joined[0]
        return Expression(f"(!{self.text})", "bool", joins=("!", (self,)))

    def __abs__(self) -> "Expression":
        if self.kind not in ("double", "lane"):
            raise TranslationError("the absolute value of a whole number or a condition; write a double")
        return Expression(f"fabs({bare(self.text)})", self.kind)

    def _compared(self, other: Any, operator: str) -> Any:
        if not is_scalar(other):
            return NotImplemented
        check_compared(kind_of(self), kind_of(other))
        is_decided = decided(operator, range_of(self), range_of(other))
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
        condition_of(self)
        condition_of(other)
        if isinstance(other, Expression):
            joins = (operator if operator in ("&&", "||") else "", (self, other))
            return Expression(f"({self.text} {operator} {other.text})", "bool", joins=joins)
        if operator == "&&":
            return self if other else False
        if operator == "||":
            return True if other else self
        return self.opposite() if other else self

    def __and__(self, other: Any) -> Any:
        return self._joined(other, "&&")

    __rand__ = __and__

    def __or__(self, other: Any) -> Any:
        return self._joined(other, "||")

    __ror__ = __or__

    def __xor__(self, other: Any) -> Any:
        return self._joined(other, "!=")

    __rxor__ = __xor__


def is_fixed(value: Any) -> bool:
    """Return whether a whole number is the same wherever its text stands in a function."""
    return not isinstance(value, Expression) or value.is_name or value.is_fixed


def condition_of(value: Any) -> Any:
    """Return a condition; refuse a number or anything else that Python would take for one."""
    if not is_scalar(value) or kind_of(value) != "bool":
        raise TranslationError(
            "a number, an array or None stands where a condition is needed; compare it, such as `x != 0.0`"
        )
    return value


def merged_kind(*values: Any) -> Kind:
    """Return the kind of what is one of some numbers, which depends on what is known on board alone."""
    spans = [range_of(value) for value in values if kind_of(value) == "int"]
    has_zero = any(span is None or span[0] <= 0 <= span[1] for span in spans)
    return common_kind({kind_of(value) for value in values}, has_zero=has_zero)


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


def _offset_of(value: Any) -> int:
    return value.offset if isinstance(value, Expression) else int(value)
