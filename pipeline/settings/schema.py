"""The schema: every key of the configuration, what is written about it, and experiments from plain data.

Settings that no result depends on belong to the command that gives them, and may be given to a resumed run.

The tables on the site, the help on a group, and comments in YAML come from the classes of settings: a key's
meaning is the text below its field, which pydantic keeps, and its range is in the field's type.
"""

import inspect
import math
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import MISSING, asdict, dataclass, fields, is_dataclass, replace
from functools import cache
from typing import Any, Final, get_type_hints

import yaml
from pydantic import TypeAdapter

from fis_tools.errors import nearest
from pipeline.settings import checks, keys, sizes
from pipeline.settings.checks import SettingError
from pipeline.settings.conditions import Only
from pipeline.settings.controllers import PLANNED
from pipeline.settings.dispersions import IN_TIME
from pipeline.settings.experiment import Experiment, Mission
from pipeline.settings.following import OF_EPOCH, following
from pipeline.settings.groups import GROUPS, conditions_of, descendants_of, names_of, texts_of
from pipeline.settings.mission import SHARED
from pipeline.settings.stages import STAGES
from pipeline.settings.training import dimensions
from pipeline.settings.types import Follows, Freely

#: characters of a value in a message
MOST_SHOWN = 60
#: names of lower and upper limits in descriptions of types, where the first two exclude the limit itself
LIMITS = (("gt", "exclusiveMinimum", "ge", "minimum"), ("lt", "exclusiveMaximum", "le", "maximum"))
#: a configuration, or a group of it, as plain data
Config = Mapping[str, Any]
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

    def exists(self, config: Config) -> bool:
        """Return whether it is part of a configuration, whatever the stages."""
        return all(mark.is_of_stages or mark.holds(config) for mark in self.only)


@cache
def schema() -> dict[str, Key]:
    """Return every key by its dotted name, except those of controllers: those at the top before groups."""
    order = ["", *names_of(Mission), *names_of(Experiment)]
    groups = [entry for entry in GROUPS if entry[0] != keys.FREE]
    groups.sort(key=lambda entry: (order.index(entry[0].partition(".")[0]), entry[1] is Mission))
    return {key.name: key for group, kind, only in groups for key in keys_of(group, kind, only)}


def keys_of(group: str, kind: Any, only: Only | None = None) -> Iterator[Key]:
    """Yield the keys of a class of settings and of its variants, without those that are groups."""
    met: set[str] = set()
    for owner in (kind, *descendants_of(kind)):
        hints, names = get_type_hints(owner, include_extras=True), names_of(owner)
        for field in fields(owner):
            hint, name = hints[field.name], keys.dotted(group, (field.name,))
            is_group = field.name == keys.FREE or is_dataclass(hint)
            if field.name in met or field.name not in names or is_group:
                continue
            met.add(field.name)
            default = field.default if field.default_factory is MISSING else field.default_factory()
            marks = [only] if only and name not in only.keys else []
            metadata = getattr(hint, "__metadata__", ())
            marks += conditions_of(kind, field.name)
            marks += [mark for mark in metadata if isinstance(mark, Only)]
            if any(isinstance(mark, Follows) for mark in metadata):
                default = None
            yield Key(name, hint, _plain(default), tuple(marks))


def _plain(value: Any) -> Any:
    """Return a value with lists for tuples, as YAML has them."""
    return [_plain(item) for item in value] if isinstance(value, tuple) else value


def defaults() -> dict[str, Any]:
    """Return the default of every key, also of keys that do not exist in the default configuration."""
    given = {key.name: key.default for key in schema().values() if key.default is not MISSING}
    return keys.with_values({}, given)


def check_tried(config: Config, tried: Iterable[str]) -> None:
    """Check that each key that a search tries is in the configuration.

    Raises
    ------
    SettingError
        If one is not; it names the condition that is not met, or the key that may be meant.
    """
    for key in tried:
        if keys.value_at(config, key, ABSENT) is not ABSENT:
            continue
        marks = schema()[key].only if key in schema() else ()
        if unmet := next((mark for mark in marks if not mark.holds(config)), None):
            raise SettingError(f"{keys.SPACE}: {unmet.refusal(key, config)}")
        group = key
        while group and not isinstance(keys.value_at(config, group), Mapping):
            group = group.rpartition(".")[0]
        node = keys.value_at(config, group)
        # names that are compared begin below the group, whose name they share
        near = nearest(key.removeprefix(f"{group}."), [name for name, _ in keys.leaves(node, ())])
        cure = (
            f"did you mean {f'{group}.{near}'.lstrip('.')}?"
            if near
            else f"the keys there are {', '.join(node)}"
        )
        raise SettingError(f"{keys.SPACE}.{key} is no key of this experiment; {cure}")


