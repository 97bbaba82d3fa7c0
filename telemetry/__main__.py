"""Entry point of ``python -m telemetry``."""

from typing import NoReturn

from plain_files.streams import run_program
from telemetry.commands import TERMINATED, main, silence_finalizers


def _main() -> int:
    code = main()
    if code == TERMINATED:
        silence_finalizers()
    return code


def program() -> NoReturn:
    """Run the command line of this process, and end it."""
    run_program(_main)


if __name__ == "__main__":
    program()
