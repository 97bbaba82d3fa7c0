"""`show`, `plot`, `surface`, `review`, `edit`: a controller in words, in pictures, on a page."""

import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from cyclopts import Parameter

from fis_tools.analysis import arrays, flights
from fis_tools.array_types import Floats
from fis_tools.commands import arguments
from fis_tools.engines.inference import infer
from fis_tools.errors import Mistake, raised_as
from fis_tools.formats.csv import rows_as_text
from fis_tools.formats.files import file_name
from fis_tools.model import FuzzyController, FuzzySystem, Inferable, tree, whole
from fis_tools.source import read_controller
from fis_tools.words.text import outline
from plain_files.document import text

if TYPE_CHECKING:
    from fis_tools.render import Figure, Theme

KINDS = ("memberships", "rules", "surfaces", "inference", "firing")


def show(args: arguments.ControllerArguments) -> None:
    """Print variables, terms and rule tables.

    For example:

        python -m fis_tools show controller.yaml
        python -m fis_tools show tipper.fis
        python -m fis_tools show outputs/train/TIME --system force_x
    """
    controller = args.read()
    print(text.write(outline(controller)), end="")


def plot(
    args: arguments.InstantArguments,
    *,
    output: Annotated[str, Parameter(name=("--output", "-o"))] = ".",
    format: Literal["png", "svg", "pdf"] = "png",
    theme: Literal["light", "dark"] = "light",
    only: tuple[Literal["memberships", "rules", "surfaces", "inference", "firing"], ...] = (),
) -> None:
    """Draw membership functions, rules, surfaces and inferences into a folder.

    Names of files begin with that of the system: force_x-memberships.png, force_x-rules.png,
    force_x-surface.png, force_x-surface-3d.png (force_x-curve.png for a single input), …

    For example:

        python -m fis_tools plot controller.yaml -o figures
        python -m fis_tools plot controller.yaml --system force_x --only rules --theme dark --format svg
        python -m fis_tools plot controller.yaml --only inference --inputs distance=80,velocity_body_x=0.05
        python -m fis_tools plot episodes/best.mcap --time 600 -o figures
        python -m fis_tools plot fan.yaml --data room.csv --only firing

    Parameters
    ----------
    output
        folder for the pictures
    format
        of the files
    theme
        of the pictures
    only
        draw only this; may be given several times [default: all; an inference when --inputs or --time say
        which; firing with flights]
    """
    from fis_tools.render import THEMES, save  # noqa: PLC0415 - the other commands start without matplotlib

    colours, kinds = THEMES[theme], _kinds(args, only)
    controller = args.read()
    inferences = _fired(args, controller) if "inference" in kinds else []
    taken: Counter[str] = Counter()
    for system, name, figure in _pictures(args, controller, kinds, inferences, colours):
        picture = f"{file_name(system.name)}-{file_name(name)}"
        taken[picture.casefold()] += 1  # other names may lead to the same file name
        if taken[picture.casefold()] > 1:
            picture += f"-{taken[picture.casefold()]}"
        path = arguments.place_for(Path(output) / f"{picture}.{format}")
        save(figure, path)
        print(path)


def _fired(args: arguments.InstantArguments, controller: FuzzyController) -> list[tuple[FuzzySystem, Floats]]:
    """Return the inferences to draw."""
    chosen = list(arguments.instants(args, controller))
    drawn = [(instant.system, instant.inputs) for instant in chosen if instant.inputs is not None]
    if not drawn:
        raise Mistake("; ".join(instant.note for instant in chosen))
    return drawn


def _kinds(args: arguments.InstantArguments, only: Sequence[str]) -> Sequence[str]:
    """Return the kinds of pictures to draw: those requested, or all."""
    if not only:
        more = {"inference": args.is_instant, "firing": bool(args.paths)}
        return [*KINDS[:3], *(kind for kind, is_asked in more.items() if is_asked)]
    if args.is_instant and "inference" not in only:
        raise Mistake("--inputs and --time are for an inference; add --only inference, or leave them out")
    if "firing" in only and not args.paths:
        raise Mistake("--only firing is for logged data; give a flight (.mcap), or add --flights FILE")
    return only


def _pictures(
    args: arguments.InstantArguments,
    controller: FuzzyController,
    kinds: Sequence[str],
    inferences: list[tuple[FuzzySystem, Floats]],
    theme: "Theme",
) -> "Iterator[tuple[Inferable, str, Figure]]":
    """Yield the pictures of some kinds, each with the system that it shows and a name for its file."""
    from fis_tools import render  # noqa: PLC0415 - as above

    sensed = args.flown(controller) or {}
    for system in controller.systems:
        if "memberships" in kinds:
            yield system, "memberships", render.memberships_figure(system, theme=theme)
        if "rules" in kinds:
            yield from ((system, *named) for named in render.rules_figures(system, theme=theme))
        for in_space in (False, True) if "surfaces" in kinds else ():
            flown = sensed.get(system.name)
            drawn = render.surface_figures(system, in_space=in_space, samples=flown, theme=theme)
            yield from ((system, *named) for named in drawn)
    if controller.wires and "surfaces" in kinds:
        wired = tree(controller)
        yield from ((wired, *named) for named in render.surface_figures(wired, theme=theme))
    for system, inputs in inferences:
        yield system, "inference", render.inference_figure(infer(system, inputs), theme=theme)
    for path in args.paths if "firing" in kinds else ():
        for along in flights.read_flight(path, args.all_periods, controller):
            if args.system in (None, along.system.name) and len(along.time_s):
                fired = along.firing_strengths
                figure = render.firing_figure(
                    along.system, along.time_s, fired, is_timed=along.is_timed, theme=theme
                )
                yield along.system, "firing", figure


