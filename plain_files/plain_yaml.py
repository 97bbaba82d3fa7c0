"""YAML that other people wrote, as plain data: limited while it is parsed, before it is put together."""

from contextlib import suppress
from typing import Any, Final

import yaml

MOST_DEEP: Final = 64
MOST_VALUES: Final = 1_000_000
#: letters of a key
LONGEST_KEY: Final = 1000
#: the first is ten times as fast
LOADER: Final = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


def parse(content: bytes | str, most_bytes: int) -> Any:
    """Return the data of a YAML document.

    Raises
    ------
    ValueError
        If it is too large or too deep, has aliases, by which a small file grows to gigabytes, or keys that
        are no text, which JSON lacks.
    """
    if len(content) > most_bytes:
        raise ValueError(f"it has {len(content)} bytes, and at most {most_bytes} are read")
    try:
        _check_events(content)
        parsed = yaml.load(content, LOADER)  # noqa: S506 - a safe one
    except yaml.YAMLError as error:
        raise ValueError(str(error)) from error
    _check_keys(parsed)
    return parsed


def is_mapping(content: bytes) -> bool:
    """Return whether a text is a YAML mapping, or empty; also for what is no YAML."""
    with suppress(yaml.YAMLError):
        for event in yaml.parse(content, LOADER):
            if isinstance(event, yaml.NodeEvent):
                return isinstance(event, yaml.MappingStartEvent)
    return True


def _check_events(content: bytes | str) -> None:
    """Raise ValueError for aliases, and for documents that are too deep or too long."""
    depth = 0
    for number, event in enumerate(yaml.parse(content, LOADER)):
        if isinstance(event, yaml.AliasEvent):
            raise ValueError("it has an alias (*), and none is written")
        depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
        if depth > MOST_DEEP:
            raise ValueError(f"it is nested more than {MOST_DEEP} deep")
        if number > MOST_VALUES:
            raise ValueError(f"it has more than {MOST_VALUES} values")


def _check_keys(data: Any) -> None:
    """Raise ValueError for keys that are no texts, or are too long."""
    if isinstance(data, dict):
        for key in data:
            if not isinstance(key, str):
                raise ValueError(f"the key {key!r} is no text; write it in quotes")
            if len(key) > LONGEST_KEY:
                raise ValueError(f"the key {key[:40]!r}... has more than {LONGEST_KEY} letters")
        data = list(data.values())
    for value in data if isinstance(data, list) else ():
        _check_keys(value)
