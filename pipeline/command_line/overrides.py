"""Overrides in Hydra's grammar: parsed, checked against the known keys and options, and expanded."""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import product

from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Glob, Override, OverrideType
from hydra.errors import HydraException

from pipeline.command_line.arguments import EXPERIMENT, ConfigError
from pipeline.settings.keys import KNOWN, choices_of, did_you_mean, is_key, nearest, renamed, unknown

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
#: Hydra's own keys that have an effect here
HYDRA_KEYS = ("hydra.run.dir", "hydra.searchpath", "hydra.sweep.dir", "hydra.sweep.subdir")

#: of a folder that is named by its run's differences
LONGEST_NAME = 120


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


def check_overrides(overrides: Sequence[Override], groups: Groups) -> None:
    """Raise ConfigError for unknown keys and options, with the nearest known one.

    Raises
    ------
    ConfigError
    """
    for override in overrides:
        key = override.key_or_group
        plain = (override.input_line or "").lstrip("+")
        if key.split("/")[0].split(".")[0] == "hydra":
            if key not in HYDRA_KEYS:
                raise ConfigError(f"there is no key {key}{did_you_mean(key, HYDRA_KEYS)}")
        elif key in groups and not isinstance(override.value(), dict):
            _check_choice(override, groups[key], plain)
        elif renamed(key) is not None:
            raise ConfigError(unknown(key))
        elif not is_key(key):
            found = nearest(key, {*KNOWN, *groups})
            plus = "+" if found == EXPERIMENT else ""
            raise ConfigError(f"there is no key {key}" + (f"; did you mean {plus}{found}?" if found else ""))
        elif override.type == OverrideType.ADD and key in KNOWN:
            raise ConfigError(f"the key {key} exists already; write {plain} without the +")


def _check_choice(override: Override, known: Sequence[str], plain: str) -> None:
    """Raise ConfigError for options that a group does not have."""
    group = override.key_or_group
    if override.type == OverrideType.DEL:
        return
    if group == EXPERIMENT and override.type == OverrideType.CHANGE:
        raise ConfigError(f"an experiment is added to what stands already: write +{plain}")
    if group != EXPERIMENT and override.type == OverrideType.ADD:
        raise ConfigError(f"{group} is chosen already; write {plain} without the +")
    for choice in _choices(override, known):
        if choice not in known:
            if group == CONTROLLER and choice.lower().endswith(TABLE_SUFFIX):
                raise ConfigError(
                    f"{group}={choice} is a table of forces, no fuzzy controller; write controller=open_loop "
                    f"controller.path={choice}"
                )
            raise ConfigError(f"there is no {group}={choice}{choices_of(choice, known)}")


def check_sweeps(overrides: Sequence[Override], is_multirun: bool) -> None:
    """Raise ConfigError for several values in a single run, and ranges without a step."""
    for override in overrides:
        text = override.input_line
        if override.is_sweep_override() and not is_multirun:
            raise ConfigError(
                f"{text} gives several values; add -m for a run of each, or write a list as key=[a,b] and a "
                "text with a comma in quotes of its own"
            )
        if override.is_sweep_override() and not override.is_discrete_sweep():
            raise ConfigError(
                f"{text} is an interval; a sweep needs its values, as in key=1,2 or key=range(1,3)"
            )


def single_runs(overrides: Sequence[Override], groups: Groups) -> Iterator[list[str]]:
    """Yield the overrides of each run of a sweep: every combination of values."""
    for chosen in product(*(_written(override, groups) for override in overrides)):
        yield list(chosen)


def differences_of(overrides: Sequence[Override], groups: Groups) -> list[dict[str, str]]:
    """Return for each run of a sweep, in the order of `single_runs`, its differences: key to value."""
    swept = [override for override in overrides if override.is_sweep_override()]
    # as they are typed: a path replaces its group, see `rewrite_paths`
    paths = {f"{group}.path": group for group in SUFFIXES}
    keys = [paths.get(override.key_or_group, override.key_or_group) for override in swept]
    values = [_choices(override, groups.get(override.key_or_group, ())) for override in swept]
    return [dict(zip(keys, chosen, strict=True)) for chosen in product(*values)]


def folder_names(differing: Sequence[Mapping[str, str]]) -> list[str]:
    """Return unique folder names for a sweep's runs by their differences, such as ``seed=1``."""
    names = []
    for number, differs in enumerate(differing):
        joined = "+".join(f"{key}={value.rsplit('/', 1)[-1]}" for key, value in differs.items())
        name = re.sub(r"[^\w.+=-]+", "-", joined) or str(number)
        if len(name) > LONGEST_NAME or name in names:
            name = f"{number}-{name[:LONGEST_NAME]}"
        names.append(name)
    return names


def _written(override: Override, groups: Groups) -> list[str]:
    """Return an override as text, once for each value of its sweep."""
    text = override.input_line or ""
    if not override.is_sweep_override():
        return [text]
    key = text.partition("=")[0]
    if isinstance(override.value(), Glob):
        return [f"{key}={name}" for name in _choices(override, groups.get(override.key_or_group, ()))]
    return [f"{key}={value}" for value in override.sweep_string_iterator()]


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
