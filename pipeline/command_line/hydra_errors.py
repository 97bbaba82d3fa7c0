"""Errors of Hydra, OmegaConf and YAML in our words."""

from collections.abc import Iterator
from contextlib import contextmanager
from itertools import accumulate
from typing import Any, cast

from hydra.conf import HydraConf
from hydra.errors import HydraException, MissingConfigException
from omegaconf import OmegaConf
from omegaconf.errors import ConfigAttributeError, ConfigKeyError, OmegaConfBaseException
from yaml import YAMLError

from pipeline.command_line.arguments import ConfigError
from pipeline.command_line.overrides import HYDRA, first_line, top_of
from pipeline.flight.state.signals import CONSTANTS
from pipeline.settings.keys import RENAMED, did_you_mean, leaves

#: launchers of Hydra that are packages of their own
LAUNCHERS = {
    "hydra/launcher/joblib": "hydra-joblib-launcher",
    "hydra/launcher/submitit_local": "hydra-submitit-launcher",
    "hydra/launcher/submitit_slurm": "hydra-submitit-launcher",
}
#: what is said of these where they are not in the configuration
ABSENT = {
    "controller.path": "the controller that is chosen has no path; for a fuzzy controller write "
    "controller=PATH, for a table of forces controller=open_loop controller.path=PATH",
    "controller.attributes": "the attributes of this controller stand in its file; to give one another value "
    "write +controller.attributes.NAME=..., with a plus",
    "dispersions": "nothing is dispersed until you say so; write +dispersions..., with a plus",
}


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
        is_missing = isinstance(cause, ConfigAttributeError | ConfigKeyError)
        key = str(getattr(cause, "full_key", ""))
        words = _not_in_configuration(key) if is_missing else first_line(error)
        raise ConfigError(words) from error


def _nearest_option(error: MissingConfigException) -> str:
    """Return the option that may be meant, or how to install it."""
    wanted = error.missing_cfg_file or ""
    if package := LAUNCHERS.get(wanted):
        return f"; it needs {package}, install it: python -m pip install {package}"
    group = wanted.rpartition("/")[0]
    return did_you_mean(wanted, [f"{group}/{name}" for name in error.options or ()])


def _not_in_configuration(key: str) -> str:
    """Return the cure for an override of a key that the configuration does not have."""
    top, name = top_of(key), key.removeprefix("controller.attributes.")
    if top == HYDRA:
        mark = "/" if "/" in key else "."
        leaf_keys = leaves(cast(dict[str, Any], OmegaConf.to_container(OmegaConf.structured(HydraConf))), ())
        known = {
            f"{HYDRA}.{part}" for leaf, _ in leaf_keys for part in accumulate(leaf.split("."), "{}.{}".format)
        }
        beside = {each for each in known if each.rpartition(".")[0] == key.rpartition(mark)[0]}
        if likely := did_you_mean(key, {each.replace(".", mark) for each in beside}):
            return f"there is no key {key}{likely}"
    if words := ABSENT.get(key) or ABSENT.get(top):
        return words
    if name != key and name in CONSTANTS:
        return (
            f"{key} is not in the configuration: the controller's file sets it, or leaves it at its default; "
            f"write +{key}=..., with a plus"
        )
    if name != key:
        return f"the controller sets no attribute {name}{did_you_mean(name, CONSTANTS)}"
    cure = f"it is {RENAMED[key]} now" if key in RENAMED else f"if something else reads it, write +{key}=..."
    return f"there is no key {key} in the configuration; {cure}"
