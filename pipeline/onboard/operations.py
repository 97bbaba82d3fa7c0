"""How the operations of vectors, of NumPy and of `math` are written in C, for `Translator`.

A vector of flights has one lane on board. A vector of points becomes the number of one point, inside a loop
over them.
"""

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from fis_tools.compiled import vectors
from pipeline.flight.period.look.guidance import POINTS
from pipeline.onboard.allowed import LEAST_INT, MOST_INT, TranslationError
from pipeline.onboard.arrays import Accumulator, Array, Begun
from pipeline.onboard.translator import Translator
from pipeline.onboard.values import (
    Expression,
    LaneConstant,
    bare,
    condition_of,
    count_of,
    kind_of,
    merged_kind,
    range_of,
    text_of,
)


def _is_known(*values: Any) -> bool:
    return not any(isinstance(value, Expression) for value in values)


def _call(name: str, *values: Any) -> Expression:
    text = ", ".join(bare(text_of(value, "double")) for value in values)
    return Expression(f"{name}({text})", "lane" if "lane" in map(kind_of, values) else "double")


def _function(name: str, compute: Callable[..., Any]) -> Callable[..., Any]:
    """Return what writes the call of a function of C's library, or computes it."""

    def write(_: Translator, *values: Any) -> Any:
        return compute(*values) if _is_known(*values) else _call(name, *values)

    return write


def _least(_: Translator, x: Any, y: Any) -> Any:
    return (x if x < y else y) if _is_known(x, y) else _call("least", x, y)


def _most(_: Translator, x: Any, y: Any) -> Any:
    return (x if x > y else y) if _is_known(x, y) else _call("most", x, y)


def _limits(value: Any) -> tuple[int, int]:
    """Return what a whole number is not beyond: its range, or what is known of it."""
    limits = value.limits if isinstance(value, Expression) else None
    return range_of(value) or limits or (LEAST_INT, MOST_INT)


def _extreme(name: str, compute: Callable[[Any, Any], Any], symbol: str) -> Callable[..., Any]:
    """Return what writes Python's `min` or `max`, which keep the first of equal values."""

    def pair(translator: Translator, first: Any, second: Any) -> Any:
        """Return the extreme of two values: as a number, a conditional of integers, or a call."""
        if _is_known(first, second):
            return compute(first, second)
        if merged_kind(first, second) == "int":
            a, b = text_of(first, "int"), text_of(second, "int")
            lower, upper = zip(*(_limits(each) for each in (first, second)), strict=True)
            limits = compute(*lower), compute(*upper)
            is_limited = limits[0] > LEAST_INT and limits[1] < MOST_INT
            span = limits if is_limited else None
            return Expression(f"(({b} {symbol} {a}) ? {b} : {a})", "int", range=span, limits=limits)
        return _call(name, second, first)

    def write(translator: Translator, first: Any, *others: Any) -> Any:
        if not others:
            raise TranslationError(f"`{compute.__name__}` of one value; give it two numbers or more")
        for other in others:
            first = pair(translator, first, other)
        return first

    return write


def _full_index(array: Any, at: Any) -> Any:
    return at if isinstance(at, tuple) else (at, 0)[: array.ndim]


def _load(translator: Translator, array: Any, at: Any, width: int) -> Any:
    if isinstance(array, np.ndarray):
        array = translator.wrapped(array, "table")
    element = translator.element(array, _full_index(array, at))
    if width == POINTS and isinstance(element, Expression):
        if translator.function.lane is None:
            raise TranslationError("a vector of points outside a loop over them")
        return Expression(element.text, "lane")
    return element


def _store(translator: Translator, array: Any, at: Any, value: Any) -> None:
    translator.put(array, _full_index(array, at), value)


def _splat(_: Translator, value: Any, width: int) -> Any:
    return LaneConstant(value) if width == POINTS and _is_known(value) else value


def _spread(translator: Translator, array: Any, at: Any, _: int) -> Any:
    return translator.element(array, at)


def _select(translator: Translator, mask: Any, x: Any, y: Any) -> Any:
    if not isinstance(mask, Expression):
        return x if mask else y
    return translator.chosen(mask, x, y)


def _total(_: Translator, value: Any) -> Any:
    if isinstance(value, Accumulator):
        return Expression(f"total({value.name})", "double")
    if isinstance(value, float):
        return float(value)
    raise TranslationError("the total of what did not add up in a loop over points")


