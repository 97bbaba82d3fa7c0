"""The command ``python -m pipeline``: checks first, then the stages.

Exit codes: 0 success, 1 a fault of the program (with a traceback), 2 a user error (in sentences
on standard error), 130 interrupted from the keyboard.
"""

import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from importlib import import_module
from pathlib import Path
from typing import Final

from pipeline.command_line import runs
from pipeline.command_line.arguments import ConfigError, read_arguments
from pipeline.command_line.runs import MISTAKE, OK
from pipeline.run import interrupts, maker
from pipeline.run.runner import Interrupted

INTERRUPTED = 130
#: other commands, to the modules with a function of that name, which few runs need, and what --help tells
COMMANDS = {
    "edit": (
        "editor",
        """edit [key=value ...] [--port PORT] [--no-browser]

Open a page on which rules and terms of controller=NAME change; each touch flies 1,000 paired cases anew, in
the world, sun and starts that the keys give. Ctrl-C ends it; only a copy that you save is written.
""",
    ),
    "summary": (
        "results",
        """summary SWEEP_FOLDER

Print the results of a sweep (python -m pipeline -m ...) run by run, and what each key changed; write both
into its folder, as a page and as Parquet.
""",
    ),
    "verify": (
        "results",
        """verify RUN_FOLDER [OTHER_RUN_FOLDER]

Check every file of a run against its manifest and fly its recordings again; or compare the files of two runs.
Exit code 0 if all is well, 1 if something differs.
""",
    ),
    "warm": (
        "cli",
        """warm

Compile what the shipped experiments need, so that later runs need not. `python -m pipeline warm &` does it in
the background.
""",
    ),
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


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command line.

    Parameters
    ----------
    arguments : sequence of str, optional
        Without the program's name; by default those of the process.

    Returns
    -------
    int
        The exit code.
    """
    words = sys.orig_argv[1:] if arguments is None else ["-m", "pipeline", *arguments]
    arguments = list(sys.argv[1:] if arguments is None else arguments)
    try:
        return _dispatch(arguments)
    except maker.NotInForce:
        return maker.start_anew(words)
    except Interrupted as interrupt:
        sys.stderr.write(f"\n{interrupt}\n")
        return INTERRUPTED
    except KeyboardInterrupt:
        sys.stderr.write("\ninterrupted before anything was done; nothing to keep\n")
        return INTERRUPTED
    except (ValueError, OSError, MemoryError) as error:
        if os.environ.get("HYDRA_FULL_ERROR") == "1":
            raise
        sys.stderr.write(runs.told(error))
        return MISTAKE


def _dispatch(arguments: Sequence[str]) -> int:
    """Print what is only printed, or run the rest."""
    if arguments and arguments[0] in COMMANDS:
        name, told = COMMANDS[arguments[0]]
        if {"--help", "-h"} & set(arguments[1:]):
            sys.stdout.write(f"usage: python -m pipeline {told}")
            return OK
        module = import_module(f"pipeline.command_line.{name}")
        run: Callable[[Sequence[str]], int] = getattr(module, arguments[0])
        return run(arguments[1:])
    asked = read_arguments(arguments)
    if asked.version:
        sys.stdout.write(f"{maker.DISTRIBUTION} {maker.product_version()}\n")
        return OK
    if asked.help or not (asked.overrides or asked.resume or asked.compare or asked.cfg):
        from pipeline.command_line.guide import help_on, help_text  # noqa: PLC0415 - it loads compiled code

        sys.stdout.write(
            help_on(asked.topics, asked.folders) if asked.topics else help_text(asked.folders) + "\n"
        )
        return OK if asked.help else MISTAKE
    if asked.compare is not None:
        from pipeline.command_line.results import compare  # noqa: PLC0415 - as above

        return compare(*asked.compare)
    from pipeline.command_line.experiments import plan  # noqa: PLC0415 - Hydra, which the others do without

    with interrupts.heeded():
        carry_out = plan(asked)
    return carry_out()


def warm(given: Sequence[str]) -> int:
    """Run each of `WARMED` twice in a folder of its own, for what is wanted once is not compiled yet.

    Return the exit code of the first that fails, else 0.

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
            for turn in ("first", "second"):
                place = f"hydra.run.dir={Path(folder, f'{number}-{turn}')}"
                command = [sys.executable, "-m", "pipeline", *words, place]
                done = subprocess.run(command, check=False, stdout=subprocess.DEVNULL)  # noqa: S603
                if done.returncode:
                    return done.returncode
    return OK
