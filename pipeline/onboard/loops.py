"""Loops of Python as loops of C, each with a constant bound; short ones are written out."""

import ast
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from pipeline.onboard import statements
from pipeline.onboard.expressions import Expressions
from pipeline.onboard.values import Array, Expression, TranslationError, Transpose, range_of, text_of
from pipeline.onboard.writer import MOST_UNROLLED, Frame, Loop

UNBOUNDED = "a loop without a constant bound; declare one for"


class Loops(Expressions, ABC):
    """Writes loops."""

    @abstractmethod
    def block(self, body: Sequence[ast.stmt], frame: Frame) -> Any:
        """Write statements; return what they return."""

    @abstractmethod
    def bind(self, target: ast.expr, value: Any, frame: Frame) -> None:
        """Bind names, or write into arrays."""

    def fill(self, array: Any, key: ast.expr, value: Any, frame: Frame) -> None:
        """Write a number into a slice of an array, which begins at its start; rows of it are filled whole."""
        leading, last = (key.elts[:-1], key.elts[-1]) if isinstance(key, ast.Tuple) else ([], key)
        if leading:
            array = array.at(tuple(self.value(index, frame) for index in leading))
        end = self._end_of(array, last, frame)
        index = self._counted("element", end, array.shape[0])
        part = array.at(index)
        if part.is_element:
            self.put(array, index, value)
        else:
            for column in range(part.shape[0]):
                self.put(part, column, value)
        self.function.depth -= 1
        self.emit("}")

    def _end_of(self, array: Any, key: ast.expr, frame: Frame) -> Any:
        """Return where a slice from the start of an array on ends."""
        if not (isinstance(array, Array) and isinstance(key, ast.Slice)) or key.lower or key.step:
            raise TranslationError("a slice that is none from the start of an array on")
        return self.stable(self.value(key.upper, frame), "end") if key.upper else array.shape[0]

    def _counted(self, name: str, end: Any, most: int, first: int = 0) -> Expression:
        """Begin a loop over the first elements of an array, and return what counts them."""
        counter = self.fresh(name)
        condition = f"{counter} < {text_of(end, 'int')}"
        if isinstance(end, Expression):
            condition = f"({counter} < {most}) && ({condition})"
        self.loops.append(Loop(self.function.name, counter, most - first, *self._line))
        self.emit(f"for (int {counter} = {first}; {condition}; ++{counter}) {{")
        self.function.depth += 1
        return Expression(counter, "int", True, (first, most - 1))

    def _value_call(self, node: ast.Call, frame: Frame) -> Any:
        function = node.func
        if (
            isinstance(function, ast.Attribute)
            and function.attr in ("max", "argmax")
            and isinstance(function.value, ast.Subscript)
            and isinstance(function.value.slice, ast.Slice)
        ):
            array = self.value(function.value.value, frame)
            greatest = self._greatest(array, self._end_of(array, function.value.slice, frame))
            return greatest[function.attr == "argmax"]
        return super()._value_call(node, frame)

    def _greatest(self, array: Any, end: Any) -> tuple[Expression, Expression]:
        """Return the greatest of the first elements of an array, and the first index where it stands."""
        length = array.shape[0]
        greatest, index = self.fresh("greatest"), self.fresh("greatest_index")
        self.emit(f"double {greatest} = {text_of(self.element(array, 0), 'double')};")
        self.emit(f"int {index} = 0;")
        counter = self._counted("element", end, length, 1)
        element = text_of(self.element(array, counter), "double")
        self.emit(f"if ({element} > {greatest}) {{")
        self.emit(f"    {greatest} = {element};")
        self.emit(f"    {index} = {counter.text};")
        self.emit("}")
        self.function.depth -= 1
        self.emit("}")
        return Expression(greatest), Expression(index, "int", range=(0, length - 1))

    def _value_attribute(self, node: ast.Attribute, frame: Frame) -> Any:
        if node.attr == "T" and isinstance(owner := self.value(node.value, frame), Array):
            return Transpose(owner)
        return super()._value_attribute(node, frame)

    def _write_for(self, statement: ast.For, frame: Frame) -> None:
        if statement.orelse:
            raise TranslationError("else of a loop")
        body = statements.without_jumps(statement.body, ast.Continue)
        if not (isinstance(statement.iter, ast.Call) and getattr(statement.iter.func, "id", "") == "range"):
            items = self.value(statement.iter, frame)
            if isinstance(items, Array):
                items = [self.element(items, index) for index in range(items.shape[0])]
            if statements.has_break(body):
                raise TranslationError("break in a loop that is written out")
            for item in items:
                self.bind(statement.target, item, frame)
                self._body(body, frame)
            return
        if not isinstance(statement.target, ast.Name):
            raise TranslationError("a range of several names")
        first, end, step, is_lanes = self._range(statement.iter.args, frame)
        name = statement.target.id
        is_known_range = not any(isinstance(item, Expression) for item in (first, end, step))
        count = len(range(first, end, step)) if is_known_range else None
        is_short = count is not None and (
            count <= MOST_UNROLLED or (frame.source.name, name) in self.setting.unrolled
        )
        if is_short and not is_lanes and not statements.has_break(body):
            for number in range(first, end, step):
                frame.names[name] = number
                frame.variables.pop(name, None)
                self._body(body, frame)
            return
        self._loop(statement, body, frame, (first, end, step), is_lanes)

    def _range(self, bounds: list[ast.expr], frame: Frame) -> tuple[Any, Any, Any, bool]:
        items = [self.value(item, frame) for item in bounds]
        first, end, step = (0, items[0], 1) if len(items) == 1 else (*items, 1)[:3]
        last = bounds[-1]
        is_lanes = len(items) == 3 and isinstance(last, ast.Name) and last.id == "POINTS"
        return first, end, 1 if is_lanes else step, is_lanes

    def _loop(
        self,
        statement: ast.For,
        body: list[ast.stmt],
        frame: Frame,
        bounds: tuple[Any, Any, Any],
        is_lanes: bool,
    ) -> None:
        name = getattr(statement.target, "id", "")
        first, end, step = (self.stable(item, "end") for item in bounds)
        if isinstance(step, Expression) or step == 0:
            raise TranslationError("a step that is not known")
        for other in sorted((statements.assigned_names(body) - {name}) & frame.names.keys()):
            self.make_variable(frame, other)
        counter = self.fresh("i" if name == "_" else name)
        least, most = range_of(first), range_of(end)
        declared = self.setting.bounds.get((frame.source.name, name))
        condition = f"{counter} {'<' if step > 0 else '>'} {text_of(end, 'int')}"
        if step < 0 and (isinstance(first, Expression) or isinstance(end, Expression)):
            raise TranslationError("a loop downwards that is not known")
        if declared is not None and isinstance(end, Expression):
            most = (0, min([declared(frame.names), *(most or ())[1:]]))
        if isinstance(end, Expression) and most is not None:
            condition = f"({counter} < {most[1]}) && ({condition})"
        if least is None or most is None:
            raise TranslationError(f"{UNBOUNDED} ({frame.source.name}, {name})")
        span = (least[0], max(most[1] - 1, least[0])) if step > 0 else (most[0] + 1, least[1])
        runs = len(range(least[0], most[1], step)) if step > 0 else len(range(least[1], most[0], step))
        self.loops.append(Loop(self.function.name, counter, runs, *self._line))
        change = f"++{counter}" if step == 1 else f"{counter} += {text_of(step, 'int')}"
        self.emit(f"for (int {counter} = {text_of(first, 'int')}; {condition}; {change}) {{")
        lane, outer = self.function.lane, self.function.runs
        self.function.runs = outer * runs
        if is_lanes:
            self.function.lane, self.function.lanes = counter, runs
        self._nested(body, frame, {name: Expression(counter, "int", True, span)})
        self.function.lane, self.function.runs = lane, outer

    def _nested(self, body: list[ast.stmt], frame: Frame, names: dict[str, Any]) -> None:
        inner = replace(frame, names=frame.names | names, variables=dict(frame.variables))
        for name in names:
            inner.variables.pop(name, None)
        self.function.depth += 1
        self._body(body, inner)
        self.function.depth -= 1
        self.emit("}")

    def _body(self, body: list[ast.stmt], frame: Frame) -> None:
        if self.block(body, frame) is not None:
            raise TranslationError("return in a loop")

    def _write_while(self, statement: ast.While, frame: Frame) -> None:
        body = statements.without_jumps(statement.body, ast.Continue)
        counts = statements.counted_by(body)
        first = range_of(frame.names.get(counts)) if counts not in frame.variables else None
        for name in sorted(statements.assigned_names(body) & frame.names.keys()):
            self.make_variable(frame, name)
        declared = self.setting.bounds.get((frame.source.name, "while"))
        if declared is None:
            raise TranslationError(f"{UNBOUNDED} ({frame.source.name}, while)")
        limit, turn = declared(frame.names), self.fresh("turn")
        self.loops.append(Loop(self.function.name, turn, limit, *self._line))
        self.emit(f"for (int {turn} = 0; {turn} < {limit}; ++{turn}) {{")
        goes_on = ast.copy_location(ast.UnaryOp(ast.Not(), statement.test), statement.test)
        leaves = ast.copy_location(ast.If(goes_on, [ast.Break()], []), statement.test)
        if first is not None:
            self._narrow(frame, counts, (first[0], first[1] + limit - 1))
        self._nested([ast.fix_missing_locations(leaves), *body], frame, {})
        if first is not None:
            self._narrow(frame, counts, (first[0], first[1] + limit))

    @staticmethod
    def _narrow(frame: Frame, name: str, span: tuple[int, int]) -> None:
        """Note between which whole numbers a variable lies from here on."""
        frame.names[name] = frame.variables[name] = replace(frame.variables[name], range=span)
