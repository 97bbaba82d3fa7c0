"""`bounds`, `domain`: outputs in a region, and flights that left the operational domain."""

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from cyclopts import Parameter

from fis_tools.analysis import flights as logged
from fis_tools.analysis import tables
from fis_tools.analysis.bounds import NUM_BOXES, ask, output_ranges
from fis_tools.analysis.domain import Box, Departure, departures, from_mapping
from fis_tools.commands.arguments import ControllerArguments, analysing, expected
from fis_tools.errors import ControllerFileError, Mistake, raised_as
from fis_tools.model import whole
from plain_files.file_access import read_text
from plain_files.plain_text import parse_json


def bounds(
    args: ControllerArguments,
    *,
    where: str = "",
    question: Annotated[str | None, Parameter(name="--ask")] = None,
    boxes: Annotated[int, expected("a whole number above 0", lambda count: count > 0)] = NUM_BOXES,
    seconds: Annotated[float, expected("a number above 0", lambda seconds: seconds > 0)] = 600.0,
    expect: Literal["yes", "no"] | None = None,
) -> int:
    """Prove what the outputs can and cannot be in a region.

    Conditions are written NAME > NUMBER, NAME in [NUMBER, NUMBER] or 2 NAME - OTHER <= NUMBER; several, with
    commas between, hold together. An input beyond its range is taken as the end of it; conditions on several
    inputs together are about values inside their ranges. A yes comes with inputs and outputs that were
    evaluated. A no is proved: no inputs of the region, of any number, can do it. Wired systems are bounded as
    a whole, from the bounds of each.

    The exit status is 0; with --expect it is 1 where the answer is another one; a mistake gives 2.

    For example:

        python -m fis_tools bounds controller.yaml
        python -m fis_tools bounds controller.yaml --system force_x --where "distance > 150"
        python -m fis_tools bounds controller.yaml --system force_x --ask "force_x > 0" --expect no

    Parameters
    ----------
    where
        conditions on inputs [default: none but their ranges]
    question
        conditions on outputs: can they hold? [default: print bounds of the outputs]
    boxes
        give up after so many boxes
    seconds
        give up after so long
    expect
        with --ask: end with status 1 at any other answer
    """
    if expect is not None and question is None:
        raise Mistake("--expect is about the answer to a question; add --ask")
    controller = args.read()
    is_one = bool(controller.wires or where or question is not None)
    systems = (whole(controller, "add --system"),) if is_one else controller.systems
    sentences, verdict = [], None
    with raised_as(Mistake, ValueError), analysing(controller) as tell:

        def progress(num_boxes: int, num_open: int) -> None:
            tell(f"{num_boxes} boxes, {num_open} open")

        for system in systems:
            if question is None:
                ranges = output_ranges(system, where, max_boxes=boxes, max_seconds=seconds, progress=progress)
                sentences += [output_range.sentence for output_range in ranges]
            else:
                answer = ask(system, question, where, max_boxes=boxes, max_seconds=seconds, progress=progress)
                sentences, verdict = [answer.sentence], answer.verdict
    print("\n".join(sentences))
    return int(expect not in (None, verdict))


def domain(domain: str, flights: tuple[str, ...], /) -> int:
    """Report when logged flights left the operational domain: the inputs that an evaluation met.

    DOMAIN is a domain.json of `python -m pipeline +experiment=assure`: the least and the greatest of each
    input that the flights of an evaluation met. What a controller does beyond is not covered by them.

    The exit status is 0 where all flights stayed inside, 1 where one left, 2 for a mistake.

    For example:

        python -m fis_tools domain outputs/assure/TIME/assure/domain.json episodes/*.mcap

    Parameters
    ----------
    domain
        an operational domain (.json)
    flights
        logged data: tables (.csv, .parquet) with a column for each input, by its name, or flights (.mcap)
    """
    boxes = {box.system: box for box in _read(Path(domain))}
    num_left = 0
    for path in flights:
        exits = _departures(path, boxes)
        num_left += bool(exits)
        print(f"{path}: {'stayed inside' if not exits else ''}".rstrip())
        for departure in sorted(exits, key=lambda departure: departure.first_s):
            print(f"  {_sentence(departure)}")
    return int(num_left > 0)


def _read(path: Path) -> tuple[Box, ...]:
    """Read an operational domain from its file."""
    try:
        content = parse_json(read_text(path))
    except (OSError, ValueError, RecursionError) as error:
        raise ControllerFileError(f"{path} cannot be read ({error}); give a domain.json") from error
    return from_mapping(content, str(path))


def _departures(path: str, boxes: dict[str, Box]) -> list[Departure]:
    """Return when a flight left the boxes of its systems."""
    exits: list[Departure] = []
    if tables.is_table(path):
        for each in boxes.values():
            sensed, time_s = tables.read(path, each.inputs)
            exits += departures(each, np.arange(1.0, len(sensed) + 1.0) if time_s is None else time_s, sensed)
        return exits
    for flown in logged.read_flight(path):
        box, inputs = boxes.get(flown.system.name), tuple(variable.name for variable in flown.system.inputs)
        if box is None or box.inputs != inputs:
            raise ControllerFileError(
                f"{path} was flown with a system {flown.system.name} of {', '.join(inputs)}, which the "
                "domain does not have; give flights of the controller that it was made with"
            )
        exits += departures(box, flown.time_s, flown.inputs)
    return exits


def _sentence(d: Departure) -> str:
    """Describe when and how far an input was outside the domain."""
    unit = f" {d.unit}" if d.unit else ""
    when = f"at {d.first_s:g} s" if d.first_s == d.last_s else f"{d.first_s:g} to {d.last_s:g} s"
    return (
        f"{when}: {d.system} senses {d.name} = {d.value:.6g}{unit}, outside {d.low:.6g} to {d.high:.6g}{unit}"
    )
