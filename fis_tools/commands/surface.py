"""`surface`: an output over two inputs, as numbers or a picture."""

from importlib import import_module
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from cyclopts import Parameter

from fis_tools.analysis import arrays
from fis_tools.array_types import Floats
from fis_tools.commands.arguments import (
    AskedAlong,
    Output,
    UserMistake,
    assignments,
    chosen,
    expected,
    flown_inputs,
    place_for,
    the_system,
    write,
)
from fis_tools.formats.csv import rows_as_text
from fis_tools.model import FuzzySystem
from fis_tools.source import read_controller

MOST_POINTS = 1000
PICTURES = (".png", ".svg", ".pdf")


def run(
    asked: AskedAlong,
    *,
    x: str | None = None,
    y: str | None = None,
    of: str | None = None,
    fixed: str = "",
    points: Annotated[
        int, expected("a whole number from 2 to 1000", lambda count: 2 <= count <= MOST_POINTS)
    ] = 61,
    in_space: Annotated[bool, Parameter(name="--3d")] = False,
    theme: Literal["light", "dark"] = "light",
    output: Output = None,
) -> None:
    """Evaluate an output over two inputs, as numbers or a picture.

    The two inputs that are not named by --x, --y or --fixed go along the axes. Numbers are printed as CSV, a
    row a point.

    For example:

        python -m fis_tools surface controller.yaml --system force_x -o force_x.png
        python -m fis_tools surface controller.yaml --system force_x --3d --theme dark -o force_x.svg
        python -m fis_tools surface controller.yaml --x a --y b --fixed c=80 --points 21 > surface.csv
        python -m fis_tools surface controller.yaml --system force_x --flights episodes/*.mcap -o flown.pdf

    Parameters
    ----------
    x
        the input along x [default: the first that is free]
    y
        the input along y [default: the next that is free]
    of
        which output [default: the first]
    fixed
        other inputs, NAME=NUMBER,NAME=NUMBER [default: the middle of their ranges]
    points
        along each axis
    in_space
        draw it in space
    theme
        of the picture
    output
        .png, .svg, .pdf, or CSV [default: CSV, printed]
    """
    controller = read_controller(asked.controller, asked.trust)
    system = the_system(chosen(controller, asked.system))
    ending = Path(output or "").suffix.lower()
    if ending not in (*PICTURES, ".csv") and output is not None:
        raise UserMistake(f"{output} ends in none of {', '.join(PICTURES)}, .csv; name the file so")
    if ending in PICTURES:  # what pictures need is missed before anything is computed
        import_module("fis_tools.render")
    elif in_space or asked.flights:
        raise UserMistake("--3d and --flights are for pictures; add -o FILE.png, .svg or .pdf")
    held = assignments(fixed)
    try:
        result = arrays.surface(system, x, y, fixed=held, output=of, num_points=points)
    except ValueError as error:
        raise UserMistake(str(error)) from error
    if output is None or ending not in PICTURES:
        write(output, _surface_csv(result))
        return
    flown = flown_inputs(asked.flights, controller, asked.all_periods) or {}
    _draw(system, result, flown.get(system.name), in_space, theme, Path(output))


def _draw(
    system: FuzzySystem,
    result: arrays.Surface,
    samples: Floats | None,
    in_space: bool,
    theme: str,
    place: Path,
) -> None:
    from fis_tools import render  # noqa: PLC0415 - as in `plot`

    colours = render.THEMES[theme]
    points = None if samples is None else render.over_axes(system, result, samples)
    words = render.held_words(system, result.fixed)
    figure, ax = render.one_panel(system.name, theme=colours, in_space=in_space)
    draw = render.surface_space if in_space else render.draw_surface
    draw(result, ax, points=points, title=words, theme=colours)
    render.save(figure, place_for(place))


def _surface_csv(result: arrays.Surface) -> str:
    rows = [[result.x_variable.name, result.y_variable.name, result.output.name]]
    for (row, column), value in np.ndenumerate(result.values):
        rows.append([repr(float(number)) for number in (result.x[column], result.y[row], value)])
    return rows_as_text(rows)
