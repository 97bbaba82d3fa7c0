"""Overrides in Hydra's grammar: parsed, checked against the known keys and options, and expanded."""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import is_dataclass
from pathlib import Path
from typing import Any, get_type_hints

from hydra.conf import HydraConf
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Glob, Override, OverrideType
from hydra.errors import HydraException

from pipeline.command_line.arguments import EXPERIMENT, ConfigError
from pipeline.settings.keys import KNOWN, choices_of, did_you_mean, is_key, suggested
from pipeline.settings.places import conf_folder

#: groups of options, to the names of these
Groups = Mapping[str, Sequence[str]]
CONTROLLER = "controller"
TABLE_SUFFIX = ".csv"
#: endings of files that a group takes instead of an option, and the option that reads them
SUFFIXES = {
    CONTROLLER: {".json": "file", ".yaml": "file", ".yml": "file", ".onnx": "policy"},
    "starts": {TABLE_SUFFIX: "file"},
}
#: keys that name a folder
FOLDERS = ("hydra.run.dir", "hydra.sweep.dir")
HYDRA = "hydra"


def parse(overrides: Sequence[str]) -> list[Override]:
    """Parse overrides by Hydra's grammar.

    Raises
    ------
    ConfigError
        If one does not follow it.
    """
    parsed = []
    for text in overrides:
        try:
            parsed += OverridesParser.create().parse_overrides([text])
        except HydraException as error:
            raise ConfigError(
                f"{text!r} cannot be read as key=value ({first_line(error)}); put a value with commas, "
                "'=' or brackets into quotes of its own, as in 'key=\"a, b\"'"
            ) from error
    return parsed


def rewrite_paths(overrides: Iterable[str]) -> list[str]:
    """Turn ``controller=PATH`` into ``controller=file controller.path=PATH``: a group cannot take a path.

    Likewise ``starts=PATH``, and ``controller=policy`` for an ONNX file. A folder name that Hydra's grammar
    would split, such as ``seed=1``, is quoted. Several paths in a sweep,
    ``controller=a.json,b.json``, are rewritten together.

    Raises
    ------
    ConfigError
        If a sweep mixes paths and names.
    """
    rewritten = []
    for text in overrides:
        key, _, value = text.partition("=")
        paths = _values(text, value) if key in SUFFIXES else []
        readers = {_reader(key, path) for path in paths}
        if key in FOLDERS and "=" in value and value[:1] not in "'\"":
            rewritten.append(f"{key}={quoted(value)}")
        elif readers <= {None}:
            rewritten.append(text)
        elif len(readers) == 1:
            rewritten += [f"{key}={readers.pop()}", f"{key}.path=" + ",".join(quoted(path) for path in paths)]
        else:
            raise ConfigError(
                f"{text!r} mixes names and paths, or kinds of files; sweep over one kind and then the other"
            )
    return rewritten


def _reader(group: str, path: str) -> str | None:
    """Return the option of a group that reads a file; None if the file is not of its kind."""
    return next((option for end, option in SUFFIXES[group].items() if path.lower().endswith(end)), None)


def _values(text: str, value: str) -> list[str]:
    """Split the value of a group; a path that is not in Hydra's grammar is kept whole."""
    try:
        (override,) = parse([text])
    except ConfigError:
        return [value]
    return [] if isinstance(override.value(), Glob) else _choices(override, ())


def read_overrides(words: Sequence[str], groups: Groups, *, is_multirun: bool) -> list[Override]:
    """Parse and check the overrides of a command line, with paths rewritten.

    Raises
    ------
    ConfigError
    """
    overrides = parse(rewrite_paths(words))
    check_overrides(overrides, groups)
    check_sweeps(overrides, is_multirun)
    return overrides


def search_folders(overrides: Sequence[str]) -> list[Path]:
    """Return the folders that overrides add to Hydra's search path."""
    added = parse([text for text in overrides if text.startswith("hydra.searchpath=")])
    paths: list[str] = []
    for override in added:
        value = override.value()
        paths += map(str, value if isinstance(value, list) else [value])
    return [Path(path.removeprefix("file://")) for path in paths if not path.startswith("pkg://")]


def first_run(overrides: Sequence[Override], groups: Groups) -> list[str]:
    """Return the overrides of the first run of a sweep; of a single run all of them."""
    words = []
    for override in overrides:
        text = override.input_line or ""
        if override.is_sweep_override():
            is_glob = isinstance(override.value(), Glob)
            values = _choices(override, groups.get(override.key_or_group, ())) if is_glob else None
            text = f"{override.get_key_element()}={next(iter(values or override.sweep_string_iterator()))}"
        words.append(text)
    return words


