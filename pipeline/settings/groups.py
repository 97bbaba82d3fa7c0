"""Groups of settings: frozen dataclasses whose values pydantic checks, and whose errors are sentences.

A key whose number has no effect is no key: it is not in a run's configuration, and giving it is a mistake.
``Only("navigation.mode=fixes")`` among the annotations of a key, or for all keys of a group given to
`settings`, says so once, for the check, the help and the reference page.
"""

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import field, fields, is_dataclass
from functools import wraps
from typing import Any, TypeVar, dataclass_transform, get_args, get_type_hints

from pydantic import ConfigDict, Field, ValidationError
from pydantic.dataclasses import dataclass as checked_dataclass

from pipeline.settings.checks import Cure, SettingError, expected, in_unit
from pipeline.settings.keys import did_you_mean, dotted, register, unit_of, unknown, value_at

Kind = TypeVar("Kind")

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


#: fields that are not part of a configuration
NOT_CONFIGURED = ("mission", "resume")
#: pydantic's names for values of the wrong type, to the right type in words
TYPES: Mapping[str, str] = {
    "float_type": "a number",
    "int_type": "a whole number",
    "bool_type": "true or false",
    "string_type": "a text",
    "tuple_type": "a list, [..., ...]",
    "dict_type": "a group of keys",
}


def names_of(kind: Any) -> list[str]:
    """Return the keys of a group, without the group's name."""
    return [field.name for field in fields(kind) if field.name not in NOT_CONFIGURED]


def sentence(kind: Any, group: str, error: ValidationError) -> str:
    """Describe the first error: unknown keys before missing ones, and those before invalid values.

    Parameters
    ----------
    kind : type
        The dataclass that was to be built.
    group : str
        Prefix of its keys.
    error : ValidationError
    """
    order = {"unexpected_keyword_argument": 0, "missing": 1}
    fault = min(error.errors(include_url=False), key=lambda one: order.get(one["type"], 2))
    cause = fault.get("ctx", {}).get("error")
    if isinstance(cause, SettingError):
        return str(cause)
    key = dotted(group, fault["loc"])
    if fault["type"] == "unexpected_keyword_argument":
        return unknown(key)
    if fault["type"] == "missing":
        return f"the key {key} is missing; give it a value, {key}=..."
    if cause is not None:
        return str(cause).replace("{key}", key).replace("{unit}", in_unit(unit_of(key)))
    return f"{key} is " + _refused(key, fault, *_place(kind, fault["loc"]))


def _refused(key: str, fault: Mapping[str, Any], kind: Any, metadata: list[Any]) -> str:
    """Return a value and what it must be, in words."""
    value = fault["input"]
    match fault["type"]:
        case "dataclass_type":
            return f"{value!r}; it must be a group of keys: {', '.join(names_of(kind))}"
        case "literal_error":
            choices = get_args(kind)
            return f"{value!r}; it must be one of {', '.join(choices)}{did_you_mean(str(value), choices)}"
        case "finite_number":
            return f"{value}; it must be a finite number"
        case name if name in TYPES:
            return f"{value!r}; it must be {TYPES[name]}"
    is_count = int in (kind, *get_args(kind))
    return _limited(key, value, fault["ctx"], metadata, is_count=is_count)


def _limited(
    key: str, value: float, broken: Mapping[str, float], metadata: list[Any], *, is_count: bool
) -> str:
    """Return a number and its allowed range."""
    limits = dict(broken)
    for one in metadata:
        limits |= {name: getattr(one, name) for name in ("gt", "ge", "le") if hasattr(one, name)}
    shown = value if is_count else float(value)
    if "gt" in limits and value <= limits["gt"]:
        return f"{shown}; it must be greater than {limits['gt']:g}{in_unit(unit_of(key))}"
    if is_count and "ge" in broken:
        cure = "".join(one.words for one in metadata if isinstance(one, Cure))
        return f"{shown}; it must be a whole number of at least {broken['ge']}{cure}"
    bounds = expected(limits.get("ge", limits.get("gt")), limits.get("le", math.inf))
    return f"{shown}; it must be {bounds}{in_unit(unit_of(key))}"


def _place(kind: Any, location: tuple[int | str, ...]) -> tuple[Any, list[Any]]:
    """Return the type at a location in a group, and the limits of the value there."""
    metadata: list[Any] = []
    for name in location:
        if isinstance(name, int) or not is_dataclass(kind):
            return kind, []
        known: Any = kind
        metadata, kind = known.__pydantic_fields__[name].metadata, get_type_hints(kind)[name]
    return kind, metadata


#: each class of settings with its group, "" for keys at the top, and what holds for all its keys
GROUPS: list[tuple[str, type[Any], tuple[Only, ...]]] = []


@dataclass_transform(kw_only_default=True, frozen_default=True, field_specifiers=(field, Field))
def settings(group: str, *only: Only) -> Callable[[type[Kind]], type[Kind]]:
    """Make a class a frozen dataclass that checks its values, with the keys of a group in its errors.

    Parameters
    ----------
    group : str
        Such as ``optimizer.penalty``; empty for keys at the top of the configuration.
    *only : Only
        Where its keys exist, except for those that the conditions are about.

    Returns
    -------
    callable
        A decorator. The class that it returns raises a `SettingError` for unknown and missing keys and for
        values of the wrong type or beyond their limits.
    """

    def checked(plain: type[Kind]) -> type[Kind]:
        # built when first needed: most commands need few groups
        config = ConfigDict(extra="forbid", defer_build=True)
        made: Any = checked_dataclass(plain, config=config, frozen=True, kw_only=True)
        build = made.__init__

        @wraps(build)
        def check_and_build(self: Any, **values: Any) -> None:
            try:
                build(self, **values)
            except ValidationError as error:
                raise SettingError(sentence(made, group, error)) from error
            finally:
                # classes built when needed get pydantic's __init__ again
                made.__init__ = check_and_build

        made.__init__ = check_and_build
        register(group, names_of(made))
        GROUPS.append((group, made, only))
        kind: type[Kind] = made
        return kind

    return checked
