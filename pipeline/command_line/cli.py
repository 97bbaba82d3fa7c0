"""The command ``python -m pipeline``: checks first, then the stages.

Exit codes: 0 success, 1 a fault of the program (with a traceback), 2 a user error (in sentences
on standard error), 130 interrupted from the keyboard.
"""

import os
import sys
from collections.abc import Callable, Sequence
from importlib import import_module

from pipeline.command_line import runs
from pipeline.command_line.arguments import read_arguments
from pipeline.command_line.runs import MISTAKE, OK
from pipeline.run import interrupts, maker, reproducible
from pipeline.run.runner import Interrupted

INTERRUPTED = 130
#: other commands, by the modules with a function of that name; few runs need them
COMMANDS = {name: f"pipeline.command_line.{name}" for name in ("cluster", "summary", "verify", "warm")}


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
    except reproducible.NotInForce:
        return reproducible.start_anew(words)
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
    if arguments and (module := COMMANDS.get(arguments[0])):
        run: Callable[[Sequence[str]], int] = getattr(import_module(module), arguments[0])
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
        from pipeline.command_line.summary import compare  # noqa: PLC0415 - as above

        return compare(*asked.compare)
    from pipeline.command_line.experiments import plan  # noqa: PLC0415 - Hydra, which the others do without

    with interrupts.heeded():
        carry_out = plan(asked)
    return carry_out()
