"""Overrides in Hydra's grammar: parsed, and checked against the known keys and the options of groups."""

import os
from collections.abc import Collection, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, cast

from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Glob, Override, OverrideType, Quote, QuotedString
from hydra.errors import OverrideParseException

from pipeline.command_line.arguments import EXPERIMENT, FOLDERS, ConfigError, check_folder
from pipeline.command_line.choices import HYDRA, options, top_of
from pipeline.settings.keys import KNOWN, choices_of, did_you_mean, is_key
from pipeline.settings.places import conf_folder

#: groups of options, to the names of these
Groups = Mapping[str, Sequence[str]]
#: endings of files that a group takes instead of an option, and the option that reads them
SUFFIXES = {
    "controller": {".json": "file", ".yaml": "file", ".yml": "file", ".onnx": "policy", ".csv": "open_loop"},
    "starts": {".csv": "file"},
}
#: of a sweep, which checks all before any begins
MOST_RUNS = 10_000


def words_of(overrides: Iterable[Override]) -> list[str]:
    """Return overrides as they were written."""
    return [override.input_line or "" for override in overrides]


def parse(overrides: Iterable[str]) -> list[Override]:
    """Parse overrides by Hydra's grammar.

    Raises
    ------
    ConfigError
        If one does not follow it.
    """
    try:
        return OverridesParser.create().parse_overrides(list(overrides))
    except OverrideParseException as error:
        raise ConfigError(
            f"{error.override!r} cannot be read as key=value ({first_line(error)}); put a value with commas, "
            "'=', brackets or letters beyond ASCII into quotes of its own, as in 'key=\"a, b\"'"
        ) from error


def rewrite_paths(overrides: Iterable[str]) -> list[str]:
    """Turn ``controller=PATH`` into ``controller=file controller.path=PATH``: a group cannot take a path.

    Likewise for the other endings of `SUFFIXES`. A folder name that Hydra's grammar
    lacks, such as ``seed=1`` or ``Läufe``, is quoted. Several paths in a sweep,
    ``controller=a.json,b.json``, are rewritten together.

    Raises
    ------
    ConfigError
        If a sweep mixes paths and names.
    """
    rewritten = []
    for text in overrides:
        key, _, value = text.partition("=")
        endings, override = SUFFIXES.get(key, {}), _in_grammar(text)
        paths = _choices(override) if endings and override and not override.is_range_sweep() else [value]
        readers = {endings.get(Path(path.lower()).suffix) for path in paths}
        if key in FOLDERS and value[:1] not in "'\"" and override is None:
            rewritten.append(f"{key}={quoted(os.path.expanduser(value))}")
        elif readers <= {None}:
            rewritten.append(text)
        elif len(readers) == 1:
            rewritten += [f"{key}={readers.pop()}", f"{key}.path=" + ",".join(quoted(path) for path in paths)]
        else:
            raise ConfigError(f"{text!r} mixes names and paths, or kinds of files; sweep over each alone")
    return rewritten


def _in_grammar(text: str) -> Override | None:
    """Return an override, or None if it does not follow Hydra's grammar, as a path may not."""
    try:
        return parse([text])[0]
    except ConfigError:
        return None


def read_overrides(words: Sequence[str], folders: Sequence[Path], cure: str) -> list[Override]:
    """Parse and check the overrides of a command line, with paths rewritten.

    Parameters
    ----------
    words : sequence of str
    folders : sequence of Path
        Of configurations.
    cure : str
        What to do about several values of a key; "" where they are a sweep.

    Raises
    ------
    ConfigError
        For unknown keys and options, with the nearest known one, and for sweeps that cannot be.
    """
    overrides = parse(rewrite_paths(words))
    searched = [override for override in overrides if override.key_or_group == "hydra.searchpath"]
    paths = [path.removeprefix("file://") for override in searched for path in _choices(override)]
    added = [Path(path) for path in paths if "://" not in path]  # else in a package
    for folder in added:
        check_folder("hydra.searchpath", folder)
    groups = options([*folders, *added])
    for index, override in enumerate(overrides):
        if isinstance(value := override.value(), Glob):
            known = groups.get(override.key_or_group, ())
            if not (names := value.filter(list(known))):
                raise ConfigError(f"{override.input_line} matches none; the choices are {', '.join(known)}")
            overrides[index : index + 1] = parse([f"{override.get_key_element()}={','.join(names)}"])
    check_sweeps(overrides, cure)
    check_overrides(overrides, groups)
    varied = {override.key_or_group for override in overrides if override.is_sweep_override()}
    return parse(_of_each_run(override, varied) for override in overrides)


