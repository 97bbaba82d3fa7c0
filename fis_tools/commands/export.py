"""`export`: a controller in another form."""

import argparse
from collections.abc import Callable

from fis_tools import serialize
from fis_tools.commands.arguments import Commands, add_command, chosen, write
from fis_tools.formats import csv, markdown, text
from fis_tools.model import FuzzyController
from fis_tools.source import read_controller

EXPORTS: dict[str, Callable[[FuzzyController], str]] = {
    "markdown": markdown.write,
    "csv": csv.write,
    "text": text.write,
    "json": serialize.dump_json,
    "yaml": serialize.dump_yaml,
}


def add(commands: Commands) -> None:
    """Add the command to the parser."""
    command = add_command(
        commands, "export", run, "write a controller as Markdown, CSV, sentences, JSON or YAML"
    )
    command.add_argument("--format", choices=sorted(EXPORTS), required=True, help="what to write")
    command.add_argument("-o", "--output", metavar="FILE", help="where to (default: printed)")


def run(arguments: argparse.Namespace) -> None:
    """Write a controller in another form."""
    controller = chosen(read_controller(arguments.controller), arguments.system)
    write(arguments.output, EXPORTS[arguments.format](controller))
