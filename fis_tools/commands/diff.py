"""`diff`: what changed from one controller to another."""

import argparse
from importlib import import_module
from pathlib import Path

from fis_tools.commands.arguments import (
    UserMistake,
    add_controller,
    add_flights,
    chosen,
    flown_inputs,
    write,
)
from fis_tools.document import data, html
from fis_tools.findings.difference import difference
from fis_tools.model import FuzzyController
from fis_tools.source import read_controller

EPILOG = """\
Terms are told with how far they moved and how much of their area is still shared; rules are
compared by what they ask for, whatever their order; outputs are compared over 4096 inputs spread
over the ranges, and along --flights.

The exit status is 0; with --exit-code it is 1 where something changed; a mistake gives 2.

examples:
  python -m fis_tools diff before.yaml after.yaml
  python -m fis_tools diff before.yaml outputs/train/20250101-120000-000000 --flights episodes/*.mcap
  python -m fis_tools diff before.yaml after.fis --exit-code
  python -m fis_tools diff before.yaml after.yaml -o diff.html
"""


def add(command: argparse.ArgumentParser) -> None:
    """Add the arguments of the command to its parser."""
    add_controller(command)
    command.add_argument("after", metavar="AFTER", help="the controller that CONTROLLER is compared with")
    add_flights(command, "along which outputs are compared as well")
    command.add_argument(
        "--json", action="store_true", help="for programs (schema fuzzy-difference, version 1)"
    )
    command.add_argument("--exit-code", action="store_true", help="end with status 1 if anything changed")
    command.add_argument(
        "-o", "--output", metavar="FILE", help="a page (.html), or the same as is printed (default: printed)"
    )


def run(arguments: argparse.Namespace) -> int:
    """Tell what changed; return 1 if something did and that is asked for."""
    is_page = not arguments.json and Path(arguments.output or "").suffix.lower() in {".html", ".htm"}
    if is_page:  # what pictures need is missed before anything is computed
        import_module("fis_tools.render")
    before, after = (
        read_controller(path, arguments.trust) for path in (arguments.controller, arguments.after)
    )
    before, after = _limited(before, after, arguments.system)
    samples = flown_inputs(arguments, after) if arguments.flights else None
    files = (str(arguments.controller), str(arguments.after))
    found = difference(before, after, samples, files)
    if arguments.json:
        content = data.write("fuzzy-difference", 1, found.plain())
    elif is_page:
        content = html.page(found.document(pictures=True))
    else:
        content = found.text()
    write(arguments.output, content)
    return int(arguments.exit_code and not found.is_empty)


def _limited(
    before: FuzzyController, after: FuzzyController, name: str | None
) -> tuple[FuzzyController, FuzzyController]:
    """Keep the system that is asked for in both, where one is."""
    if name is None:
        return before, after
    limited = [
        chosen(one, name) if any(system.name == name for system in one.systems) else None
        for one in (before, after)
    ]
    if limited == [None, None]:
        chosen(after, name)
    if limited[0] is None or limited[1] is None:
        which = before if limited[0] is None else after
        raise UserMistake(
            f"controller {which.name!r} has no system {name!r}; leave --system out to see all changes"
        )
    return limited[0], limited[1]
