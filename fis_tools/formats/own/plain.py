"""What the JSON and the YAML form of a controller share: limits, and which lists are rule tables."""

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