def completed(config: Config) -> dict[str, Any]:
    """Return a configuration with missing defaults filled in, without keys that do not exist in it."""
    absent = (key for key in schema().values() if keys.value_at(config, key.name, ABSENT) is ABSENT)
    whole = keys.with_values(config, {key.name: key.default for key in absent if key.default is not MISSING})
    whole = keys.without(whole, [key.name for key in schema().values() if not key.exists(whole)])
    return keys.with_values(whole, following(whole))


def present(config: Config) -> dict[str, Any]:
    """Return a configuration, perhaps of an earlier version, under present names and `completed`."""
    return completed(keys.without(keys.in_todays_words(config), keys.GONE))


def idle(config: Config, *, stages: bool = False) -> dict[str, Only]:
    """Return the keys that are set or dispersed but do not exist, each with the condition that fails.

    Parameters
    ----------
    config : mapping
        Plain data with all keys.
    stages : bool
        Whether also those that no stage of the run reads.
    """
    unmet: dict[str, Only] = {}
    # what stages of one's own read is not known
    stages = stages and set(config.get("stages", ())) <= set(STAGES)
    set_here = {name: name for name in schema() if keys.value_at(config, name, ABSENT) is not ABSENT}
    given = config.get(keys.DISPERSIONS)
    spread = given if isinstance(given, Mapping) else {}
    dispersed = {f"{keys.DISPERSIONS}.{name}": name for name, _ in keys.leaves(spread, ("kind",))}
    for key, name in (set_here | dispersed).items():
        for mark in schema()[name].only if name in schema() else ():
            if (stages or not mark.is_of_stages) and not mark.holds(config):
                unmet.setdefault(key, mark)
    return unmet


def checked(config: Config, given: Collection[str]) -> tuple[dict[str, Any], Experiment, list[str]]:
    """Return a composed configuration `completed`, its experiment, and notes on keys without effect.

    Parameters
    ----------
    config : mapping
        Plain data, resolved.
    given : collection of str
        The keys that the user sets, alone or with their group.

    Raises
    ------
    SettingError
        If one of these is idle, or a value is not allowed.
    """
    notes = []
    for key, mark in idle(config).items():
        if key not in schema() or key in given:
            raise SettingError(mark.refusal(key, config))
        # who sets the key that makes it idle knows
        is_known = any(other in given or other.rpartition(".")[0] in given for other in mark.keys)
        if keys.value_at(config, key) != schema()[key].default and not is_known:
            notes.append(f"a file sets {key}, but {mark.refusal(key, config)}")
    whole = completed(config)
    return whole, _experiment(whole), notes


def experiment_from(config: Config) -> Experiment:
    """Build an experiment from a resolved configuration of plain data.

    Raises
    ------
    SettingError
        If a key is unknown or missing, or a value has the wrong type or is not allowed. Keys of earlier
        versions are read if today's are missing, and those that do not exist are passed over.
    """
    return _experiment(present(config))


def _experiment(config: Config) -> Experiment:
    of_experiment, of_mission = names_of(Experiment), names_of(Mission)
    for name in config:
        if name not in of_experiment and name not in of_mission:
            raise SettingError(keys.unknown(name))
    mission = Mission(**{name: config[name] for name in of_mission if name in config})
    experiment = Experiment(
        mission=mission, **{name: config[name] for name in of_experiment if name in config}
    )
    if "search" in experiment.stages:
        check_tried(config, [each.key for each in dimensions(experiment.hparams_search.space)])
    return experiment


@cache
def free_keys() -> tuple[str, ...]:
    """Return the dotted keys of the configuration that no result depends on."""
    marks = {key.name: getattr(key.hint, "__metadata__", ()) for key in schema().values()}
    return tuple(name for name, given in marks.items() if any(isinstance(mark, Freely) for mark in given))


