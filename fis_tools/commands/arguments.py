"""What the commands share: how a controller, a system, inputs and a place to write are asked for."""

import argparse
import re
from collections.abc import Callable
from math import inf, isfinite
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fis_tools.analysis import arrays, flights
from fis_tools.analysis.contribution import importance
from fis_tools.engines.compiler import compile as compiled
from fis_tools.formats import serialize
from fis_tools.model import FuzzyController, FuzzySystem
from fis_tools.model.validate import nearest
from fis_tools.source import read_controller

Floats = NDArray[np.float64]

#: Samples of the ranges of the inputs, where importance is asked for without flights.
NUM_SPREAD = 2048

_WRITERS = {".json": serialize.dump_json, ".yaml": serialize.dump_yaml, ".yml": serialize.dump_yaml}

CONTROLLER_HELP = (
    "a controller file (.json, .yaml), a file of another program (.fis, .fll, .fml, .xml), the folder of a "
    "run (its champion.json), a logged flight (.mcap), or, with --trust, FILE.py:NAME: a scikit-fuzzy "
    "ControlSystem, or a system of fis_tools"
)

FLIGHTS_HELP = (
    "logged data: tables (.csv, .parquet) with a column for each input, by its name, or flights (.mcap)"
)


class UserMistake(ValueError):  # noqa: N818
    """What the person at the keyboard can put right, told in a sentence."""


def add_controller(command: argparse.ArgumentParser) -> None:
    """Let a command be about one controller, or one system of it."""
    command.add_argument("controller", metavar="CONTROLLER", help=CONTROLLER_HELP)
    command.add_argument("--system", metavar="NAME", help="only this system of the controller")
    add_trust(command)


def add_trust(command: argparse.ArgumentParser) -> None:
    """Let a command run the program that a controller is an object of."""
    command.add_argument(
        "--trust", action="store_true", help="run the Python program that a controller is read from"
    )


def asked(arguments: argparse.Namespace) -> FuzzyController:
    """Return the controller that a command is about, or the one system of it that is asked for."""
    return chosen(read_controller(arguments.controller, arguments.trust), arguments.system)


def add_flights(
    command: argparse.ArgumentParser,
    use: str = "whose inputs are looked at (default: CONTROLLER, if it is a flight)",
) -> None:
    """Let a command look at what systems sensed along flights."""
    command.add_argument("--flights", "--data", nargs="+", metavar="FLIGHT", help=f"{FLIGHTS_HELP} {use}")
    add_periods(command)


def flight_paths(arguments: argparse.Namespace) -> list[str]:
    """Return the flights that are named: the controller's own, where it is one."""
    return arguments.flights or [path for path in [arguments.controller] if flights.is_flight(path)]


def add_periods(command: argparse.ArgumentParser) -> None:
    """Let a command count every inference along flights."""
    command.add_argument(
        "--all-periods",
        action="store_true",
        help="along flights, count every inference, not only those whose force was fired",
    )


def flown_inputs(arguments: argparse.Namespace, controller: FuzzyController) -> dict[str, Floats] | None:
    """Return what the systems of a controller sensed along the flights that are named; None without any.

    The flights may be those of another controller, such as the one before a change, if its systems of the
    same names have the same inputs.
    """
    paths = flight_paths(arguments)
    if not paths:
        return None
    sensed = flights.inputs_along(paths, arguments.all_periods, controller)
    carried = flights.read_controller(paths[0]) if flights.is_flight(paths[0]) else controller
    flown = {system.name: [v.name for v in system.inputs] for system in carried.systems}
    for system in controller.systems:
        inputs = [variable.name for variable in system.inputs]
        if flown.get(system.name, inputs) != inputs:
            raise UserMistake(
                f"{paths[0]} was flown with a system {system.name!r} of the inputs "
                f"{', '.join(flown[system.name])}, but the controller's has {', '.join(inputs)}; "
                "give flights of this controller"
            )
    found = {system.name: sensed[system.name] for system in controller.systems if system.name in sensed}
    if not found:
        raise UserMistake(
            f"{paths[0]} was flown with {', '.join(flown)}, but the controller has "
            f"{', '.join(system.name for system in controller.systems)}; give flights of this controller"
        )
    return found


