"""The door: a command line in, a checked configuration out.

Hydra composes it. What Hydra would let pass, or refuse in words of its own, is checked here before any folder
is made: misspelled keys and options (also behind ``+`` and ``++``), missing choices, values that cannot be.
"""

import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, is_dataclass
from fnmatch import fnmatch
from pathlib import Path
from typing import Any, cast

from hydra import compose, initialize_config_dir
from hydra.conf import HydraConf
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Glob, Override, OverrideType
from hydra.errors import HydraException
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException
from yaml import YAMLError

from pipeline.settings.experiment import Experiment
from pipeline.settings.nearest import did_you_mean, nearest
from pipeline.settings.places import conf_folder
from pipeline.settings.schema import FREE, all_keys, experiment_from, is_key

CONFIG_NAME = "config"
EXPERIMENT = "experiment"
VERSION_BASE = "1.3"
CONTROLLER = "controller"
TABLE_SUFFIX = ".csv"
CONTROLLER_SUFFIXES = (".json", ".yaml", ".yml")
#: characters of a value in a message
MOST_SHOWN = 60


class ConfigError(ValueError):
    """A configuration that cannot be composed."""


@dataclass(frozen=True)
class Composed:
    """A configuration as plain data, resolved, and the experiment that it describes."""

    config: dict[str, Any]
    experiment: Experiment


def options(folders: Sequence[Path]) -> dict[str, list[str]]:
    """List the groups of some configuration folders and the options of each, hydra's own aside.

    Returns
    -------
    dict of str to list of str
        Group, such as ``controller`` or ``controller/champions``, to the sorted names of its options; a file
        in a group's subfolder is also an option ``subfolder/name`` of the group.
    """
    found: dict[str, set[str]] = {}
    for folder in folders:
        for path in sorted(folder.rglob("*.yaml")):
            parts = path.relative_to(folder).with_suffix("").parts
            for cut in range(1, len(parts)):
                found.setdefault("/".join(parts[:cut]), set()).add("/".join(parts[cut:]))
    return {group: sorted(names) for group, names in sorted(found.items()) if group.split("/")[0] != "hydra"}


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
                f"{text!r} cannot be read as key=value ({_first_line(error)}); put a value with commas, "
                "'=' or brackets into quotes of its own, as in 'key=\"a, b\"'"
            ) from error
    return parsed


def rewrite_controller_paths(overrides: Iterable[str]) -> list[str]:
    """Turn ``controller=PATH`` into ``controller=file controller.path=PATH``: a group cannot take a path.

    Several paths in a sweep, ``controller=a.json,b.json``, are rewritten together.

    Raises
    ------
    ConfigError
        If a sweep mixes paths and names.
    """
    rewritten = []
    for text in overrides:
        key, _, value = text.partition("=")
        paths = _controllers(text, value) if key == CONTROLLER else []
        are_paths = [path.lower().endswith(CONTROLLER_SUFFIXES) for path in paths]
        if not any(are_paths):
            rewritten.append(text)
        elif all(are_paths):
            rewritten += ["controller=file", "controller.path=" + ",".join(_quoted(path) for path in paths)]
        else:
            raise ConfigError(
                f"{text!r} mixes names and paths of controllers; sweep over one kind and then the other"
            )
    return rewritten


def _controllers(text: str, value: str) -> list[str]:
    """Split what ``controller=`` is set to; a path that is not Hydra's grammar stands for itself."""
    try:
        (override,) = parse([text])
    except ConfigError:
        return [value]
    if not override.is_sweep_override():
        return [str(override.value())]
    return [] if isinstance(override.value(), Glob) else _sweep_values(override)


def check_overrides(overrides: Sequence[Override], groups: Mapping[str, Sequence[str]]) -> None:
    """Refuse keys and options that do not exist, with the nearest that does.

    Raises
    ------
    ConfigError
        In a sentence.
    """
    for override in overrides:
        key = override.key_or_group
        plain = (override.input_line or "").lstrip("+")
        if key.split("/")[0].split(".")[0] == "hydra":
            _check_hydra_key(key)
        elif key in groups and not isinstance(override.value(), dict):
            _check_choice(override, groups[key], plain)
        elif not is_key(key):
            found = nearest(key, {*all_keys(), *groups})
            plus = "+" if found == EXPERIMENT else ""
            raise ConfigError(f"there is no key {key}" + (f"; did you mean {plus}{found}?" if found else ""))
        elif override.type == OverrideType.ADD and key in all_keys():
            raise ConfigError(f"the key {key} exists already; write {plain} without the +")


def _check_choice(override: Override, known: Sequence[str], plain: str) -> None:
    """Refuse options that a group does not have."""
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
            raise ConfigError(
                f"there is no {group}={choice}"
                + (f"{guess} The" if (guess := did_you_mean(choice, known)) else "; the")
                + f" choices are {', '.join(known)}"
            )


def _check_hydra_key(key: str) -> None:
    """Refuse keys that Hydra's own configuration does not have."""
    node = OmegaConf.structured(HydraConf)
    place = "hydra"
    for part in key.split(".")[1:]:
        if not isinstance(node, DictConfig) or not is_dataclass(OmegaConf.get_type(node)):
            return
        if part not in node.keys():  # noqa: SIM118 - `in` the node itself passes over keys without a value
            raise ConfigError(f"there is no key {key}{did_you_mean(part, map(str, node), f'{place}.')}")
        place = f"{place}.{part}"
        node = node._get_node(part)


