"""From overrides to a checked configuration.

Hydra composes it; its errors are turned into sentences.
"""

import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

from hydra import compose, initialize_config_dir
from hydra.core.override_parser.types import OverrideType
from hydra.errors import HydraException
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException
from yaml import YAMLError

from pipeline.command_line.arguments import EXPERIMENT, ConfigError, folders_with
from pipeline.command_line.overrides import first_line, parse, quoted
from pipeline.flight.state.signals import CONSTANTS
from pipeline.settings import start_table
from pipeline.settings.checks import SettingError
from pipeline.settings.experiment import Experiment
from pipeline.settings.keys import did_you_mean, value_at
from pipeline.settings.places import conf_folder
from pipeline.settings.schema import completed, defaults, experiment_from, idle, schema

CONFIG_NAME = "config"
VERSION_BASE = "1.3"
WORLD, COMPARE, ASSURANCE = "world", "compare", "assurance"
#: folders of the configuration that are not groups of options: Hydra's own, and requirements, read by name
NOT_CHOSEN = ("hydra", "requirements")


@dataclass(frozen=True)
class Job:
    """A run to be started.

    Parameters
    ----------
    config : dict
        Plain data, resolved, without Hydra's own.
    experiment : Experiment
        The experiment it describes.
    folder : Path
        The run's folder.
    sweep_folder : Path
        That of the sweep that the run belongs to, if any.
    """

    config: dict[str, Any]
    experiment: Experiment
    folder: Path
    sweep_folder: Path


def options(folders: Sequence[Path]) -> dict[str, list[str]]:
    """Return the groups of some configuration folders and the options of each, without `NOT_CHOSEN`.

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
            # files whose names begin with _ hold what several options share
            if path.stem.startswith("_") or parts[0] in NOT_CHOSEN:
                continue
            for cut in range(1, len(parts)):
                found.setdefault("/".join(parts[:cut]), set()).add("/".join(parts[cut:]))
    return {group: sorted(names) for group, names in sorted(found.items())}


def compose_experiment(overrides: Sequence[str], config_dir: Path | None = None) -> Job:
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
    """
    return compose_jobs([overrides], config_dir)[0]


def compose_jobs(
    jobs: Sequence[Sequence[str]], config_dir: Path | None = None, names: Sequence[str] | None = None
) -> list[Job]:
    """Compose the configurations of several runs, see `compose_experiment`.

    Runs of a sweep have names, which become their folders inside the sweep's.

    Raises
    ------
    ConfigError, SettingError
    """
    composed: list[Job] = []
    first: DictConfig | None = None
    for index, overrides in enumerate(jobs):
        own = [f"hydra.job.num={index}", f"hydra.sweep.subdir={quoted(names[index])}"] if names else []
        node = compose_node([*own, *overrides], config_dir)
        first = first or node
        # resolvers such as `now` give all runs of a sweep the same value
        OmegaConf.copy_cache(first, node)
        config = _resolved(node, overrides, config_dir)
        together = Path(node.hydra.sweep.dir)
        folder = together / str(node.hydra.sweep.subdir) if names else Path(node.hydra.run.dir)
        composed.append(Job(config, experiment_from(config), folder, together))
    return composed


def compose_node(overrides: Sequence[str], config_dir: Path | None = None) -> DictConfig:
    """Compose a configuration with Hydra's own, even if values are missing, over all defaults.

    Raises
    ------
    ConfigError
    """
    searched = [*_forced(overrides)]
    if config_dir and not any(text.startswith("hydra.searchpath") for text in overrides):
        searched.append(f"hydra.searchpath=[{quoted(config_dir.resolve().as_uri())}]")
    try:
        with initialize_config_dir(str(conf_folder()), version_base=VERSION_BASE):
            node = compose(CONFIG_NAME, overrides=searched, return_hydra_config=True)
    except YAMLError as error:
        raise ConfigError(f"no YAML: {' '.join(str(error).split())}; correct the file") from error
    except (HydraException, OmegaConfBaseException) as error:
        raise ConfigError(_in_words(error, folders_with(config_dir))) from error
    return cast(DictConfig, OmegaConf.merge(OmegaConf.create(defaults()), node))


def _forced(overrides: Sequence[str]) -> Iterator[str]:
    """Let overrides set keys that have their default in the schema, and are in no file."""
    for override in parse(overrides):
        is_key = override.type == OverrideType.CHANGE and override.key_or_group in schema()
        yield f"{'++' if is_key else ''}{override.input_line}"


def job_of(node: DictConfig) -> DictConfig:
    """Return a configuration without Hydra's own."""
    return OmegaConf.masked_copy(node, [str(key) for key in node if key != "hydra"])


def _resolved(node: DictConfig, overrides: Sequence[str], config_dir: Path | None) -> dict[str, Any]:
    """Resolve the references of a configuration; return it without keys that do not exist.

    Raises
    ------
    ConfigError, SettingError
        If a value is missing, or an override sets a key that another setting makes idle.
    """
    folders = folders_with(config_dir)
    try:
        job = job_of(node)
        if missing := sorted(OmegaConf.missing_keys(job)):
            raise ConfigError(_missing(missing, options(folders).get(EXPERIMENT, [])))
        config = cast(dict[str, Any], OmegaConf.to_container(job, resolve=True))
    except (HydraException, OmegaConfBaseException) as error:
        raise ConfigError(_in_words(error, folders)) from error
    read_starts(config)
    _expand_worlds(config, overrides, config_dir)
    _check_idle(config, overrides)
    return completed(config)


