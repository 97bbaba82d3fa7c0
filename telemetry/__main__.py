"""Entry point of ``python -m telemetry``."""

from typing import NoReturn

from fis_tools.streams import run_program
from telemetry.commands import main


def program() -> NoReturn:
    """Run the command line of this process, and end it."""
    run_program(main)


if __name__ == "__main__":
    program()
