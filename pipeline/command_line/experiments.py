"""Starts, resumes or prints the experiment of a command line."""

import os
import sys
from collections.abc import Sequence
from pathlib import Path

from hydra.core.override_parser.types import Override

from pipeline.command_line import runs
from pipeline.command_line.application import run_application
from pipeline.command_line.arguments import EXPERIMENT, CommandLine, ConfigError
from pipeline.command_line.config import check_stages, compose_experiment
from pipeline.command_line.endings import OK
from pipeline.command_line.hydra_parts import split_arguments
from pipeline.command_line.overrides import read_overrides, words_of
from pipeline.command_line.sweeps import resume_words
from pipeline.run import artifacts
from pipeline.run.lock import held
from pipeline.run.sweep import SWEEP
from pipeline.settings import schema


def run_command(command: CommandLine) -> int:
    """Run, resume or print an experiment, or pass the command line to Hydra; return the exit code.

    Raises
    ------
    ValueError, OSError
        User errors.
    """
    if command.shell_completion:  # a shell asks for completions, or how to install them
        if "COMP_LINE" not in os.environ and "query=" in " ".join(command.overrides):
            raise ConfigError(
                "-sc query=... is asked by a shell, which sets COMP_LINE; to let it complete words: "
                'eval "$(inspection-pipeline -sc install=bash)"'
            )
        return run_application([*command.hydra_options, *command.overrides], ())
    read = read_overrides(command.overrides, command.folders, "" if command.multirun else "add -m to run all")
    if command.resume is not None:
        _check_runs(command, command.resume)
        return _resume(command, command.resume, read)
    by_key = {override.key_or_group: override for override in read}
    if "hydra.run.dir" in by_key and not command.multirun:
        folder = Path(str(by_key["hydra.run.dir"].value()))
        if (folder / artifacts.MANIFEST).exists():
            _check_runs(command, folder)
            return runs.repeat(folder, by_key, command.config_dir)
        if "stages" in by_key and EXPERIMENT not in by_key:
            cure = artifacts.choose_run(folder)
            raise ConfigError(f"{folder} holds no run; {cure}, or start one by +experiment=NAME")
    if command.cfg == "job" and not (command.resolve or command.package or command.info):
        job = compose_experiment(split_arguments(read, None)[0][0], command.config_dir)
        check_stages(job)
        sys.stdout.write(schema.commented(job.config))
        return OK
    words = words_of(read)
    option = ["--config-dir", str(command.config_dir.resolve())] if command.config_dir else []
    return run_application([*command.hydra_options, *words], [*option, *words])


def _check_runs(command: CommandLine, folder: Path) -> None:
    """Raise ConfigError if a command that would go on in a run's folder asks for a configuration instead."""
    if command.cfg or command.info:
        path = folder / artifacts.CONFIG
        raise ConfigError(f"--cfg and --info print what a new run would have; what this has is in {path}")


def _resume(command: CommandLine, folder: Path, overrides: Sequence[Override]) -> int:
    """Resume a run, or the unfinished runs of a sweep; return the exit code."""
    if not (folder / SWEEP).exists():
        return runs.resume(folder, overrides)
    with held(folder):  # also where nothing is left: a killed process may have left its lock
        words = resume_words(folder, overrides)
    return run_application(["--multirun", *command.hydra_options, *words], ()) if words else OK
