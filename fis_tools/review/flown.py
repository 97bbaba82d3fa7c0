"""The flights that a controller is reviewed along, and the samples that its rules are counted over."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fis_tools import analysis, flights
from fis_tools.flights import FlownSystem
from fis_tools.inference import Floats
from fis_tools.model import FuzzyController, FuzzySystem
from fis_tools.validate import ControllerFileError


@dataclass(frozen=True)
class Flight:
    """A flight by its name, and what each system did on it, by the system's name."""

    name: str
    flown: Mapping[str, FlownSystem]

    @property
    def num_inferences(self) -> int:
        """Of the system that inferred most."""
        return max(len(one.time_s) for one in self.flown.values())


@dataclass(frozen=True)
class Samples:
    """Inputs of a system, (n, num_inputs), and in words where they come from."""

    inputs: Floats
    words: str
    are_flown: bool


def read_flight(path: Path | str, controller: FuzzyController) -> Flight:
    """Read a flight to review a controller along.

    Raises
    ------
    fis_tools.validate.ControllerFileError
        If it cannot be read, or its systems have other inputs than the controller's.
    """
    known = {system.name: system for system in controller.systems}
    flown = {one.system.name: one for one in flights.read_flight(path) if one.system.name in known}
    if not flown:
        names = ", ".join(known)
        raise ControllerFileError(f"{path} was flown without any of the systems {names}; give another flight")
    for name, one in flown.items():
        logged, wanted = ([v.name for v in system.inputs] for system in (one.system, known[name]))
        if logged != wanted:
            raise ControllerFileError(
                f"{path}: its system {name!r} senses {', '.join(logged)}, but the controller's senses "
                f"{', '.join(wanted)}; give flights of this controller"
            )
    return Flight(Path(path).stem, flown)


def samples_of(system: FuzzySystem, flown: Sequence[Flight]) -> Samples:
    """Return what a system sensed on the flights; where it sensed nothing, samples of all its inputs."""
    rows = [flight.flown[system.name].inputs for flight in flown if system.name in flight.flown]
    sensed = np.concatenate([np.empty((0, len(system.inputs))), *rows])
    if len(sensed):
        words = "along the flight" if len(flown) == 1 else f"along the {len(flown)} flights"
        return Samples(sensed, words, are_flown=True)
    spread = analysis.spread_inputs(system)
    return Samples(spread, f"over {len(spread):,} points spread evenly over all its inputs", are_flown=False)
