"""What the runs of a sweep differ in, by what was composed, and the names of their folders."""

import re
from collections.abc import Sequence
from typing import Final

from omegaconf import DictConfig, OmegaConf

from pipeline.command_line.arguments import ConfigError
from pipeline.command_line.overrides import SUFFIXES
from pipeline.run.sweep import SweptRun

#: of a folder that is named by its run's differences
LONGEST_NAME: Final = 120


def labels(node: DictConfig, varied: Sequence[str]) -> dict[str, str]:
    """Return the composed values of the keys and groups that vary in a sweep.

    Parameters
    ----------
    node : DictConfig
        With Hydra's own part.
    varied : sequence of str
        The keys and groups of overrides with several values; a path stands for its group.
    """
    choices, values = node.hydra.runtime.choices, {}
    paths = {f"{group}.path": group for group in SUFFIXES}
    for word in varied:
        key = word.lstrip("+~").partition("@")[0]
        value = choices[key] if key in choices else OmegaConf.select(node, key)
        plain = OmegaConf.to_container(value) if OmegaConf.is_config(value) else value
        values[paths.get(key, key)] = str(plain)
    return values


def check_different(swept: Sequence[SweptRun]) -> None:
    """Raise ConfigError if two runs are the same, or would have one folder."""
    met: dict[tuple[str, ...], SweptRun] = {}
    for run in swept:
        values = tuple(_number_or_text(value) for value in run.differs.values())
        if values in met:
            same = ", ".join(f"{key}={value}" for key, value in run.differs.items())
            raise ConfigError(f"two runs of the sweep would have {same}; give each value once")
        met[values] = run
    folders = [run.folder for run in swept]
    if twice := next((folder for folder in folders if folders.count(folder) > 1), None):
        raise ConfigError(
            f"two runs of the sweep would have the folder {twice}; let hydra.sweep.subdir differ"
        )


def _number_or_text(value: str) -> str:
    """Return a number in a canonical form, so that 9.0 equals 9; other text as it is."""
    try:
        return f"{float(value):.17g}"
    except ValueError:
        return value


def run_folder(*varied: str, _root_: DictConfig) -> str:
    """Return the name of a run's folder in its sweep by what it differs in, such as ``seed=1``."""
    differs = labels(_root_, varied)
    number = _root_.hydra.job.get("num")
    joined = "+".join(f"{key}={value}" for key, value in differs.items())
    name = re.sub(r"[^\w.+=-]+", "-", joined).strip("-") or str(number)
    return name if len(name) <= LONGEST_NAME else f"{number}-{name[:LONGEST_NAME]}"


# in every process that imports this module, so also where a launcher runs a job
OmegaConf.register_new_resolver("run_folder", run_folder, replace=True)
