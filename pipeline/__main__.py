"""``python -m pipeline``."""

import sys
from collections.abc import Sequence
from functools import partial
from typing import NoReturn

from pipeline.run import interrupts
from plain_files.streams import guarded, run_program


def main(arguments: Sequence[str] | None = None, *, replaces_process: bool = False) -> int:
    """Load the program and run a command line; see `pipeline.command_line.cli.main`."""
    try:
        with guarded(), interrupts.heeded():
            from pipeline.command_line import cli  # noqa: PLC0415 - takes a while, and may be interrupted
        return cli.main(arguments, replaces_process=replaces_process)
    except KeyboardInterrupt:
        with guarded():
            sys.stderr.write(
                f"\ninterrupted{interrupts.in_words()} before anything was done; nothing to keep\n"
            )
        return interrupts.exit_code()


def program() -> NoReturn:
    """Run the command line of this process, and end it."""
    interrupts.remember(*interrupts.SIGNALS)
    run_program(partial(main, replaces_process=True))


if __name__ == "__main__":
    program()
