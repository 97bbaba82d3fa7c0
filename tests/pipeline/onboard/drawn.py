"""Random functions of an array and a number, in Python that the translator reads and somewhat beyond."""

import importlib.util
import random
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

#: what each function may call: one changes the array, one has several results, one counts
OPENING = """\
import math
import numpy as np
from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.vectors import Three, least, most, select


@compiled
def bump(cells):
    cells[0] = cells[0] + 1.0
    return cells[0]


@compiled
def pair(x, y):
    if x < y:
        return y, x
    return x, y


@compiled
def counted(cells, x):
    count = 0
    for i in range(8):
        if cells[i] > x:
            count += 1
    return count


"""
#: constructs that C or numba may take otherwise than Python, a class each; "plain" has none of them
CLASSES = (
    *("plain", "rest", "quotient", "bits", "value_of_or", "loop_variable", "rebinding", "index", "overflow"),
    *("truth_of_number", "call_in_target", "sum_of_conditions", "extreme", "sign_of_zero", "name", "alias"),
    *(
        "several_targets",
        "tuple_loop",
        "cast",
        "kinds",
        "slice",
        "fill",
        "chain",
        "negative_condition",
        "count",
    ),
)
#: how often a construct of a function's class stands where it may
SHARE = 0.3


class Drawn:
    """A function that is drawn, statement by statement.

    Parameters
    ----------
    name, kind : str
        Its name, and which of `CLASSES` it is of.
    seed : int
    """

    def __init__(self, name: str, kind: str, seed: int) -> None:
        self.random = random.Random(f"{kind} {seed}")  # noqa: S311 - nothing is secret
        self.kind, self.depth, self.lines = kind, 1, [f"@compiled\ndef {name}(cells, x):"]
        self.odd_depth = 0  # constructs of the class, one in the other
        self.doubles, self.wholes, self.counters, self.number = ["x"], list[str](), list[str](), 0
        for variable in ("d0", "d1"):
            self.put(f"{variable} = {self.double(1)}")
            self.doubles.append(variable)
        for variable in ("n0", "n1"):
            self.put(f"{variable} = {self.random.randint(-3, 9)}")
            self.wholes.append(variable)
        for _ in range(self.random.randint(3, 6)):
            self.statement(0)
        for cell, variable in enumerate((*self.doubles[:3], *self.wholes[:2])):
            self.put(f"cells[{cell}] = cells[{cell}] + 1.0 * {variable}")

    def text(self) -> str:
        return "\n".join(self.lines) + "\n\n\n"

    def put(self, line: str) -> None:
        self.lines.append("    " * self.depth + line)

    def one_of(self, *choices: str) -> str:
        return self.random.choice(choices)

    def is_odd(self, *kinds: str) -> bool:
        return self.kind in kinds and self.odd_depth < 2 and self.random.random() < SHARE

    def whole(self, depth: int = 1) -> str:
        odd: dict[str, Callable[[], str]] = {
            "rest": lambda: f"({self.count()} % {self.one_of('2', '3', '7')})",
            "quotient": lambda: f"({self.count()} // {self.one_of('2', '3')})",
            "bits": lambda: f"({self.count()} {self.one_of('&', '|', '^')} {self.one_of('1', '3', '6')})",
            "overflow": lambda: f"({self.count()} * {self.one_of('65536', '100003', '3')})",
            "sum_of_conditions": lambda: f"({self.count()} {self.one_of('+', '-')} {self.condition(0)})",
            "cast": lambda: f"int({self.double(0)})",
            "negative_condition": lambda: f"({self.one_of('-', '~', '+')}{self.condition(0)})",
        }
        if depth and self.is_odd(*odd):
            return self.deeper(odd[self.kind])
        if depth == 0 or self.random.random() < 0.3:
            return self.count()
        return f"({self.whole(depth - 1)} {self.one_of('+', '-', '*')} {self.count()})"

    def deeper(self, odd: Callable[[], str]) -> str:
        self.odd_depth += 1
        text = odd()
        self.odd_depth -= 1
        return text

    def count(self) -> str:
        """Return a whole number: a counter of a loop, more often than a variable, or a small number."""
        choices = [*self.counters, *self.counters, *self.wholes, str(self.random.randint(0, 5))]
        return self.one_of(*choices)

    def double(self, depth: int = 2) -> str:
        odd: dict[str, Callable[[], str]] = {
            "value_of_or": lambda: (
                f"({self.one_of(*self.doubles)} {self.one_of('or', 'and')} {self.double(0)})"
            ),
            "sign_of_zero": lambda: f"math.atan2(0.0, -{self.one_of('float', '')}({self.whole(0)}))",
            "extreme": lambda: (
                f"{self.one_of('min', 'max')}({self.double(0)}, "
                f"{self.one_of(self.double(0), self.whole(0))}{self.one_of('', ', 0.5')})"
            ),
            "index": lambda: f"cells[{self.count()} {self.one_of('-', '+')} {self.random.randint(0, 3)}]",
            "chain": lambda: f"(1.0 if {self.double(0)} < {self.double(0)} < bump(cells) else 0.5)",
            "kinds": lambda: f"({self.one_of('0', '3', '2.5')} if {self.condition(0)} else {self.double(0)})",
            "slice": lambda: f"cells[{self.random.randint(0, 6)}:][{self.count()}]",
            "call_in_target": lambda: self.one_of("bump(cells)", f"pair({self.double(0)}, bump(cells))[0]"),
        }
        if self.is_odd(*odd):
            return self.deeper(odd[self.kind])
        if depth == 0:
            return self.one_of(*self.doubles, "0.5", "-3.25", "cells[2]", "cells[5]")
        left, right = self.double(depth - 1), self.double(0)
        return self.one_of(
            f"({left} {self.one_of('+', '-', '*')} {right})",
            f"abs({left})",
            f"(0.5 * {self.whole()})",
            f"({left} if {self.condition(0)} else {right})",
            f"{self.one_of('min', 'max', 'least', 'most')}({left}, {right})",
            f"(-{right})",
            f"({left} / 3.0)",
            f"np.{self.one_of('floor', 'sqrt')}(abs({right}))",
            f"select({self.condition(0)}, {left}, {right})",
            f"(Three({left}, {right}, 1.0) * 2.0).{self.one_of('x', 'y', 'z')}",
            f"pair({left}, {right})[{self.one_of('0', '1')}]",
            f"cells[{self.one_of(*self.counters)}]" if self.counters else "cells[3]",
        )

    def condition(self, depth: int = 1) -> str:
        if self.is_odd("truth_of_number"):
            return f"({self.one_of('not ', '', 'bool')}({self.one_of(*self.doubles, *self.wholes)}))"
        if depth:
            return f"({self.condition(0)} {self.one_of('and', 'or')} {self.condition(0)})"
        return self.one_of(
            f"({self.double(0)} {self.one_of('<', '<=', '>', '>=', '==', '!=')} {self.double(0)})",
            f"({self.whole(0)} {self.one_of('<', '!=', '==', '>')} {self.whole(0)})",
            f"(not {self.double(0)} < {self.double(0)})",
            f"({self.double(0)} <= {self.double(0)} < {self.double(0)})",
        )

    def statement(self, level: int) -> None:
        odd = getattr(self, f"_{self.kind}", None)
        choice = self.random.random()
        if odd is not None and self.random.random() < SHARE:
            odd()
        elif choice < 0.3 or level > 1:
            if self.random.random() < 0.6:
                self.put(
                    f"{self.one_of(*self.doubles[1:])} {self.one_of('=', '+=', '-=', '*=')} {self.double()}"
                )
            else:
                self.put(f"{self.one_of(*self.wholes)} {self.one_of('=', '+=', '+=', '-=')} {self.whole()}")
        elif choice < 0.5:
            self.put(f"cells[{self.cell()}] {self.one_of('=', '+=', '*=')} {self.double()}")
        elif choice < 0.75:
            self.branch(level)
        else:
            self.loop(level)

    def cell(self) -> str:
        return (
            self.one_of(*self.counters, "0", "1", "3", "7") if self.counters else self.one_of("0", "1", "6")
        )

    def branch(self, level: int) -> None:
        self.put(f"if {self.condition()}:")
        self.inside(level)
        if self.random.random() < 0.5:
            self.put("else:")
            self.inside(level)

    def inside(self, level: int) -> None:
        self.depth += 1
        for _ in range(self.random.randint(1, 2)):
            self.statement(level + 1)
        self.depth -= 1

    def loop(self, level: int) -> None:
        self.number += 1
        counter = f"k{self.number}"
        if self.kind == "loop_variable" and self.random.random() < 0.5:
            counter = self.one_of(*self.wholes)
        bounds = self.one_of("2", "3", "6", "8", "1, 7", "7, 0, -1", "0, 8, 3")
        self.put(f"for {counter} in range({bounds}):")
        self.counters.append(counter)
        self.inside(level)
        if self.random.random() < 0.3:
            self.put(f"    if {self.condition()}:")
            self.put(f"        {self.one_of('break', 'continue')}")
        self.put(f"    cells[1] += 0.25 * {counter}")
        self.counters.remove(counter)
        if self.kind == "loop_variable" and self.random.random() < 0.3:
            self.put(f"cells[6] = 1.0 * {counter}")

    # --- statements of one class each

    def _rebinding(self) -> None:
        self.put("a = np.zeros(8)")
        self.put("b = np.zeros(8)")
        self.put(f"if {self.condition(0)}:")
        self.put(f"    {self.one_of('a = b', 'a, b = b, a', 'a[2] = 4.0', 'c = a')}")
        self.put(f"a[1] = {self.double(0)}")
        self.put("cells[3] = b[1] + a[2]")

    def _call_in_target(self) -> None:
        at = f"counted(cells, bump(cells)) {self.one_of('% 8', '// 2')}"
        self.put(f"cells[{at}] {self.one_of('=', '+=')} cells[0]")

    def _name(self) -> None:
        name = self.one_of(
            "state", "double", "NAN", "errno", "least", "cells_2", "total", "three", "fabs", "entry"
        )
        self.put(f"{name} = {self.double(0)}")
        self.put(f"cells[0] = {name}")

    def _alias(self) -> None:
        self.put(f"row = cells[{self.count()}:]")
        self.put(f"{self.one_of(*self.wholes)} += 1")
        self.put(f"row[{self.random.randint(0, 2)}] = {self.double(0)}")

    def _several_targets(self) -> None:
        first, second = self.one_of("cells[0]", "d0", "n0"), self.one_of("cells[1]", "d1")
        self.put(
            self.one_of(f"{first} = {second} = cells[0] + 1.0", f"d0, cells[0] = cells[0], {self.double(0)}")
        )

    def _tuple_loop(self) -> None:
        self.number += 1
        self.put(f"for v{self.number} in (cells[0], {self.double(0)}, d1):")
        self.put(f"    cells[0] = cells[0] + v{self.number}")
        self.put("    d1 = d1 + 1.0")

    def _kinds(self) -> None:
        self.put(f"{self.one_of('n0', 'd0')} = {self.one_of('1', '0', '2.0', self.condition(0))}")

    def _fill(self) -> None:
        end = self.one_of("3", self.count(), "8")
        self.put(f"cells[:{end}] = {self.one_of('cells[1]', self.double(0))}")
        self.put(f"cells[7] = cells[:{self.random.randint(2, 8)}].max()")
        self.put(f"n1 = cells[:{self.random.randint(2, 8)}].argmax()")

    def _count(self) -> None:
        self.put(f"{self.one_of('n0', 'n1', 'd0')} += {self.condition(0)}")


def functions(first: int, count: int, kind: str, folder: Path) -> list[Any]:
    """Return functions of a class, of consecutive seeds, from a module in a folder."""
    names = [f"{kind}_{seed}" for seed in range(first, first + count)]
    drawn = [Drawn(name, kind, first + number).text() for number, name in enumerate(names)]
    return load(f"drawn_{kind}_{first}", OPENING + "".join(drawn), names, folder)


def load(name: str, text: str, names: list[str], folder: Path) -> list[Any]:
    """Return functions of a module, which is written into a folder."""
    path = folder / f"{name}.py"
    path.write_text(text)
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module = sys.modules[name] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    del sys.modules[name]
    return [getattr(module, each) for each in names]
