"""Compiled functions of the flight as C99, by partial evaluation.

A function is walked with its arguments. What is known, such as the mission and the controller's law, is
computed; a branch on it is taken or left out. What is known only on board is an `Expression`, and what is
done with it is written down. So the C has the operations of the flight in the same order, and the same bits.
Functions that numba inlines are written where they are called, others become functions of C.

Every kind of statement and of operation that is not handled is refused, with file and line.
"""

import ast
import inspect
import math
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from fis_tools.compiled.vectors import Three
from pipeline.onboard import statements
from pipeline.onboard.allowed import C_TYPES, TranslationError, union
from pipeline.onboard.arrays import Accumulator, Array, is_known, leaves, map_leaves
from pipeline.onboard.expressions import OPERATORS, Computed
from pipeline.onboard.functions import Frame, Function, FunctionSource, Line, change_arrays, pruned
from pipeline.onboard.loops import Loops
from pipeline.onboard.values import (
    Expression,
    LaneConstant,
    bare,
    conclusions,
    condition_of,
    count_of,
    is_scalar,
    kind_of,
    merged_kind,
    range_of,
    text_of,
)
from pipeline.onboard.writer import PROJECT, in_either


class Translator(Loops):
    """Writes functions of C by walking those of Python."""

    def source(self, function: Any) -> FunctionSource:
        """Return the text of a compiled function."""
        if function not in self.sources:
            python = function.py_func
            if python.__code__.co_freevars:
                raise TranslationError(
                    f"{python.__name__} reads {', '.join(python.__code__.co_freevars)} of the function "
                    "around it; pass it as an argument"
                )
            lines, first = inspect.getsourcelines(python)
            (node,) = ast.parse(textwrap.dedent("".join(lines))).body
            if not isinstance(node, ast.FunctionDef):
                raise TranslationError(f"{python.__name__} is no plain function")
            body = node.body[1:] if ast.get_docstring(node) is not None else node.body
            path = Path(inspect.getsourcefile(python) or "").resolve()
            file = (path.relative_to(PROJECT) if path.is_relative_to(PROJECT) else path).as_posix()
            summary = (inspect.getdoc(python) or "").partition("\n\n")[0]
            self.sources[function] = FunctionSource(
                *(file, first, python.__name__, summary),
                tuple(statements.without_jumps(body, ast.Return)),
                frozenset(python.__code__.co_varnames),
            )
        return self.sources[function]

    def invoked(self, function: Any, arguments: list[Any], named: dict[str, Any]) -> Any:
        """Return what a compiled function returns; write it in place, or as a function of C."""
        if function in self._open:
            raise TranslationError(f"{function.__name__} calls itself; write a loop with a constant bound")
        self._open.append(function)
        try:
            return self._invoked(function, arguments, named)
        finally:
            self._open.pop()

    def _invoked(self, function: Any, arguments: list[Any], named: dict[str, Any]) -> Any:
        bound = inspect.signature(function.py_func).bind(*arguments, **named)
        bound.apply_defaults()
        names = dict(bound.arguments)
        is_inline = bool({"forceinline", "inline"} & function.targetoptions.keys())
        is_local = any(
            isinstance(leaf, Accumulator)
            or (isinstance(leaf, Array) and leaf.data is None and not leaf.name.startswith("state->"))
            for leaf in leaves(tuple(names.values()))
        )
        if not (is_inline or is_local or function in self._inlined or self.function.lane):
            plain = function.__name__.lstrip("_")
            name, count = plain, 2
            while name in self._names:
                name, count = f"{plain}_{count}", count + 1
            kept = len(self.functions), dict(self.members), dict(self.tables), len(self.loops)
            obligations = dict(self.obligations)
            try:
                return self._called(name, function, names)
            except NoResultError:
                del self.functions[kept[0] :], self.loops[kept[3] :]
                self.members, self.tables, self.obligations = kept[1], kept[2], obligations
                self._inlined.add(function)
        source = self.source(function)
        frame = Frame(
            {name: self.stable(value, name) for name, value in names.items()},
            function.py_func.__globals__,
            source,
        )
        return self._read(self.block(source.body, frame))

    def write(
        self, name: str, function: Any, arguments: dict[str, Any], operations: Mapping[Any, Any] | None = None
    ) -> None:
        """Write an entry, a function that is called from outside, with some operations of its own."""
        usual = self.setting
        self.setting = replace(usual, operations={**usual.operations, **(operations or {})})
        self._called(name, function, arguments)
        self.setting = usual

    def _called(self, name: str, function: Any, arguments: dict[str, Any]) -> Any:
        """Write a function of C, and return the call of it; nothing is written that does nothing."""
        outer, source = self._function, self.source(function)
        self._function = Function(name, source)
        self._names.add(name)
        parameters, given = self.function.parameters, list[str]()

        def parameter(leaf: Any, leaf_name: str) -> Any:
            if isinstance(leaf, Array):
                indices = (parameter(index, f"{leaf_name}_index") for index in leaf.indices)
                return replace(leaf, indices=tuple(indices), first=parameter(leaf.first, leaf_name))
            if not isinstance(leaf, Expression):
                return leaf
            variable = self.fresh(leaf_name)
            parameters[variable] = C_TYPES[leaf.kind], leaf.range
            given.append(bare(leaf.text))
            return Expression(variable, leaf.kind, True, leaf.range)

        try:
            names = {key: map_leaves(item, parameter, key) for key, item in arguments.items()}
            result = self.block(source.body, Frame(names, function.py_func.__globals__, source))
            written = self._function
            if not written.lines and is_known(result):
                self._names.discard(name)
                return result
            c_type = self._returned(result)
        finally:
            self._function = outer
        numbers = (f"{kind} {variable}" for variable, (kind, _) in parameters.items())
        text = ", ".join(["struct controller *state", *numbers])
        written.signature = f"{c_type} {name}({text})"
        written.lines = pruned(written.lines)
        if outer is None:
            self.functions.append(written)
            return None
        if (same := next(filter(written.is_as, self.functions), None)) is None:
            self.functions.append(written)
        else:
            self._forget(written, same)
            name = same.name
        call = f"{name}({', '.join(['state', *given])})"
        if c_type == "void":
            self.emit(f"{call};")
            return result
        variable = self.fresh(f"{name}_result" if isinstance(result, Three) else name + "_value")
        self.emit(f"const {c_type} {variable} = {call};")
        if isinstance(result, Three):
            return Three(*(Expression(f"{variable}.{axis}", is_name=True) for axis in "xyz"))  # type: ignore[arg-type]
        return Expression(variable, kind_of(result), True, range_of(result))

    def _forget(self, written: Function, same: Function) -> None:
        """Forget a function that was written as another one was; that stands for both, with both's ranges."""
        self._names.discard(written.name)
        for variable, (kind, span) in same.parameters.items():
            same.parameters[variable] = kind, union(span, written.parameters[variable][1])
        for each in [each for each in self.obligations if each.function == written.name]:
            del self.obligations[each]
            self.obligations[replace(each, function=same.name)] = None
        self.loops = [each for each in self.loops if each.function != written.name]

    def _returned(self, result: Any) -> str:
        """Write the return of a function, and return its type."""
        if result is None:
            return "void"
        if isinstance(result, Three):
            items = ", ".join(bare(text_of(item, "double")) for item in result)
            variable = self.fresh("returned")
            self.emit(f"const struct three {variable} = {{{items}}};")
            self.emit(f"return {variable};")
            return "struct three"
        if not is_scalar(result) or kind_of(result) == "lane":
            raise NoResultError
        c_type = C_TYPES[kind_of(result)]
        self.emit(f"return {bare(text_of(result, c_type))};")
        return c_type

    def block(self, body: Sequence[ast.stmt], frame: Frame) -> Any:
        """Write statements; return what they return."""
        for statement in body:
            write = getattr(self, f"_write_{type(statement).__name__.lower()}", None)
            with self.located(frame, statement):
                if write is None:
                    raise TranslationError(f"{type(statement).__name__} is not translated")
                result = write(statement, frame)
            if result is not None:
                return result
        return None

    def _write_pass(self, _: ast.Pass, __: Frame) -> None:
        """Write nothing."""

    def _write_break(self, _: ast.Break, __: Frame) -> None:
        self.emit("break;")

    def _write_return(self, statement: ast.Return, frame: Frame) -> Any:
        if statement.value is None:
            raise TranslationError("a return without a value inside a branch")
        return self.value(statement.value, frame)

    def _write_expr(self, statement: ast.Expr, frame: Frame) -> None:
        self.value(statement.value, frame)

    def _write_annassign(self, statement: ast.AnnAssign, frame: Frame) -> None:
        if statement.value is not None:
            self.bind(statement.target, self.value(statement.value, frame), frame)

    def _write_assign(self, statement: ast.Assign, frame: Frame) -> None:
        value = self.value(statement.value, frame)
        if len(statement.targets) > 1:  # it is computed before one is written
            value = self.stable(value, "value")
        for target in statement.targets:
            self.bind(target, value, frame)

    def bind(self, target: ast.expr, value: Any, frame: Frame) -> None:
        """Bind names, or write into arrays."""
        if isinstance(target, ast.Name):
            self.assign(frame, target.id, value)
        elif isinstance(target, ast.Tuple):
            if isinstance(value, Array):
                value = [self.element(value, index) for index in range(value.shape[0])]
            items = list(value)
            if any(
                not isinstance(part, ast.Name) or part.id in frame.variables for part in target.elts
            ):  # all are read before one is written
                items = [
                    self.stable(item, part.id if isinstance(part, ast.Name) else "value")
                    for item, part in zip(items, target.elts, strict=True)
                ]
            for part, item in zip(target.elts, items, strict=True):
                self.bind(part, item, frame)
        elif isinstance(target, ast.Subscript) and _ends_in_slice(target.slice):
            self.fill(self.value(target.value, frame), target.slice, value, frame)
        elif isinstance(target, ast.Subscript):
            (owner, key), lines = self._element_of(target, frame)
            if change_arrays(lines):  # by a call in the index, which Python makes after the value
                value = self.stable(value, "value")
            self.function.lines += lines
            self.put(owner, key, value)
        else:
            raise TranslationError(f"{type(target).__name__} as a target")

    def _element_of(self, target: ast.Subscript, frame: Frame) -> tuple[tuple[Any, Any], list[Line]]:
        """Return an array and an index, and the lines that compute them, which are not written yet."""
        outer, self.function.lines = self.function.lines, []
        parts = self.value(target.value, frame), self._key(target.slice, frame)
        lines, self.function.lines = self.function.lines, outer
        return parts, lines

    def _write_augassign(self, statement: ast.AugAssign, frame: Frame) -> None:
        target, owner, key = statement.target, None, None
        if isinstance(target, ast.Name):
            before = self.value(ast.Name(target.id, ast.Load()), frame)
        elif isinstance(target, ast.Subscript) and not _ends_in_slice(target.slice):
            (owner, key), lines = self._element_of(target, frame)
            self.function.lines += lines
            before = self.element(owner, key)
        else:
            raise TranslationError(f"{type(target).__name__} as a target")
        if type(statement.op) not in OPERATORS:
            raise TranslationError(f"operator {type(statement.op).__name__}")
        owner, key, before, change = self.in_order([statement.value], frame, owner, key, before)
        if isinstance(statement.op, ast.Add) and is_scalar(change) and kind_of(change) == "bool":
            change = count_of(change, self.function.runs)
        if isinstance(change, Expression) and change.mask:
            self._count(statement, target, before, change, frame)
            return
        if isinstance(target, ast.Subscript):
            change = float(change) if isinstance(change, LaneConstant) else change
            self.put(owner, key, self._combined(OPERATORS[type(statement.op)], before, change))
            return
        most = self.setting.bounds.get((frame.source.name, getattr(target, "id", "")))
        if most is not None:
            self.emit(f"if ({before.text} < {most(frame.names)}) {{")
            self.function.depth += 1
        if isinstance(change, LaneConstant):
            change = float(change)
        self.bind(target, self._combined(OPERATORS[type(statement.op)], before, change), frame)
        if most is not None:
            self.function.depth -= 1
            self.emit("}")

    def _count(
        self, statement: ast.AugAssign, target: ast.expr, before: Any, change: Expression, frame: Frame
    ) -> None:
        """Write a count of points that goes up by one where a mask holds, and never beyond their number."""
        if (
            not isinstance(statement.op, ast.Add)
            or not isinstance(target, ast.Name)
            or change.range is None
            or target.id not in frame.variables
            or kind_of(before) != "int"
        ):
            raise TranslationError("a count that is no sum; begin with 0, and add conditions in a loop")
        span = range_of(before)
        self.whole(before)
        bound = f"{before.text} < {max(change.range[1], (span or (0, 0))[1] + 1)}"
        self.emit(f"if ({bound}) {{" if change.mask == "true" else f"if ({change.mask} && ({bound})) {{")
        self.function.depth += 1
        self.emit(f"{before.text} += 1;")
        self.function.depth -= 1
        self.emit("}")
        counted = None if span is None else (span[0], span[1] + 1)
        frame.names[target.id] = replace(frame.variables[target.id], range=counted)

    def _write_if(self, statement: ast.If, frame: Frame) -> Any:
        condition = self.value(statement.test, frame)
        if not isinstance(condition, Expression):
            return self.block(statement.body if condition else statement.orelse, frame)
        condition_of(condition)
        bound = statements.assigned_names([*statement.body, *statement.orelse])
        for name in sorted(bound & frame.names.keys()):
            self.make_variable(frame, name)
        outer = self.function.lines
        branches, known = [], self.function.known
        for body, holds in ((statement.body, True), (statement.orelse, False)):
            self.function.lines, self.function.depth = [], self.function.depth + 1
            self.function.known = {**known, **conclusions(condition, holds=holds)}
            inner = replace(frame, names=dict(frame.names), variables=dict(frame.variables))
            result = self.block(body, inner)
            branches.append((self.function.lines, inner, result))
            self.function.known, self.function.depth = known, self.function.depth - 1
        (first, names, result), (second, other_names, other_result) = branches
        if result is None:
            self.check_unchanged(bound, frame, names, other_names)
            for name in sorted(bound & frame.variables.keys()):
                frame.names[name] = in_either(names.names[name], other_names.names[name])
        declarations: list[Line] = []
        self.function.lines = declarations
        merged = None
        if (result is None) != (other_result is None):
            raise TranslationError("a branch returns, and the other goes on")
        if result is not None:
            merged = self._merged(result, other_result, "result", first, second)
        for name in sorted(names.names.keys() & other_names.names.keys() - frame.names.keys()):
            try:
                frame.names[name] = self._merged(
                    names.names[name], other_names.names[name], name, first, second
                )
            except TranslationError:  # then no name is bound after the branches, and its use is refused
                continue
        self.function.lines = outer
        outer += declarations
        self._branched(condition, first, second)
        return merged

    def either(self, condition: Expression, taken: Computed, otherwise: Computed) -> Any:
        """Return one value where a condition holds, else the other; only that one is computed."""
        (first, lines), (second, others) = taken, otherwise
        branches = [[replace(line, text=f"    {line.text}") for line in each] for each in (lines, others)]
        merged = self._merged(first, second, "either", *branches)
        self._branched(condition, *branches)
        return merged

    def _branched(self, condition: Expression, first: list[Line], second: list[Line]) -> None:
        """Write two branches, of which either may be empty."""
        if first:
            self.emit(f"if ({bare(condition.text)}) {{")
            self.function.lines += first
            if second:
                self.emit("} else {")
                self.function.lines += second
            self.emit("}")
        elif second:
            self.emit(f"if ({bare(condition.opposite().text)}) {{")
            self.function.lines += second
            self.emit("}")

    def _merged(self, first: Any, second: Any, name: str, lines: list[Line], others: list[Line]) -> Any:
        """Return what is either value, by which branch was taken; the branches write it into variables."""
        if isinstance(first, tuple) and isinstance(second, tuple):
            parts = getattr(first, "_fields", range(len(first)))
            items = [
                self._merged(a, b, f"{name}_{part}", lines, others)
                for a, b, part in zip(first, second, parts, strict=True)
            ]
            return type(first)(*items) if hasattr(first, "_fields") else tuple(items)
        if first is second or _is_same(first, second):
            return first
        if not (is_scalar(first) and is_scalar(second)):
            raise TranslationError("branches that differ in what are no numbers")
        kind = merged_kind(first, second)
        span = union(range_of(first), range_of(second)) if kind == "int" else None
        variable = self.fresh(name)
        self.emit(f"{C_TYPES[kind]} {variable};")
        kept = self.function.lines
        self.function.depth += 1
        for branch, value in ((lines, first), (others, second)):
            self.function.lines = branch
            self.emit(f"{variable} = {bare(text_of(value, C_TYPES[kind]))};")
        self.function.lines, self.function.depth = kept, self.function.depth - 1
        return Expression(variable, kind, True, span)


class NoResultError(Exception):
    """What a function returns is more than a number or three: it is written where it is called."""


def _ends_in_slice(key: ast.expr) -> bool:
    return isinstance(key.elts[-1] if isinstance(key, ast.Tuple) else key, ast.Slice)


def _is_same(first: Any, second: Any) -> bool:
    if isinstance(first, Expression) or isinstance(second, Expression):
        return (
            isinstance(first, Expression)
            and isinstance(second, Expression)
            and first.is_name
            and first.text == second.text
        )
    if isinstance(first, Array) and isinstance(second, Array):
        is_whole = not first.indices and not second.indices and type(first.first) is type(second.first) is int
        return first.name == second.name and is_whole and first.first == second.first
    if not (type(first) is type(second) and is_scalar(first) and bool(first == second)):
        return False
    return not isinstance(first, float) or math.copysign(1.0, first) == math.copysign(1.0, second)
