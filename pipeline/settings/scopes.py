"""Settings that no result depends on: how a command shares out its work, and what it reaches outside a run.

They belong to the command that gives them. A configuration that is read from a file is data about the past:
of what it reaches outside the run's folder, nothing is taken over.
"""

import copy
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from typing import Any, Final, get_type_hints

from pipeline.settings.checks import Scope
from pipeline.settings.experiment import Experiment, Mission
from pipeline.settings.keys import dotted

_ABSENT: Final = object()


@cache
def keys_in(*scopes: Scope) -> Mapping[str, Any]:
    """Return the dotted keys of the configuration that are marked with one of some scopes, and defaults."""
    return dict(_marked(Experiment, "", scopes))


def _marked(kind: Any, group: str, scopes: tuple[Scope, ...]) -> Iterator[tuple[str, Any]]:
    hints = get_type_hints(kind, include_extras=True)
    for field in fields(kind):
        hint = hints[field.name]
        key = "" if hint is Mission else dotted(group, (field.name,))
        if is_dataclass(hint):
            yield from _marked(hint, key, scopes)
        elif any(mark in scopes for mark in getattr(hint, "__metadata__", ())):
            yield key, field.default


def reached_outside(config: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a configuration reaches outside its run: dotted keys to values."""
    neutral = keys_in(Scope.OUTSIDE)
    found = {key: _value(config, key) for key in neutral}
    return {key: value for key, value in found.items() if value not in (_ABSENT, neutral[key])}


def without_outside(config: Mapping[str, Any]) -> dict[str, Any]:
    """Return a configuration of the past: one that reaches nothing outside its run."""
    return with_command(config, {key: keys_in(Scope.OUTSIDE)[key] for key in reached_outside(config)})


def only_results(config: Mapping[str, Any]) -> dict[str, Any]:
    """Return a configuration without the settings that no result depends on."""
    told = copy.deepcopy(dict(config))
    for key in keys_in(*Scope):
        group, _, name = key.rpartition(".")
        node = _value(told, group)
        if isinstance(node, dict):
            node.pop(name, None)
    return told


def with_command(config: Mapping[str, Any], given: Mapping[str, Any]) -> dict[str, Any]:
    """Return a configuration with dotted keys of the present command put in."""
    changed = copy.deepcopy(dict(config))
    for key, value in given.items():
        group, _, name = key.rpartition(".")
        changed[group] = {**(changed.get(group) or {}), name: value}
    return changed


def _value(config: Mapping[str, Any], key: str) -> Any:
    node: Any = config
    for name in key.split("."):
        node = node.get(name, _ABSENT) if isinstance(node, Mapping) else _ABSENT
    return node
