"""`simplify`: fewer rules, terms and digits, while the outputs stay within a budget."""

import argparse
import sys

from fis_tools.commands.arguments import (
    UserMistake,
    add_controller,
    add_flights,
    asked,
    flown_inputs,
    form_of,
    write,
)
from fis_tools.document import data
from fis_tools.findings.simplification import Budget, simplify
from fis_tools.findings.simplification.budget import NUM_SPREAD

SCHEMA = "fuzzy-simplification"
SCHEMA_VERSION = 1

EPILOG = f"""\
Steps leave out inputs, drop rules, merge terms that look alike, and round numbers. Each is measured
against the original; what changes least goes first, until nothing more fits the budget. It holds along the
flights that are given, and at {NUM_SPREAD:,} points spread over the whole ranges of the inputs; between
them a change can be a little larger. With --flights-only far more can go, but what was not flown
changes at will, and other starts are flown worse. What comes out is an ordinary controller: fly
it before you trust it.

examples:
  python -m fis_tools simplify controller.yaml -o simpler.yaml
  python -m fis_tools simplify controller.yaml --flights episodes/*.mcap --max-change 2% -o simpler.json
  python -m fis_tools simplify controller.yaml --flights episodes/*.mcap --flights-only
"""


def add(command: argparse.ArgumentParser) -> None:
    """Add the arguments of the command to its parser."""
    add_controller(command)
    add_flights(command)
    defaults = Budget()
    for name, default, what in (
        ("max", defaults.max_change, "the largest change of an output that is allowed"),
        ("mean", defaults.mean_change, "the mean change that is allowed"),
    ):
        command.add_argument(
            f"--{name}-change",
            type=_share,
            default=default,
            metavar="SHARE",
            help=f"{what}, of its range (default: {100 * default:g}%%)",
        )
    command.add_argument(
        "--look-alike",
        type=_share,
        default=defaults.look_alike,
        metavar="SHARE",
        help=f"merge terms that share so much of their areas (default: {100 * defaults.look_alike:g}%%)",
    )
    command.add_argument(
        "--flights-only", action="store_true", help="keep the budget along the flights alone"
    )
    command.add_argument("-o", "--output", metavar="FILE", help="write the simpler controller (.json, .yaml)")
    command.add_argument(
        "--json", action="store_true", help=f"print the steps for programs (schema {SCHEMA}, version 1)"
    )


def run(arguments: argparse.Namespace) -> None:
    """Print the steps, and write what comes out."""
    form = form_of(arguments.output)
    controller = asked(arguments)
    samples = flown_inputs(arguments, controller)
    if samples is None and arguments.flights_only:
        raise UserMistake("--flights-only needs flights; add --flights, or leave it out")
    try:
        budget = Budget(
            arguments.max_change, arguments.mean_change, arguments.flights_only, arguments.look_alike
        )
    except ValueError as error:
        raise UserMistake(str(error)) from error
    found = simplify(controller, samples, budget, _tell if sys.stderr.isatty() else None)
    if form is not None:
        write(arguments.output, form(found.controller))
    print(data.write(SCHEMA, SCHEMA_VERSION, found.plain()) if arguments.json else found.text(), end="")


def _tell(words: str) -> None:
    """Write how far it is over what was written before."""
    print(f"{words}\x1b[K\r", end="", file=sys.stderr, flush=True)


def _share(word: str) -> float:
    """Read ``5%`` or ``0.05``."""
    number = word.strip().removesuffix("%").strip()
    try:
        value = float(number) / (100.0 if word.strip().endswith("%") else 1.0)
    except ValueError:
        value = -1.0
    if not 0.0 <= value <= 1.0:
        raise argparse.ArgumentTypeError(f"{word!r} is no share from 0% to 100%; write 5% or 0.05")
    return value
