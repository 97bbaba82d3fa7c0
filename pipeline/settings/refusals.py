"""pydantic's errors as sentences about a setting."""

import re
from collections.abc import Mapping
from typing import Any, get_type_hints

from pydantic import ValidationError

from pipeline.settings.checks import SettingError, in_unit, no_choice
from pipeline.settings.keys import FREE, KNOWN, choices_of, dotted, unit_of, unknown
from pipeline.settings.variants import conditions_of, names_of

#: pydantic's names for errors, to what a value must be
EXPECTED: Mapping[str, str] = {
    "greater_than": "greater than {gt:g}",
    "greater_than_equal": "at least {ge:g}",
    "less_than": "less than {lt:g}",
    "less_than_equal": "at most {le:g}",
    "finite_number": "a finite number",
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
    key, value = dotted(kind.group, fault["loc"]), fault["input"]
    unit = in_unit(unit_of(key))
    match fault["type"]:
        case "unexpected_keyword_argument":
            words = _unexpected(kind, key)
        case "missing":
            words = f"the key {key} is missing; give it a value, {key}=..."
        case "dataclass_type":
            words = no_group(key, value, get_type_hints(kind)[str(fault["loc"][-1])])
        case "literal_error":
            choices = re.findall("'([^']*)'", fault["ctx"]["expected"])
            words = f"{key} is {no_choice(value, choices)}"
        case _ if cause is not None:
            words = str(cause).replace("{key}", key).replace("{unit}", unit)
        case name:
            limits = fault.get("ctx", {})
            words = (
                f"{key} is {value!r}; it must be {EXPECTED[name].format(**limits)}{unit if limits else ''}"
            )
    return words


def no_group(key: str, value: Any, kind: Any) -> str:
    """Return a message about a value that is no group of keys, as a class of settings must have."""
    return f"{key} is {value!r}; it must be a group of keys: {', '.join(names_of(kind))}"


def _unexpected(kind: Any, key: str) -> str:
    """Return a message about a key that a class does not have: a variant's, or one that does not exist."""
    if kind.group == FREE:
        choices = choices_of(key.rpartition(".")[2], names_of(kind), "keys")
        return f"there is no key {key} with {FREE}.kind={kind.kind}{choices}"
    if key not in KNOWN:
        return unknown(key)
    where = " and ".join(map(str, conditions_of(kind.root, key.rpartition(".")[2])))
    return f"{key} counts only with {where}; set that, or leave {key} out"
