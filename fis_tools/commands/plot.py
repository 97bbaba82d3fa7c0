"""`plot`: every picture of a controller, into a folder."""

import argparse
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

from fis_tools.analysis import flights
from fis_tools.commands.arguments import (
    UserMistake,
    add_controller,
    add_flights,
    asked,
    file_name,
    flight_paths,
    flown_inputs,
    place_for,
)
from fis_tools.commands.instant import add_instant, instants
from fis_tools.engines.inference import Floats, infer

if TYPE_CHECKING:
    from fis_tools.model import FuzzyController, FuzzySystem
    from fis_tools.render import Figure, Theme

    Pictures: TypeAlias = Iterator[tuple[FuzzySystem, str, Figure]]

KINDS = ("memberships", "rules", "surfaces", "inference", "firing")

EPILOG = """\
Names of files begin with that of the system: force_x-memberships.png, force_x-rules.png,
force_x-surface.png, force_x-surface-3d.png (force_x-curve.png for a single input), …

examples:
  python -m fis_tools plot controller.yaml -o figures
  python -m fis_tools plot controller.yaml --system force_x --only rules --theme dark --format svg
  python -m fis_tools plot controller.yaml --only inference --inputs distance=80,velocity_body_x=0.05
  python -m fis_tools plot episodes/best.mcap --time 600 -o figures
  python -m fis_tools plot fan.yaml --data room.csv --only firing
"""


def add(command: argparse.ArgumentParser) -> None:
    """Add the arguments of the command to its parser."""
    add_controller(command)
    command.add_argument(
        "-o", "--output", metavar="DIR", default=".", help="folder for the pictures (default: here)"
    )
    command.add_argument("--format", choices=["png", "svg", "pdf"], default="png", help="default: png")
    command.add_argument("--theme", choices=["light", "dark"], default="light", help="default: light")
    command.add_argument(
        "--only",
        choices=KINDS,
        action="append",
        metavar="KIND",
        help=f"draw only this, one of {', '.join(KINDS)}; may be given several times (default: all; an "
        "inference when --inputs or --time say which; firing with flights)",
    )
    add_instant(command)
    add_flights(
        command, "whose rules are drawn, and whose inputs over surfaces (default: CONTROLLER, if it is one)"
    )


def run(arguments: argparse.Namespace) -> None:
    """Draw every system of a controller into a folder."""
    from fis_tools.render import THEMES, save  # noqa: PLC0415 - the other commands start without matplotlib

    theme, kinds = THEMES[arguments.theme], _kinds(arguments)
    controller = asked(arguments)
    inferences = _fired(arguments, controller) if "inference" in kinds else []
    taken: Counter[str] = Counter()
    for drawn in (
        _of_systems(arguments, controller, kinds, theme),
        _of_instants(inferences, theme),
        _of_flights(arguments, controller, kinds, theme),
    ):
        for system, name, figure in drawn:
            picture = f"{file_name(system.name)}-{file_name(name)}"
            taken[picture.casefold()] += 1  # other names may come to the same file's
            if taken[picture.casefold()] > 1:
                picture += f"-{taken[picture.casefold()]}"
            path = place_for(Path(arguments.output) / f"{picture}.{arguments.format}")
            save(figure, path)
            print(path)


def _fired(
    arguments: argparse.Namespace, controller: "FuzzyController"
) -> "list[tuple[FuzzySystem, Floats]]":
    """Return the inferences that there are to draw."""
    found = list(instants(arguments, controller))
    drawn = [(one.system, one.inputs) for one in found if one.inputs is not None]
    if not drawn:
        raise UserMistake("; ".join(one.told for one in found))
    return drawn


def _kinds(arguments: argparse.Namespace) -> list[str]:
    """Return what to draw: what is asked for, or all there is."""
    is_told = arguments.inputs is not None or arguments.time is not None
    if arguments.only is None:
        return [
            *KINDS[:3],
            *(["inference"] if is_told else []),
            *(["firing"] if flight_paths(arguments) else []),
        ]
    if is_told and "inference" not in arguments.only:
        raise UserMistake("--inputs and --time are for an inference; add --only inference, or leave them out")
    if "firing" in arguments.only and not flight_paths(arguments):
        raise UserMistake("--only firing is for logged data; give a flight (.mcap), or add --flights FILE")
    return list(arguments.only)


def _of_systems(
    arguments: argparse.Namespace, controller: "FuzzyController", kinds: list[str], theme: "Theme"
) -> "Pictures":
    from fis_tools import render  # noqa: PLC0415 - as above

    sensed = flown_inputs(arguments, controller) or {}
    for system in controller.systems:
        if "memberships" in kinds:
            yield system, "memberships", render.memberships_figure(system, theme=theme)
        if "rules" in kinds:
            yield from ((system, *named) for named in render.rules_figures(system, theme=theme))
        for in_space in (False, True) if "surfaces" in kinds else ():
            flown = sensed.get(system.name)
            drawn = render.surface_figures(system, in_space=in_space, samples=flown, theme=theme)
            yield from ((system, *named) for named in drawn)


def _of_instants(inferences: "list[tuple[FuzzySystem, Floats]]", theme: "Theme") -> "Pictures":
    from fis_tools import render  # noqa: PLC0415 - as above

    for system, inputs in inferences:
        yield system, "inference", render.inference_figure(infer(system, inputs), theme=theme)


def _of_flights(
    arguments: argparse.Namespace, controller: "FuzzyController", kinds: list[str], theme: "Theme"
) -> "Pictures":
    from fis_tools import render  # noqa: PLC0415 - as above

    for path in flight_paths(arguments) if "firing" in kinds else ():
        for flown in flights.read_flight(path, arguments.all_periods, controller):
            if arguments.system in (None, flown.system.name) and len(flown.time_s):
                figure = render.firing_figure(
                    flown.system,
                    flown.time_s,
                    flown.firing_strengths,
                    is_timed=flown.is_timed,
                    theme=theme,
                )
                yield flown.system, "firing", figure