MOST_POINTS = 1000
PICTURES = (".png", ".svg", ".pdf")


def surface(
    args: arguments.FlightArguments,
    *,
    x: str | None = None,
    y: str | None = None,
    of: str | None = None,
    fixed: str = "",
    points: Annotated[int, arguments.whole_number(2, MOST_POINTS)] = 61,
    in_space: Annotated[bool, Parameter(name="--3d")] = False,
    theme: Literal["light", "dark"] = "light",
    output: arguments.Output = None,
) -> None:
    """Evaluate an output over two inputs, as numbers or a picture.

    By default the first two inputs that --fixed does not name go along the axes. Numbers are printed as CSV,
    one row per point.

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
    controller = read_controller(args.controller, args.trust)
    system = whole(arguments.chosen(controller, args.system), "add --system")
    ending = Path(output or "").suffix.lower()
    if ending not in (*PICTURES, ".csv") and output is not None:
        raise Mistake(f"{output} ends in none of {', '.join(PICTURES)}, .csv; name the file so")
    if ending in PICTURES:  # a missing package is reported before anything is computed
        import_module("fis_tools.render")
    elif in_space or args.flights:
        raise Mistake("--3d and --flights are for pictures; add -o FILE.png, .svg or .pdf")
    held = arguments.assignments(fixed)
    with raised_as(Mistake, ValueError):
        result = arrays.surface(system, x, y, fixed=held, output=of, num_points=points)
    if output is None or ending not in PICTURES:
        arguments.write(output, _surface_csv(result))
        return
    from fis_tools import render  # noqa: PLC0415 - as in `plot`

    flown = arguments.flown_inputs(args.flights, controller, args.all_periods) or {}
    marked = render.over_axes(system, result, flown.get(system.name))
    words = render.held_words(system, result.fixed)
    colours = render.THEMES[theme]
    figure, ax = render.one_panel(system.name, theme=colours, in_space=in_space)
    draw = render.surface_space if in_space else render.draw_surface
    draw(result, ax, points=marked, title=words, theme=colours)
    render.save(figure, arguments.place_for(Path(output)))


def _surface_csv(result: arrays.Surface) -> str:
    """Return a surface as CSV, a row for each point."""
    rows = [[result.x_variable.name, result.y_variable.name, result.output.name]]
    for (row, column), value in np.ndenumerate(result.values):
        rows.append([repr(float(number)) for number in (result.x[column], result.y[row], value)])
    return rows_as_text(rows)


def review(
    args: arguments.FlightArguments,
    *,
    evidence: str | None = None,
    output: Annotated[str, Parameter(name=("--output", "-o"))] = "review.html",
) -> None:
    """Write one HTML page to review a controller and sign it off.

    The page is one HTML file that needs no network: what the controller is for, verdicts, its rule tables,
    how often it fails, what is not covered, findings, constants, then each system with an inference whose
    sliders compute in the page what Python computes. Findings are accepted or waived on it, checks ticked, a
    name and a date entered; it saves these as JSON tied to the controller's SHA-256 (that of `python -m
    fis_tools export CONTROLLER --format json`), and prints whole, or a summary. --flights may also be the
    folder of a run: then failures are counted over all flights of its evaluation.

    For example:

        python -m fis_tools review controller.yaml
        python -m fis_tools review outputs/train/TIME --flights outputs/train/TIME
        python -m fis_tools review episodes/best.mcap -o best.html
        python -m fis_tools review controller.yaml --flights RUN --evidence RUN/assure/evidence.json

    Parameters
    ----------
    evidence
        an evidence.json, with verdicts on the requirements
    output
        where to
    """
    from fis_tools.review import page  # noqa: PLC0415 - the other commands start without templates

    controller = args.read()
    print(f"reviewing {controller.name}", file=sys.stderr)
    with arguments.analysing(controller):
        text = page.write(controller, args.paths, args.system, evidence, all_periods=args.all_periods)
    path = Path(output)
    arguments.write_file(path, text.encode())
    print(f"{path}: {len(text.encode()) / 1e6:.2f} MB; open it in a browser", file=sys.stderr)


def edit(
    args: arguments.ControllerArguments,
    *,
    port: Annotated[int, arguments.whole_number(0, 65535)] = 0,
    no_browser: bool = False,
) -> None:
    """Edit a controller on a page that answers every touch; nothing is written but the copies you save.

    Drag the terms, or type their numbers; click through the terms of the rules. The page shows at once how
    the surface and the findings of `audit` change, and what differs from the file. It is served on this
    machine alone, at an address that is printed, until Ctrl-C.

    For example:

        python -m fis_tools edit controller.yaml
        python -m fis_tools edit tipper.fis --no-browser --port 8700

    Parameters
    ----------
    port
        of the page; 0 for any that is free
    no_browser
        print the address and open no browser
    """
    controller = args.read()
    from fis_tools.edit.server import serve  # noqa: PLC0415, I001 - says first what is not installed
    from fis_tools.edit.page import Editor  # noqa: PLC0415 - the other commands do without a server
    from fis_tools.edit.session import Session  # noqa: PLC0415 - as above

    path = Path(args.controller)
    serve(lambda: Session(path, controller), Editor, controller.name, port, not no_browser)