def _check_idle(config: Mapping[str, Any], overrides: Sequence[str]) -> None:
    """Raise SettingError for overrides of keys that do not exist; print which keys of files do not."""
    given = _given(overrides)
    for key, mark in idle(config).items():
        if key not in schema() or key in given:
            raise SettingError(mark.refusal(key, config))
        # who overrides the setting that makes it idle knows
        is_known = any({other, other.rpartition(".")[0]} & given for other in mark.keys)
        if value_at(config, key) != schema()[key].default and not is_known:
            sys.stderr.write(f"note: a file sets {key}, but {mark.refusal(key, config)}\n")


def check_stages(config: Mapping[str, Any], overrides: Sequence[str]) -> None:
    """Print which overrides of a new run no stage of it reads.

    Raises
    ------
    SettingError
        If one means something else to the stages that there are.
    """
    given = _given(overrides)
    unread = {key: mark for key, mark in idle(config, stages=True).items() if key in given}
    for key, mark in unread.items():
        if not mark.is_told:
            raise SettingError(mark.refusal(key, config))
    if unread:
        sys.stderr.write(f"note: no stage of this run reads {', '.join(unread)}\n")


def _given(overrides: Sequence[str]) -> set[str]:
    """Return the keys that some overrides set, alone or with their group."""
    return {key for one in parse(overrides) for key in _keys_set(one.key_or_group, one.value())}


def _keys_set(key: str, value: Any) -> Iterator[str]:
    yield key
    for name, inside in value.items() if isinstance(value, dict) else ():
        yield from _keys_set(f"{key}.{name}", inside)


def _expand_worlds(config: dict[str, Any], overrides: Sequence[str], config_dir: Path | None) -> None:
    """Put what they change into the worlds of a comparison that are named by options.

    A world is the name of one, or changes of groups; a group in it may be the name of an option.
    """
    worlds = value_at(config, f"{COMPARE}.worlds")
    if not isinstance(worlds, dict):
        return
    for name, given in worlds.items():
        changes = {WORLD: given} if isinstance(given, str) else given
        if not isinstance(changes, dict):
            continue
        chosen = {group: value for group, value in changes.items() if isinstance(value, str)}
        if not chosen:
            continue
        kept = [text for text in overrides if text.partition("=")[0] not in chosen]
        there = compose_node([*kept, *(f"{group}={value}" for group, value in chosen.items())], config_dir)
        composed = cast(dict[str, Any], OmegaConf.to_container(job_of(there), resolve=True))
        changed = _differences(completed(config), completed(composed))
        worlds[name] = changed | {group: value for group, value in changes.items() if group not in chosen}


def _differences(here: Mapping[str, Any], there: Mapping[str, Any]) -> dict[str, Any]:
    """Return the keys, within their groups, whose values are others there, and on which flights depend."""
    found: dict[str, Any] = {}
    for name, value in there.items():
        if name not in here or (value != here[name] and not isinstance(value, dict)):
            found[name] = value
        elif value != here[name] and name not in (COMPARE, ASSURANCE):
            found[name] = _differences(here[name], value)
    return found


def read_starts(config: dict[str, Any]) -> None:
    """Put the starts of a file into a configuration that names one and does not contain them yet.

    Raises
    ------
    ConfigError, SettingError
        If the file cannot be read, or contains no starts.
    """
    starts, cases = config.get("starts"), config.get("monte_carlo")
    if not isinstance(starts, dict) or not isinstance(cases, dict) or starts.get("kind") != "file":
        return
    if starts.get("path") is None or starts.get("table") is not None:
        return
    path = Path(str(starts["path"]))
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, ValueError) as error:
        raise ConfigError(f"{path} cannot be read ({error}); give a CSV file of starts") from error
    starts["table"], cases["table"] = start_table.split(text, str(path))
    starts["num_cases"] = start_table.num_rows(starts["table"])
    cases["num_cases"] = start_table.num_rows(cases["table"])


def _missing(keys: Sequence[str], experiments: Sequence[str]) -> str:
    """Return a message naming the missing choices."""
    if "stages" in keys:
        return f"no experiment is chosen; add +experiment=NAME, where NAME is one of {', '.join(experiments)}"
    return f"the key {keys[0]} has no value yet; add {keys[0]}=..."


def _in_words(error: Exception, folders: Sequence[Path]) -> str:
    """Turn an error of Hydra or OmegaConf into a sentence, with the nearest option for a missing one."""
    text = first_line(error)
    if "'controller.path'" in text:
        return (
            "the controller that is chosen has no path; for a fuzzy controller write controller=PATH, for a "
            "table of forces controller=open_loop controller.path=PATH"
        )
    if attribute := text.partition("Could not override 'controller.attributes.")[2].rstrip("'."):
        if attribute in CONSTANTS:
            return (
                f"controller.attributes.{attribute} is not in the configuration: the controller's file sets "
                f"it, or leaves it at its default; write +controller.attributes.{attribute}=..., with a plus"
            )
        return f"the controller sets no attribute {attribute}{did_you_mean(attribute, CONSTANTS)}"
    if "Could not override 'dispersions." in text:
        return f"{text} Nothing is dispersed until you say so: write +dispersions..., with a plus"
    _, marker, rest = str(error).partition("Could not find '")
    if marker:
        wanted = rest.partition("'")[0]
        known = [f"{group}/{name}" for group, names in options(folders).items() for name in names]
        text = f"{text}{did_you_mean(wanted, known)}"
    return text
