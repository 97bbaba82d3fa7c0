"""The operational domain of a controller: the inputs that its evaluation met, as a box for each system.

What a controller does at inputs that no evaluated flight sensed is not covered by what was found on those
flights. A domain says where that begins, and a monitor says when a flight was there.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from fis_tools.array_types import Floats
from fis_tools.errors import ControllerFileError
from fis_tools.model import FuzzySystem

SCHEMA, SCHEMA_VERSION = "operational-domain", 1
#: what is told of each input, and what it is
_COLUMNS: dict[str, type] = {"name": str, "unit": str, "low": float, "high": float}


@dataclass(frozen=True)
class Box:
    """The range of each input of one system that was met in an evaluation.

    Parameters
    ----------
    system : str
    inputs, units : tuple of str
    low, high : tuple of float
        The least and the greatest of each, before they are clipped to the universes.
    num_samples : int
        Inferences that it was made from.
    """

    system: str
    inputs: tuple[str, ...]
    units: tuple[str, ...]
    low: tuple[float, ...]
    high: tuple[float, ...]
    num_samples: int

    def beyond(self, inputs: Floats) -> Floats:
        """Return how far outside of the box each input is, (n, num_inputs), in its unit; zero inside."""
        low, high = np.array(self.low), np.array(self.high)
        return np.asarray(np.maximum(np.maximum(low - inputs, inputs - high), 0.0))


@dataclass(frozen=True)
class Departure:
    """A time during which an input was outside its box.

    Parameters
    ----------
    system, name, unit : str
        The input.
    first_s, last_s : float
        Of the inferences outside.
    value : float
        The farthest outside.
    low, high : float
        What was met in evaluation.
    """

    system: str
    name: str
    unit: str
    first_s: float
    last_s: float
    value: float
    low: float
    high: float


def box_of(system: FuzzySystem, inputs: Floats) -> Box:
    """Return the bounding box of the inputs that a system sensed, (n, num_inputs), n at least one."""
    names, units = zip(*((variable.name, variable.unit) for variable in system.inputs), strict=True)
    low, high = (tuple(ends.tolist()) for ends in (inputs.min(axis=0), inputs.max(axis=0)))
    return Box(system.name, names, units, low, high, len(inputs))


def departures(box: Box, time_s: Floats, inputs: Floats) -> tuple[Departure, ...]:
    """Return a departure for each run of consecutive inferences with an input outside the box.

    Parameters
    ----------
    box : Box
    time_s : (n,)
    inputs : (n, num_inputs)
    """
    beyond = box.beyond(inputs)
    stretches = []
    for index, name in enumerate(box.inputs):
        is_outside = np.concatenate([[False], beyond[:, index] > 0.0, [False]])
        edges = np.flatnonzero(np.diff(is_outside.astype(np.int8)))
        for first, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
            farthest = first + int(np.argmax(beyond[first:end, index]))
            numbers = (float(time_s[first]), float(time_s[end - 1]), float(inputs[farthest, index]))
            extent = (box.low[index], box.high[index])
            stretches.append(Departure(box.system, name, box.units[index], *numbers, *extent))
    return tuple(sorted(stretches, key=lambda exit_: (exit_.first_s, exit_.system, exit_.name)))


def as_mapping(boxes: Iterable[Box]) -> dict[str, Any]:
    """Return a domain as plain data."""
    systems = []
    for box in boxes:
        columns = zip(box.inputs, box.units, box.low, box.high, strict=True)
        inputs = [dict(zip(_COLUMNS, row, strict=True)) for row in columns]
        systems.append({"system": box.system, "num_samples": box.num_samples, "inputs": inputs})
    return {"schema": SCHEMA, "schema_version": SCHEMA_VERSION, "systems": systems}


def from_mapping(mapping: Any, source: str) -> tuple[Box, ...]:
    """Read an operational domain from plain data.

    Raises
    ------
    ControllerFileError
        If it is something else.
    """
    try:
        if (mapping["schema"], mapping["schema_version"]) != (SCHEMA, SCHEMA_VERSION):
            raise KeyError("schema")
        return tuple(_box(entry) for entry in mapping["systems"])
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise ControllerFileError(
            f"{source} holds no operational domain; give the domain.json that the stage assure writes"
        ) from error


def _box(mapping: Mapping[str, Any]) -> Box:
    """Return the box of a system from plain data."""
    names, units, low, high = (
        tuple(kind(row[key]) for row in mapping["inputs"]) for key, kind in _COLUMNS.items()
    )
    if not all(-math.inf < least <= greatest < math.inf for least, greatest in zip(low, high, strict=True)):
        raise ValueError("no range")
    return Box(str(mapping["system"]), names, units, low, high, int(mapping["num_samples"]))
