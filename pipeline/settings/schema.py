"""The schema: every key of the configuration, and experiments from plain data."""

import copy
from collections.abc import Iterator, Mapping
from dataclasses import MISSING, dataclass, fields, is_dataclass
from functools import cache
from itertools import chain
from typing import Any, get_type_hints

from pipeline.settings.conditions import Only, value_at
from pipeline.settings.experiment import Experiment, Mission, SettingError
from pipeline.settings.groups import GROUPS
from pipeline.settings.keys import DISPERSIONS, FREE, dotted, in_todays_words, unknown
from pipeline.settings.sentences import names_of


@dataclass(frozen=True)
class Key:
    """A key of the configuration.

    Parameters
    ----------
    name : str
        Dotted, such as ``deputy.mass_kg``.
    hint : type
        Its annotation.
    default : object
        As plain data; `dataclasses.MISSING` if it must be given.
    only : tuple of Only
        All of which must hold where it exists.
    """

    name: str
    hint: Any
    default: Any
    only: tuple[Only, ...]

    def exists(self, config: Mapping[str, Any]) -> bool:
        """Return whether it is part of a configuration, whatever the stages."""
        return all(mark.is_of_stages or mark.holds(config) for mark in self.only)


@cache
def schema() -> dict[str, Key]:
    """Return every key by its dotted name, except those of controllers, in the order of their definition."""
    tops = [entry for entry in GROUPS if not entry[0]]
    groups = [entry for entry in GROUPS if entry[0] not in ("", FREE)]
    keys = (keys_of(group, kind, only) for group, kind, only in [*reversed(tops), *groups])
    return {key.name: key for key in chain.from_iterable(keys)}


def keys_of(group: str, kind: Any, only: tuple[Only, ...] = ()) -> Iterator[Key]:
    """Yield the keys of a class of settings, without those that are groups."""
    hints, own = get_type_hints(kind, include_extras=True), names_of(kind)
    for field in fields(kind):
        hint, name = hints[field.name], dotted(group, (field.name,))
        if field.name in own and field.name != FREE and not is_dataclass(hint):
            default = field.default if field.default_factory is MISSING else field.default_factory()
            marks = [mark for mark in only if name not in mark.keys]
            marks += [mark for mark in getattr(hint, "__metadata__", ()) if isinstance(mark, Only)]
            yield Key(name, hint, _plain(default), tuple(marks))


def _plain(value: Any) -> Any:
    """Return a value with lists for tuples, as YAML has them."""
    return [_plain(one) for one in value] if isinstance(value, tuple) else value


def defaults() -> dict[str, Any]:
    """Return the configuration of all defaults, with the keys that only some of them make exist."""
    made: dict[str, Any] = {}
    for key in schema().values():
        if key.default is not MISSING:
            group, _, name = key.name.rpartition(".")
            group_in(made, group)[name] = copy.deepcopy(key.default)
    return made


def group_in(config: dict[str, Any], group: str) -> dict[str, Any]:
    """Return a group of a configuration, made if missing; a new one if its place is taken by a value."""
    node = config
    for name in filter(None, group.split(".")):
        below = node.setdefault(name, {})
        node = below if isinstance(below, dict) else {}
    return node


def completed(config: Mapping[str, Any]) -> dict[str, Any]:
    """Return a configuration with the defaults that it leaves out, without the keys that do not exist."""
    whole = _merged(defaults(), config)
    for key in schema().values():
        if not key.exists(whole):
            group, _, name = key.name.rpartition(".")
            group_in(whole, group).pop(name, None)
    return whole


def present(config: Mapping[str, Any]) -> dict[str, Any]:
    """Return a configuration, perhaps of an earlier version, as the present one would be `completed`."""
    return completed(in_todays_words(config))


def _merged(under: Mapping[str, Any], over: Mapping[str, Any]) -> dict[str, Any]:
    """Return one mapping over another, group by group."""
    merged = dict(under)
    for name, value in over.items():
        below = merged.get(name)
        is_group = isinstance(below, dict) and isinstance(value, Mapping)
        merged[name] = _merged(below or {}, value) if is_group else copy.deepcopy(value)
    return merged


def idle(config: Mapping[str, Any], *, stages: bool = False) -> dict[str, Only]:
    """Return the keys of a configuration that do not exist, set or dispersed, each with what does not hold.

    Parameters
    ----------
    config : mapping
        Plain data with all keys.
    stages : bool
        Whether also those that no stage of the run reads.
    """
    found: dict[str, Only] = {}
    set_here = {name: name for name in schema() if value_at(config, name, schema) is not schema}
    dispersed = {f"{DISPERSIONS}.{name}": name for name in _dispersed(config.get(DISPERSIONS))}
    for place, name in (set_here | dispersed).items():
        for mark in schema()[name].only if name in schema() else ():
            if (stages or not mark.is_of_stages) and not mark.holds(config):
                found.setdefault(place, mark)
    return found


def _dispersed(node: Any, above: str = "") -> Iterator[str]:
    """Yield the keys that are dispersed."""
    for name, value in node.items() if isinstance(node, Mapping) else ():
        if isinstance(value, Mapping) and "kind" not in value:
            yield from _dispersed(value, f"{above}{name}.")
        else:
            yield f"{above}{name}"


def experiment_from(config: Mapping[str, Any]) -> Experiment:
    """Build an experiment from a resolved configuration of plain data.

    Raises
    ------
    SettingError
        If a key is unknown or missing, or a value has the wrong type or is not allowed. Keys of earlier
        versions are read if today's are missing, and those that do not exist are passed over.
    """
    config = present(config)
    own, of_mission = names_of(Experiment), names_of(Mission)
    for name in config:
        if name not in own and name not in of_mission:
            raise SettingError(unknown(name))
    mission = Mission(**{name: config[name] for name in of_mission if name in config})
    return Experiment(mission=mission, **{name: config[name] for name in own if name in config})
