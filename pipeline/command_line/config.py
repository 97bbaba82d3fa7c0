"""From overrides to a checked configuration.

Hydra composes it; its errors are turned into sentences.
"""

import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

from hydra import compose, initialize_config_dir
from hydra.conf import HydraConf
from hydra.core.config_store import ConfigStore
from hydra.core.global_hydra import GlobalHydra
from hydra.core.hydra_config import HydraConfig
from omegaconf import DictConfig, OmegaConf

from fis_tools.file_access import read_text
from pipeline.command_line.arguments import EXPERIMENT, ConfigError
from pipeline.command_line.groups import options
from pipeline.command_line.hydra_errors import errors_in_words
from pipeline.command_line.overrides import parse, quoted
from pipeline.settings import start_table
from pipeline.settings.checks import SettingError
from pipeline.settings.experiment import Experiment
from pipeline.settings.keys import value_at
from pipeline.settings.places import conf_folder
from pipeline.settings.schema import completed, defaults, experiment_from, idle, schema

CONFIG_NAME = "config"
VERSION_BASE = "1.3"
WORLD, COMPARE, ASSURANCE = "world", "compare", "assurance"


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
    """

    config: dict[str, Any]
    experiment: Experiment
    folder: Path


#: the defaults of all keys, as plain data: what a value may be is judged once all is composed
ConfigStore.instance().store(name="schema", node=defaults(), provider="pipeline")


def compose_experiment(overrides: Sequence[str], config_dir: Path | None = None) -> Job:
    """Compose, resolve and check the configuration of one run, from Python.

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
    folders = [config_dir] if config_dir else []
    node = compose_node(overrides, folders)
    return checked_job(without_hydra(node), overrides, Path(node.hydra.run.dir), folders)


@contextmanager
def hydra_apart() -> Iterator[None]:
    """Clear Hydra's global state within a block: runs nest, and notebooks use Hydra too."""
    used, config = GlobalHydra.instance().hydra, HydraConfig.instance().cfg
    GlobalHydra.instance().clear()
    try:
        yield
    finally:
        GlobalHydra.instance().hydra, HydraConfig.instance().cfg = used, config


def compose_node(overrides: Sequence[str], folders: Sequence[Path] = ()) -> DictConfig:
    """Compose a configuration with Hydra's own part, even if values are missing.

    Parameters
    ----------
    overrides : sequence of str
    folders : sequence of Path
        The user's folders of configurations.

    Raises
    ------
    ConfigError
    """
    words = [*overrides]
    if folders and not any(text.startswith("hydra.searchpath") for text in overrides):
        paths = ",".join(quoted(folder.resolve().as_uri()) for folder in folders)
        words.append(f"hydra.searchpath=[{paths}]")
    with (
        errors_in_words([conf_folder(), *folders]),
        hydra_apart(),
        initialize_config_dir(str(conf_folder()), version_base=VERSION_BASE),
    ):
        return compose(CONFIG_NAME, overrides=words, return_hydra_config=True)


def checked_job(config: DictConfig, overrides: Sequence[str], folder: Path, folders: Sequence[Path]) -> Job:
    """Resolve and check a composed configuration.

    Parameters
    ----------
    config : DictConfig
        Without Hydra's own part.
    overrides : sequence of str
        Those that it was composed with.
    folder : Path
        Of the run.
    folders : sequence of Path
        The user's folders of configurations.

    Raises
    ------
    ConfigError, SettingError
        If a value is missing or not allowed, or an override sets a key that another setting makes idle.
    """
    with errors_in_words([conf_folder(), *folders]):
        if missing := sorted(OmegaConf.missing_keys(config)):
            experiments = options([conf_folder(), *folders]).get(EXPERIMENT, [])
            raise ConfigError(_missing(missing, experiments))
        plain = cast(dict[str, Any], OmegaConf.to_container(config, resolve=True))
    read_starts(plain)
    _expand_worlds(plain, overrides, folders)
    _check_idle(plain, overrides)
    plain = completed(plain)
    return Job(plain, experiment_from(plain), folder)


def folders_of(settings: HydraConf) -> list[Path]:
    """Return the user's folders that Hydra has composed a configuration from."""
    paths = [Path(source.path) for source in settings.runtime.config_sources if source.schema == "file"]
    return [path for path in paths if path != conf_folder()]


def check_working_directory(settings: HydraConf, job: Job) -> None:
    """Raise ConfigError if a run works in its own folder, and would not find a file that it names."""
    starts = job.config.get("starts") or {}
    for group, settings_of_group in (("controller", job.config["controller"]), ("starts", starts)):
        path = settings_of_group.get("path")
        if settings.job.chdir and path is not None and not Path(str(path)).is_absolute():
            raise ConfigError(
                f"{group}.path is {path}, and with hydra.job.chdir=true the run works in its "
                "own folder; give an absolute path"
            )


def without_hydra(node: DictConfig) -> DictConfig:
    """Return a configuration without Hydra's own part."""
    return OmegaConf.masked_copy(node, [str(key) for key in node if key != "hydra"])


def _check_idle(config: Mapping[str, Any], overrides: Sequence[str]) -> None:
    """Raise SettingError for overrides without effect; print which keys of files have none."""
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
    return {
        key for override in parse(overrides) for key in _keys_set(override.key_or_group, override.value())
    }


def _keys_set(key: str, value: Any) -> Iterator[str]:
    yield key
    for name, inside in value.items() if isinstance(value, dict) else ():
        yield from _keys_set(f"{key}.{name}", inside)


def _expand_worlds(config: dict[str, Any], overrides: Sequence[str], folders: Sequence[Path]) -> None:
    """Replace the names of worlds and options in a comparison by the keys that they change.

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
        there = compose_node([*kept, *(f"{group}={value}" for group, value in chosen.items())], folders)
        composed = cast(dict[str, Any], OmegaConf.to_container(without_hydra(there), resolve=True))
        changed = _differences(completed(config), completed(composed))
        worlds[name] = changed | {group: value for group, value in changes.items() if group not in chosen}


def _differences(here: Mapping[str, Any], there: Mapping[str, Any]) -> dict[str, Any]:
    """Return the keys that flights depend on and whose values differ, in their groups."""
    changes: dict[str, Any] = {}
    for name, value in there.items():
        if name not in here or (value != here[name] and not isinstance(value, dict)):
            changes[name] = value
        elif value != here[name] and name not in (COMPARE, ASSURANCE):
            changes[name] = _differences(here[name], value)
    return changes


def read_starts(config: dict[str, Any]) -> None:
    """Load the starts that a configuration names as a file into it, unless it has them.

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
        text = read_text(path, encoding="utf-8-sig")
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
