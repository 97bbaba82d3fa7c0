"""`explain`: why this output? which rules moved it, what would flip it, and what each did over a flight."""

import argparse
import math
from typing import Any

from fis_tools.commands.arguments import (
    UserMistake,
    add_controller,
    add_flights,
    asked,
    flight_paths,
    flown_inputs,
)
from fis_tools.commands.instant import add_instant, instants
from fis_tools.document import data
from fis_tools.engines.inference import infer
from fis_tools.findings.explanation import explain, shares
from fis_tools.model import FuzzyController
from fis_tools.words import text

SCHEMA = "fuzzy-explanation"
SCHEMA_VERSION = 2

EPILOG = """\
With --inputs or --time it tells of one inference the share of each rule in the output (Shapley
values: they add up to its way from the output of no rule), what would be missing without the
rule ("needed": nothing where others say the same), and the smallest change of one input that
flips the output's sign. With --flights (or a flight as CONTROLLER) it tells the shares over them.
Of a flight it tells about forces that were fired; where none was, it says why. --all-periods tells
about every inference.

examples:
  python -m fis_tools explain controller.yaml --inputs distance=80,velocity_body_x=0.05
  python -m fis_tools explain episodes/best.mcap --time 600 --system force_x --crossing=-0.01
  python -m fis_tools explain episodes/best.mcap
  python -m fis_tools explain controller.yaml --flights episodes/*.mcap --all
  python -m fis_tools explain fan.yaml --data room.csv --time 60
"""


def add(command: argparse.ArgumentParser) -> None:
    """Add the arguments of the command to its parser."""
    add_controller(command)
    add_instant(command)
    add_flights(command)
    command.add_argument(
        "--crossing",
        type=_finite,
        metavar="VALUE",
        help="look for what takes the output across this value, in its unit (default: 0, its sign)",
    )
    command.add_argument("--steps", action="store_true", help="tell the inference step by step instead")
    command.add_argument("--all", action="store_true", help="tell also the rules that hardly moved anything")
    command.add_argument(
        "--json",
        action="store_true",
        help=f"print it for programs (schema {SCHEMA}, version {SCHEMA_VERSION})",
    )


def run(arguments: argparse.Namespace) -> None:
    """Explain one inference, or what rules did over flights."""
    at_an_instant = arguments.inputs is not None or arguments.time is not None
    if arguments.inputs is not None and arguments.flights:
        raise UserMistake("--flights are for the share of each rule over them; drop --inputs, or the flights")
    if arguments.steps and (arguments.json or arguments.crossing is not None):
        raise UserMistake("--steps go without --json and --crossing; drop one of them")
    controller = asked(arguments)
    if at_an_instant or not flight_paths(arguments):
        _explain_instant(arguments, controller)
    else:
        _explain_flights(arguments, controller)


def _explain_instant(arguments: argparse.Namespace, controller: FuzzyController) -> None:
    found = list(instants(arguments, controller))
    told = [f"{one.told}\n" for one in found if one.told]
    silent = [{"system": one.system.name, "words": one.told} for one in found if one.inputs is None]
    if arguments.steps:
        steps = [text.explain(infer(one.system, one.inputs)) for one in found if one.inputs is not None]
        print("\n".join([*steps, *told]), end="")
        return
    try:
        explained = [
            explain(one.system, one.inputs, arguments.crossing or 0.0)
            for one in found
            if one.inputs is not None
        ]
    except ValueError as error:
        raise UserMistake(str(error)) from error
    if arguments.json:
        _print_json("explanations", [one.plain() for one in explained], not_fired=silent)
    else:
        print("\n".join([*(one.text(everything=arguments.all) for one in explained), *told]), end="")


def _explain_flights(arguments: argparse.Namespace, controller: FuzzyController) -> None:
    if arguments.steps or arguments.crossing is not None:
        raise UserMistake("--steps and --crossing are about one inference; add --time SECONDS or --inputs")
    flown = flown_inputs(arguments, controller) or {}
    found = {
        system.name: shares(system, flown[system.name]) if len(flown.get(system.name, ())) else None
        for system in controller.systems
    }
    if arguments.json:
        _print_json("shares", [one.plain() for one in found.values() if one is not None])
        return
    told = [
        f"{name}: it never fired anything on these flights\n"
        if one is None
        else one.text(everything=arguments.all)
        for name, one in found.items()
    ]
    print("\n".join(told), end="")


def _print_json(key: str, entries: list[dict[str, Any]], **more: list[dict[str, Any]]) -> None:
    print(data.write(SCHEMA, SCHEMA_VERSION, {key: entries} | more), end="")


def _finite(word: str) -> float:
    try:
        value = float(word)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"{word!r} is no number")
    return value
