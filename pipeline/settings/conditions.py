"""Conditions for a key to exist, such as another key's value."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from pipeline.settings.keys import value_at

#: the key whose value is a list, in which one must be
STAGES = "stages"


@dataclass(frozen=True, init=False)
class Only:
    """The conditions, one of which must hold for a key to exist.

    Parameters
    ----------
    *conditions : str
        ``key=value`` (for stages: one of them is the value), ``key>number``, or ``key``, whose value is then
        not null.
    is_told : bool
        Whether a key that is set where it has no effect is accepted with a note instead of being refused.
    """

    conditions: tuple[str, ...]
    is_told: bool

    def __init__(self, *conditions: str, is_told: bool = False) -> None:
        vars(self).update(conditions=conditions, is_told=is_told)

    @property
    def keys(self) -> tuple[str, ...]:
        """The keys that the conditions are about."""
        return tuple(re.split("[=>]", condition)[0] for condition in self.conditions)

    @property
    def is_of_stages(self) -> bool:
        """Whether the conditions are about the stages of a run, which may change, not about the flight."""
        return self.is_told or STAGES in self.keys

    def holds(self, config: Mapping[str, Any]) -> bool:
        """Return whether one of the conditions holds in a complete configuration of plain data."""
        return any(_holds(condition, config) for condition in self.conditions)

    def refusal(self, key: str, config: Mapping[str, Any]) -> str:
        """Return a message that a key does not exist in a configuration: why, and the cure."""
        if self.is_of_stages:
            read_by = ", ".join(condition.partition("=")[2] for condition in self.conditions)
            present = _shown(config, STAGES)
            return f"{key} counts in the stages {read_by}, and this run has {present}; leave it out"
        values = " and ".join(f"{other} is {_shown(config, other)}" for other in dict.fromkeys(self.keys))
        return f"{key} counts only with {self}, and {values}; set that, or leave {key} out"

    def __str__(self) -> str:
        return " or ".join(f"{each} given" if each in self.keys else each for each in self.conditions)


def _holds(condition: str, config: Mapping[str, Any]) -> bool:
    key, sign, wanted = (*re.split("([=>])", condition), "", "")[:3]
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
