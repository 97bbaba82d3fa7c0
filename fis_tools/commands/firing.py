"""`firing`: which rules fired along logged flights."""

import argparse

import numpy as np

from fis_tools.analysis import arrays, flights
from fis_tools.commands.arguments import (
    FLIGHTS_HELP,
    UserMistake,
    add_periods,
    add_trust,
    asked,
    chosen,
    flown_inputs,
)
from fis_tools.model import FuzzyController
from fis_tools.words import text

EPILOG = """\
Counted are the rows of tables, and along flights the inferences whose force was fired; with
--all-periods, all that were logged. Flights carry their controller along, tables do not.
fired: in how many of them the rule fired at the threshold or more; leading: in how many no
rule fired more strongly; mean, max: its strength over all of them.

examples:
  python -m fis_tools firing episodes/*.mcap
  python -m fis_tools firing episodes/best.mcap --system force_x --threshold 0.2
  python -m fis_tools firing room.csv --controller fan.yaml
"""


def add(command: argparse.ArgumentParser) -> None:
    """Add the arguments of the command to its parser."""
    command.add_argument("flights", nargs="+", metavar="FLIGHT", help=f"{FLIGHTS_HELP} of one controller")
    command.add_argument(
        "--controller", metavar="CONTROLLER", help="whose rules (default: those of the flights)"
    )
    add_trust(command)
    command.add_argument("--system", metavar="NAME", help="only this system")
    command.add_argument(
        "--threshold",
        type=_strength,
        default=arrays.FIRED,
        metavar="STRENGTH",
        help=f"a rule counts as fired from this strength on (default: {arrays.FIRED:g})",
    )
    add_periods(command)


def _strength(word: str) -> float:
    try:
        value = float(word)
    except ValueError:
        value = -1.0
    if not 0.0 < value <= 1.0:
        raise argparse.ArgumentTypeError(f"{word!r} is no strength above 0 and up to 1; write 0.05")
    return value


def _used(arguments: argparse.Namespace) -> tuple[FuzzyController, dict[str, arrays.RuleUsage]]:
    """Return the controller that is asked about, and how the rules of its systems fired."""
    paths, threshold = arguments.flights, arguments.threshold
    if arguments.controller is None:
        tables = [path for path in paths if not flights.is_flight(path)]
        if tables:
            raise UserMistake(f"{tables[0]} is no flight (.mcap) with a controller in it; add --controller")
        usages = flights.usage_along(paths, threshold, arguments.all_periods)
        return chosen(flights.read_controller(paths[0]), arguments.system), usages
    controller = asked(arguments)
    sensed = flown_inputs(arguments, controller) or {}
    return controller, {
        system.name: arrays.rule_usage(arrays.firing(system, sensed[system.name]), threshold)
        for system in controller.systems
        if len(sensed.get(system.name, ()))
    }


def run(arguments: argparse.Namespace) -> None:
    """Print which rules fired along logged flights."""
    controller, usages = _used(arguments)
    blocks = []
    for system in controller.systems:
        if system.name not in usages:
            blocks.append([f"{system.name}: it never fired anything on these flights"])
            continue
        usage = usages[system.name]
        order = np.argsort(-usage.fired, kind="stable")
        rows = [["fired", "leading", "mean", "max", "rule"]]
        for place in order:
            numbers = (usage.fired[place], usage.leading[place])
            strengths = (usage.mean_strength[place], usage.max_strength[place])
            rows.append(
                [
                    *(f"{100 * number:5.1f} %" for number in numbers),
                    *(f"{number:.2f}" for number in strengths),
                    f"{place + 1}. {text.sentence(system.rules[place])}",
                ]
            )
        idle = int(np.count_nonzero(usage.fired == 0))
        head = (
            f"{system.name}: {usage.num_samples} inferences; {idle} of {len(system.rules)} rules never fire "
            f"at {arguments.threshold:g} or more"
        )
        blocks.append([head, *text.aligned(rows, 2)])
    print("\n\n".join("\n".join(block) for block in blocks))
