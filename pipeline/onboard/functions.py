"""A function while it is translated: its Python, its lines of C, and which of these are needed."""

import ast
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from pipeline.onboard.allowed import Range

_STORE = re.compile(r"\s*(\w+) = (.*);")
_DECLARATION = re.compile(r"\s*(?:const )?(?:double|int|bool) (\w+)(?: = (.*))?;")
#: what changes nothing but the state, and what reads alone
_PURE_CALLS = frozenset(
    {
        *("sqrt", "fabs", "ceil", "floor", "cos", "sin", "atan", "atan2"),
        *("least", "most", "total", "nearest_whole", "power_of_two"),
    }
)
_CHANGE = re.compile(r"\(state\b|^\s*state->[^=;]*[^=;<>!]=[^=]|^\s*\w+\[[^=;]* =[^=]")


@dataclass(frozen=True)
class FunctionSource:
    """A Python function as it is read: where it stands, and its statements without early exits."""

    file: str
    line: int
    name: str
    summary: str
    body: tuple[ast.stmt, ...]
    #: every name that it binds
    local_names: frozenset[str] = frozenset()


@dataclass
class Line:
    """A line of C, and the line of Python that it comes from."""

    text: str
    file: str = ""
    number: int = 0


@dataclass(frozen=True)
class Obligation:
    """What ranges alone do not show of the C: an analyser of any input must."""

    function: str
    what: str
    file: str
    line: int


@dataclass(frozen=True)
class Loop:
    """A loop of the C, and how often it runs at most."""

    function: str
    variable: str
    most: int
    file: str
    line: int


@dataclass
class Function:
    """A function of C while it is written."""

    name: str
    source: FunctionSource
    lines: list[Line] = field(default_factory=list)
    depth: int = 1
    names: set[str] = field(default_factory=set)
    #: the variable that counts points, inside a loop over vectors of them
    lane: str | None = None
    #: and how many it counts
    lanes: int = 0
    #: how often what is written now runs at most, in a call of the function
    runs: int = 1
    #: conditions that hold, or do not, where what is written now runs
    known: Mapping[str, bool] = field(default_factory=dict)
    signature: str = ""
    #: its numbers, each with its kind, and with its range, or None
    parameters: dict[str, tuple[str, Range]] = field(default_factory=dict)

    def is_as(self, other: "Function") -> bool:
        """Return whether another is the same word for word; its numbers may have other ranges."""
        kinds, others = (
            {name: kind for name, (kind, _) in each.parameters.items()} for each in (self, other)
        )
        return (
            self.source is other.source
            and kinds == others
            and self.signature.replace(f" {self.name}(", f" {other.name}(") == other.signature
            and [line.text for line in self.lines] == [line.text for line in other.lines]
        )


@dataclass
class Frame:
    """What a function of Python sees: its names, of which `variables` are variables of C."""

    names: dict[str, Any]
    globals: Mapping[str, Any]
    source: FunctionSource
    variables: dict[str, Any] = field(default_factory=dict)


def change_arrays(lines: Sequence[Line]) -> bool:
    """Return whether lines write into arrays or the state, or call functions that may."""
    return any(_CHANGE.search(line.text) for line in lines)


def _calls(text: str | None) -> set[str]:
    """Return the functions that a text calls, and that may change something."""
    return set(re.findall(r"([A-Za-z_]\w*)\(", text or "")) - _PURE_CALLS


def pruned(lines: list[Line]) -> list[Line]:
    """Leave out variables that nothing reads, and what is written into them."""
    while True:
        reads: dict[str, int] = {}
        for line in lines:
            match = _DECLARATION.fullmatch(line.text) or _STORE.fullmatch(line.text)
            for word in re.findall(r"[A-Za-z_]\w*", (match[2] or "") if match else line.text):
                # what only changes itself is not read, unless something is called for what it does
                if match is None or word != match[1] or _calls(match[2]):
                    reads[word] = reads.get(word, 0) + 1
        local = {match[1] for line in lines if (match := _DECLARATION.fullmatch(line.text))}
        kept = []
        for line in lines:
            match = _DECLARATION.fullmatch(line.text) or _STORE.fullmatch(line.text)
            if match is None or match[1] not in local or reads.get(match[1]):
                kept.append(line)
            elif _calls(match[2]):  # it is called for what it does
                indent = line.text[: len(line.text) - len(line.text.lstrip())]
                kept.append(Line(f"{indent}(void){match[2]};", line.file, line.number))
        if kept == lines:
            return lines
        lines = kept