def _some(_: Translator, mask: Any) -> Any:
    return mask


def _count(translator: Translator, mask: Any) -> Any:
    return count_of(mask, translator.function.lanes)


def _gather_rows(translator: Translator, array: Any, at: Any, offsets: Any, count: int, out: Any) -> None:
    offset = translator.stable(at + whole(translator, offsets), "offset")
    for row in range(count):
        translator.put(out, (row, 0), translator.element(array, offset + row))


def whole(translator: Translator, value: Any) -> Any:
    """Return a value as a whole number: a condition as 1 or 0."""
    if not isinstance(value, Expression):
        return int(value)
    if value.kind == "int":
        return value
    if value.kind == "bool":
        return Expression(f"({value.text} ? 1 : 0)", "int", range=(0, 1))
    translator.doubt("a double might not fit into 32 bits as a whole number; count whole numbers instead")
    return Expression(f"(int){value.text}", "int", range=value.range)


def _power_of_two(_: Translator, exponent: Any) -> Any:
    if _is_known(exponent):
        return math.ldexp(1.0, int(exponent))
    return Expression(f"power_of_two({bare(exponent.text)})", exponent.kind)


def _length(_: Translator, value: Any) -> Any:
    if isinstance(value, Begun) and not value.indices:
        return value.count
    return int(value.shape[0]) if isinstance(value, Array) else len(value)


def _matrix(translator: Translator, rows: Any, **_: Any) -> Any:
    """Return an array of numbers that are not known as an array of expressions."""
    nested = np.array(rows, dtype=object)
    for index in np.ndindex(nested.shape):
        nested[index] = translator.stable(nested[index], "entry")
    return nested


def _empty(translator: Translator, length: Any, name: str = "local") -> Array:
    name, span = translator.fresh(name), range_of(length)
    if span is None:
        raise TranslationError("an array without a constant bound of its length")
    length = span[1]
    translator.emit(f"double {name}[{length}] = {{0}};")
    return Array(name, (length,))


def _zeros(translator: Translator, shape: Any) -> Any:
    """Return an array of C, or where the shape is known and has several axes, one of expressions."""
    if not isinstance(shape, tuple):
        return _empty(translator, shape, "zeros")
    if any(isinstance(length, Expression) for length in shape):
        raise TranslationError("an array whose shape is not known; give whole numbers")
    return translator.made(np.full(shape, 0.0, dtype=object))


def _same(_: Translator, value: Any) -> Any:
    return value


def _double(_: Translator, value: Any) -> Any:
    if not isinstance(value, Expression):
        return float(value)
    return value if value.kind in ("double", "lane") else Expression(f"({text_of(value, 'double')})")


def _condition(_: Translator, value: Any) -> Any:
    return condition_of(value) if isinstance(value, Expression) else bool(value)


OPERATIONS: Mapping[Any, Callable[..., Any]] = {
    vectors.load: _load,
    vectors.store: _store,
    vectors.splat: _splat,
    vectors.spread: _spread,
    vectors.select: _select,
    vectors.least: _least,
    vectors.most: _most,
    vectors.higher: _most,
    vectors.total: _total,
    vectors.some: _some,
    vectors.count: _count,
    vectors.gather_rows: _gather_rows,
    vectors.power_of_two: _power_of_two,
    vectors.width_of: lambda _, rows: 1,
    vectors.borrowed: _same,
    min: _extreme("least", min, "<"),
    max: _extreme("most", max, ">"),
    len: _length,
    int: whole,
    float: _double,
    bool: _condition,
    abs: lambda _, value: abs(value),
    range: lambda _, *bounds: range(*bounds),
    enumerate: lambda _, items: list(enumerate(items)),
    np.array: _matrix,
    np.empty: _empty,
    np.zeros: _zeros,
    np.sqrt: _function("sqrt", math.sqrt),
    np.rint: _function("nearest_whole", lambda x: float(np.rint(x))),
    np.ceil: _function("ceil", lambda x: float(math.ceil(x))),
    np.floor: _function("floor", lambda x: float(math.floor(x))),
    math.sqrt: _function("sqrt", math.sqrt),
    math.cos: _function("cos", math.cos),
    math.sin: _function("sin", math.sin),
    math.atan2: _function("atan2", math.atan2),
    math.atan: _function("atan", math.atan),
    math.tan: _function("tan", math.tan),
}
