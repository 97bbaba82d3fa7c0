"""`domain`: when logged flights left the inputs that an evaluation met."""

import json
from pathlib import Path

import numpy as np

from fis_tools.analysis import flights as logged
from fis_tools.analysis import tables
from fis_tools.analysis.domain import Box, Departure, departures, from_mapping
from fis_tools.errors import ControllerFileError


def run(domain: str, flights: tuple[str, ...], /) -> int:
    """Tell when logged flights left the inputs that an evaluation met.

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
        found = _departures(path, boxes)
        num_left += bool(found)
        print(f"{path}: {'stayed inside' if not found else ''}".rstrip())
        for one in found:
            print(f"  {_sentence(one)}")
    return int(num_left > 0)


def _read(path: Path) -> tuple[Box, ...]:
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise ControllerFileError(f"{path} cannot be read ({error}); give a domain.json") from error
    return from_mapping(content, str(path))


def _departures(path: str, boxes: dict[str, Box]) -> list[Departure]:
    """Return when a flight left the boxes of its systems, in order of time."""
    found: list[Departure] = []
    if tables.is_table(path):
        for each in boxes.values():
            sensed, time_s = tables.read(path, each.inputs)
            found += departures(each, np.arange(1.0, len(sensed) + 1.0) if time_s is None else time_s, sensed)
        return sorted(found, key=lambda one: one.first_s)
    for flown in logged.read_flight(path):
        box, inputs = boxes.get(flown.system.name), tuple(one.name for one in flown.system.inputs)
        if box is None or box.inputs != inputs:
            raise ControllerFileError(
                f"{path} was flown with a system {flown.system.name} of {', '.join(inputs)}, which the "
                "domain does not have; give flights of the controller that it was made with"
            )
        found += departures(box, flown.time_s, flown.inputs)
    return sorted(found, key=lambda one: one.first_s)


def _sentence(one: Departure) -> str:
    unit = f" {one.unit}" if one.unit else ""
    when = f"at {one.first_s:g} s" if one.first_s == one.last_s else f"{one.first_s:g} to {one.last_s:g} s"
    return (
        f"{when}: {one.system} senses {one.name} = {one.value:.6g}{unit}, outside {one.low:.6g} to "
        f"{one.high:.6g}{unit}"
    )
