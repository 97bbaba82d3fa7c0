"""What a page plays: runs, the cases that they share, and flights that were recorded."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from pipeline.array_types import Booleans, Floats, Integers
from pipeline.flight.control.controller import Controller
from pipeline.flight.state.log import Scenario
from pipeline.settings.experiment import Mission


@dataclass(frozen=True)
class CaseColumn:
    """A number of each case: its name, words with unit, decimals, and whether the table has it."""

    name: str
    label: str
    decimals: int
    values: Floats
    is_told: bool = True


@dataclass(frozen=True)
class CasePlot:
    """Dots of two columns, or bars of one; dots of the same column of two runs are paired."""

    name: str
    title: str
    columns: tuple[str, ...]
    is_paired: bool = False


@dataclass(frozen=True)
class PlayedCases:
    """Cases that all runs of a page fly.

    Parameters
    ----------
    numbers : (n,) array
    succeeds : sequence of (n,) array
        Whether each run succeeds in them.
    columns : sequence of CaseColumn
    plots : sequence of CasePlot
    words : sequence of str
        What each case is, where they are few.
    outcome : tuple of str
        What a run does in a case, as a heading, and in words where it does and where it does not.
    """

    numbers: Integers
    succeeds: Sequence[Booleans]
    columns: Sequence[CaseColumn] = ()
    plots: Sequence[CasePlot] = ()
    words: Sequence[str] = ()
    outcome: tuple[str, str, str] = ("succeeds", "succeeds", "fails")


@dataclass(frozen=True)
class PlayedRun:
    """A mission and a controller, and the starts that a page flies or shows as recorded.

    Parameters
    ----------
    name : str
        As people call it, beside others.
    file_name : str
        With which files that are saved begin.
    mission : Mission
    controller : Controller
    starts : sequence of Scenario
        Of all cases.
    rows : sequence of int
        Of the cases, which matter most, where not all fit.
    command : str
        Which flies a case of the run, ``CASE`` standing for its number.
    """

    name: str
    file_name: str
    mission: Mission
    controller: Controller
    starts: Sequence[Scenario] = ()
    rows: Sequence[int] = ()
    command: str = ""


@dataclass(frozen=True)
class Carried:
    """What a page carries of a run's flights.

    Parameters
    ----------
    flown : mapping, optional
        Its ``module``, ``snapshot`` and ``own``, what each case has of its own; see `pipeline.player.flown`.
    reasons : mapping of int to mapping
        By row, reasons that the product logged, where a page cannot tell them from what is flown.
    recorded : mapping of int to mapping
        By row, flights as the product logged them.
    why : str
        Why other rows do not open.
    ends : sequence of int
        By row, the sample at which a flight that is flown ends; none where all end alike.
    """

    flown: Mapping[str, Any] | None = None
    reasons: Mapping[int, Mapping[str, Any]] = field(default_factory=dict)
    recorded: Mapping[int, Mapping[str, Any]] = field(default_factory=dict)
    why: str = ""
    ends: Sequence[int] = ()


@dataclass(frozen=True)
class PlayedPage:
    """What a player shows: runs beside each other, under one time.

    Parameters
    ----------
    title : str
        Of a flight that is no case.
    file_name : str
        By which an address names the page.
    runs : sequence of (PlayedRun, Carried)
    cases : PlayedCases, optional
    first : int
        Row of the case that is shown first.
    fleets : sequence of int
        How many of the runs, one after the other, are the deputies of a fleet; 1 for what flies alone, as
        all do where none are given. `PlayedCases.succeeds` tells of each fleet.
    """

    title: str
    file_name: str
    runs: Sequence[tuple[PlayedRun, Carried]]
    cases: PlayedCases | None = None
    first: int = 0
    fleets: Sequence[int] = ()
