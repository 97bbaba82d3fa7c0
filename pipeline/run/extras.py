"""Packages that only some settings need, and how to install them."""

from importlib.util import find_spec
from typing import Final

from pipeline.settings import plugged
from pipeline.settings.checks import SettingError
from pipeline.settings.experiment import Experiment

#: modules, to what installs them
PACKAGES: Final = {"optuna": "optuna", "tensorboardX": "tensorboardX tensorboard"}


def require_package(module: str, user: str) -> None:
    """Raise SettingError unless a module of `PACKAGES` is installed; `user` names what needs it."""
    if find_spec(module) is None:
        raise SettingError(
            f"{user} needs the package {module}; install it: python -m pip install {PACKAGES[module]}"
        )


def require_packages(experiment: Experiment) -> None:
    """Raise SettingError unless all packages that the stages of an experiment need are installed."""
    if "search" in experiment.stages:
        require_package("optuna", "the stage search")
    for stage in experiment.own_stages:
        plugged.function(plugged.STAGES, stage)
    logger = experiment.logger
    if "train" in experiment.stages and logger.is_own:
        plugged.function(plugged.LOGGERS, logger.kind)
    elif "train" in experiment.stages and logger.kind != "none":
        require_package("tensorboardX", f"logger={logger.kind}")
