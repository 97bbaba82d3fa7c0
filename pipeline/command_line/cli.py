"""The command ``python -m pipeline``: checks first, then the stages.

Exit codes: 0 success, 1 a fault of the program (with a traceback), 2 a user error (in sentences
on standard error), 130 interrupted from the keyboard.
"""

import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from functools import partial
from importlib import import_module
from inspect import cleandoc
from pathlib import Path
from typing import Final

from fis_tools.streams import guarded
from pipeline.command_line import runs
from pipeline.command_line.arguments import COMMANDS, ConfigError, parse_arguments
from pipeline.command_line.invocation import shows_tracebacks
from pipeline.run import interrupts, maker
from pipeline.run.runner import Interrupted

INTERRUPTED = 130
#: modules with a function of a command's name, which few runs need; --help prints its text
MODULES: Final = {
    "edit": "edit",
    "export_c": "export_c",
    "summary": "results",
    "verify": "results",
    "warm": "cli",
}
#: what short runs are given
FEW: Final = ("duration_s=600", "monte_carlo.num_cases=8")
SMALL: Final = ("optimizer.population_size=8", "optimizer.generations=2")
#: short runs, whose kinds of flight are those of the shipped experiments
WARMED: Final[Sequence[Sequence[str]]] = (
    ("+experiment=fly", "controller=champion_27"),
    ("+experiment=evaluate", "controller=champion_27", "stages=[scenario,evaluate]", *FEW),
    ("+experiment=train", "stages=[scenario,train]", *SMALL),
    ("+experiment=fly", "controller=lqr"),
    ("+experiment=fly", "controller=champion_leo", "world=leo"),
)


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
    with guarded():
        return _main(list(sys.argv[1:] if arguments is None else arguments), replaces_process)


def _main(arguments: Sequence[str], replaces_process: bool) -> int:
    try:
        with interrupts.heeded():
            command = _command_of(arguments)
        return command()
    except maker.NotInForce:
        if replaces_process:
            maker.start_anew(sys.orig_argv[1:])
        code = maker.run_anew(["-m", "pipeline", *arguments])
        # so Python ends where an interrupt came while it ran a text, as imports of named tuples do
        return INTERRUPTED if code == -signal.SIGINT else code
    except Interrupted as interrupt:
        sys.stderr.write(f"\n{interrupt}\n")
        return INTERRUPTED
    except (ValueError, OSError, MemoryError) as error:
        if shows_tracebacks():
            raise
        sys.stderr.write(runs.error_text(error))
        return runs.MISTAKE


def _command_of(arguments: Sequence[str]) -> Callable[[], int]:
    """Return a function that runs the requested command and returns its exit code."""
    if arguments and arguments[0] in COMMANDS:
        module = import_module(f"pipeline.command_line.{MODULES[arguments[0]]}")
        function: Callable[[Sequence[str]], int] = getattr(module, arguments[0])
        if {"--help", "-h"} & set(arguments[1:]):
            return partial(_print, cleandoc(function.__doc__ or "").partition("\n\nRaises")[0] + "\n")
        return partial(function, arguments[1:])
    command = parse_arguments(arguments)
    if command.version:
        return partial(_print, f"{maker.DISTRIBUTION} {maker.product_version()}\n")
    if command.help or not (command.overrides or command.resume or command.compare or command.hydra_options):
        from pipeline.command_line.guide import help_on, help_text  # noqa: PLC0415 - it loads compiled code

        text = (
            help_on(command.topics, command.folders) if command.topics else help_text(command.folders) + "\n"
        )
        return partial(_print, text, runs.OK if command.help else runs.MISTAKE)
    if command.compare is not None:
        from pipeline.command_line.results import compare  # noqa: PLC0415 - as above

        return partial(compare, *command.compare)
    from pipeline.command_line.experiments import run_command  # noqa: PLC0415 - Hydra, which the others do without

    return partial(run_command, command)


def _print(text: str, code: int = runs.OK) -> int:
    sys.stdout.write(text)
    return code


def warm(given: Sequence[str]) -> int:
    """Compile what the shipped experiments need, so that later runs need not.

    Usage: python -m pipeline warm

    Some short runs are run in a folder of their own. `python -m pipeline warm &` does it in the background.

    Raises
    ------
    ConfigError
        If anything is given.
    """
    if given:
        raise ConfigError("warm takes no arguments; python -m pipeline warm --help says what it does")
    with tempfile.TemporaryDirectory() as folder:
        for number, words in enumerate(WARMED):
            sys.stderr.write(f"[{number + 1}/{len(WARMED)}] {' '.join(words)}\n")
            command = [sys.executable, "-m", "pipeline", *words, f"hydra.run.dir={Path(folder, str(number))}"]
            at_once = os.environ | {"COMPILE_AT_ONCE": "1"}
            done = subprocess.run(command, check=False, stdout=subprocess.DEVNULL, env=at_once)  # noqa: S603
            if done.returncode:
                return done.returncode
    return runs.OK