def add_order(command: argparse.ArgumentParser) -> None:
    """Let a command list rules by how much they matter."""
    command.add_argument(
        "--by",
        choices=["importance"],
        help="list rules that matter most first: along --flights, else over the whole ranges of the inputs",
    )
    add_flights(command)


def importance_asked(arguments: argparse.Namespace, controller: FuzzyController) -> dict[str, Floats] | None:
    """Return how much each rule matters, by `fis_tools.analysis.contribution`; None if nobody asked.

    A system that decided nothing on the flights is missing.
    """
    if arguments.by is None:
        if arguments.flights:
            raise UserMistake("--flights are for --by importance; add it, or leave the flights out")
        return None
    samples = flown_inputs(arguments, controller)
    if samples is None:
        samples = {system.name: arrays.spread_inputs(system, NUM_SPREAD) for system in controller.systems}
    return {
        system.name: importance(compiled(system), samples[system.name])
        for system in controller.systems
        if len(samples.get(system.name, ()))
    }


def chosen(controller: FuzzyController, name: str | None) -> FuzzyController:
    """Keep only the system that is asked for, where one is."""
    if name is None:
        return controller
    names = [system.name for system in controller.systems]
    if name not in names:
        raise UserMistake(f"controller {controller.name!r} has no system {name!r}; {nearest(name, names)}")
    systems = tuple(system for system in controller.systems if system.name == name)
    return FuzzyController(controller.name, systems, controller.attributes, controller.provenance)


def the_system(controller: FuzzyController, name: str | None) -> FuzzySystem:
    """Return the system that is asked for, or the only one."""
    systems = chosen(controller, name).systems
    if len(systems) > 1:
        names = ", ".join(system.name for system in systems)
        raise UserMistake(f"controller {controller.name!r} has several systems; add --system, one of {names}")
    return systems[0]


def assignments(words: str) -> dict[str, float]:
    """Read ``NAME=NUMBER,NAME=NUMBER``."""
    values: dict[str, float] = {}
    for word in filter(None, (word.strip() for word in words.split(","))):
        name, _, number = (part.strip() for part in word.rpartition("="))
        try:
            value = float(number)
        except ValueError:
            value = inf
        if not name or not isfinite(value):
            raise UserMistake(f"{word!r} gives no name a finite number; write NAME=NUMBER,NAME=NUMBER")
        if name in values:
            raise UserMistake(f"{name!r} is given twice; give it one number")
        values[name] = value
    return values


def file_name(name: str) -> str:
    """Return a name that every file system takes."""
    return re.sub(r"[^\w.-]+", "_", name).strip(".") or "_"


def place_for(path: Path) -> Path:
    """Make the folder that a file goes into; return the file's path."""
    path.parent.mkdir(parents=True, exist_ok=True)
    return path


def form_of(output: str | None) -> Callable[[FuzzyController], str] | None:
    """Return what writes a controller into a file of such a name; None without one."""
    form = _WRITERS.get(Path(output).suffix.lower()) if output else None
    if output and form is None:
        raise UserMistake(f"{output} ends in none of {', '.join(_WRITERS)}; name the file so")
    return form


def write(output: str | None, content: str) -> None:
    """Write a text to a file, or print it where none is named."""
    if output is None:
        print(content, end="")
    else:
        place_for(Path(output)).write_text(content, encoding="utf-8")


def count(word: str) -> int:
    """Read a number of points."""
    if not word.isdecimal() or not 2 <= int(word) <= 1000:
        raise argparse.ArgumentTypeError(f"{word!r} is no whole number from 2 to 1000")
    return int(word)