def only_results(config: Config) -> dict[str, Any]:
    """Return a configuration without the settings that no result depends on."""
    of_others = (key for key in keys.GONE if not key.startswith("optimizer."))
    counted = keys.without(keys.in_todays_words(config), [*free_keys(), *of_others])
    counted.pop(keys.TAGS, None)
    return counted


def in_world(experiment: Experiment, name: str) -> Experiment:
    """Return an experiment moved to one of the worlds of ``compare.worlds``; "" changes nothing.

    Raises
    ------
    SettingError
        If the world changes keys that are not part of a world, or sets a value that is not allowed.
    """
    changes = experiment.compare.worlds.get(name, {})
    there: dict[str, Any] = asdict(experiment.mission) | {"sun": asdict(experiment.sun)}
    for group, values in changes.items():
        current = there.get(group)
        there[group] = current | values if isinstance(current, dict) and isinstance(values, dict) else values
    if there["orbit"].get("epoch") is not None and "orbit" in changes:
        unset = {key: None for key in OF_EPOCH if keys.value_at(changes, key) is None}
        there = keys.with_values(there, unset)
        there = keys.with_values(there, following(keys.without(there, idle(there))))
    unmet = idle(there)
    for key, mark in unmet.items():
        group, _, last = key.rpartition(".")
        # the Sun's mode is that of compare.suns
        if group != "sun" and last in changes.get(group, {}):
            raise SettingError(f"compare.worlds.{name}: {mark.refusal(key, there)}")
    parts = keys.without(there, unmet)
    try:
        return replace(experiment, sun=parts.pop("sun"), mission=Mission(**parts))
    except SettingError as error:
        raise SettingError(f"compare.worlds.{name}: {error}") from error


def differences(
    then: Config, now: Config, but: Collection[str], words: tuple[str, str] = ("then", "now")
) -> list[str]:
    """Return the keys in which two configurations differ, with both values, shortened.

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
        Such as ``seed (then 1, now 2)``; a controller counts as one value, told by its name if that differs.
    """

    def flat(config: Config) -> dict[str, Any]:
        counted = {name: value for name, value in config.items() if name not in (*but, keys.FREE)}
        controller = {keys.FREE: config.get(keys.FREE)} if keys.FREE not in but else {}
        return controller | dict(keys.leaves(counted, ()))

    first, second = flat(then), flat(now)
    values = {key: _by_name(first.get(key), second.get(key)) for key in sorted({*first, *second})}
    return [
        f"{key} ({words[0]} {_short(before)}, {words[1]} {_short(after)})"
        for key, (before, after) in values.items()
        if before != after
    ]


def _by_name(before: Any, after: Any) -> tuple[Any, Any]:
    if isinstance(before, Mapping) and isinstance(after, Mapping):
        names = before.get("name"), after.get("name")
        return names if all(names) and names[0] != names[1] else (before, after)
    return before, after


def _short(value: Any) -> str:
    text = " ".join(str(value).split())
    return text if len(text) <= MOST_SHOWN else f"{text[: MOST_SHOWN - 3]}..."


def tables() -> dict[str, list[Key]]:
    """Return the keys of each group as the page of keys lists them; "" for those at the top."""
    sections: dict[str, list[Key]] = {"": []}
    for key in schema().values():
        sections.setdefault(key.name.rpartition(".")[0], []).append(key)
    for name, kind in PLANNED.items():
        sections[f"{keys.FREE} ({name})"] = list(keys_of(keys.FREE, kind))
    return sections


def rows_of(group: str, shown: list[Key]) -> Iterator[tuple[str, str, str, str]]:
    """Yield the name, default, range and meaning of each key of a group."""
    for key in shown:
        name, unit = key.name.rpartition(".")[2], keys.unit_of(key.name).symbol
        default = "" if key.default is MISSING else f"`{as_yaml(key.default)}` {unit}".strip()
        conditions = [mark for mark in key.only if not mark.is_of_stages and mark != of_group(group)]
        meaning = descriptions().get(f"{group}.{name}".lstrip("."), "")
        only = f" Only with {in_code(conditions)}." if conditions else ""
        yield f"`{name}`{marks_of(key)}", default, range_of(key), meaning + only


