"""`show`: a controller in words and tables."""

import argparse

from fis_tools.commands.arguments import Commands, add_command, chosen
from fis_tools.formats import text
from fis_tools.source import read_controller


def add(commands: Commands) -> None:
    """Add the command to the parser."""
    add_command(commands, "show", run, "print variables, terms and rule tables")


def run(arguments: argparse.Namespace) -> None:
    """Print terms and rule tables."""
    controller = chosen(read_controller(arguments.controller), arguments.system)
    print(text.describe(controller), end="")
