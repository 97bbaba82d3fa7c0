"""Settings that no result depends on: how a command shares out its work, and what it reaches outside a run.

They belong to the command that gives them. A configuration that is read from a file is data about the past:
of what it reaches outside the run's folder, nothing is taken over.
"""

import copy
from collections.abc import Mapping
from functools import cache
from typing import Any, Final

from pipeline.settings.checks import Scope
from pipeline.settings.conditions import value_at
from pipeline.settings.keys import in_todays_words
from pipeline.settings.schema import group_in, schema

_ABSENT: Final = object()


@cache
def keys_in(*scopes: Scope) -> Mapping[str, Any]:
    """Return the dotted keys of the configuration that are marked with one of some scopes, and defaults."""
    return {
        key.name: key.default
        for key in schema().values()
        if any(mark in scopes for mark in getattr(key.hint, "__metadata__", ()))
    }


def reached_outside(config: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a configuration reaches outside its run: dotted keys to values."""
    neutral, config = keys_in(Scope.OUTSIDE), in_todays_words(config)
    found = {key: value_at(config, key, _ABSENT) for key in neutral}
    return {key: value for key, value in found.items() if value not in (_ABSENT, neutral[key])}


def without_outside(config: Mapping[str, Any]) -> dict[str, Any]:
    """Return a configuration of the past: one that reaches nothing outside its run."""
    return with_command(
        in_todays_words(config), {key: keys_in(Scope.OUTSIDE)[key] for key in reached_outside(config)}
    )


def only_results(config: Mapping[str, Any]) -> dict[str, Any]:
    """Return a configuration without the settings that no result depends on."""
    told = in_todays_words(config)
    for key in keys_in(*Scope):
        group, _, name = key.rpartition(".")
        node = value_at(told, group)
        if isinstance(node, dict):
            node.pop(name, None)
    return told


def with_command(config: Mapping[str, Any], given: Mapping[str, Any]) -> dict[str, Any]:
    """Return a configuration with dotted keys of the present command put in."""
    changed = copy.deepcopy(dict(config))
    for key, value in given.items():
        group, _, name = key.rpartition(".")
        group_in(changed, group)[name] = value
    return changed
