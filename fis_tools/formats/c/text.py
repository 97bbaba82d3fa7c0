"""The text of C: comments, identifiers, numbers and lines."""

import re
from collections.abc import Iterable, Sequence
from functools import partial
from textwrap import wrap

from fis_tools.plain_text import distinct

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


def numbers(values: Sequence[float], indent: int) -> str:
    """Write numbers that read back as the same doubles, as many on a line as fit."""
    before = " " * indent
    return "\n".join(
        _wrap(", ".join(map(repr, values)), WIDTH, initial_indent=before, subsequent_indent=before)
    )


def broken(line: str, further: int = 4) -> list[str]:
    """Break a statement that is too long between its words; what follows is indented further."""
    if len(line) <= WIDTH or line.endswith("*/"):
        return [line]
    before = " " * (len(line) - len(line.lstrip()))
    return _wrap(line.lstrip(), WIDTH, initial_indent=before, subsequent_indent=before + " " * further)
