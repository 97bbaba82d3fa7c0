"""Expressions of Python: computed where all is known, else written down."""

import ast
import operator
import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from fis_tools.compiled.decorator import Compiled
from fis_tools.compiled.vectors import Three
from pipeline.onboard.allowed import C_TYPES, TranslationError, union
from pipeline.onboard.arrays import Accumulator, Array, is_known, leaves
from pipeline.onboard.functions import Frame, Line, change_arrays
from pipeline.onboard.values import Expression, condition_of, is_scalar, merged_kind, range_of, text_of
from pipeline.onboard.writer import Writer

#: a value, and the lines that compute it
Computed = tuple[Any, list[Line]]

OPERATORS: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.FloorDiv: operator.floordiv,
    ast.Mod: operator.mod,
    ast.BitAnd: operator.and_,
    ast.BitOr: operator.or_,
    ast.BitXor: operator.xor,
}
COMPARISONS: dict[type[ast.cmpop], Callable[[Any, Any], Any]] = {
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
}


def _reads_arrays(value: Any) -> bool:
    return any(
        (isinstance(leaf, Expression) and re.search(r"\[|->", leaf.text))
        or (isinstance(leaf, Array) and _reads_arrays((*leaf.indices, leaf.first)))
        for leaf in leaves(value)
    )


def _has_call(node: ast.expr) -> bool:
    return any(isinstance(part, ast.Call) for part in ast.walk(node))


