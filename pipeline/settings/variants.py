"""Variants of a group of settings: the classes that its tags, such as ``navigation.mode``, choose among."""

from collections.abc import Iterator, Mapping
from dataclasses import fields
from functools import cache
from typing import Any, Literal, get_args, get_origin, get_type_hints

from pipeline.settings.checks import SettingError, no_choice
from pipeline.settings.conditions import Only
from pipeline.settings.keys import dotted

#: fields that are not part of a configuration
NOT_CONFIGURED = ("mission", "resume")


def names_of(kind: Any) -> list[str]:
    """Return the keys of a group, without the group's name."""
    return [field.name for field in fields(kind) if field.name not in NOT_CONFIGURED]


def variants_of(kind: type[Any]) -> list[type[Any]]:
    """Return the variants of a class of settings: its subclasses without subclasses, or itself."""
    return [leaf for inner in kind.__subclasses__() for leaf in variants_of(inner)] or [kind]


def descendants_of(kind: type[Any]) -> Iterator[type[Any]]:
    """Yield all subclasses of a class, each before its own."""
    for inner in kind.__subclasses__():
        yield inner
        yield from descendants_of(inner)


@cache
def tags_of(kind: type[Any]) -> Mapping[str, Mapping[type[Any], str]]:
    """Return the keys that name a variant: by key, its one value in each variant that has it."""
    tags: dict[str, dict[type[Any], str]] = {}
    for variant in variants_of(kind):
        for name, hint in get_type_hints(variant).items():
            if get_origin(hint) is Literal and len(get_args(hint)) == 1:
                tags.setdefault(name, {})[variant] = get_args(hint)[0]
    return tags


def variant_of(kind: Any, values: Mapping[str, Any]) -> type[Any]:
    """Return the variant that the tags among some values name; of a tag that is left out the first counts.

    Raises
    ------
    SettingError
        If there is none.
    """
    variants = variants_of(kind)
    for tag, value_of in tags_of(kind).items():
        choices = list(dict.fromkeys(value_of[variant] for variant in variants if variant in value_of))
        value = values.get(tag, choices[0] if choices else None)
        if choices and value not in choices:
            key = dotted(getattr(kind, "group", ""), (tag,))
            raise SettingError(f"{key} is {no_choice(value, choices)}")
        variants = [variant for variant in variants if value_of.get(variant, value) == value]
    return variants[0]


def conditions_of(kind: Any, name: str) -> Iterator[Only]:
    """Yield where a key exists, by the variants that have it: a condition for each tag that decides."""
    having = [variant for variant in variants_of(kind) if name in variant.__dataclass_fields__]
    for tag, value_of in tags_of(kind).items():
        values = list(dict.fromkeys(value_of[variant] for variant in having if variant in value_of))
        if tag != name and 0 < len(values) < len({*value_of.values()}):
            yield Only(*(f"{dotted(kind.group, (tag,))}={value}" for value in values))
