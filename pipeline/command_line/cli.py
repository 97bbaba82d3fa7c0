"""The command ``python -m pipeline``: checks first, then the stages.

Exit codes: 0 success, 1 a fault of the program (with a traceback), 2 a user error (in sentences
on standard error), 3 a proof that was not found, 4 a training or fit that gained nothing, 5 a fit that misses
its goal, 130 interrupted from the keyboard.
"""

import re
import signal
import sys
from collections.abc import Callable, Sequence
from functools import partial
from importlib import import_module
from inspect import cleandoc
from pathlib import Path
from typing import Final

from pipeline.command_line import endings
from pipeline.command_line.arguments import COMMANDS, parse_arguments
from pipeline.command_line.guide import help_on
from pipeline.run import interrupts, maker
from pipeline.run.runner import Interrupted
from pipeline.settings.places import conf_folder
from plain_files.streams import guarded

#: the command that compares two runs
COMPARE = "compare="
HELP: Final = frozenset(("--help", "-h"))


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
            return endings.INTERRUPTED if code == -signal.SIGINT else code
        except Interrupted as interrupt:
            sys.stderr.write(f"\n{interrupt}\n")
            return interrupts.exit_code()
        except endings.MISTAKES as error:
            from pipeline.command_line.application import shows_tracebacks  # noqa: PLC0415 - Hydra

            if shows_tracebacks():
                raise
            sys.stderr.write(endings.error_text(error))
            return endings.MISTAKE


def _command_of(arguments: Sequence[str]) -> Callable[[], int]:
    """Return a function that runs the requested command and returns its exit code."""
    first, *others = arguments or [""]
    given = first.removeprefix(COMPARE)
    # it is a group of settings, too: whose value is a mapping, or an option's name
    if given != first and not given.startswith("{") and ("," in given or Path(given).expanduser().is_dir()):
        first, *others = "compare", given, *others
    if first in COMMANDS:
        function: Callable[[Sequence[str]], int]
        function = getattr(import_module(f"pipeline.command_line.{COMMANDS[first]}"), first)
        if HELP.intersection(others):
            text = cleandoc(function.__doc__ or "")  # of which sections are for programmers
            return partial(_print, re.split(r"\n\n(?:Returns|Raises)\n", text)[0] + "\n")
        return partial(function, others)
    if HELP.issuperset(arguments):
        return partial(_print, help_on((), [conf_folder()]), endings.OK if arguments else endings.MISTAKE)
    command = parse_arguments(arguments)
    if command.version:
        return partial(_print, f"{maker.DISTRIBUTION} {maker.product_version()}\n")
    if command.help or not (command.overrides or command.resume or command.hydra_options):
        text = help_on(command.overrides, command.folders)
        return partial(_print, text, endings.OK if command.help else endings.MISTAKE)
    from pipeline.command_line.experiments import run_command  # noqa: PLC0415 - Hydra, which --help does without

    return partial(run_command, command)


def _print(text: str, code: int = endings.OK) -> int:
    sys.stdout.write(text)
    return code
