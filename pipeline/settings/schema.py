"""Plain mappings to settings: which keys there are, of what type, and the right one nearest to a wrong one.

The tree of keys is that of the dataclasses in `pipeline.settings.experiment`, but for the mission, whose
settings stand at the top of the configuration.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from types import UnionType
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

from pipeline.settings.experiment import Experiment, Mission, SettingError
from pipeline.settings.nearest import did_you_mean

#: keys under which anything may stand here; whoever reads a controller checks it
FREE = "controller"
#: fields of `Experiment` that are no part of a configuration
NOT_CONFIGURED = ("resume",)

_WORDS = {int: "a whole number", float: "a number", bool: "true or false", str: "a text"}


def types_of(kind: type) -> dict[str, Any]:
    """Return the keys of a group and the type of each, the mission's among those of the whole."""
    hints = get_type_hints(kind)
    names = {field.name: hints[field.name] for field in fields(kind) if field.name not in NOT_CONFIGURED}
    if kind is Experiment:
        mission = names.pop("mission")
        names = {**names, **types_of(mission)}
    return names


@cache
def all_keys() -> frozenset[str]:
    """Return every key and group of the configuration, dotted."""

    def walk(kind: type, prefix: str) -> Iterable[str]:
        for name, hint in types_of(kind).items():
            yield prefix + name
            if is_dataclass(hint) and isinstance(hint, type):
                yield from walk(hint, f"{prefix}{name}.")

    return frozenset(walk(Experiment, ""))


def is_key(key: str) -> bool:
    """Tell whether a dotted key may stand in the configuration."""
    return key in all_keys() or key.startswith(FREE + ".")


def experiment_from(config: Mapping[str, Any]) -> Experiment:
    """Build an experiment from a resolved configuration of plain data.

    Raises
    ------
    SettingError
        If a key is unknown or missing, or a value is of the wrong type or cannot be.
    """
    values = _group_values(Experiment, config, "")
    mission = {name: values.pop(name) for name in types_of(Mission)}
    return Experiment(**values, mission=Mission(**mission))


def _group_values(kind: type, node: object, prefix: str) -> dict[str, Any]:
    """Convert the keys of one group."""
    if not isinstance(node, Mapping):
        raise SettingError(
            f"{prefix.rstrip('.')} is {node!r}; it must be a group of keys: {', '.join(types_of(kind))}"
        )
    types = types_of(kind)
    for name in node:
        if name not in types:
            key = f"{prefix}{name}"
            raise SettingError(f"there is no key {key}{did_you_mean(key, all_keys())}")
    for name in types:
        if name not in node:
            raise SettingError(f"the key {prefix}{name} is missing; give it a value, {prefix}{name}=...")
    return {name: _convert(hint, node[name], f"{prefix}{name}") for name, hint in types.items()}


def _convert(kind: Any, value: Any, key: str) -> Any:
    """Convert one value to the type of its key."""
    origin, arguments = get_origin(kind), get_args(kind)
    if is_dataclass(kind) and isinstance(kind, type):
        return kind(**_group_values(kind, value, f"{key}."))
    if origin in (Union, UnionType):
        inner = next(argument for argument in arguments if argument is not type(None))
        return None if value is None else _convert(inner, value, key)
    if origin is Literal:
        if value not in arguments:
            raise SettingError(
                f"{key} is {value!r}; it must be one of {', '.join(arguments)}"
                + did_you_mean(str(value), arguments)
            )
        return value
    if origin is tuple:
        if not isinstance(value, list | tuple):
            raise SettingError(f"{key} is {value!r}; it must be a list, [..., ...]")
        return tuple(_convert(arguments[0], item, f"{key}[{index}]") for index, item in enumerate(value))
    if kind in _WORDS:
        return _scalar(kind, value, key)
    if not isinstance(value, Mapping):
        raise SettingError(f"{key} is {value!r}; it must be a group of keys")
    return dict(value)


def _scalar(kind: type, value: Any, key: str) -> Any:
    """Convert a number, a truth value or a text; whole numbers may be written like 1e3."""
    if kind is str and isinstance(value, str):
        return value
    if kind is bool and isinstance(value, bool):
        return value
    if kind in (int, float) and isinstance(value, int | float) and not isinstance(value, bool):
        if not math.isfinite(value):
            raise SettingError(f"{key} is {value}; it must be a finite number")
        if kind is float or value == int(value):
            return kind(value)
    raise SettingError(f"{key} is {value!r}; it must be {_WORDS[kind]}")
