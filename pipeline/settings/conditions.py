"""Keys that exist only where another setting has some value: the one mechanism behind all such settings.

A key whose number has no effect is no key: it is not in a run's configuration, and giving it is a mistake.
``Only("navigation.mode=fixes")`` among the annotations of a key, or for all keys of a group given to
`pipeline.settings.groups.settings`, says so once, for the check, the help and the reference page.
"""

import re
from collections.abc import Mapping
from typing import Any

#: the key whose value is a list, in which one must be
STAGES = "stages"


class Only:
    """Where a key exists: one of some conditions must hold.

    Parameters
    ----------
    *conditions : str
        ``key=value`` (for stages: one of them is the value), ``key>number``, or ``key``, whose value is then
        not null.
    is_told : bool
        Whether one that is set where it counts for nothing is taken with a note, and not refused.
    """

    def __init__(self, *conditions: str, is_told: bool = False) -> None:
        self.conditions, self.is_told = conditions, is_told
        self.keys = tuple(re.split("[=>]", condition)[0] for condition in conditions)

    @property
    def is_of_stages(self) -> bool:
        """Whether it is about what a run does, which may change, and not about what flies."""
        return STAGES in self.keys

    def holds(self, config: Mapping[str, Any]) -> bool:
        """Return whether it holds in a configuration of plain data with all its keys."""
        return any(_holds(condition, config) for condition in self.conditions)

    def refusal(self, key: str, config: Mapping[str, Any]) -> str:
        """Return why a key does not exist in a configuration, and the cure."""
        if self.is_of_stages:
            read_by = ", ".join(condition.partition("=")[2] for condition in self.conditions)
            present = _shown(config, STAGES)
            return f"{key} counts in the stages {read_by}, and this run has {present}; leave it out"
        found = " and ".join(f"{other} is {_shown(config, other)}" for other in dict.fromkeys(self.keys))
        return f"{key} counts only with {self}, and {found}; set that, or leave {key} out"

    def __str__(self) -> str:
        return " or ".join(one if "=" in one or ">" in one else f"{one} given" for one in self.conditions)


def value_at(config: Mapping[str, Any], key: str, otherwise: Any = None) -> Any:
    """Return the value of a dotted key, or another where there is none."""
    node: Any = config
    for name in key.split("."):
        node = node.get(name, otherwise) if isinstance(node, Mapping) else otherwise
    return node


def _holds(condition: str, config: Mapping[str, Any]) -> bool:
    key, sign, wanted = re.split("([=>])", condition) if re.search("[=>]", condition) else (condition, "", "")
    value = value_at(config, key)
    if sign == ">":
        return isinstance(value, int | float) and value > float(wanted)
    if sign == "=":
        return wanted in value if isinstance(value, list) else _word(value) == wanted
    return value is not None


def _shown(config: Mapping[str, Any], key: str) -> str:
    value = value_at(config, key)
    return ", ".join(map(_word, value)) if isinstance(value, list) else _word(value)


def _word(value: Any) -> str:
    """Return a value as YAML writes it."""
    return "null" if value is None else str(value).lower() if isinstance(value, bool) else str(value)
