"""The text of C: comments, identifiers, numbers and lines."""

import re
from collections.abc import Iterable, Sequence
from functools import partial
from math import isinf
from textwrap import wrap
from typing import Any

from plain_files.plain_text import distinct

#: words of C
WORDS = frozenset(
    {
        *("auto", "break", "case", "char", "const", "continue", "default", "do", "double", "else", "enum"),
        *("extern", "float", "for", "goto", "if", "inline", "int", "long", "register", "restrict", "return"),
        *("short", "signed", "sizeof", "static", "struct", "switch", "typedef", "union", "unsigned", "void"),
        *("volatile", "while"),
    }
)
#: what C compiles with, also as C++. Not ``-Wfloat-equal``: equal numbers are told apart on purpose
WARNINGS = (
    *("-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wshadow", "-Wdouble-promotion", "-Wundef"),
    *("-Wcast-qual", "-Werror"),
)
#: what a source begins with, below the comment that says what it is
OPENING = """\
#include <math.h>
#include <stdbool.h>

#ifdef __FAST_MATH__
#error "compile without -ffast-math: results depend on exact comparisons"
#endif
"""
WIDTH = 110
_wrap = partial(wrap, break_long_words=False, break_on_hyphens=False)
_INDENTED = {"initial_indent": "    ", "subsequent_indent": "    "}


def comment(paragraphs: Sequence[str], indent: int = 0) -> str:
    """Render paragraphs as a comment, wrapped and indented."""
    lines = [line for text in paragraphs for line in _wrap(plain(text), WIDTH - 8) or [""]]
    before = " " * indent
    if len(lines) == 1:
        return f"{before}/* {lines[0]} */"
    return "\n".join([f"{before}/*", *(f"{before} * {line}".rstrip() for line in lines), f"{before} */"])


def plain(text: str) -> str:
    """Keep a text from ending its comment, from opening another and from spelling a trigraph."""
    printable = "".join(letter if letter.isprintable() else " " for letter in text)
    return printable.replace("*/", "* /").replace("/*", "/ *").replace("??", "? ?")


def identifiers(names: Iterable[str]) -> list[str]:
    """Turn names into words that can be part of a C identifier, no two alike."""
    return distinct(re.sub(r"[^A-Za-z0-9]+", "_", name).strip("_") or "unnamed" for name in names)


def exact(value: float) -> str:
    """Write a number that reads back as the same double, or the same whole number."""
    if not isinstance(value, int) and isinf(value):
        return "HUGE_VAL" if value > 0.0 else "-HUGE_VAL"  # INFINITY is a float
    return repr(value)


def table(kind: str, name: str, values: Sequence[Any], notes: Sequence[str] = ()) -> str:
    """Define a constant table of doubles or ints, of any number of axes; notes stand above its rows."""
    lengths, part = "", values
    while isinstance(part, Sequence):
        lengths, part = f"{lengths}[{len(part)}]", part[0]
    opening = f"static const {kind} {name}{lengths} = "
    if not notes and len(line := f"{opening}{_braces(values)};") <= WIDTH:
        return line
    lines = []
    for row, note in zip(values, notes, strict=True) if notes else ():
        lines += [comment([note], 4), *_wrap(_braces(row) + ",", WIDTH, **_INDENTED)]
    lines = lines or _wrap(_braces(values)[1:-1], WIDTH, **_INDENTED)
    return "\n".join([f"{opening}{{", *lines, "};"])


def _braces(values: Any) -> str:
    """Write numbers, or rows of them, as an initializer."""
    return f"{{{', '.join(map(_braces, values))}}}" if isinstance(values, Sequence) else exact(values)


def broken(line: str, further: int = 4) -> list[str]:
    """Break a statement that is too long between its words; what follows is indented further."""
    if len(line) <= WIDTH or line.endswith("*/"):
        return [line]
    before = " " * (len(line) - len(line.lstrip()))
    return _wrap(line.lstrip(), WIDTH, initial_indent=before, subsequent_indent=before + " " * further)
