"""`audit`: what a reviewer should look at before signing."""

import argparse
import json
import shutil
from dataclasses import fields, replace

from fis_tools.audit import Severity, Thresholds, audit, report
from fis_tools.commands.arguments import (
    Commands,
    UserMistake,
    add_command,
    add_flights,
    assignments,
    chosen,
    flown_inputs,
)
from fis_tools.source import read_controller
from fis_tools.validate import nearest

#: A terminal of another width than this is taken as this.
NARROWEST, WIDEST = 60, 120

EPILOG = """\
The exit status is 0; with --fail-on it is 1 where there is a finding so severe or worse;
a mistake gives 2.

examples:
  python -m fis_tools audit controller.yaml
  python -m fis_tools audit controller.yaml --flights episodes/*.mcap --fail-on serious
  python -m fis_tools audit episodes/best.mcap --json > audit.json
  python -m fis_tools audit controller.yaml --thresholds coverage=0.5,look_alike=0.6
"""


def add(commands: Commands) -> None:
    """Add the command to the parser."""
    command = add_command(commands, "audit", run, "list what a reviewer should know: gaps, slips, idle rules")
    command.epilog = EPILOG
    command.formatter_class = argparse.RawDescriptionHelpFormatter
    add_flights(command)
    command.add_argument(
        "--json", action="store_true", help="print it for programs (schema fuzzy-audit, version 1)"
    )
    command.add_argument(
        "--fail-on",
        choices=[severity.word for severity in Severity],
        help="end with status 1 if there is a finding so severe or worse",
    )
    command.add_argument(
        "--thresholds",
        metavar="NAME=NUMBER,…",
        default="",
        help="from where on something is a finding: "
        + ", ".join(f"{field.name}={field.default}" for field in fields(Thresholds)),
    )


def run(arguments: argparse.Namespace) -> int:
    """Print what is found; return 1 if that is too much."""
    controller = chosen(read_controller(arguments.controller), arguments.system)
    found = audit(controller, flown_inputs(arguments, controller), _thresholds(arguments.thresholds))
    if arguments.json:
        print(json.dumps(report.plain(found), indent=2, allow_nan=False, ensure_ascii=False))
    else:
        width = min(WIDEST, max(NARROWEST, shutil.get_terminal_size((110, 24)).columns))
        print(report.text(found, width), end="")
    if arguments.fail_on is None:
        return 0
    return int(bool(found.at_least(Severity[arguments.fail_on.upper()])))


def _thresholds(words: str) -> Thresholds:
    values = assignments(words)
    defaults = {field.name: field.default for field in fields(Thresholds)}
    for name in values:
        if name not in defaults:
            raise UserMistake(f"there is no threshold {name!r}; {nearest(name, defaults)}")
    return replace(Thresholds(), **values)  # type: ignore[arg-type]
