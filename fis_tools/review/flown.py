"""The flights and tables that a controller is reviewed along, and what its rules are counted over.

Both are called flights in the code; the page calls them logs where no flight is among them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fis_tools.analysis import arrays, flights
from fis_tools.analysis.flights import FlownSystem
from fis_tools.array_types import Floats
from fis_tools.errors import ControllerFileError
from fis_tools.model import FuzzyController, FuzzySystem


@dataclass(frozen=True)
class Flight:
    """A flight.

    Parameters
    ----------
    name : str
    flown : mapping of str to FlownSystem
        What each system did on it, by the system's name.
    is_own : bool
        Whether the reviewed controller flew it: every system as it is now.
    """

    name: str
    flown: Mapping[str, FlownSystem]
    is_own: bool

    @property
    def num_inferences(self) -> int:
        """The most inferences that one of its systems made."""
        return max(len(one.time_s) for one in self.flown.values())


@dataclass(frozen=True)
class Samples:
    """Inputs of a system, (n, num_inputs), and in words where they come from."""

    inputs: Floats
    words: str
    are_flown: bool


def read_flights(
    paths: Sequence[Path | str], controller: FuzzyController, all_periods: bool = False
) -> list[Flight]:
    """Read the flights and tables to review a controller along, each once.

    One is called as its file, or as its path.

    Of each the inferences whose force was fired are read, or all.

    Raises
    ------
    fis_tools.errors.ControllerFileError
        If one cannot be read, or its systems have other inputs than the controller's.
    """
    once = unique(paths)
    return [
        _flight(name, path, controller, all_periods) for name, path in zip(_names(once), once, strict=True)
    ]


def noun_of(paths: Sequence[Path | str]) -> str:
    """Return what the page calls what it is given: a flight, or a log where none is among them."""
    return "flight" if any(map(flights.is_flight, paths)) else "log"


def unique(paths: Sequence[Path | str]) -> list[Path]:
    """Return each file once."""
    return list({Path(path).resolve(): Path(path) for path in paths}.values())


def _flight(name: str, path: Path, controller: FuzzyController, all_periods: bool) -> Flight:
    flown = _flown(path, controller, all_periods)
    own = {system.name: system for system in controller.systems}
    return Flight(name, flown, all(one.system == own[key] for key, one in flown.items()))


def _names(paths: Sequence[Path]) -> list[str]:
    """Return the shortest ends of paths, without suffix, that tell them apart."""
    parts = [path.with_suffix("").parts for path in paths]
    lengths = range(1, max((len(one) for one in parts), default=0) + 1)
    candidates = (["/".join(one[-length:]) for one in parts] for length in lengths)
    return next((names for names in candidates if len(set(names)) == len(set(parts))), [])


def _flown(path: Path | str, controller: FuzzyController, all_periods: bool) -> dict[str, FlownSystem]:
    known = {system.name: system for system in controller.systems}
    read = flights.read_flight(path, all_periods, controller)
    flown = {one.system.name: one for one in read if one.system.name in known}
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
    return flown


def samples_of(system: FuzzySystem, flown: Sequence[Flight], noun: str) -> Samples:
    """Return what a system sensed on the flights; where it sensed nothing, samples of all its inputs."""
    rows = [flight.flown[system.name].inputs for flight in flown if system.name in flight.flown]
    sensed = np.concatenate([np.empty((0, len(system.inputs))), *rows])
    if len(sensed):
        words = f"along the {noun}" if len(flown) == 1 else f"along the {len(flown)} {noun}s"
        return Samples(sensed, words, are_flown=True)
    spread = arrays.spread_inputs(system)
    return Samples(spread, f"over {len(spread):,} points spread evenly over all its inputs", are_flown=False)