class Expressions(Writer, ABC):
    """Returns what expressions are."""

    @abstractmethod
    def invoked(self, function: Any, arguments: list[Any], named: dict[str, Any]) -> Any:
        """Return what a compiled function returns, having written it."""

    def value(self, node: ast.expr, frame: Frame) -> Any:
        """Return what an expression is."""
        evaluate = getattr(self, f"_value_{type(node).__name__.lower()}", None)
        if evaluate is None:
            with self.located(frame, node):
                raise TranslationError(f"{type(node).__name__} is not translated")
        return evaluate(node, frame)

    def _value_constant(self, node: ast.Constant, _: Frame) -> Any:
        return node.value

    def _value_name(self, node: ast.Name, frame: Frame) -> Any:
        if node.id in frame.names:
            return self._read(frame.names[node.id])
        if node.id in frame.source.local_names:
            raise TranslationError(
                f"{node.id} is not bound on every way here, or counted a loop; give it a value before"
            )
        if node.id in frame.globals:
            return self.wrapped(frame.globals[node.id], node.id)
        builtins = frame.globals["__builtins__"]
        names = builtins if isinstance(builtins, dict) else vars(builtins)
        if node.id not in names:
            raise TranslationError(f"{node.id} is not bound on every way here")
        return names[node.id]

    def _value_attribute(self, node: ast.Attribute, frame: Frame) -> Any:
        owner = self.value(node.value, frame)
        if isinstance(owner, Expression | Accumulator | np.ndarray) or (
            isinstance(owner, Array) and node.attr not in ("shape", "ndim")
        ):
            raise TranslationError(f"attribute {node.attr} of {type(owner).__name__}")
        return self.wrapped(getattr(owner, node.attr), node.attr)

    @abstractmethod
    def either(self, condition: Expression, taken: Computed, otherwise: Computed) -> Any:
        """Return one value where a condition holds, else the other; only that one is computed."""

    def apart(self, node: ast.expr, frame: Frame) -> Computed:
        """Return what an expression is, and the lines that compute it, which are not written yet."""
        outer, self.function.lines = self.function.lines, []
        value = self.value(node, frame)
        lines, self.function.lines = self.function.lines, outer
        return value, lines

    def in_order(self, nodes: Sequence[ast.expr], frame: Frame, *before: Any) -> list[Any]:
        """Return values, and what expressions are, each as it is before the next one is computed."""
        values = list(before)
        for node in nodes:
            value, lines = self.apart(node, frame)
            if change_arrays(lines):
                values = [self.stable(item, "value") if _reads_arrays(item) else item for item in values]
            self.function.lines += lines
            values.append(value)
        return values

    def _value_tuple(self, node: ast.Tuple, frame: Frame) -> Any:
        return tuple(self.in_order(node.elts, frame))

    def _value_list(self, node: ast.List, frame: Frame) -> Any:
        return self.in_order(node.elts, frame)

    def _value_binop(self, node: ast.BinOp, frame: Frame) -> Any:
        if type(node.op) not in OPERATORS:
            raise TranslationError(f"operator {type(node.op).__name__}")
        return self._combined(OPERATORS[type(node.op)], *self.in_order([node.left, node.right], frame))

    def _combined(self, combine: Callable[[Any, Any], Any], left: Any, right: Any) -> Any:
        for item in (left, right):
            if isinstance(item, Array | np.ndarray | list):
                raise TranslationError("arithmetic of whole arrays")
        if isinstance(left, Three) and is_scalar(right):
            right = self.stable(right, "factor")
        if isinstance(right, Three) and is_scalar(left):
            left = self.stable(left, "factor")
        return self.whole(combine(left, right))

    def _value_unaryop(self, node: ast.UnaryOp, frame: Frame) -> Any:
        item = self.value(node.operand, frame)
        if isinstance(node.op, ast.Not):
            return item.opposite() if isinstance(item, Expression) else not condition_of(item)
        if not is_scalar(item):
            raise TranslationError(f"the negative of a {type(item).__name__}; write it by its components")
        if isinstance(node.op, ast.Invert):
            raise TranslationError("`~` is not translated; write `not` before a condition")
        return self.whole(-item) if isinstance(node.op, ast.USub) else +item

    def _value_boolop(self, node: ast.BoolOp, frame: Frame) -> Any:
        is_and = isinstance(node.op, ast.And)
        result: Any = None
        for part in node.values:
            item, lines = self.apart(part, frame)
            if result is not None and change_arrays(lines):
                either = ((item, lines), (False, [])) if is_and else ((True, []), (item, lines))
                result = self.either(result, *either)
                if isinstance(result, Expression):
                    continue
                return result
            self.function.lines += lines
            if result is not None or isinstance(item, Expression):
                condition_of(item)
            if not isinstance(item, Expression):
                if bool(item) != is_and:  # decides, but for what was to be computed before
                    return item if result is None else self._both(result, not is_and, is_and)
                if part is node.values[-1] and result is None:
                    return item
                continue
            result = item if result is None else self._both(result, item, is_and)
        return result

    @staticmethod
    def _both(left: Any, right: Any, is_and: bool) -> Any:
        return left & right if is_and else left | right

    def _value_compare(self, node: ast.Compare, frame: Frame) -> Any:
        if len(node.comparators) > 1 and any(map(_has_call, node.comparators[1:])):
            raise TranslationError("a chain of comparisons with calls; join two comparisons by `and`")
        left, *others = self.in_order([node.left, *node.comparators], frame)
        result = None
        for symbol, right in zip(node.ops, others, strict=True):
            if isinstance(symbol, ast.Is | ast.IsNot):
                if left is not None and right is not None:
                    raise TranslationError("`is` of anything but None; compare values by `==`")
                item: Any = (left is right) == isinstance(symbol, ast.Is)
            elif not (is_scalar(left) and is_scalar(right)) and not (is_known(left) and is_known(right)):
                raise TranslationError("a comparison of what are no numbers")
            else:
                if type(symbol) not in COMPARISONS:
                    raise TranslationError(f"comparison {type(symbol).__name__}")
                item = COMPARISONS[type(symbol)](left, right)
            if isinstance(item, Expression):
                item = self.function.known.get(item.text, item)
            result = item if result is None else self._both(result, item, True)
            left = right
        return result

    def _value_ifexp(self, node: ast.IfExp, frame: Frame) -> Any:
        condition = self.value(node.test, frame)
        if not isinstance(condition, Expression):
            return self.value(node.body if condition else node.orelse, frame)
        condition_of(condition)
        first, second = self.apart(node.body, frame), self.apart(node.orelse, frame)
        if change_arrays([*first[1], *second[1]]):
            return self.either(condition, first, second)
        self.function.lines += [*first[1], *second[1]]
        return self.chosen(condition, first[0], second[0])

    def chosen(self, condition: Expression, first: Any, second: Any) -> Any:
        """Return the first where a condition holds, else the second."""
        if isinstance(first, tuple):
            items = [self.chosen(condition, a, b) for a, b in zip(first, second, strict=True)]
            return type(first)(*items) if hasattr(first, "_fields") else tuple(items)
        if not (is_scalar(first) and is_scalar(second)):
            if first is second:
                return first
            raise TranslationError("a choice between what are no numbers")
        kind = merged_kind(first, second)
        span = union(range_of(first), range_of(second)) if kind == "int" else None
        text = f"({condition.text} ? {text_of(first, C_TYPES[kind])} : {text_of(second, C_TYPES[kind])})"
        return Expression(text, kind, range=span)

    def _value_subscript(self, node: ast.Subscript, frame: Frame) -> Any:
        owner, key = self.value(node.value, frame), self._key(node.slice, frame)
        if isinstance(owner, Three) and isinstance(key, Expression):
            x, y, z = self.stable(owner, "component")
            return self.chosen(key == 0, x, self.chosen(key == 1, y, z))
        return self.element(owner, key)

    def _key(self, node: ast.expr, frame: Frame) -> Any:
        if not isinstance(node, ast.Slice):
            return self.value(node, frame)
        if node.upper is not None or node.step is not None:
            raise TranslationError("a slice with an end")
        return slice(self.value(node.lower, frame) if node.lower else 0, None)

    def _value_call(self, node: ast.Call, frame: Frame) -> Any:
        function = self.value(node.func, frame)
        names = [item.arg for item in node.keywords if item.arg]
        if len(names) != len(node.keywords):
            raise TranslationError("arguments by **")
        arguments = self.in_order([*node.args, *(item.value for item in node.keywords)], frame)
        named = dict(zip(names, arguments[len(node.args) :], strict=True))
        arguments = arguments[: len(node.args)]
        with self.located(frame, node):
            return self.call(function, arguments, named)

    def call(self, function: Any, arguments: list[Any], named: dict[str, Any]) -> Any:
        """Return what a call does: by what writes it down, by translating it, or by computing it."""
        function = self.setting.instead.get(function, function) if callable(function) else function
        try:
            write = self.setting.operations.get(function)
        except TypeError:
            write = None
        if write is not None:
            return write(self, *arguments, **named)
        if isinstance(function, Compiled):
            return self.invoked(function, arguments, named)
        if isinstance(function, type) and issubclass(function, tuple) and hasattr(function, "_fields"):
            return function(*arguments, **named)
        raise TranslationError(
            f"a call of {getattr(function, '__name__', function)}, which is neither compiled nor among the "
            "operations that are written in C; call what is, or pass its result as an argument"
        )
