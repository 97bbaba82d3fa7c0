"""`surface`: an output over two inputs, as numbers or a picture."""

import argparse
from importlib import import_module
from pathlib import Path

import numpy as np

from fis_tools.analysis import arrays
from fis_tools.commands.arguments import (
    UserMistake,
    add_controller,
    add_flights,
    assignments,
    count,
    flown_inputs,
    place_for,
    the_system,
    write,
)
from fis_tools.formats.csv import rows_as_text
from fis_tools.model import FuzzyController, FuzzySystem
from fis_tools.source import read_controller

PICTURES = (".png", ".svg", ".pdf")

EPILOG = """\
The two inputs that are not named by --x, --y or --fixed go along the axes. Numbers are printed as CSV,
a row a point.

examples:
  python -m fis_tools surface controller.yaml --system force_x -o force_x.png
  python -m fis_tools surface controller.yaml --system force_x --3d --theme dark -o force_x.svg
  python -m fis_tools surface controller.yaml --x a --y b --fixed c=80 --points 21 > surface.csv
  python -m fis_tools surface controller.yaml --system force_x --flights episodes/*.mcap -o flown.pdf
"""


def add(command: argparse.ArgumentParser) -> None:
    """Add the arguments of the command to its parser."""
    add_controller(command)
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
    command.add_argument("--3d", dest="in_space", action="store_true", help="draw it in space")
    command.add_argument("--theme", choices=["light", "dark"], default="light", help="default: light")
    add_flights(command, "to lay over the picture")
    command.add_argument(
        "-o", "--output", metavar="FILE", help=".png, .svg, .pdf, or CSV (default: CSV, printed)"
    )


def run(arguments: argparse.Namespace) -> None:
    """Evaluate an output over two inputs: a table of numbers, or a picture."""
    controller = read_controller(arguments.controller, arguments.trust)
    system = the_system(controller, arguments.system)
    fixed = assignments(arguments.fixed)
    x, y, of, num_points = arguments.x, arguments.y, arguments.of, arguments.points
    ending = Path(arguments.output or "").suffix.lower()
    if ending not in (*PICTURES, ".csv") and arguments.output is not None:
        raise UserMistake(f"{arguments.output} ends in none of {', '.join(PICTURES)}, .csv; name the file so")
    if ending in PICTURES:  # what pictures need is missed before anything is computed
        import_module("fis_tools.render")
    elif arguments.in_space or arguments.flights:
        raise UserMistake("--3d and --flights are for pictures; add -o FILE.png, .svg or .pdf")
    try:
        result = arrays.surface(system, x, y, fixed=fixed, output=of, num_points=num_points)
    except ValueError as error:
        raise UserMistake(str(error)) from error
    if ending not in PICTURES:
        write(arguments.output, _surface_csv(result))
        return
    _draw(arguments, controller, system, result)


def _draw(
    arguments: argparse.Namespace,
    controller: FuzzyController,
    system: FuzzySystem,
    result: arrays.Surface,
) -> None:
    from fis_tools import render  # noqa: PLC0415 - as in `plot`

    theme = render.THEMES[arguments.theme]
    flown = flown_inputs(arguments, controller) if arguments.flights else None
    samples = None if flown is None else flown.get(system.name)
    points = None if samples is None else render.over_axes(system, result, samples)
    words = render.held_words(system, result.fixed)
    figure, ax = render.one_panel(system.name, theme=theme, in_space=arguments.in_space)
    draw = render.surface_space if arguments.in_space else render.draw_surface
    draw(result, ax, points=points, title=words, theme=theme)
    render.save(figure, place_for(Path(arguments.output)))


def _surface_csv(result: arrays.Surface) -> str:
    rows = [[result.x_variable.name, result.y_variable.name, result.output.name]]
    for (row, column), value in np.ndenumerate(result.values):
        rows.append([repr(float(number)) for number in (result.x[column], result.y[row], value)])
    return rows_as_text(rows)
