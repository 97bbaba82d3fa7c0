"""pydantic's errors as sentences about a setting."""

from collections.abc import Mapping
from dataclasses import is_dataclass
from typing import Any, get_args, get_origin, get_type_hints

from pydantic import ValidationError

from pipeline.settings.checks import SettingError, expected, in_unit, no_choice
from pipeline.settings.keys import FREE, KNOWN, choices_of, dotted, unit_of, unknown
from pipeline.settings.types import Cure, ends_of, opened
from pipeline.settings.variants import conditions_of, names_of

#: pydantic's names for values of the wrong type, to the right type in words
TYPES: Mapping[str, str] = {
    "float_type": "a number",
    "int_type": "a whole number",
    "bool_type": "true or false",
    "string_type": "a text",
    "tuple_type": "a list, [..., ...]",
    "dict_type": "a group of keys",
}


def sentence(kind: Any, error: ValidationError) -> str:
    """Describe the first error: unknown keys before missing ones, and those before invalid values.

    Parameters
    ----------
    kind : type
        The class of settings that was to be built.
    error : ValidationError
    """
    order = {"unexpected_keyword_argument": 0, "missing": 1}
    fault = min(error.errors(include_url=False), key=lambda details: order.get(details["type"], 2))
    cause = fault.get("ctx", {}).get("error")
    if isinstance(cause, SettingError):
        return str(cause)
    key = dotted(kind.group, fault["loc"])
    if fault["type"] == "unexpected_keyword_argument":
        return _unexpected(kind, key)
    if fault["type"] == "missing":
        return f"the key {key} is missing; give it a value, {key}=..."
    if cause is not None:
        return str(cause).replace("{key}", key).replace("{unit}", in_unit(unit_of(key)))
    return f"{key} is {_refused(key, fault, _hint_at(kind, fault['loc']))}"


def _unexpected(kind: Any, key: str) -> str:
    """Return a message about a key that a class does not have: a variant's, or one that does not exist."""
    if kind.group == FREE:
        choices = choices_of(key.rpartition(".")[2], names_of(kind), "keys")
        return f"there is no key {key} with {FREE}.kind={kind.kind}{choices}"
    if key not in KNOWN:
        return unknown(key)
    where = " and ".join(map(str, conditions_of(kind.root, key.rpartition(".")[2])))
    return f"{key} counts only with {where}; set that, or leave {key} out"


def _hint_at(kind: Any, location: tuple[int | str, ...]) -> Any:
    """Return the annotation of the field at a location, or of the mapping that contains it."""
    for name in location:
        inside, *_ = opened(kind)
        if is_dataclass(inside):
            kind = get_type_hints(inside, include_extras=True)[str(name)]
        elif get_origin(inside) is tuple:
            kind = get_args(inside)[0]
    return kind


def _refused(key: str, fault: Mapping[str, Any], hint: Any) -> str:
    """Return the rest of a message about an invalid value: the value, and what it must be."""
    value, (kind, limits, marks) = fault["input"], opened(hint)
    match fault["type"]:
        case "dataclass_type":
            return f"{value!r}; it must be a group of keys: {', '.join(names_of(kind))}"
        case "literal_error":
            return no_choice(value, get_args(kind))
        case "finite_number":
            return f"{value}; it must be a finite number"
        case name if name in TYPES:
            return f"{value!r}; it must be {TYPES[name]}"
    shown, unit = value if kind is int else float(value), in_unit(unit_of(key))
    words = f"{expected(*ends_of(limits))}{unit}"
    if "gt" in limits and value <= limits["gt"]:
        words = f"greater than {limits['gt']:g}{unit}"
    elif "lt" in limits:  # which is no part of the range
        words = f"less than {limits['lt']:g}" if value >= limits["lt"] else f"at least {limits['ge']:g}"
    elif kind is int and "ge" in limits and value < limits["ge"]:
        cures = [mark.words for mark in marks if isinstance(mark, Cure)]
        words = f"a whole number of at least {limits['ge']}{''.join(cures)}"
    return f"{shown}; it must be {words}"
