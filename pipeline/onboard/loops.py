"""Loops of Python as loops of C, each with a constant bound; short ones are written out."""

import ast
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from pipeline.onboard import statements
from pipeline.onboard.allowed import Range, TranslationError, checked_range
from pipeline.onboard.arrays import Array, Transpose
from pipeline.onboard.expressions import Expressions
from pipeline.onboard.functions import Frame, Loop
from pipeline.onboard.growth import growth
from pipeline.onboard.values import Expression, range_of, text_of
from pipeline.onboard.writer import MOST_UNROLLED

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
        end, value = self._end_of(array, last, frame), self.stable(value, "value")
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
        end = self.stable(self.value(key.upper, frame), "end") if key.upper else array.shape[0]
        span = range_of(end)
        if span is None or span[0] < 0 or span[1] > array.shape[0]:
            self.doubt(f"a slice of {array.name} might not end from 0 to {array.shape[0]}")
        if span is not None and span[0] < 0:
            raise TranslationError(f"a slice that ends at {span[0]}; count from the start of {array.name}")
        return end

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
        # as NumPy, where one is NaN: the first of them is the greatest
        self.emit(f"if (!({element} <= {greatest}) && ({greatest} == {greatest})) {{")
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
            else:
                items = self.stable(tuple(items), "item")  # all are computed before the first is taken
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
        if name in frame.names and name != "_":
            raise TranslationError(
                f"{name} counts a loop and was bound before, and Python keeps its last number; use another "
                "name"
            )
        if is_short and not is_lanes and not statements.has_break(body):
            for number in range(first, end, step):
                frame.names[name] = number
                frame.variables.pop(name, None)
                self._body(body, frame)
            frame.names.pop(name, None)  # C's counters end with their loops
            frame.variables.pop(name, None)
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
        changed = statements.assigned_names(body) - {name}
        grown = self._grown(changed, body, frame, runs)
        lane, outer = self.function.lane, self.function.runs
        self.function.runs = outer * runs
        if is_lanes:
            self.function.lane, self.function.lanes = counter, runs
        self._nested(body, frame, {name: Expression(counter, "int", True, span)})
        self._grow(frame, grown)
        self.function.lane, self.function.runs = lane, outer

    def _nested(self, body: list[ast.stmt], frame: Frame, names: dict[str, Any]) -> None:
        inner = replace(frame, names=frame.names | names, variables=dict(frame.variables))
        for name in names:
            inner.variables.pop(name, None)
        self.function.depth += 1
        self._body(body, inner)
        self.function.depth -= 1
        self.emit("}")
        self.check_unchanged(statements.assigned_names(body) - names.keys(), frame, inner)

    def _body(self, body: list[ast.stmt], frame: Frame) -> None:
        if self.block(body, frame) is not None:
            raise TranslationError("return in a loop")

    def _write_while(self, statement: ast.While, frame: Frame) -> None:
        if statement.orelse:
            raise TranslationError("else of a loop")
        body = statements.without_jumps(statement.body, ast.Continue)
        changed = statements.assigned_names(body)
        for name in sorted(changed & frame.names.keys()):
            self.make_variable(frame, name)
        declared = self.setting.bounds.get((frame.source.name, "while"))
        if declared is None:
            raise TranslationError(f"{UNBOUNDED} ({frame.source.name}, while)")
        limit, turn = declared(frame.names), self.fresh("turn")
        self.loops.append(Loop(self.function.name, turn, limit, *self._line))
        self.emit(f"for (int {turn} = 0; {turn} < {limit}; ++{turn}) {{")
        goes_on = ast.copy_location(ast.UnaryOp(ast.Not(), statement.test), statement.test)
        leaves = ast.copy_location(ast.If(goes_on, [ast.Break()], []), statement.test)
        grown = self._grown(changed, body, frame, limit)
        outer, self.function.runs = self.function.runs, self.function.runs * limit
        self._nested([ast.fix_missing_locations(leaves), *body], frame, {})
        self.function.runs = outer
        self._grow(frame, grown)

    def _grown(self, names: set[str], body: list[ast.stmt], frame: Frame, runs: int) -> dict[str, Range]:
        """Give whole numbers the ranges that they have in a loop; return those that they have after it."""
        after: dict[str, Range] = {}
        kept = {name: value for name, value in frame.names.items() if name not in names}
        known = replace(frame, names=kept)
        for name in sorted(names & frame.variables.keys()):
            value = frame.names[name]
            if not isinstance(value, Expression) or value.kind != "int":
                frame.names[name] = frame.variables[name]
                continue
            change = growth(
                body,
                name,
                lambda node: self._range_of_node(node, known),
                lambda loop: self._runs_of(loop, known),
            )
            before, inside, after[name] = value.range, None, None
            if before is not None and change is not None:
                after[name] = before[0] + runs * change[0], before[1] + runs * change[1]
                # downwards by one more: a test for the end stays in the C, where an analyser needs it
                inside = before[0] + runs * change[0], before[1] + max(runs - 1, 0) * change[1]
            frame.names[name] = replace(frame.variables[name], range=inside and checked_range(inside))
        return after

    def _grow(self, frame: Frame, ranges: dict[str, Range]) -> None:
        for name, span in ranges.items():
            frame.names[name] = replace(frame.variables[name], range=span and checked_range(span))

    def _range_of_node(self, node: ast.expr, frame: Frame) -> Range:
        """Return the range of what is added in a loop; None if it is not known before the loop."""
        if isinstance(node, ast.Compare | ast.BoolOp) or (
            isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not)
        ):
            return 0, 1
        simple = (ast.Constant, ast.Name, ast.Attribute, ast.BinOp, ast.UnaryOp, ast.operator, ast.unaryop)
        parts = list(ast.walk(node))
        names = {part.id for part in parts if isinstance(part, ast.Name)}
        if names - frame.names.keys() or not all(
            isinstance(part, (*simple, ast.expr_context)) for part in parts
        ):
            return None
        return range_of(self.apart(node, frame)[0])

    def _runs_of(self, loop: ast.stmt, frame: Frame) -> int | None:
        """Return how often the body of a loop in a loop runs at most; None if it is not known before."""
        if not isinstance(loop, ast.For) or not isinstance(loop.iter, ast.Call):
            return None
        spans = [self._range_of_node(node, frame) for node in loop.iter.args]
        known = [span[0] for span in spans if span is not None and span[0] == span[1]]
        is_known = getattr(loop.iter.func, "id", "") == "range" and len(known) == len(spans)
        return len(range(*known)) if is_known else None
