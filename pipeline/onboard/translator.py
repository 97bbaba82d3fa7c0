"""Compiled functions of the flight as C99, by partial evaluation.

A function is walked with its arguments. What is known, such as the mission and the controller's law, is
computed; a branch on it is taken or left out. What is known only on board is an `Expression`, and what is
done with it is written down. So the C has the operations of the flight in the same order, and the same bits.
Functions that numba inlines are written where they are called, others become functions of C.

Every kind of statement and of operation that is not handled is refused, with file and line.
"""

import ast
import inspect
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from fis_tools.compiled.vectors import Three
from pipeline.onboard import statements
from pipeline.onboard.expressions import OPERATORS, Computed
from pipeline.onboard.loops import Loops
from pipeline.onboard.values import (
    C_TYPES,
    Accumulator,
    Array,
    Expression,
    LaneConstant,
    TranslationError,
    bare,
    conclusions,
    count_of,
    is_known,
    is_scalar,
    kind_of,
    leaves,
    map_leaves,
    range_of,
    text_of,
)
from pipeline.onboard.writer import PROJECT, Frame, Function, FunctionSource, Line, pruned


class Translator(Loops):
    """Writes functions of C by walking those of Python."""

    def source(self, function: Any) -> FunctionSource:
        """Return the text of a compiled function."""
        if function not in self.sources:
            python = function.py_func
            lines, first = inspect.getsourcelines(python)
            (node,) = ast.parse(textwrap.dedent("".join(lines))).body
            if not isinstance(node, ast.FunctionDef):
                raise TranslationError(f"{python.__name__} is no plain function")
            body = node.body[1:] if ast.get_docstring(node) is not None else node.body
            file = Path(inspect.getsourcefile(python) or "").resolve().relative_to(PROJECT).as_posix()
            summary = (inspect.getdoc(python) or "").partition("\n\n")[0]
            self.sources[function] = FunctionSource(
                file, first, python.__name__, summary, tuple(statements.without_jumps(body, ast.Return))
            )
        return self.sources[function]

    def invoked(self, function: Any, arguments: list[Any], named: dict[str, Any]) -> Any:
        """Return what a compiled function returns; write it in place, or as a function of C."""
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
            try:
                return self._called(name, function, names)
            except NoResultError:
                del self.functions[kept[0] :], self.loops[kept[3] :]
                self.members, self.tables = kept[1], kept[2]
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
        parameters: list[str] = []
        given: list[str] = []

        def parameter(leaf: Any, leaf_name: str) -> Any:
            if isinstance(leaf, Array):
                indices = (parameter(index, f"{leaf_name}_index") for index in leaf.indices)
                return replace(leaf, indices=tuple(indices), first=parameter(leaf.first, leaf_name))
            if not isinstance(leaf, Expression):
                return leaf
            variable = self.fresh(leaf_name)
            parameters.append(f"{C_TYPES[leaf.kind]} {variable}")
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
        text = ", ".join(["struct controller *state", *parameters])
        written.signature = f"{c_type} {name}({text})"
        written.lines = pruned(written.lines)
        self.functions.append(written)
        if outer is None:
            return None
        call = f"{name}({', '.join(['state', *given])})"
        if c_type == "void":
            self.emit(f"{call};")
            return result
        variable = self.fresh(f"{name}_result" if isinstance(result, Three) else name + "_value")
        self.emit(f"const {c_type} {variable} = {call};")
        if isinstance(result, Three):
            return Three(*(Expression(f"{variable}.{axis}", is_name=True) for axis in "xyz"))  # type: ignore[arg-type]
        return Expression(variable, kind_of(result), True, range_of(result))

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
            self.put(self.value(target.value, frame), self._key(target.slice, frame), value)
        else:
            raise TranslationError(f"{type(target).__name__} as a target")

    def _write_augassign(self, statement: ast.AugAssign, frame: Frame) -> None:
        target = statement.target
        if isinstance(target, ast.Name):
            before = self.value(ast.Name(target.id, ast.Load()), frame)
        elif isinstance(target, ast.Subscript):
            before = self.value(ast.Subscript(target.value, target.slice, ast.Load()), frame)
        else:
            raise TranslationError(f"{type(target).__name__} as a target")
        before, change = self.in_order([statement.value], frame, before)
        if isinstance(statement.op, ast.Add) and is_scalar(change) and kind_of(change) == "bool":
            change = count_of(change, self.function.runs)
        if isinstance(change, Expression) and change.mask:
            self._count(statement, target, before, change, frame)
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
        if not isinstance(statement.op, ast.Add) or not isinstance(target, ast.Name) or change.range is None:
            raise TranslationError("a count that is no sum")
        bound = f"{before.text} < {change.range[1]}"
        self.emit(f"if ({bound}) {{" if change.mask == "true" else f"if ({change.mask} && ({bound})) {{")
        self.function.depth += 1
        self.emit(f"{before.text} += 1;")
        self.function.depth -= 1
        self.emit("}")

    def _write_if(self, statement: ast.If, frame: Frame) -> Any:
        condition = self.value(statement.test, frame)
        if not isinstance(condition, Expression):
            return self.block(statement.body if condition else statement.orelse, frame)
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
            self.emit(f"if ({bare((~condition).text)}) {{")
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
        kinds = {kind_of(first), kind_of(second)}
        kind = kinds.pop() if len(kinds) == 1 else "double"
        span = None
        if kind == "int" and (a := range_of(first)) and (b := range_of(second)):
            span = (min(a[0], b[0]), max(a[1], b[1]))
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
        return first.name == second.name and not first.indices and not second.indices
    return type(first) is type(second) and is_scalar(first) and bool(first == second)
