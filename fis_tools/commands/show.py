"""`show`: a controller in words and tables."""

import argparse

from fis_tools.commands.arguments import add_controller, add_order, asked, importance_asked
from fis_tools.document import text
from fis_tools.words.outline import outline

EPILOG = """\
examples:
  python -m fis_tools show controller.yaml
  python -m fis_tools show tipper.fis
  python -m fis_tools show outputs/train/20250101-120000-000000 --system force_x
  python -m fis_tools show controller.yaml --by importance --flights episodes/*.mcap
"""


def add(command: argparse.ArgumentParser) -> None:
    """Add the arguments of the command to its parser."""
    add_controller(command)
    add_order(command)


def run(arguments: argparse.Namespace) -> None:
    """Print terms and rule tables."""
    controller = asked(arguments)
    print(text.write(outline(controller, importance_asked(arguments, controller))), end="")
