"""`review`: one page of everything about a controller, to sign off from."""

import argparse
import sys
from pathlib import Path

from fis_tools.commands.arguments import (
    FLIGHTS_HELP,
    add_controller,
    add_periods,
    asked,
    flight_paths,
    place_for,
)

EPILOG = """\
The page is one HTML file that needs no network: how it flew, requirements, findings, constants, then
each system with an inference whose sliders compute in the page what Python computes. Findings are
accepted or waived on it, checks ticked, a name and a date entered; it saves these as JSON tied to the
controller's SHA-256 (that of `python -m fis_tools export CONTROLLER --format json`), and prints a
summary of two pages.

examples:
  python -m fis_tools review controller.yaml
  python -m fis_tools review outputs/train/TIME --flights outputs/train/TIME
  python -m fis_tools review episodes/best.mcap -o best.html
  python -m fis_tools review controller.yaml --flights RUN --evidence RUN/assure/evidence.json
"""


def add(command: argparse.ArgumentParser) -> None:
    """Add the arguments of the command to its parser."""
    add_controller(command)
    command.add_argument(
        "--flights",
        "--data",
        metavar="FLIGHT",
        nargs="+",
        default=[],
        help=f"{FLIGHTS_HELP}, or the folder of a run (default: CONTROLLER, if it is a flight)",
    )
    command.add_argument(
        "--evidence", metavar="FILE", help="the evidence.json that tells what became of the requirements"
    )
    add_periods(command)
    command.add_argument(
        "-o", "--output", metavar="FILE", default="review.html", help="where to (default: review.html)"
    )


def run(arguments: argparse.Namespace) -> None:
    """Write the review page."""
    from fis_tools.review import page  # noqa: PLC0415 - the other commands start without templates

    controller = asked(arguments)
    print(f"reviewing {controller.name}", file=sys.stderr)
    text = page.write(
        controller,
        flight_paths(arguments),
        arguments.system,
        arguments.evidence,
        all_periods=arguments.all_periods,
    )
    path = place_for(Path(arguments.output))
    path.write_text(text, encoding="utf-8")
    print(f"{path}: {len(text.encode()) / 1e6:.2f} MB; open it in a browser", file=sys.stderr)
