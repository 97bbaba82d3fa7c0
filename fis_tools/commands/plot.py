"""`plot`: every picture of a controller, into a folder."""

import argparse
from pathlib import Path

from fis_tools.commands.arguments import Commands, add_command, chosen, file_name, place_for
from fis_tools.source import read_controller


def add(commands: Commands) -> None:
    """Add the command to the parser."""
    command = add_command(
        commands, "plot", run, "draw membership functions, rule tables and surfaces into a folder"
    )
    command.add_argument(
        "-o", "--output", metavar="DIR", default=".", help="folder for the pictures (default: here)"
    )
    command.add_argument("--format", choices=["png", "svg", "pdf"], default="png", help="default: png")


def run(arguments: argparse.Namespace) -> None:
    """Draw every system of a controller into a folder."""
    from fis_tools.render import system_figures  # noqa: PLC0415 - the other commands start without matplotlib

    controller = chosen(read_controller(arguments.controller), arguments.system)
    for system in controller.systems:
        for name, figure in system_figures(system):
            picture = f"{file_name(system.name)}-{file_name(name)}.{arguments.format}"
            path = place_for(Path(arguments.output) / picture)
            figure.savefig(path, dpi=150)
            print(path)
