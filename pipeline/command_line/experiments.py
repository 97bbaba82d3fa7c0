"""Experiments from the command line: their keys are checked, then they are run, resumed or printed."""

import sys
from collections.abc import Sequence
from pathlib import Path

from hydra.core.override_parser.types import Override

from pipeline.command_line import application, runs
from pipeline.command_line.arguments import EXPERIMENT, CommandLine, ConfigError
from pipeline.command_line.config import check_stages, compose_experiment
from pipeline.command_line.groups import options
from pipeline.command_line.overrides import first_run, read_overrides, search_folders
from pipeline.command_line.sweeps import resume_words
from pipeline.run import artifacts
from pipeline.run.lock import held
from pipeline.run.sweep import SWEEP
from pipeline.settings.schema import commented


def run_command(command: CommandLine) -> int:
    """Run, resume or print an experiment, or pass the command line to Hydra; return the exit code.

    Raises
    ------
    ValueError, OSError
        User errors.
    """
    if command.is_completion:
        return application.run_application([*command.hydra_options, *command.overrides], ())
    groups = options([*command.folders, *search_folders(command.overrides)])
    overrides = read_overrides(command.overrides, groups, is_multirun=command.multirun)
    words = [override.input_line or "" for override in overrides]
    if command.resume is not None:
        return _resume(command, command.resume, overrides)
    folder = None if command.multirun else _run_folder(overrides)
    if folder is not None and (folder / artifacts.MANIFEST).exists():
        return runs.repeat(folder, overrides, command.config_dir)
    keys = {override.key_or_group for override in overrides}
    if folder is not None and "stages" in keys and EXPERIMENT not in keys:
        raise ConfigError(
            f"{folder} holds no run; give the folder of a run to repeat stages of it, or add "
            "+experiment=NAME to start one there"
        )
    if command.is_ours_to_print:
        words = first_run(overrides, groups)
        config = compose_experiment(words, command.config_dir).config
        check_stages(config, words)
        sys.stdout.write(commented(config))
        return runs.OK
    return application.run_application([*command.hydra_options, *words], [*command.config_option, *words])


def _run_folder(overrides: Sequence[Override]) -> Path | None:
    """Return the folder that an override sets; None if none does."""
    values = [override.value() for override in overrides if override.key_or_group == "hydra.run.dir"]
    return Path(str(values[-1])) if values else None


def _resume(command: CommandLine, folder: Path, overrides: Sequence[Override]) -> int:
    """Resume a run, or the unfinished runs of a sweep; return the exit code."""
    if not (folder / SWEEP).exists():
        return runs.resume(folder, overrides)
    with held(folder):  # also where nothing is left: a killed process may have left its lock
        words = resume_words(folder, overrides)
    options = [option for option in command.hydra_options if option != "--multirun"]
    return (
        application.run_application(["--multirun", *options, *words], (), resumes=True) if words else runs.OK
    )
