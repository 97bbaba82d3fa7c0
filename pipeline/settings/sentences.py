"""Turns pydantic's validation errors into sentences: what is wrong, what is expected, how to fix it."""

import math
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any, get_args, get_type_hints

from pydantic import ValidationError

from pipeline.settings.checks import Cure, SettingError, expected, in_unit
from pipeline.settings.keys import dotted, unit_of, unknown
from pipeline.settings.nearest import did_you_mean

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