def _of_each_run(override: Override, varied: Collection[str]) -> str:
    """Return an override as text: as a choice of one value if it sets a key of a group that varies.

    Hydra composes a sweep first without what varies, and would look for the key in another option.
    """
    key, text = override.key_or_group, override.input_line or ""
    is_free = key not in {*KNOWN, *varied} and top_of(key) in varied and "${" not in text
    if not is_free or override.type != OverrideType.CHANGE or override.value() is None:
        return text
    return f"{key}=choice({text.partition('=')[2]})"


def check_overrides(overrides: Sequence[Override], groups: Groups) -> None:
    """Raise ConfigError for unknown keys and options, with the nearest known one; Hydra checks its own keys.

    Raises
    ------
    ConfigError
    """
    chosen = [override.input_line for override in overrides if override.key_or_group == EXPERIMENT]
    if len(chosen) > 1:
        raise ConfigError(f"{' and '.join(map(str, chosen))} are given; keep one")
    for override in overrides:
        key, plain = override.key_or_group, (override.input_line or "").lstrip("+")
        if key in groups and not isinstance(override.value(), dict):
            _check_choice(override, groups[key], plain)
        elif top_of(key) != HYDRA and not is_key(key):
            likely = did_you_mean(key, {*KNOWN, *groups}).replace(f" {EXPERIMENT}?", f" +{EXPERIMENT}?")
            raise ConfigError(f"there is no key {key or plain}{likely}")
        elif override.type == OverrideType.ADD and key in KNOWN:
            raise ConfigError(f"the key {key} exists already; write {plain} without the +")


def _check_choice(override: Override, known: Sequence[str], plain: str) -> None:
    """Raise ConfigError for options that a group does not have."""
    group = override.key_or_group
    # a group that ships has a choice by default, but for the experiment
    is_chosen = group != EXPERIMENT and (conf_folder() / group).is_dir()
    if not is_chosen and override.type == OverrideType.CHANGE:
        raise ConfigError(f"{group} has no choice yet; write +{plain}")
    if is_chosen and override.type == OverrideType.ADD:
        raise ConfigError(f"{group} is chosen already; write {plain} without the +")
    if isinstance(override.value(), list):
        raise ConfigError(f"{plain} gives a list; give one of {group}, or with -m several as {group}=a,b")
    for choice in _choices(override):
        if choice not in known and override.type != OverrideType.DEL:
            raise ConfigError(f"there is no {group}={choice}{choices_of(choice, known)}")


def check_sweeps(overrides: Sequence[Override], cure: str) -> None:
    """Raise ConfigError for several values in a single run, ranges without a step, and several folders.

    Also for too many runs, whose values are not listed.
    """
    count = 1.0
    for override in filter(Override.is_sweep_override, overrides):
        text, value = override.input_line, cast(Any, override.value())
        if cure:
            raise ConfigError(
                f"{text} gives several values; {cure}, or write a key's list as key=[a,b] and a text with a "
                "comma in quotes of its own"
            )
        length = override.is_range_sweep() and value.step and (value.stop - value.start) / value.step
        count *= len(value.list) if override.is_choice_sweep() else length
        if count > MOST_RUNS:
            raise ConfigError(f"with {text} these are {count:,.0f} runs; give at most {MOST_RUNS:,}")
        if not count > 0:  # as if a number of a range is none
            raise ConfigError(f"{text} is an interval, or empty; give values, as key=1,2 or key=range(1,3)")
        if top_of(override.key_or_group) == HYDRA:
            raise ConfigError(f"{text} gives several values, and a sweep takes one; start a sweep for each")


def _choices(override: Override) -> list[str]:
    """Return all values that an override of a group takes, without quotes and escapes."""
    value = override.value()
    if override.is_discrete_sweep() and not isinstance(value, Glob):
        return [str(parse([f"value={text}"])[0].value()) for text in override.sweep_string_iterator()]
    values = value if isinstance(value, list) else [value]
    return [str(item) for item in values if item is not None]


def quoted(text: str) -> str:
    """Quote a value for Hydra's grammar."""
    return QuotedString(text, Quote.single).with_quotes()


def first_line(error: BaseException) -> str:
    """Return the first line of an error's message."""
    return (str(error).strip() or type(error).__name__).splitlines()[0]
