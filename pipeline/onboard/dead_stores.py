"""Stores to the state that nothing reads, left out."""

import re
from collections.abc import Iterable
from dataclasses import replace

from pipeline.onboard.functions import Function, Line, pruned

_STORE = re.compile(r"\s*state->(\w+(?:\[\d+\])*) = (.*);")


def without_dead_stores(functions: Iterable[Function], kept_members: frozenset[str]) -> list[Function]:
    """Return functions without what is written to elements of the state that nothing reads, and its needs.

    The kept members are read elsewhere.
    """
    functions = [replace(function) for function in functions]  # a program may be written again
    while True:
        elements, wholes = _read(line for function in functions for line in function.lines)
        is_changed = False
        for function in functions:
            kept = []
            for line in function.lines:
                match = _STORE.fullmatch(line.text)
                name = match[1].partition("[")[0] if match else ""
                if match is None or match[1] in elements or name in wholes | kept_members:
                    kept.append(line)
            kept = pruned(kept)
            is_changed |= len(kept) < len(function.lines)
            function.lines = kept
        if not is_changed:
            return functions


def _read(lines: Iterable[Line]) -> tuple[set[str], set[str]]:
    """Return the elements of the state that lines read, and the arrays of which they read some element."""
    elements, wholes = set(), set()
    for line in lines:
        match = _STORE.fullmatch(line.text)
        text = match[2] if match else line.text
        for name, indices in re.findall(r"state->(\w+)((?:\[\d+\])*)", text):
            if match is None or name + indices != match[1]:  # a sum that only adds to itself is not read
                elements.add(name + indices)
        wholes |= set(re.findall(r"state->(\w+)(?:\[\d+\])*\[[^\]\d]", text))
    return elements, wholes
