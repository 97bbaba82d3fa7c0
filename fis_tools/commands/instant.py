"""Which inputs of which systems a command is about: given by hand, or those of a flight at a time."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from cyclopts import Parameter

from fis_tools.analysis import flights
from fis_tools.array_types import Floats
from fis_tools.commands.arguments import AskedAlong, UserMistake, assignments
from fis_tools.model import FuzzyController, FuzzySystem
from fis_tools.model.thrust import COUNTED, REASONS, UNKNOWN
from fis_tools.model.validate import nearest
from fis_tools.words.text import number


@Parameter(name="*")
@dataclass(frozen=True)
class AskedInstant(AskedAlong):
    """What a command is about, and at which inputs.

    Parameters
    ----------
    inputs
        the inputs, in the units that `show` prints: NAME=NUMBER,NAME=NUMBER
    time
        of logged data: the inputs at this time, in seconds; of a table without times: of this row
    """

    inputs: str | None = None
    time: float | None = None

    @property
    def is_instant(self) -> bool:
        """Whether inputs are given, by themselves or by a time."""
        if self.inputs is not None and self.time is not None:
            raise UserMistake("--inputs and --time both say which inputs are meant; drop one of them")
        return self.inputs is not None or self.time is not None


@dataclass(frozen=True)
class Instant:
    """A system at an instant.

    Parameters
    ----------
    system : FuzzySystem
    inputs : (num_inputs,), optional
        None where nothing was fired, and there is nothing to tell about.
    note : str
        What became of the force, in words; empty where it was fired as asked for, or nothing is known of it.
    """

    system: FuzzySystem
    inputs: Floats | None
    note: str = ""


def instants(asked: AskedInstant, controller: FuzzyController) -> Iterator[Instant]:
    """Yield each system of a controller that is meant with its inputs, given by hand or logged."""
    if asked.time is None:
        yield from (Instant(system, inputs) for system, inputs in _given(asked.inputs or "", controller))
        return
    paths = asked.paths
    if len(paths) != 1:
        raise UserMistake(
            "--time is for one file of logged data; give a flight (.mcap), or add --flights FILE"
        )
    periods = flights.read_periods(paths[0], asked.time, controller)
    names = [period.flown.system.name for period in periods]
    if asked.system is not None and asked.system not in names:
        raise UserMistake(f"the flight has no system {asked.system!r}; {nearest(asked.system, names)}")
    for period in periods:
        if asked.system in (None, period.flown.system.name):
            yield _instant(period, asked.all_periods)


def _instant(period: flights.Period, all_periods: bool) -> Instant:
    flown, row = period.flown, period.row
    if row is None:
        return Instant(flown.system, None, _in_words(period))
    became = str(flown.reason[row])
    is_plain = became in ("fired", UNKNOWN) and not flown.delay_s
    is_told = became in (*COUNTED, UNKNOWN) or all_periods
    return Instant(
        flown.system, flown.inputs[row] if is_told else None, "" if is_plain else _in_words(period)
    )


def _in_words(period: flights.Period) -> str:
    """Say what became of what a system asked for, and when that was fired before and after."""
    flown, row = period.flown, period.row
    words = f"{flown.system.name}: at {period.time_s:g} s "
    if period.reason == UNKNOWN and row is None:
        return words + "nothing was inferred"
    became = period.reason if row is None else str(flown.reason[row])
    if period.reason in COUNTED and became not in COUNTED:
        words += "what was fired was not its doing; "
    if row is not None:
        asked = f"{number(float(flown.output[row]))} {flown.system.outputs[0].unit}".rstrip()
        was_due = f"{asked} was due, asked for at {flown.time_s[row]:g} s; "
        words += was_due if flown.delay_s else f"it asked for {asked}; "
    elif period.reason in COUNTED:
        return words + "it asked for nothing"
    words += REASONS.get(became, "nothing was fired")
    fired = flown.time_s[flown.is_counted] + flown.delay_s
    before, after = fired[fired < period.time_s], fired[fired > period.time_s]
    words += f"; it last fired at {before[-1]:g} s" if len(before) else "; it had not fired before"
    words += f" and next at {after[0]:g} s" if len(after) else " and did not fire again"
    return words


def _given(inputs: str, controller: FuzzyController) -> Iterator[tuple[FuzzySystem, Floats]]:
    values = assignments(inputs)
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
