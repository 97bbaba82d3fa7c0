"""Which inputs of which systems a command is about: given by hand, or those of a flight at a time."""

import argparse
from collections.abc import Iterator

import numpy as np

from fis_tools.analysis import flights
from fis_tools.commands.arguments import UserMistake, assignments, chosen
from fis_tools.engines.inference import Floats
from fis_tools.model import FuzzySystem
from fis_tools.model.validate import nearest
from fis_tools.source import read_controller


def add_instant(command: argparse.ArgumentParser) -> None:
    """Let a command be told inputs, or the time of a flight."""
    instant = command.add_mutually_exclusive_group()
    instant.add_argument(
        "--inputs", metavar="NAME=NUMBER,…", help="the inputs, in the units that `show` prints"
    )
    instant.add_argument(
        "--time", type=float, metavar="SECONDS", help="of a logged flight: its inputs at this time"
    )


def samples(arguments: argparse.Namespace) -> Iterator[tuple[FuzzySystem, Floats]]:
    """Yield each system that is meant with its inputs, given by hand or logged."""
    if arguments.time is None:
        yield from _given(arguments)
        return
    if not flights.is_flight(arguments.controller):
        raise UserMistake("--time is for logged flights (.mcap); give --inputs for a controller file")
    flown_systems = flights.read_flight(arguments.controller)
    names = [flown.system.name for flown in flown_systems]
    if arguments.system is not None and arguments.system not in names:
        raise UserMistake(
            f"the flight has no system {arguments.system!r}; {nearest(arguments.system, names)}"
        )
    span = flights.span_of_inference(flown_systems)
    if span is not None and not arguments.time <= span[1]:
        raise UserMistake(
            f"--time {arguments.time:g} is not on this flight, whose inferences cover "
            f"{span[0]:g} to {span[1]:g} s; choose a time among these"
        )
    for flown in flown_systems:
        if arguments.system in (None, flown.system.name):
            place = int(np.searchsorted(flown.time_s, arguments.time, side="right")) - 1
            if place < 0:
                raise UserMistake(f"{flown.system.name!r} decided nothing up to {arguments.time:g} s")
            yield flown.system, flown.inputs[place]


def _given(arguments: argparse.Namespace) -> Iterator[tuple[FuzzySystem, Floats]]:
    controller = chosen(read_controller(arguments.controller), arguments.system)
    values = assignments(arguments.inputs or "")
    known = list(dict.fromkeys(v.name for system in controller.systems for v in system.inputs))
    for name in values:
        if name not in known:
            raise UserMistake(f"there is no input {name!r}; {nearest(name, known)}")
    complete = [s for s in controller.systems if all(variable.name in values for variable in s.inputs)]
    if not complete:
        needs = "; ".join(f"{s.name} needs {', '.join(v.name for v in s.inputs)}" for s in controller.systems)
        raise UserMistake(
            "the inputs of no system are all given; add --inputs NAME=NUMBER,… "
            f"(or --time for a flight): {needs}"
        )
    for system in complete:
        yield system, np.array([values[variable.name] for variable in system.inputs])
