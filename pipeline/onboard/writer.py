"""What a translation has written so far: functions of C, their lines and variables, tables and members."""

import ast
import re
from collections.abc import Callable, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import numpy as np

from fis_tools.formats.c.text import WORDS
from pipeline.onboard.allowed import C_TYPES, TranslationError, check_stored, union
from pipeline.onboard.arrays import Accumulator, Array, Record, is_known, leaves, map_leaves
from pipeline.onboard.functions import Frame, Function, FunctionSource, Line, Loop, Obligation
from pipeline.onboard.values import (
    Expression,
    LaneConstant,
    bare,
    is_fixed,
    is_scalar,
    kind_of,
    range_of,
    text_of,
)

PROJECT = Path(__file__).resolve().parents[2]
#: words of C, and names of its library, that no variable may have
RESERVED = WORDS | frozenset(
    {
        *("bool", "false", "true", "abs", "j0", "j1", "jn", "y0", "y1", "yn", "gamma"),
        *("sin", "cos", "tan", "sqrt", "floor", "ceil", "rint", "exp", "log", "pow", "least", "most"),
        *("total", "s", "near", "far", "time", "index", "signal"),
        *(
            "fabs",
            "atan",
            "atan2",
            "tan",
            "ldexp",
            "draw_numbers",
            "drawn",
            "nearest_whole",
            "power_of_two",
            "finite_number",
        ),
        *("state", "three", "controller", "errno", "NAN", "INFINITY", "HUGE_VAL", "main", "asm"),
    }
)
#: loops of known length up to this are written out
MOST_UNROLLED = 4


@runtime_checkable
class Readable(Protocol):
    """What says itself what stands at an index."""

    ndim: int
    #: marks it: arrays have no such method
    used: list[str]

    def at(self, writer: "Writer", index: Any) -> Any:
        """Return what stands at an index."""


class Made(np.ndarray[Any, Any]):
    """An array of expressions that is written in one function, and not in a branch or a loop there."""

    where: tuple[Function, int] | None = None

    def __array_finalize__(self, source: Any) -> None:
        """Take over from what it is a copy of where it may be written."""
        self.where = getattr(source, "where", None)


@dataclass(frozen=True)
class Setting:
    """What a translation takes besides the functions and their arguments.

    Parameters
    ----------
    operations : mapping of a function to what writes it down
        It is called with the translator and the arguments.
    instead : mapping of a compiled function to another
        Which stands in its place.
    bounds : mapping of (function, loop) to a function of the names in it
        How often a loop runs at most whose length is not known: by the name that it counts with, "while".
    unrolled : frozenset of (function, loop)
        Loops that are written out however long they are.
    ranges : mapping of str to (int, int)
        Least and greatest of members of the state that hold whole numbers.
    guarded : frozenset of str
        Members of the state into which only finite numbers are written.
    is_proved_apart : bool
        Whether an analyser will show what ranges alone do not: that whole numbers fit into 32 bits, and that
        indices lie inside their arrays. Else that is refused.
    """

    operations: Mapping[Any, Callable[..., Any]]
    instead: Mapping[Any, Any] = field(default_factory=dict)
    bounds: Mapping[tuple[str, str], Callable[[Mapping[str, Any]], int]] = field(default_factory=dict)
    unrolled: frozenset[tuple[str, str]] = frozenset()
    ranges: Mapping[str, tuple[int, int]] = field(default_factory=dict)
    guarded: frozenset[str] = frozenset()
    is_proved_apart: bool = False


