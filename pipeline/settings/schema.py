"""The schema: every key of the configuration, and experiments from plain data.

Settings that no result depends on belong to the command that gives them, and may be given to a resumed run.
"""

import copy
from collections.abc import Collection, Iterator, Mapping
from dataclasses import MISSING, asdict, dataclass, fields, is_dataclass, replace
from functools import cache
from itertools import chain
from typing import Any, Final, get_type_hints

from pipeline.settings.checks import Freely, SettingError
from pipeline.settings.experiment import Experiment, Mission
from pipeline.settings.groups import GROUPS, Only, names_of
from pipeline.settings.keys import (
    DISPERSIONS,
    FREE,
    GONE,
    dotted,
    in_todays_words,
    unknown,
    value_at,
    without,
)

#: characters of a value in a message
MOST_SHOWN = 60
#: stands for a value that a configuration does not have
ABSENT: Final = object()


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
    return with_values({}, {key.name: key.default for key in schema().values() if key.default is not MISSING})


def with_values(config: Mapping[str, Any], values: Mapping[str, Any]) -> dict[str, Any]:
    """Return a configuration with some dotted keys set; groups are made where they are missing."""
    changed = copy.deepcopy(dict(config))
    for key, value in values.items():
        *groups, name = key.split(".")
        node = changed
        for group in groups:
            below = node.setdefault(group, {})
            # the group is a new one if its place is taken by a value
            node = below if isinstance(below, dict) else {}
        node[name] = copy.deepcopy(value)
    return changed


def with_tried(config: Mapping[str, Any], values: Mapping[str, Any]) -> dict[str, Any]:
    """Return a configuration with the values of a trial of a search.

    Raises
    ------
    SettingError
        If a key is not in this configuration.
    """
    for key in values:
        if value_at(config, key, ABSENT) is ABSENT:
            raise SettingError(f"hparams_search.space.{key} is no key of this experiment; leave it out")
    return with_values(config, values)


def completed(config: Mapping[str, Any]) -> dict[str, Any]:
    """Return a configuration with the defaults that it leaves out, without the keys that do not exist."""
    whole = _merged(defaults(), config)
    return without(whole, [key.name for key in schema().values() if not key.exists(whole)])


def present(config: Mapping[str, Any]) -> dict[str, Any]:
    """Return a configuration, perhaps of an earlier version, as the present one would be `completed`."""
    return completed(without(in_todays_words(config), GONE))


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
    set_here = {name: name for name in schema() if value_at(config, name, ABSENT) is not ABSENT}
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


@cache
def free_keys() -> tuple[str, ...]:
    """Return the dotted keys of the configuration that no result depends on."""
    marks = {key.name: getattr(key.hint, "__metadata__", ()) for key in schema().values()}
    return tuple(name for name, own in marks.items() if any(isinstance(mark, Freely) for mark in own))


def only_results(config: Mapping[str, Any]) -> dict[str, Any]:
    """Return a configuration without the settings that no result depends on."""
    of_others = (key for key in GONE if not key.startswith("optimizer."))
    return without(in_todays_words(config), [*free_keys(), *of_others])


def in_world(experiment: Experiment, name: str) -> Experiment:
    """Return an experiment in one of the worlds of ``compare.worlds``; "" is its own.

    Raises
    ------
    SettingError
        If the world changes keys that are not part of a world, or sets a value that is not allowed.
    """
    changes = experiment.compare.worlds.get(name, {})
    there: dict[str, Any] = asdict(experiment.mission) | {"sun": asdict(experiment.sun)}
    for group, values in changes.items():
        own = there.get(group)
        there[group] = own | values if isinstance(own, dict) and isinstance(values, dict) else values
    parts = dict(there)
    try:
        made = replace(experiment, sun=parts.pop("sun"), mission=Mission(**parts))
    except SettingError as error:
        raise SettingError(f"compare.worlds.{name}: {error}") from error
    for key, mark in idle(there).items():
        group, _, last = key.rpartition(".")
        # the Sun's mode is that of compare.suns
        if group != "sun" and last in changes.get(group, {}):
            raise SettingError(f"compare.worlds.{name}: {mark.refusal(key, there)}")
    return made


def differences(
    then: Mapping[str, Any],
    now: Mapping[str, Any],
    but: Collection[str],
    words: tuple[str, str] = ("then", "now"),
) -> list[str]:
    """Return the keys in which two configurations differ, each with both values shortened.

    Parameters
    ----------
    then, now : mapping
        Plain data.
    but : collection of str
        Top-level keys to ignore.
    words : (str, str)
        Names of the two.

    Returns
    -------
    list of str
        Such as ``seed (then 1, now 2)``; a controller counts as one value.
    """

    def walk(one: Any, other: Any, key: str) -> Iterator[str]:
        if one == other:
            return
        if isinstance(one, Mapping) and isinstance(other, Mapping) and key != FREE:
            for name in sorted({*one, *other}):
                yield from walk(one.get(name), other.get(name), f"{key}.{name}" if key else name)
        else:
            yield f"{key} ({words[0]} {_short(one)}, {words[1]} {_short(other)})"

    first, second = (
        {key: value for key, value in config.items() if key not in but} for config in (then, now)
    )
    return list(walk(first, second, ""))


def _short(value: Any) -> str:
    text = " ".join(str(value).split())
    return text if len(text) <= MOST_SHOWN else f"{text[: MOST_SHOWN - 3]}..."
