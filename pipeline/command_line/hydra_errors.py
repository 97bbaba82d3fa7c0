"""Errors of Hydra, OmegaConf and YAML in our words."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from hydra.errors import HydraException, MissingConfigException
from omegaconf.errors import ConfigAttributeError, ConfigKeyError, OmegaConfBaseException
from yaml import YAMLError

from pipeline.command_line.arguments import ConfigError
from pipeline.command_line.groups import options
from pipeline.command_line.overrides import first_line
from pipeline.flight.state.signals import CONSTANTS
from pipeline.settings.keys import RENAMED, did_you_mean

#: launchers of Hydra that are packages of their own
LAUNCHERS = {
    "hydra/launcher/joblib": "hydra-joblib-launcher",
    "hydra/launcher/submitit_local": "hydra-submitit-launcher",
    "hydra/launcher/submitit_slurm": "hydra-submitit-launcher",
}


@contextmanager
def errors_in_words(folders: Sequence[Path]) -> Iterator[None]:
    """Turn errors of Hydra, OmegaConf and YAML into ConfigError, with the nearest option for a missing one.

    Parameters
    ----------
    folders : sequence of Path
        Configuration folders, ours and the user's.
    """
    try:
        yield
    except YAMLError as error:
        raise ConfigError(f"no YAML: {' '.join(str(error).split())}; correct the file") from error
    except MissingConfigException as error:
        raise ConfigError(f"{first_line(error)}{_nearest_option(error, folders)}") from error
    except (HydraException, OmegaConfBaseException) as error:
        cause = error if isinstance(error, OmegaConfBaseException) else error.__cause__
        is_missing = isinstance(cause, ConfigAttributeError | ConfigKeyError) and cause is not error
        words = (
            _not_in_configuration(str(getattr(cause, "full_key", ""))) if is_missing else first_line(error)
        )
        raise ConfigError(words) from error


def _nearest_option(error: MissingConfigException, folders: Sequence[Path]) -> str:
    """Return the option that may be meant, or how to install it."""
    wanted = error.missing_cfg_file or ""
    if package := LAUNCHERS.get(wanted):
        return f"; it needs {package}, install it: python -m pip install {package}"
    known = {f"{group}/{name}" for group, names in options(folders).items() for name in names}
    group = wanted.rpartition("/")[0]
    return did_you_mean(wanted, known | {f"{group}/{name}" for name in error.options or ()})


def _not_in_configuration(key: str) -> str:
    """Return the cure for an override of a key that the configuration does not have."""
    name = key.removeprefix("controller.attributes.")
    if key == "controller.path":
        return (
            "the controller that is chosen has no path; for a fuzzy controller write controller=PATH, for a "
            "table of forces controller=open_loop controller.path=PATH"
        )
    if key == "controller.attributes":
        return (
            "the attributes of this controller stand in its file; to give one another value write "
            "+controller.attributes.NAME=..., with a plus"
        )
    if name != key and name in CONSTANTS:
        return (
            f"{key} is not in the configuration: the controller's file sets it, or leaves it at its default; "
            f"write +{key}=..., with a plus"
        )
    if name != key:
        return f"the controller sets no attribute {name}{did_you_mean(name, CONSTANTS)}"
    if key.partition(".")[0] == "dispersions":
        return "nothing is dispersed until you say so; write +dispersions..., with a plus"
    cure = f"it is {RENAMED[key]} now" if key in RENAMED else f"if something else reads it, write +{key}=..."
    return f"there is no key {key} in the configuration; {cure}"
