"""JSON text to plain data and back: strict when reading, laid out for people when writing.

The limits, and which lists are rule tables, hold for YAML too.
"""

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

#: Levels of lists and mappings in a file.
MAX_DEPTH = 64
#: Bytes of a file; of JSON so many that every system that can be compiled can be read.
MAX_FILE_BYTES = 10 * 1024 * 1024
MAX_JSON_BYTES = 128 * 1024 * 1024
#: Characters of a written line, where it can be kept.
LINE_WIDTH = 110


class Unreadable(ValueError):  # noqa: N818
    """Raised for a text that is not acceptable JSON or YAML; says why in a sentence."""


def is_scalar(value: object) -> bool:
    """Return whether a value has no parts."""
    return value is None or isinstance(value, str | int | float)


def rule_rows(system: Mapping[str, Any]) -> list[Sequence[str]]:
    """Cut a system's rule table into rows, one term of the last input after the other in each.

    Parameters
    ----------
    system : mapping
        Any mapping; only a fuzzy system whose `rules` are output terms has rows.

    Returns
    -------
    list
        The rows; empty where there is no rule table.
    """
    rules, inputs = system.get("rules"), system.get("inputs")
    if not rules or not inputs or not all(isinstance(rule, str) for rule in rules):
        return []
    width = len(inputs[-1]["terms"])
    return [rules[start : start + width] for start in range(0, len(rules), width)]


def read(text: str) -> Any:
    """Turn JSON into plain data, refusing what JSON leaves open: repeated keys, NaN, bottomless nesting.

    Raises
    ------
    Unreadable
        With a sentence.
    """
    try:
        return json.loads(text, object_pairs_hook=_unique_keys, parse_constant=_refuse_constant)
    except json.JSONDecodeError as error:
        if not text[error.pos :].strip():
            raise Unreadable(
                f"the JSON ends in the middle of a value (line {error.lineno}); the file is cut short: "
                "get a whole copy"
            ) from error
        raise Unreadable(
            f"it is not JSON: {error.msg} in line {error.lineno}, column {error.colno}; correct it there"
        ) from error
    except RecursionError as error:
        raise Unreadable(f"it is nested more than {MAX_DEPTH} deep; flatten it") from error
    except ValueError as error:
        raise (
            error if isinstance(error, Unreadable) else Unreadable(f"a number is too long: {error}")
        ) from error


def write(mapping: Mapping[str, Any]) -> str:
    """Write plain data as JSON: short things on one line, rule tables in rows.

    Parameters
    ----------
    mapping : mapping
        Strings, finite floats, ints, lists and mappings.
    """
    return _block(mapping, 0) + "\n"


def _unique_keys(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    mapping = dict(pairs)
    if len(mapping) != len(pairs):
        times = Counter(key for key, _ in pairs)
        repeated = next(key for key, _ in pairs if times[key] > 1)
        raise Unreadable(f"the key {repeated!r} appears twice in one place; keep one of them")
    return mapping


def _refuse_constant(name: str) -> None:
    raise Unreadable(f"it contains {name}; every number must be finite")


def _inline(value: Any) -> str:
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=not value.isprintable())
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{_inline(key)}: {_inline(item)}" for key, item in value.items()) + "}"
    if is_scalar(value):
        return json.dumps(value, allow_nan=False)
    return "[" + ", ".join(_inline(item) for item in value) + "]"


def _block(value: Any, depth: int) -> str:
    inner, outer = "  " * (depth + 1), "  " * depth
    if isinstance(value, Mapping):
        rows = rule_rows(value)
        lines = [
            f"{inner}{_inline(key)}: "
            + (_table(rows, depth + 1) if key == "rules" and rows else _fitted(item, depth + 1, len(key) + 4))
            for key, item in value.items()
        ]
        return "{\n" + ",\n".join(lines) + f"\n{outer}}}"
    return "[\n" + ",\n".join(inner + _fitted(item, depth + 1, 0) for item in value) + f"\n{outer}]"


def _fitted(value: Any, depth: int, used: int) -> str:
    inline = _inline(value)
    has_mappings = isinstance(value, Sequence) and any(isinstance(item, Mapping) for item in value)
    if is_scalar(value) or (not has_mappings and 2 * depth + used + len(inline) <= LINE_WIDTH):
        return inline
    return _block(value, depth)


def _table(rows: Sequence[Sequence[str]], depth: int) -> str:
    inner, outer = "  " * (depth + 1), "  " * depth
    lines = [inner + ", ".join(_inline(term) for term in row) for row in rows]
    return "[\n" + ",\n".join(lines) + f"\n{outer}]"
