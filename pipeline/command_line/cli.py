"""The command ``python -m pipeline``: checks first, then the stages.

Exit codes: 0 success, 1 a fault of the program (with a traceback), 2 a user error (in sentences
on standard error), 3 a proof that was not found, 4 a training or fit that gained nothing, 5 a fit that misses
its goal, 130 interrupted from the keyboard.
"""

import os
import re
import signal
import sys
from collections.abc import Callable, Sequence
from functools import partial
from importlib import import_module
from inspect import cleandoc
from pathlib import Path

from hydra.core.override_parser.types import Override

from fis_tools.streams import guarded
from pipeline.command_line import runs
from pipeline.command_line.application import run_application, shows_tracebacks
from pipeline.command_line.arguments import COMMANDS, EXPERIMENT, CommandLine, ConfigError, parse_arguments
from pipeline.command_line.config import check_stages, compose_experiment
from pipeline.command_line.hydra_parts import split_arguments
from pipeline.command_line.overrides import read_overrides, words_of
from pipeline.command_line.sweeps import resume_words
from pipeline.run import artifacts, interrupts, maker
from pipeline.run.lock import held
from pipeline.run.runner import Interrupted
from pipeline.run.sweep import SWEEP
from pipeline.settings import schema

#: the command that compares two runs
COMPARE = "compare="


def main(arguments: Sequence[str] | None = None, *, replaces_process: bool = False) -> int:
    """Run a command line.

    A reproducible run needs libraries that were loaded for it, and so another process.

    Parameters
    ----------
    arguments : sequence of str, optional
        Without the program's name; by default those of the process.
    replaces_process : bool
        Whether a reproducible run takes this process's place; else it runs in a child process.

    Returns
    -------
    int
        The exit code.
    """
    words = list(sys.argv[1:] if arguments is None else arguments)
    with guarded():
        try:
            with interrupts.heeded():
                command = _command_of(words)
            return command()
        except maker.NotInForce:
            if replaces_process:
                maker.start_anew(sys.orig_argv[1:])
            code = maker.run_anew(["-m", "pipeline", *words])
            # so Python ends where an interrupt came while it ran a text, as imports of named tuples do
            return runs.INTERRUPTED if code == -signal.SIGINT else code
        except Interrupted as interrupt:
            sys.stderr.write(f"\n{interrupt}\n")
            return interrupts.exit_code()
        except runs.MISTAKES as error:
            if shows_tracebacks():
                raise
            sys.stderr.write(runs.error_text(error))
            return runs.MISTAKE


def _command_of(arguments: Sequence[str]) -> Callable[[], int]:
    """Return a function that runs the requested command and returns its exit code."""
    first, *others = arguments or [""]
    if first.startswith(COMPARE) and "," in first:  # it is a group of settings, too
        first, *others = "compare", first.removeprefix(COMPARE), *others
    if first in COMMANDS:
        function: Callable[[Sequence[str]], int]
        function = getattr(import_module(f"pipeline.command_line.{COMMANDS[first]}"), first)
        if {"--help", "-h"}.intersection(others):
            text = cleandoc(function.__doc__ or "")  # of which sections are for programmers
            return partial(_print, re.split(r"\n\n(?:Returns|Raises)\n", text)[0] + "\n")
        return partial(function, others)
    command = parse_arguments(arguments)
    if command.version:
        return partial(_print, f"{maker.DISTRIBUTION} {maker.product_version()}\n")
    if command.help or not (command.overrides or command.resume or command.hydra_options):
        from pipeline.command_line.guide import help_on  # noqa: PLC0415 - it loads compiled code

        text = help_on(command.overrides, command.folders)
        return partial(_print, text, runs.OK if command.help else runs.MISTAKE)
    return partial(run_command, command)


def _print(text: str, code: int = runs.OK) -> int:
    sys.stdout.write(text)
    return code


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
            raise ConfigError(f"{folder} holds no run; give a run's folder, or start one by +experiment=NAME")
    if command.cfg == "job" and not (command.resolve or command.package or command.info):
        job = compose_experiment(split_arguments(read, None)[0][0], command.config_dir)
        check_stages(job)
        return _print(schema.commented(job.config))
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
    return run_application(["--multirun", *command.hydra_options, *words], ()) if words else runs.OK