def of_group(group: str) -> Only | None:
    """Return the condition that holds for all keys of a group."""
    table = tables()[group] if group else []
    marks = (mark for key in table for mark in key.only)
    return next(
        (mark for mark in marks if all(mark in key.only or key.name in mark.keys for key in table)), None
    )


def in_code(marks: list[Only]) -> str:
    """Return conditions in Markdown; of further alternatives for one key the values alone."""
    return ", and ".join(_alternatives(str(mark).split(" or ")) for mark in marks)


def _alternatives(words: list[str]) -> str:
    shown, key = [], ""
    for word in words:
        name, _, value = word.partition("=")
        shown.append(f"`{value if value and name == key else word}`")
        key = name
    *others, last = shown
    return f"{', '.join(others)} or {last}" if others else last


def marks_of(key: Key) -> str:
    """Return the mark **d** for a key that may be dispersed, **t** for one that may also vary in time."""
    top = key.name.partition(".")[0]
    if top not in names_of(Mission) or not isinstance(key.default, float) or key.name in SHARED:
        return ""
    return " **t**" if key.name in IN_TIME else " **d**"


def range_of(key: Key) -> str:
    """Return the values that a key may have, as pydantic's JSON schema of its type says."""
    described = TypeAdapter(key.hint).json_schema()
    described = described.get("anyOf", [described])[0]
    kind, words = described.get("type"), ""
    low, high = (next((described[name] for name in names if name in described), None) for names in LIMITS)
    if choices := described.get("enum", {"boolean": ("true", "false")}.get(kind)):
        words = ", ".join(f"`{choice}`" for choice in choices)
    elif high is not None and (kind != "integer" or high < sizes.MOST):
        words = checks.expected(low, high)
    elif low is not None:
        words = "greater than 0" if described.keys() & LIMITS[0][:2] else checks.expected(low, math.inf)
    return f"whole, {words}".removesuffix(", ") if kind == "integer" else words


def as_yaml(value: Any) -> str:
    """Return a value on one line, as YAML writes it."""
    text = yaml.safe_dump(value, default_flow_style=True, width=math.inf, allow_unicode=True)
    return text.removesuffix("\n").removesuffix("\n...")


def help_on(group: str) -> str:
    """Return the keys of a group, or one key, with defaults and meanings; nothing if there is none."""
    lines = []
    for name, table in tables().items():
        shown = [key for key in table if f"{key.name}.".startswith(f"{group}.")]
        lines += [f"{name}: {descriptions()[name]}"] if shown and name else []
        for key, (_, default, values, meaning) in zip(shown, rows_of(name, shown), strict=True):
            lines += [f"  {key.name}={default}", f"      {meaning}{f' ({values})' if values else ''}"]
    return "\n".join(lines).replace("`", "")


def commented(config: Config) -> str:
    """Return a configuration as YAML, with the meaning of each key above it."""
    return "\n".join(_commented(config, "", "")) + "\n"


def _commented(node: Config, above: str, indent: str) -> Iterator[str]:
    for name, value in node.items():
        key = f"{above}{name}"
        is_group = isinstance(value, dict) and value and key not in schema()
        if meaning := descriptions().get(key):
            yield f"{indent}# {meaning}{'' if is_group else checks.in_unit(keys.unit_of(key).symbol)}"
        if is_group and key != keys.FREE:
            yield f"{indent}{name}:"
            yield from _commented(value, f"{key}.", f"{indent}  ")
        elif key == keys.FREE:
            text = yaml.safe_dump({name: value}, sort_keys=False, allow_unicode=True, width=110)
            yield from text.splitlines()
        else:
            yield f"{indent}{name}: {as_yaml(value)}"


@cache
def descriptions() -> dict[str, str]:
    """Return the meaning of each key, and of each group: the text below its field or class."""
    texts: dict[str, str] = {}
    # controllers that plan have a group each
    planned = ((f"{keys.FREE} ({name})", kind) for name, kind in PLANNED.items())
    groups = ((group, kind) for group, kind, _ in GROUPS if group != keys.FREE)
    for group, kind in (*planned, *groups):
        prefix = f"{group}." if group else ""
        texts[group] = (inspect.getdoc(kind) or "").partition("\n")[0]
        for owner in (kind, *descendants_of(kind)):
            for name, text in texts_of(owner).items():
                texts.setdefault(prefix + name, text)
    return texts
