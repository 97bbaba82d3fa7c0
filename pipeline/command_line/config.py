"""From overrides to a checked configuration: Hydra composes it, the schema judges it, in our words."""

import re
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, cast

from hydra import compose, initialize_config_dir
from hydra.conf import HydraConf
from hydra.core.config_store import ConfigStore
from hydra.core.global_hydra import GlobalHydra
from hydra.core.hydra_config import HydraConfig
from hydra.errors import HydraException, MissingConfigException
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import ConfigAttributeError, ConfigKeyError, OmegaConfBaseException
from yaml import YAMLError

from pipeline.command_line.arguments import EXPERIMENT, ConfigError
from pipeline.command_line.choices import HYDRA, options, top_of
from pipeline.command_line.overrides import first_line, parse, quoted
from pipeline.flight.state.signals import CONSTANTS
from pipeline.settings import start_table
from pipeline.settings.checks import SettingError
from pipeline.settings.experiment import Experiment
from pipeline.settings.keys import RENAMED, did_you_mean, leaves, value_at, with_values
from pipeline.settings.places import conf_folder
from pipeline.settings.schema import checked, completed, defaults, idle

#: the folder of configurations, the first of them, and the version of Hydra whose defaults count
COMPOSED_FROM: Final = (str(conf_folder()), "config", "1.3")
#: groups that flights do not depend on
NOT_FLOWN = ("compare", "assurance")
#: launchers of Hydra in packages of their own, which are named by the first word
LAUNCHERS = ("joblib", "submitit_local", "submitit_slurm")
#: what is said of these where they are not in the configuration
ABSENT = {
    "controller.path": "the controller that is chosen has no path; write controller=PATH",
    "controller.attributes": "attributes stand in its file; change one by +controller.attributes.NAME=...",
    "dispersions": "nothing is dispersed until you say so; write +dispersions..., with a plus",
    "tags": "a run has only the tags that you give it; write +tags..., with a plus",
    "extensions": "a stage of your own has the settings that you give; write +extensions..., with a plus",
    "hydra.launcher": "the launcher that is chosen has none; choose another, as hydra/launcher=joblib",
}


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
    given : frozenset of str
        The keys that its overrides set, alone or with their group.
    """

    config: dict[str, Any]
    experiment: Experiment
    folder: Path
    given: frozenset[str] = frozenset()


#: groups whose files set keys of others, and so begin with a line that says so
AT_THE_TOP: Final = (EXPERIMENT, "world")

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
    node = compose_node(overrides, [config_dir] if config_dir else [])
    return checked_job(node, node.hydra, Path(node.hydra.run.dir))


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
    paths = ",".join(quoted(folder.resolve().as_uri()) for folder in folders)
    has_path = any(text.startswith("hydra.searchpath") for text in overrides)
    words = [*overrides] if has_path else [*overrides, f"hydra.searchpath=[{paths}]"]
    folder, name, version = COMPOSED_FROM
    with errors_in_words(), hydra_apart(), initialize_config_dir(folder, version_base=version):
        return compose(name, words, return_hydra_config=True)


def checked_job(config: DictConfig, settings: Any, folder: Path) -> Job:
    """Resolve and check a composed configuration.

    Parameters
    ----------
    config : DictConfig
        With Hydra's own part, or without.
    settings : HydraConf
        Hydra's own part.
    folder : Path
        Of the run.

    Raises
    ------
    ConfigError, SettingError
        If a value is missing or not allowed, or an override sets a key that another setting makes idle.
    """
    words: list[str] = list(settings.overrides.task)
    folders = [Path(source.path) for source in settings.runtime.config_sources if source.schema == "file"]
    with errors_in_words():
        node = _without_hydra(config)
        _check_headers(node, words, folders)
        missing = sorted(OmegaConf.missing_keys(node))
        if "stages" in missing:
            names = ", ".join(options(folders)[EXPERIMENT])
            raise ConfigError(f"no experiment is chosen; add +experiment=NAME, where NAME is one of {names}")
        if missing:
            raise ConfigError(f"the key {missing[0]} has no value yet; add {missing[0]}=...")
        values = plain(node)
    start_table.read_starts(values)
    _expand_worlds(values, words, folders)
    pairs = (leaves({override.key_or_group: override.value()}, ()) for override in parse(words))
    given = frozenset(key for of_override in pairs for key, _ in of_override)
    whole, experiment, notes = checked(values, given)
    sys.stderr.writelines(f"note: {note}\n" for note in notes)
    return Job(whole, experiment, folder, given)


def _check_headers(node: DictConfig, words: Sequence[str], folders: Sequence[Path]) -> None:
    """Raise ConfigError if a file that was chosen lacks the line that puts its keys at the top."""
    for group in AT_THE_TOP:
        if group in node:
            names = [text.partition("=")[2] for text in words if text.lstrip("+").startswith(f"{group}=")]
            paths = [folder / group / f"{name}.yaml" for name in names for folder in folders]
            path = next((path for path in reversed(paths) if path.is_file()), f"the file of {group}")
            raise ConfigError(_lacks_header(path, group))


def _lacks_header(path: Path | str, group: str) -> str:
    return (
        f"{path} lacks the line `# @package _global_`, so that its keys went below {group} and not to the "
        "top of the configuration; make it the file's first line"
    )


def _without_hydra(node: DictConfig) -> DictConfig:
    """Return a configuration without Hydra's own part."""
    return OmegaConf.masked_copy(node, [str(key) for key in node if key != HYDRA]) if HYDRA in node else node