def _choices(override: Override, known: Sequence[str]) -> list[str]:
    """Return all values that an override of a group takes, a sweep's one after the other."""
    value = override.value()
    if isinstance(value, Glob):
        return [name for name in known if any(fnmatch(name, pattern) for pattern in value.include)]
    if override.is_sweep_override():
        return _sweep_values(override)
    if isinstance(value, list):
        return [str(item) for item in value]
    return [] if value is None else [str(value)]


def _sweep_values(override: Override) -> list[str]:
    """Return the values of a sweep, without quotes and escapes."""
    return [str(parse([f"value={text}"])[0].value()) for text in override.sweep_string_iterator()]


def single_runs(overrides: Sequence[Override]) -> Iterator[list[str]]:
    """Yield override lists of single runs such that every value of every sweep is in one of them."""
    values = [_values(override) for override in overrides]
    first = [choices[0] for choices in values]
    yield first
    for index, choices in enumerate(values):
        for choice in choices[1:]:
            yield [*first[:index], choice, *first[index + 1 :]]


def _values(override: Override) -> list[str]:
    """Return an override once for each value of its sweep."""
    text = override.input_line or ""
    if not override.is_sweep_override() or isinstance(override.value(), Glob):
        return [text]
    key = text.partition("=")[0]
    return [f"{key}={value}" for value in override.sweep_string_iterator()]


def compose_experiment(overrides: Sequence[str], config_dir: Path | None = None) -> Composed:
    """Compose, resolve and check the configuration of one run.

    Parameters
    ----------
    overrides : sequence of str
        Of Hydra's grammar, without sweeps.
    config_dir : Path, optional
        A user's own folder of configurations.

    Raises
    ------
    ConfigError, SettingError
        In a sentence.
    """
    folders = [conf_folder(), *([config_dir] if config_dir else [])]
    searched = [*overrides]
    if config_dir and not any(text.startswith("hydra.searchpath") for text in overrides):
        searched.append(f"hydra.searchpath=[{_quoted(config_dir.resolve().as_uri())}]")
    try:
        with initialize_config_dir(str(conf_folder()), version_base=VERSION_BASE):
            composed = compose(CONFIG_NAME, overrides=searched)
        if missing := sorted(OmegaConf.missing_keys(composed)):
            raise ConfigError(_missing(missing, options(folders).get("experiment", [])))
        config = OmegaConf.to_container(composed, resolve=True)
    except YAMLError as error:
        raise ConfigError(f"no YAML: {' '.join(str(error).split())}; correct the file") from error
    except (HydraException, OmegaConfBaseException) as error:
        raise ConfigError(_in_words(error, folders)) from error
    plain = cast(dict[str, Any], config)
    return Composed(plain, experiment_from(plain))


def differences(then: Mapping[str, Any], now: Mapping[str, Any], but: Collection[str]) -> list[str]:
    """Name the keys in which two configurations differ, each with both values, in short.

    Parameters
    ----------
    then, now : mapping
        Plain data.
    but : collection of str
        Keys of the first level that do not count.

    Returns
    -------
    list of str
        Such as ``seed (then 1, now 2)``; a controller is one value.
    """

    def walk(one: Any, other: Any, key: str) -> Iterator[str]:
        if one == other:
            return
        if isinstance(one, Mapping) and isinstance(other, Mapping) and key != FREE:
            for name in sorted({*one, *other}):
                yield from walk(one.get(name), other.get(name), f"{key}.{name}" if key else name)
        else:
            yield f"{key} (then {_short(one)}, now {_short(other)})"

    first, second = (
        {key: value for key, value in config.items() if key not in but} for config in (then, now)
    )
    return list(walk(first, second, ""))


def _short(value: Any) -> str:
    text = " ".join(str(value).split())
    return text if len(text) <= MOST_SHOWN else f"{text[: MOST_SHOWN - 3]}..."


def _missing(keys: Sequence[str], experiments: Sequence[str]) -> str:
    """Say what has to be chosen."""
    if "stages" in keys:
        return f"no experiment is chosen; add +experiment=NAME, where NAME is one of {', '.join(experiments)}"
    return f"the key {keys[0]} has no value yet; add {keys[0]}=..."


def _in_words(error: Exception, folders: Sequence[Path]) -> str:
    """Turn an error of Hydra's or OmegaConf's into a sentence, with the nearest option for a missing one."""
    text = _first_line(error)
    if "'controller.path'" in text:
        return (
            "the controller that is chosen has no path; for a fuzzy controller write controller=PATH, for a "
            "table of forces controller=open_loop controller.path=PATH"
        )
    _, marker, rest = str(error).partition("Could not find '")
    if marker:
        wanted = rest.partition("'")[0]
        known = [f"{group}/{name}" for group, names in options(folders).items() for name in names]
        text = f"{text}{did_you_mean(wanted, known)}"
    return text


def _first_line(error: BaseException) -> str:
    return str(error).strip().splitlines()[0] if str(error).strip() else type(error).__name__


def _quoted(text: str) -> str:
    """Quote a value for Hydra's grammar, where a backslash counts only before a quote."""
    escaped = re.sub(r"(\\*)'", r"\1\1\\'", text)
    return "'" + re.sub(r"(\\+)$", r"\1\1", escaped) + "'"
