"""`explain`: an inference step by step."""

import argparse

from fis_tools.commands.arguments import Commands, add_command
from fis_tools.commands.instant import add_instant, samples
from fis_tools.formats import text
from fis_tools.inference import infer


def add(commands: Commands) -> None:
    """Add the command to the parser."""
    command = add_command(commands, "explain", run, "tell an inference step by step: why this output?")
    add_instant(command)


def run(arguments: argparse.Namespace) -> None:
    """Tell an inference step by step."""
    told = [text.explain(infer(system, inputs)) for system, inputs in samples(arguments)]
    print("\n".join(told), end="")
