"""`audit`: what a reviewer should look at before signing."""

import argparse
import shutil
from dataclasses import fields, replace

from fis_tools.commands.arguments import (
    UserMistake,
    add_controller,
    add_flights,
    asked,
    assignments,
    flown_inputs,
)
from fis_tools.document import data, text
from fis_tools.findings.audit import Severity, Thresholds, audit
from fis_tools.findings.audit.report import SCHEMA, SCHEMA_VERSION
from fis_tools.model.validate import nearest
from fis_tools.source import read_controller

#: A terminal of another width than this is taken as this.
NARROWEST, WIDEST = 60, 120

EPILOG = """\
The exit status is 0; with --fail-on it is 1 where there is a finding so severe or worse;
a mistake gives 2.

thresholds, most of them shares from 0 to 1:
  fired        a rule counts as fired, and a value as covered at all, from this strength on
  coverage     each value should belong to a term, and each input to a rule, this much
  look_alike   terms that share more of their areas mean the same
  possibility  terms that hold together by more are hard to tell apart
  inside       a term of which more lies under another one says little of its own
  zero         how much 0 should belong to a term called zero
  jump         neighbouring rules should differ by no more of the output's range
  against      up to this share of steps against the rest, an input counts as meant to act one way
  reversal     the least way back of an output that counts, of its range
  consistency  the least consistency of a rule
  reach        an output should reach this much of its range
  partition    the least GM3M of a variable, against --reference or an even partition
  clipped      an input should lie outside its range in no more of the inferences
  dead         no more of the rules should never fire on flights
  dominant     no rule should lead, or matter, by more
  idle         a rule should move an output by more of its range on average
  rules        the most rules of a system
  terms        the most terms of a variable

examples:
  python -m fis_tools audit controller.yaml
  python -m fis_tools audit controller.yaml --flights episodes/*.mcap --fail-on serious
  python -m fis_tools audit episodes/best.mcap --json > audit.json
  python -m fis_tools audit tuned.yaml --reference untuned.yaml
  python -m fis_tools audit controller.yaml --thresholds coverage=0.5,look_alike=0.6
"""


def add(command: argparse.ArgumentParser) -> None:
    """Add the arguments of the command to its parser."""
    add_controller(command)
    add_flights(command)
    command.add_argument(
        "--reference",
        metavar="CONTROLLER",
        help="compare terms with those of this one, such as before tuning (default: an even partition)",
    )
    command.add_argument(
        "--json", action="store_true", help="print it for programs (schema fuzzy-audit, version 2)"
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
        help="from where on something is a finding, as told below: "
        + ", ".join(f"{field.name}={field.default}" for field in fields(Thresholds)),
    )


def run(arguments: argparse.Namespace) -> int:
    """Print what is found; return 1 if that is too much."""
    controller = asked(arguments)
    reference = None if arguments.reference is None else read_controller(arguments.reference, arguments.trust)
    thresholds = _thresholds(arguments.thresholds)
    flown = flown_inputs(arguments, controller)
    try:
        found = audit(controller, flown, thresholds, reference)
    except ValueError as error:
        raise UserMistake(f"{error}; give a --reference of the same systems") from error
    if arguments.json:
        print(data.write(SCHEMA, SCHEMA_VERSION, found.plain()), end="")
    else:
        width = min(WIDEST, max(NARROWEST, shutil.get_terminal_size((110, 24)).columns))
        print(text.write(found.document(), width), end="")
    if arguments.fail_on is None:
        return 0
    return int(bool(found.at_least(Severity[arguments.fail_on.upper()])))


def _thresholds(words: str) -> Thresholds:
    values = assignments(words)
    defaults = {field.name: field.default for field in fields(Thresholds)}
    for name in values:
        if name not in defaults:
            raise UserMistake(f"there is no threshold {name!r}; {nearest(name, defaults)}")
        if values[name] < 0.0:
            raise UserMistake(f"the threshold {name!r} is below 0; give one that is not")
    return replace(Thresholds(), **values)  # type: ignore[arg-type]