class Writer:
    """Writes lines of C, and notes the tables and members of the state that they use."""

    def __init__(self, setting: Setting) -> None:
        self.setting = setting
        self.functions: list[Function] = []
        self.members: dict[str, tuple[tuple[int, ...], str]] = {}
        self.tables: dict[int, Array] = {}
        self.loops: list[Loop] = []
        self.obligations: dict[Obligation, None] = {}
        self.sources: dict[Any, FunctionSource] = {}
        self._names: set[str] = set()
        self._locals: set[str] = set()
        self._inlined: set[Any] = set()
        self._open: list[
            Any
        ] = []  # the functions of Python that are being translated, each in the one before
        self._function: Function | None = None
        self._line: tuple[str, int] = ("", 0)

    # --- lines and names

    @property
    def function(self) -> Function:
        """The function that is written."""
        if self._function is None:
            raise TranslationError("no function is written")
        return self._function

    def emit(self, text: str) -> None:
        """Write a line."""
        self.function.lines.append(Line("    " * self.function.depth + text, *self._line))

    def doubt(self, what: str) -> None:
        """Note what an analyser must show, or refuse it where none will."""
        if not self.setting.is_proved_apart:
            raise TranslationError(what)
        self.obligations[Obligation(self.function.name, what, *self._line)] = None

    def whole(self, value: Any) -> Any:
        """Return a number that was computed; if it is whole, it fits into C's int."""
        if isinstance(value, Expression) and value.kind == "int" and value.range is None:
            self.doubt("a whole number might not fit into 32 bits; limit it by `min` and `max`")
        return value

    def fresh(self, name: str) -> str:
        """Return a name for a variable that the function does not use yet, such as a given one."""
        name = re.sub(r"\W", "_", name) or "value"
        taken = self._names.union(table.name for table in self.tables.values())
        if name in RESERVED or name in taken or name[0].isdigit():
            name = f"the_{name}"
        candidate, number = name, 2
        while candidate in self.function.names:
            candidate, number = f"{name}_{number}", number + 1
        self.function.names.add(candidate)
        self._locals.add(candidate)
        return candidate

    @contextmanager
    def located(self, frame: Frame, node: ast.AST) -> Any:
        """Note the line of Python that is translated, and name it in what is refused."""
        before, number = self._line, frame.source.line + getattr(node, "lineno", 1) - 1
        self._line = (frame.source.file, number)
        try:
            yield
        except (
            *(TranslationError, TypeError, AttributeError, LookupError, ValueError, ArithmeticError),
        ) as error:
            if isinstance(error, TranslationError) and re.match(r"\S+\.py:\d+: ", str(error)):
                raise
            fact = f"{frame.source.file}:{number}: {error}, in {frame.source.name}"
            raise TranslationError(fact) from error
        self._line = before

    # --- arrays

    def member(self, name: str, shape: tuple[int, ...], kind: str) -> Array:
        """Return a member of the state."""
        self.members.setdefault(name, (shape, kind))
        return Array(f"state->{name}", shape, "double" if kind == "double" else "int")

    def wrapped(self, value: Any, name: str) -> Any:
        """Return an array of numbers as a table; anything else as it is."""
        if not isinstance(value, np.ndarray) or value.dtype == object or value.dtype.names:
            return value
        if value.dtype.kind not in "iufb":
            raise TranslationError(f"{name} is an array of {value.dtype}")
        return Array(name, value.shape, "double" if value.dtype.kind == "f" else "int", value)

    def element(self, array: Any, key: Any) -> Any:
        """Return what stands at an index, or the part of an array that it leads to."""
        if isinstance(array, Record | Readable):
            return array.at(key) if isinstance(array, Record) else array.at(self, key)
        if isinstance(array, np.ndarray) and array.dtype == object:
            keys = key if isinstance(key, tuple) else (key,)
            if any(isinstance(index, Expression) for index in keys):
                raise TranslationError("an index that is not known, into values that are")
            return array[key]
        if isinstance(array, np.ndarray):
            array = self.wrapped(array, "table")
        if not isinstance(array, Array):
            if isinstance(key, Expression):
                raise TranslationError(f"an index that is not known, into {type(array).__name__}")
            return array[key]
        part = array.at(key)
        self._check_indices(part)
        if not part.is_element:
            return part
        known = part.known
        if known is not None:
            return known
        span = self.setting.ranges.get(part.name.removeprefix("state->"))
        if part.kind == "int" and part.data is not None:
            span = (int(np.min(part.data)), int(np.max(part.data)))
        return Expression(self.array_text(part), part.kind, range=span)

    def _check_indices(self, array: Array) -> None:
        """Note, or refuse, indices that are not known to lie inside an array; the last one found is told."""
        for number, (index, length) in enumerate(zip(array.indices, array.shape_whole, strict=False)):
            if not isinstance(index, Expression):
                continue
            if index.kind != "int" and not (index.kind == "bool" and length > 1):
                raise TranslationError(f"{index.text} indexes {array.name}, and is no whole number")
            span = range_of(index)
            is_inside = span is not None and span[0] >= 0 and span[1] < length
            if not is_inside and length == 1:  # C leaves the axis out
                raise TranslationError(
                    f"an index of axis {number} of {array.name}, of length 1, might not be 0"
                )
            if not is_inside:
                name = array.name.removeprefix("state->")
                self.doubt(f"an index of axis {number} of {name} might not lie from 0 to {length - 1}")

    def array_text(self, array: Array) -> str:
        """Return an array, or an element of it, as C."""
        name = array.name
        if array.data is not None:
            name = self._table_name(array)
        text = name
        for index, length in zip(array.indices, array.shape_whole, strict=False):
            if length != 1:
                text += f"[{bare(text_of(index, 'int'))}]"
        return text

    def _table_name(self, array: Array) -> str:
        key = array.data.__array_interface__["data"][0], array.shape_whole, array.data.strides
        number = hash(key)
        if number not in self.tables:
            names = self._locals.union(table.name for table in self.tables.values())
            name, count = array.name, 2
            while name in names or name in RESERVED:
                name, count = f"{array.name}_{count}", count + 1
            self.tables[number] = Array(name, array.shape_whole, array.kind, array.data)
        return self.tables[number].name

    @property
    def _where(self) -> tuple[Function, int]:
        """The function that is written, and how deep in branches and loops."""
        return self.function, self.function.depth

    def made(self, array: Any) -> Any:
        """Return an array of expressions, which is written only where it is made."""
        written = array.view(Made)
        written.where = self._where
        return written

    def put(self, array: Any, key: Any, value: Any) -> None:
        """Write a number into an array."""
        if isinstance(array, np.ndarray) and array.dtype == object:
            if isinstance(array, Made) and array.where != self._where:
                raise TranslationError(
                    "an array of known shape is written in a branch or a loop; write it where it is made"
                )
            array[key] = self.stable(value, "value")
            return
        if not isinstance(array, Array) or array.data is not None:
            raise TranslationError(f"writing into {type(array).__name__}")
        part = array.at(key)
        self._check_indices(part)
        if not part.is_element:
            raise TranslationError(f"writing into a part of {part.name}")
        if part.kind == "int":
            check_stored("int", kind_of(value), is_zero_possible=True, what=part.name)
        text = bare(text_of(value, "int" if part.kind == "int" else "double"))
        if re.sub(r"^state->|_\d+$", "", part.name) in self.setting.guarded:
            text = f"finite_number({text})"
        self.emit(f"{self.array_text(part)} = {text};")

    # --- variables

    @staticmethod
    def check_unchanged(bound: set[str], frame: Frame, *inner: Frame) -> None:
        """Refuse that a branch or a loop binds a name of anything but numbers anew."""
        for name in sorted(bound & frame.names.keys() - frame.variables.keys()):
            if any(each.names.get(name) is not frame.names[name] for each in inner):
                raise TranslationError(
                    f"{name}, which is no number, is bound anew in a branch or a loop; use another name, or "
                    "branch where it is used"
                )

    def stable(self, value: Any, name: str) -> Any:
        """Return a value whose expressions are constants of the function."""

        def settle(leaf: Any, leaf_name: str) -> Any:
            if isinstance(leaf, np.ndarray) and leaf.dtype == object:
                settled = leaf.copy()
                for index in np.ndindex(leaf.shape):
                    settled[index] = settle(leaf[index], leaf_name)
                return settled
            if isinstance(leaf, Array):
                first, *indices = (
                    index if is_fixed(index) else settle(index, "at") for index in (leaf.first, *leaf.indices)
                )
                return replace(leaf, indices=tuple(indices), first=first)
            if not isinstance(leaf, Expression) or leaf.is_name:
                return leaf
            variable = self.fresh(leaf_name)
            self.emit(f"const {C_TYPES[leaf.kind]} {variable} = {bare(leaf.text)};")
            return replace(leaf, text=variable, is_name=True, mask="")

        return map_leaves(value, settle, name)

    def declared(self, value: Any, name: str) -> Any:
        """Declare variables of C that begin with a value, in its shape."""

        def declare(leaf: Any, leaf_name: str) -> Any:
            if isinstance(leaf, LaneConstant) and self.function.lane is None:
                variable = self.fresh(leaf_name)
                if float(leaf) != 0.0:
                    raise TranslationError(f"sums of a vector that begin with {float(leaf)}")
                self.emit(f"double {variable}[8] = {{0}};")
                return Accumulator(variable)
            if not is_scalar(leaf):
                return leaf
            kind = kind_of(leaf)
            variable = self.fresh(leaf_name)
            self.emit(f"{C_TYPES[kind]} {variable} = {bare(text_of(leaf, C_TYPES[kind]))};")
            return Expression(variable, kind, range=range_of(leaf) if kind == "int" else None)

        return map_leaves(value, declare, name)

    def assign(self, frame: Frame, name: str, value: Any) -> None:
        """Bind a name, or write into its variables of C."""
        if name not in frame.variables:
            frame.names[name] = self.stable(value, name)
            return
        if len(leaves(value)) > 1:  # all are read before one is written
            value = self.stable(value, name)
        self._write(frame.variables[name], value)
        frame.names[name] = map_leaves(frame.variables[name], ranges_of(value))

    def _write(self, target: Any, value: Any) -> None:
        if isinstance(target, tuple):
            for part, item in zip(target, value, strict=True):
                self._write(part, item)
        elif isinstance(target, Accumulator):
            if self.function.lane is None:
                raise TranslationError("a vector of points outside a loop over them")
            self.emit(f"{target.name}[{self.function.lane} % 8] = {bare(text_of(value, 'double'))};")
        elif isinstance(target, Expression):
            span = range_of(value)
            is_zero_possible = span is None or span[0] <= 0 <= span[1]
            check_stored(target.kind, kind_of(value), is_zero_possible=is_zero_possible, what=target.text)
            c_type = C_TYPES[target.kind]
            if isinstance(value, Expression) and value.mask:
                raise TranslationError("a count that is no sum")
            text = text_of(value, c_type)
            if text != target.text:
                self.emit(f"{target.text} = {bare(text)};")
        elif target is not value and not (is_known(target) and is_known(value) and target == value):
            raise TranslationError(f"{target!r:.60} changes")

    def make_variable(self, frame: Frame, name: str) -> None:
        """Let a name stand for variables of C from here on, if it stands for numbers."""
        if name not in frame.variables and all(is_scalar(leaf) for leaf in leaves(frame.names[name])):
            frame.variables[name] = frame.names[name] = self.declared(frame.names[name], name)

    def _read(self, value: Any) -> Any:
        """Return a value in which sums over vectors are those of the lane, and known conditions are taken."""
        lane, known = self.function.lane, self.function.known

        def read(leaf: Any, _: str) -> Any:
            if isinstance(leaf, Accumulator) and lane is not None:
                return Expression(f"{leaf.name}[{lane} % 8]", "lane")
            if isinstance(leaf, Expression) and leaf.is_name:
                return known.get(leaf.text, leaf)
            return leaf

        return map_leaves(value, read)


def ranges_of(value: Any) -> Callable[[Any, str], Any]:
    """Return what gives variables, leaf by leaf, the ranges of a value's numbers."""
    spans = iter([range_of(leaf) for leaf in leaves(value)])

    def give(leaf: Any, _: str) -> Any:
        span = next(spans)
        return replace(leaf, range=span) if isinstance(leaf, Expression) and leaf.kind == "int" else leaf

    return give


def in_either(first: Any, second: Any) -> Any:
    """Return variables, leaf by leaf, that lie in one of two ranges each."""
    spans = iter([range_of(leaf) for leaf in leaves(second)])

    def give(leaf: Any, _: str) -> Any:
        span = next(spans)
        is_whole = isinstance(leaf, Expression) and leaf.kind == "int"
        return replace(leaf, range=union(leaf.range, span)) if is_whole else leaf

    return map_leaves(first, give)
