"""What a page infers with: the functions that Python runs, as JavaScript, those that its systems need."""

import ast
import math
import re
from collections.abc import Iterator, Sequence
from typing import Any

from fis_tools.formats.c.transcribed.entries import ENTRIES
from fis_tools.formats.c.transcribed.functions import ScalarFunction
from fis_tools.formats.c.transcribed.writer import C


def camel(text: str) -> str:
    """Join words by capitals instead of underscores."""
    return re.sub(r"(?<=[a-z0-9])_([a-z0-9])", lambda match: match[1].upper(), text)


class JavaScript(C):
    """JavaScript, in which words are joined by capitals, and arrays know their lengths."""

    def text(self, function: ScalarFunction) -> str:
        """Return a function as text."""
        self.function = function
        head, *lines = [*self.opening(), *self.block(function.body, 1), "}"]
        return "\n".join([head, *(re.sub("^ +", lambda m: m[0][::2], line) for line in lines)]) + "\n"

    def opening(self) -> list[str]:
        """Return the comment and the head."""
        parameters = ", ".join(map(camel, self.function.parameters))
        about = f"/** {self.function.about} */\n" if self.function.about else ""
        return [f"{about}function {camel(self.function.name)}({parameters}) {{"]

    def declaration(self, name: str, is_const: bool) -> str:
        """Write a variable where it is declared."""
        return f"{'const' if is_const else 'let'} {camel(name)}"

    def sizes(self, function: ScalarFunction, name: str) -> list[str]:
        """Return nothing."""
        return []

    def length(self, name: str) -> str:
        """Write the length of an array."""
        return f"{name}.length"

    def value(self, node: ast.expr) -> str:
        """Write an expression."""
        return camel(node.id) if isinstance(node, ast.Name) else super().value(node)

    def counting(self, name: str, ends: Sequence[ast.expr]) -> str:
        """Write what stands in the brackets of a loop that counts."""
        return camel(super().counting(name, ends))

    def widened(self, text: str) -> str:
        """Write a whole number that is combined with one that is not."""
        return text

    def quotient(self, text: str) -> str:
        """Write an operation of two numbers."""
        return f"Math.floor({text.replace(' // ', ' / ')})" if " // " in text else text

    def number(self, value: float) -> str:
        """Write a number."""
        return "Infinity" if math.isinf(value) else super().number(value)

    def sign(self, sign: str) -> str:
        """Write a comparison."""
        return {"==": "===", "!=": "!=="}.get(sign, sign)

    def element(self, name: str, index: ast.expr) -> str:
        """Write an element of an array."""
        axes = index.elts if isinstance(index, ast.Tuple) else [index]
        return camel(name) + "".join(f"[{self.value(axis)}]" for axis in axes)

    def call(self, node: ast.Call, arguments: Sequence[ast.expr]) -> str:
        """Write a call."""
        return (
            camel(super().call(node, arguments))
            if node in self.function.calls
            else super().call(node, arguments)
        )

    def library(self, name: str) -> str:
        """Write the name of a function of the library."""
        return "Math." + {"fabs": "abs", "fmin": "min", "fmax": "max"}.get(name, name)


#: What each entry's name begins with, and where scripts find it; some are written whatever a page carries.
_TABLES = {"fuzzy_": "FUZZY", "degree_": "SHAPES", "defuzzify_": "DEFUZZIFIERS"}
_ALWAYS = ("aggregate", "counted", "degree_table")


def script(systems: list[dict[str, Any]]) -> str:
    """Return the functions that systems need, in tables by the names of operators, shapes and defuzzifiers.

    Parameters
    ----------
    systems : list of dict
        As `fis_tools.review.carried.system_data` gives them. What is named in them is written; where a term
        has the name of an operator, that operator is written too.
    """
    named = set(_texts(systems))
    tables: dict[str, list[str]] = {table: [] for table in _TABLES.values()}
    functions: dict[str, ScalarFunction] = {}
    for name in ENTRIES:
        begin = next((word for word in _TABLES if name.startswith(word)), "")
        word = name.removeprefix(begin)
        if name in _ALWAYS or (begin and _is_named(word, named)):
            functions |= {each.name: each for each in ENTRIES[name]().called}
            if name not in _ALWAYS:
                tables[_TABLES[begin]].append(f"{word}: {camel(name)}")
    returned = [*map(camel, _ALWAYS), *(f"{table}: {{ {', '.join(tables[table])} }}" for table in tables)]
    written = "\n".join(map(JavaScript().text, functions.values()))
    return f"const TRANSCRIBED = (() => {{\n{written}\nreturn {{ {', '.join(returned)} }};\n}})();\n"


def _is_named(name: str, named: set[str]) -> bool:
    """Return whether systems ask for an operator, a shape, or a defuzzifier of a program."""
    if name in named:
        return True
    semantics = next((word for word in named if name.startswith(f"sampled_{word}_")), None)
    return semantics is not None and name.removeprefix(f"sampled_{semantics}_") in named


def _texts(data: Any) -> Iterator[str]:
    """Yield the texts in plain data."""
    if isinstance(data, str):
        yield data
    for part in data.values() if isinstance(data, dict) else data if isinstance(data, list) else ():
        yield from _texts(part)