def check_overrides(overrides: Sequence[Override], groups: Groups) -> None:
    """Raise ConfigError for unknown keys and options, with the nearest known one.

    Raises
    ------
    ConfigError
    """
    for override in overrides:
        key = override.key_or_group
        plain = (override.input_line or "").lstrip("+")
        if re.split("[./]", key, maxsplit=1)[0] == HYDRA:
            _check_hydra_key(key)
        elif key in groups and not isinstance(override.value(), dict):
            _check_choice(override, groups[key], plain)
        elif not is_key(key):
            likely = suggested(key, {*KNOWN, *groups})
            likely = f"+{likely}" if likely == EXPERIMENT else likely
            raise ConfigError(f"there is no key {key}" + (f"; did you mean {likely}?" if likely else ""))
        elif override.type == OverrideType.ADD and key in KNOWN:
            raise ConfigError(f"the key {key} exists already; write {plain} without the +")


def _check_choice(override: Override, known: Sequence[str], plain: str) -> None:
    """Raise ConfigError for options that a group does not have."""
    group = override.key_or_group
    if override.type == OverrideType.DEL:
        return
    # a group that ships has a choice by default, but for the experiment
    is_chosen = group != EXPERIMENT and (conf_folder() / group).is_dir()
    if not is_chosen and override.type == OverrideType.CHANGE:
        what = "an experiment" if group == EXPERIMENT else f"an option of {group}"
        raise ConfigError(f"{what} is added to what stands already: write +{plain}")
    if is_chosen and override.type == OverrideType.ADD:
        raise ConfigError(f"{group} is chosen already; write {plain} without the +")
    for choice in _choices(override, known):
        if choice not in known:
            if group == CONTROLLER and choice.lower().endswith(TABLE_SUFFIX):
                raise ConfigError(
                    f"{group}={choice} is a table of forces, no fuzzy controller; write controller=open_loop "
                    f"controller.path={choice}"
                )
            raise ConfigError(f"there is no {group}={choice}{choices_of(choice, known)}")


def _check_hydra_key(key: str) -> None:
    """Raise ConfigError for a key that the schema of Hydra's own configuration does not have."""
    node: Any = HydraConf
    for depth, name in enumerate(names := key.split(".")[1:]):
        if not is_dataclass(node):  # what a plugin or a callback has
            return
        hints = get_type_hints(node)
        if name not in hints:
            above = ".".join([HYDRA, *names[:depth]])
            near = {f"{above}.{known}" for known in hints}
            near |= {
                f"{HYDRA}.{group}.{last}"
                for group, kind in get_type_hints(HydraConf).items()
                if is_dataclass(kind)
                for last in get_type_hints(kind)
            }
            raise ConfigError(f"there is no key {key}{did_you_mean(key, near)}")
        node = hints[name]


def check_sweeps(overrides: Sequence[Override], is_multirun: bool) -> None:
    """Raise ConfigError for several values in a single run, ranges without a step, and several folders."""
    for override in overrides:
        text = override.input_line
        if not override.is_sweep_override():
            continue
        if not is_multirun:
            raise ConfigError(
                f"{text} gives several values; add -m for a run of each, or write a list as key=[a,b] and a "
                "text with a comma in quotes of its own"
            )
        if not override.is_discrete_sweep():
            raise ConfigError(
                f"{text} is an interval; a sweep needs its values, as in key=1,2 or key=range(1,3)"
            )
        if re.split("[./]", override.key_or_group, maxsplit=1)[0] == HYDRA:
            raise ConfigError(f"{text} gives several values, and a sweep has one; start a sweep for each")


def _choices(override: Override, known: Sequence[str]) -> list[str]:
    """Return all values that an override of a group takes, without quotes and escapes."""
    value = override.value()
    if isinstance(value, Glob):
        return value.filter(list(known))
    if override.is_sweep_override():
        return [str(parse([f"value={text}"])[0].value()) for text in override.sweep_string_iterator()]
    if isinstance(value, list):
        return [str(item) for item in value]
    return [] if value is None else [str(value)]


def quoted(text: str) -> str:
    """Quote a value for Hydra's grammar, where a backslash counts only before a quote."""
    escaped = re.sub(r"(\\*)'", r"\1\1\\'", text)
    return "'" + re.sub(r"(\\+)$", r"\1\1", escaped) + "'"


def first_line(error: BaseException) -> str:
    """Return the first line of an error's message."""
    return str(error).strip().splitlines()[0] if str(error).strip() else type(error).__name__