def plain(node: DictConfig, *, resolve: bool = True) -> dict[str, Any]:
    """Return a configuration without Hydra's own part as plain data."""
    return cast(dict[str, Any], OmegaConf.to_container(_without_hydra(node), resolve=resolve))


def check_stages(job: Job) -> None:
    """Print which overrides of a new run no stage of it reads.

    Raises
    ------
    SettingError
        If one means something else to the stages that there are.
    """
    unread = {key: mark for key, mark in idle(job.config, stages=True).items() if key in job.given}
    for key, mark in unread.items():
        if not mark.is_told:
            raise SettingError(mark.refusal(key, job.config))
    if unread:
        sys.stderr.write(f"note: no stage of this run reads {', '.join(unread)}\n")


def _expand_worlds(config: dict[str, Any], overrides: Sequence[str], folders: Sequence[Path]) -> None:
    """Replace the names of worlds and options in a comparison by the keys that they change.

    A world is the name of one, or changes of groups; a group in it may be the name of an option.
    """
    worlds = value_at(config, "compare.worlds")
    for name, given in worlds.items() if isinstance(worlds, dict) else ():
        changes = {"world": given} if isinstance(given, str) else given
        if not isinstance(changes, dict):
            continue
        chosen = {group: value for group, value in changes.items() if isinstance(value, str)}
        if chosen:
            kept = [text for text in overrides if text.partition("=")[0] not in chosen]
            words = [*kept, *(f"{group}={value}" for group, value in chosen.items())]
            here, there = completed(config), completed(plain(compose_node(words, folders)))
            differing = {key: value for key, value in leaves(there, ()) if value_at(here, key, ...) != value}
            others = {group: value for group, value in changes.items() if group not in chosen}
            flown = (item for item in differing.items() if top_of(item[0]) not in NOT_FLOWN)
            worlds[name] = with_values({}, dict(flown)) | others


@contextmanager
def errors_in_words() -> Iterator[None]:
    """Turn errors of Hydra, OmegaConf and YAML into ConfigError, with what may be meant."""
    try:
        yield
    except YAMLError as error:
        raise ConfigError(f"no YAML: {' '.join(str(error).split())}; correct the file") from error
    except MissingConfigException as error:
        raise ConfigError(f"{first_line(error)}{_nearest_option(error)}") from error
    except (HydraException, OmegaConfBaseException) as error:
        cause = error.__cause__ if isinstance(error, HydraException) else None
        if isinstance(cause, ConfigAttributeError | ConfigKeyError):
            raise ConfigError(_not_in_configuration(str(cause.full_key))) from error
        # what such a file overrides in its defaults list is sought below its group, too
        if astray := re.match(rf"In '(({'|'.join(AT_THE_TOP)})/[^']+)': .*@\2\.", str(error)):
            raise ConfigError(_lacks_header(f"{astray[1]}.yaml", astray[2])) from error
        errors = (error, cause) if isinstance(cause, OmegaConfBaseException) else (error,)
        raise ConfigError(": ".join(map(first_line, errors))) from error


def _nearest_option(error: MissingConfigException) -> str:
    """Return the option that may be meant, or how to install it."""
    group, _, name = (error.missing_cfg_file or "").rpartition("/")
    if group == "hydra/launcher" and name in LAUNCHERS:
        package = f"hydra-{name.partition('_')[0]}-launcher"
        return f"; it needs {package}, install it: python -m pip install {package}"
    return did_you_mean(f"{group}/{name}", [f"{group}/{option}" for option in error.options or ()])


def _not_in_configuration(key: str) -> str:
    """Return the cure for an override of a key that the configuration does not have."""
    top, name = top_of(key), key.removeprefix("controller.attributes.")
    if top == HYDRA:
        group, mark = key.rpartition("/" if "/" in key else ".")[:2]
        beside = OmegaConf.select(OmegaConf.create({HYDRA: HydraConf}), group.replace("/", "."))
        known = [f"{group}{mark}{name}" for name in beside] if OmegaConf.is_dict(beside) else []
        if likely := did_you_mean(key, known):
            return f"there is no key {key}{likely}"
    if name != key and name not in CONSTANTS:
        return f"the controller sets no attribute {name}{did_you_mean(name, CONSTANTS)}"
    if words := ABSENT.get(key) or ABSENT.get(key.rpartition(".")[0]) or ABSENT.get(top):
        return f"there is no key {key}: {words}"
    cure = f"it is {RENAMED[key]} now" if key in RENAMED else f"if something else reads it, write +{key}=..."
    return f"there is no key {key} in the configuration; {cure}"
