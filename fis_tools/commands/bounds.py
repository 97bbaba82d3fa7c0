"""`bounds`: what the outputs can be, and cannot be, while the inputs lie in a region."""

import argparse
import sys

from fis_tools.analysis.bounds import NUM_BOXES, ask, output_ranges
from fis_tools.commands.arguments import UserMistake, add_controller, asked, the_system

EPILOG = """\
Conditions are written NAME > NUMBER, NAME in [NUMBER, NUMBER] or 2 NAME - OTHER <= NUMBER;
several, with commas between, hold together. An input beyond its range is taken as the end of it;
conditions on several inputs together are about values inside their ranges. A yes comes with inputs
and outputs that were evaluated. A no is proved: no inputs of the region, of any number, can do it.

The exit status is 0; with --expect it is 1 where the answer is another one; a mistake gives 2.

examples:
  python -m fis_tools bounds controller.yaml
  python -m fis_tools bounds controller.yaml --system force_x --where "distance > 150"
  python -m fis_tools bounds controller.yaml --system force_x \\
      --where "distance > 150, velocity_body_x > 0" --ask "force_x > 0" --expect no
"""


def add(command: argparse.ArgumentParser) -> None:
    """Add the arguments of the command to its parser."""
    add_controller(command)
    command.add_argument(
        "--where", metavar="CONDITIONS", default="", help="on inputs (default: all that their ranges hold)"
    )
    command.add_argument(
        "--ask", metavar="CONDITIONS", help="on outputs: can they hold? (default: how far the outputs go)"
    )
    command.add_argument(
        "--boxes",
        type=_count,
        default=NUM_BOXES,
        metavar="N",
        help=f"give up after so many boxes (default: {NUM_BOXES})",
    )
    command.add_argument(
        "--expect", choices=["yes", "no"], help="with --ask: end with status 1 at any other answer"
    )


def run(arguments: argparse.Namespace) -> int:
    """Print an answer, or ranges; return 1 for an answer that is not expected."""
    if arguments.expect is not None and arguments.ask is None:
        raise UserMistake("--expect is about the answer to a question; add --ask")
    controller = asked(arguments)
    effort = {"max_boxes": arguments.boxes, "progress": _tell if sys.stderr.isatty() else None}
    try:
        if arguments.ask is None:
            systems = (the_system(controller, None),) if arguments.where else controller.systems
            for system in systems:
                for one in output_ranges(system, arguments.where, **effort):
                    print(one.sentence)
            return 0
        answer = ask(the_system(controller, None), arguments.ask, arguments.where, **effort)
    except ValueError as error:
        raise UserMistake(str(error)) from error
    print(answer.sentence)
    return int(arguments.expect not in (None, answer.verdict))


def _tell(num_boxes: int, num_open: int) -> None:
    """Write how far a search is over what was written before."""
    print(f"{num_boxes} boxes, {num_open} open\x1b[K\r", end="", file=sys.stderr, flush=True)


def _count(word: str) -> int:
    if not word.isdecimal() or int(word) < 1:
        raise argparse.ArgumentTypeError(f"{word!r} is no whole number above 0")
    return int(word)
