"""Free text that came with data: units, descriptions, facts. It is shown in terminals and on pages."""

import json
import re
from collections.abc import Iterable
from typing import Any, Final

#: control characters but line ends and tabs, what turns the direction of writing, and halves of pairs
UNFIT: Final = re.compile(
    "[\\x00-\\x08\\x0b-\\x1f\\x7f-\\x9f\\u061c\\u200e\\u200f\\u2028-\\u202e\\u2066-\\u2069\\ud800-\\udfff]"
)
MISSING_SIGN: Final = "\N{REPLACEMENT CHARACTER}"


def plain(data: Any) -> Any:
    """Return text, or plain data, in which `UNFIT` characters are replaced; what is no text stays."""
    if isinstance(data, str):
        return UNFIT.sub(MISSING_SIGN, data)
    if isinstance(data, dict):
        return {plain(key): plain(value) for key, value in data.items()}
    if isinstance(data, list | tuple):
        return type(data)(map(plain, data))
    return data


def parse_json(content: str | bytes) -> Any:
    """Parse JSON that somebody may have written, with its texts made `plain`.

    Raises
    ------
    ValueError, RecursionError
        If it is none, or deeper than Python's stack.
    """
    return plain(json.loads(content))


def as_number(data: Any) -> float | None:
    """Return a text or data as a number; None where it is none."""
    try:
        return float(data)
    except (TypeError, ValueError):
        return None


def distinct(names: Iterable[str]) -> list[str]:
    """Return names made unique: later equal ones get a number."""
    words: list[str] = []
    for name in names:
        candidate, count = name, 1
        while candidate in words:
            count += 1
            candidate = f"{name}_{count}"
        words.append(candidate)
    return words
