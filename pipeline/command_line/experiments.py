"""Experiments from the command line: checked, then run, resumed, repeated, or printed."""

import sys
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from hydra.core.override_parser.types import Override
from omegaconf import OmegaConf
from omegaconf.errors import OmegaConfBaseException

from pipeline.command_line import runs, sweeps
from pipeline.command_line.arguments import Asked
from pipeline.command_line.config import check_stages, compose_experiment, compose_node, options
from pipeline.command_line.job import EXPERIMENT, ConfigError, Job
from pipeline.command_line.overrides import (
    check_overrides,
    check_sweeps,
    first_line,
    parse,
    rewrite_paths,
    single_runs,
)
from pipeline.run import artifacts
from pipeline.run.sweep import SWEEP
from pipeline.settings.reference import commented


def plan(asked: Asked) -> Callable[[], int]:
    """Check and compose the arguments; return a function that carries them out and returns the exit code.

    Raises
    ------
    ValueError, OSError
    """
    groups = options(asked.folders)
    overrides = parse(rewrite_paths(asked.overrides))
    check_overrides(overrides, groups)
    check_sweeps(overrides, asked.multirun)
    if asked.resume is not None:
        if (asked.resume / SWEEP).exists():
            return partial(sweeps.resume, asked.resume, overrides)
        return partial(runs.resume, asked.resume, overrides)
    folder = None if asked.multirun else _run_folder(overrides)
    if folder is not None:
        if (folder / artifacts.MANIFEST).exists():
            return partial(runs.repeat, folder, overrides, asked)
        keys = {override.key_or_group for override in overrides}
        if "stages" in keys and EXPERIMENT not in keys:
            raise ConfigError(
                f"{folder} holds no run; give the folder of a run to repeat stages of it, or add "
                "+experiment=NAME to start one there"
            )
    words = next(single_runs(overrides, groups))
    if asked.cfg:
        return partial(_print, words, asked)
    if asked.multirun:
        return partial(sweeps.start, *sweeps.composed(asked, overrides))
    own = ["--config-dir", str(asked.config_dir.resolve())] if asked.config_dir else []
    job = compose_experiment(words, asked.config_dir)
    check_stages(job.config, words)
    return partial(runs.start_new, Job(job.config, job.experiment, job.folder), [*own, *words])


def _run_folder(overrides: Sequence[Override]) -> Path | None:
    """Return the requested folder, None without one."""
    given = [override.value() for override in overrides if override.key_or_group == "hydra.run.dir"]
    return Path(str(given[-1])) if given else None


def _print(words: Sequence[str], asked: Asked) -> int:
    """Print a configuration as YAML: the run's, with the meanings of its keys, Hydra's own, or both."""
    if asked.cfg == "job":
        job = compose_experiment(words, asked.config_dir)
        check_stages(job.config, words)
        sys.stdout.write(commented(job.config))
        return runs.OK
    node = compose_node(words, asked.config_dir)
    try:
        sys.stdout.write(
            OmegaConf.to_yaml(node.hydra if asked.cfg == "hydra" else node, resolve=asked.resolve)
        )
    except OmegaConfBaseException as error:
        raise ConfigError(first_line(error)) from error
    return runs.OK
