"""`surface`: an output over two inputs, as numbers or a picture."""

import argparse
import csv
import io
from pathlib import Path

import numpy as np

from fis_tools import analysis
from fis_tools.commands.arguments import (
    Commands,
    UserMistake,
    add_command,
    assignments,
    count,
    place_for,
    the_system,
    write,
)
from fis_tools.source import read_controller

PICTURES = (".png", ".svg", ".pdf")


def add(commands: Commands) -> None:
    """Add the command to the parser."""
    command = add_command(
        commands, "surface", run, "evaluate an output over two inputs, as numbers or a picture"
    )
    command.add_argument("--x", metavar="INPUT", help="input along x (default: the first that is free)")
    command.add_argument("--y", metavar="INPUT", help="input along y (default: the next that is free)")
    command.add_argument("--of", metavar="OUTPUT", help="which output (default: the first)")
    command.add_argument(
        "--fixed",
        metavar="NAME=NUMBER,…",
        default="",
        help="other inputs (default: the middle of their ranges)",
    )
    command.add_argument("--points", type=count, default=61, help="along each axis (default: 61)")
    command.add_argument(
        "-o", "--output", metavar="FILE", help=".png, .svg, .pdf, or CSV (default: CSV, printed)"
    )


def run(arguments: argparse.Namespace) -> None:
    """Evaluate an output over two inputs: a table of numbers, or a picture."""
    system = the_system(read_controller(arguments.controller), arguments.system)
    fixed = assignments(arguments.fixed)
    x, y, of, num_points = arguments.x, arguments.y, arguments.of, arguments.points
    try:
        result = analysis.surface(system, x, y, fixed=fixed, output=of, num_points=num_points)
    except ValueError as error:
        raise UserMistake(str(error)) from error
    if arguments.output is None or Path(arguments.output).suffix not in PICTURES:
        write(arguments.output, _surface_csv(result))
        return
    from fis_tools.render import one_panel, surface_map  # noqa: PLC0415 - as in `plot`

    figure, ax = one_panel(system.name)
    surface_map(system, ax, x, y, fixed=fixed, output=of, num_points=num_points)
    figure.savefig(place_for(Path(arguments.output)), dpi=150)


def _surface_csv(result: analysis.Surface) -> str:
    lines = io.StringIO()
    writer = csv.writer(lines, lineterminator="\n")
    writer.writerow([result.x_variable.name, result.y_variable.name, result.output.name])
    for (row, column), value in np.ndenumerate(result.values):
        writer.writerow([repr(float(number)) for number in (result.x[column], result.y[row], value)])
    return lines.getvalue()
