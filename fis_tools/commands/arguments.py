"""Arguments that commands share: a controller, flights, inputs, and a file to write."""

import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import KW_ONLY, dataclass
from math import isfinite
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from cyclopts import Parameter

from fis_tools.analysis import flights
from fis_tools.analysis.flight_data import Period, Points
from fis_tools.array_types import Floats
from fis_tools.engines.tree_inference import infer_tree
from fis_tools.errors import Mistake, raised_as, require_known
from fis_tools.formats import serialize
from fis_tools.model import FuzzyController, FuzzySystem, FuzzyTree, tree
from fis_tools.model.thrust import COUNTED, REASONS, UNKNOWN
from fis_tools.model.trees import require_unwired
from fis_tools.source import read_controller
from fis_tools.waiting import waiting
from fis_tools.words.text import number
from plain_files.file_access import write_bytes
from plain_files.plain_text import as_number

#: Rules of a system, and points of its output, beyond which analyses take more than seconds.
MANY_RULES, MANY_POINTS = 1_000, 10_000


_WRITERS = {".json": serialize.dump_json, ".yaml": serialize.dump_yaml, ".yml": serialize.dump_yaml}

FLIGHTS = Parameter(name=("--flights", "--data"), consume_multiple=True)

Output = Annotated[str | None, Parameter(name=("--output", "-o"))]


def expected(words: str, is_right: Callable[[Any], bool]) -> Parameter:
    """Return a validator that refuses an option's values unless they are as expected."""

    def check(_kind: object, value: Any) -> None:
        if value is not None and not is_right(value):
            raise ValueError(f"Give {words}.")

    return Parameter(validator=check)


def whole_number(least: int, most: int) -> Parameter:
    """Return a validator that accepts the whole numbers from `least` to `most`."""
    return expected(f"a whole number from {least} to {most}", lambda count: least <= count <= most)


@Parameter(name="*")
@dataclass(frozen=True)
class ControllerArguments:
    """The controller that a command works on.

    Parameters
    ----------
    controller
        a controller file (.json, .yaml), a file of another program (such as .fis), the folder of a
        run (its champion.json), a logged flight (.mcap), or, with --trust, FILE.py:NAME: a scikit-fuzzy
        ControlSystem, or a system of fis_tools
    system
        only this system of the controller
    trust
        run the Python program that a controller is read from
    """

    controller: str
    _: KW_ONLY
    system: str | None = None
    trust: bool = False

    def read(self) -> FuzzyController:
        """Return the controller, or the one system of it that is named."""
        return chosen(read_controller(self.controller, self.trust), self.system)


@contextmanager
def analysing(*controllers: FuzzyController) -> Iterator[Callable[[str], None]]:
    """Warn of a long analysis, and show its progress in a terminal."""
    for system in {
        system.name: system for controller in controllers for system in controller.systems
    }.values():
        num_points = max(variable.num_points for variable in system.outputs)
        if len(system.rules) > MANY_RULES or num_points > MANY_POINTS:
            sys.stderr.write(
                f"note: {system.name} has {len(system.rules):,} rules and an output of {num_points:,} "
                "points; this may take minutes, Ctrl-C ends it\n"
            )
    with waiting("analysing") as tell:
        yield tell


@Parameter(name="*")
@dataclass(frozen=True)
class FlightArguments(ControllerArguments):
    """The controller that a command works on, and flights of it.

    Parameters
    ----------
    flights
        logged data: tables (.csv, .parquet) with a column for each input, by its name, or flights (.mcap);
        [default: CONTROLLER, if it is a flight]
    all_periods
        along flights, count every inference, not only those whose force was fired
    """

    flights: Annotated[tuple[str, ...], FLIGHTS] = ()
    all_periods: bool = False

    @property
    def paths(self) -> list[str]:
        """The flights named; the controller's own file, if that is a flight."""
        return list(self.flights) or [path for path in [self.controller] if flights.is_flight(path)]

    def flown(self, controller: FuzzyController) -> dict[str, Floats] | None:
        """Return what each system sensed along the flights, as `flown_inputs` does."""
        return flown_inputs(self.paths, controller, self.all_periods)


def flown_inputs(
    paths: Sequence[str], controller: FuzzyController, all_periods: bool
) -> dict[str, Floats] | None:
    """Return what each system sensed along flights, by its name, (n, num_inputs); None without flights.

    The flights may be those of another controller, such as the one before a change, if its systems of the
    same names have the same inputs.
    """
    if not paths:
        return None
    require_unwired([controller], "a log of inputs")
    sensed = flights.inputs_along(paths, all_periods, controller)
    if flights.is_flight(paths[0]):
        flights.require_same_inputs(paths[0], flights.read_controller(paths[0]).systems, controller)
    return {system.name: sensed[system.name] for system in controller.systems if system.name in sensed}


def chosen(controller: FuzzyController, name: str | None) -> FuzzyController:
    """Return the controller with only the system named, or all of it."""
    if name is None:
        return controller
    names = [system.name for system in controller.systems]
    require_known([name], names, f"controller {controller.name!r} has no system", Mistake)
    return controller.only([name])


def assignments(words: str) -> dict[str, float]:
    """Read ``NAME=NUMBER,NAME=NUMBER``."""
    values: dict[str, float] = {}
    for word in filter(None, (word.strip() for word in words.split(","))):
        name, _, number = (part.strip() for part in word.rpartition("="))
        value = as_number(number)
        if not name or value is None or not isfinite(value):
            raise Mistake(f"{word!r} gives no name a finite number; write NAME=NUMBER,NAME=NUMBER")
        if name in values:
            raise Mistake(f"{name!r} is given twice; give it one number")
        values[name] = value
    return values


def place_for(path: Path) -> Path:
    """Return the path of a file, whose folder is created if it is missing."""
    path.parent.mkdir(parents=True, exist_ok=True)
    return path


def form_of(output: str | None) -> Callable[[FuzzyController], str] | None:
    """Return the function that writes a controller to a file of this name; None without a name."""
    form = _WRITERS.get(Path(output).suffix.lower()) if output else None
    if output and form is None:
        raise Mistake(f"{output} ends in none of {', '.join(_WRITERS)}; name the file so")
    return form


def write(output: str | None, content: str) -> None:
    """Write a text to a file, or print it if no file is named."""
    if output is None:
        print(content, end="")
    else:
        write_file(Path(output), content.encode())


def write_file(path: Path, content: bytes) -> None:
    """Write a file, whose folder is made if missing; raise Mistake where it cannot be."""
    try:
        write_bytes(place_for(path), content)
    except OSError as error:
        raise Mistake(f"{path} cannot be written ({error.strerror}); choose another path") from error


@Parameter(name="*")
@dataclass(frozen=True)
class InstantArguments(FlightArguments):
    """The controller that a command works on, and the inputs or the instant to look at.

    Parameters
    ----------
    inputs
        the inputs, in the units that the command show prints: NAME=NUMBER,NAME=NUMBER
    time
        of logged data: the inputs at this time, in seconds; of a table without times: of this row
    """

    inputs: str | None = None
    time: float | None = None

    @property
    def is_instant(self) -> bool:
        """Whether inputs are given, by themselves or by a time."""
        if self.inputs is not None and self.time is not None:
            raise Mistake("--inputs and --time both say which inputs are meant; drop one of them")
        return self.inputs is not None or self.time is not None


@dataclass(frozen=True)
class Instant:
    """A system, its inputs at an instant, and whether its output was fired.

    Parameters
    ----------
    system : FuzzySystem
        A system of its own, or one that others are wired to.
    inputs : (num_inputs,), optional
        None where nothing was fired, and there is nothing to tell about.
    note : str
        What became of the force, in words; empty where it was fired as asked for, or nothing is known of it.
    points : Points, optional
        Which points the inputs were made of, where that is recorded.
    """

    system: FuzzySystem
    inputs: Floats | None
    note: str = ""
    points: Points | None = None


def instants(args: InstantArguments, controller: FuzzyController) -> Iterator[Instant]:
    """Yield each selected system of a controller with its inputs, given by hand or logged."""
    if args.time is None:
        yield from (Instant(system, inputs) for system, inputs in _given(args.inputs or "", controller))
        return
    paths = args.paths
    require_unwired([controller], "--time")
    if len(paths) != 1:
        raise Mistake("--time is for one file of logged data; give a flight (.mcap), or add --flights FILE")
    periods = flights.read_periods(paths[0], args.time, controller)
    names = [period.flown.system.name for period in periods]
    if args.system is not None:
        require_known([args.system], names, "the flight has no system", Mistake)
    for period in periods:
        if args.system in (None, period.flown.system.name):
            yield _instant(period, args.all_periods)


def _instant(period: Period, all_periods: bool) -> Instant:
    """Return the inputs of a logged inference, with a note on what became of its output."""
    flown, row = period.flown, period.row
    if row is None:
        return Instant(flown.system, None, _in_words(period))
    reason = str(flown.reason[row])
    is_plain = reason in ("fired", UNKNOWN) and not flown.delay_s
    is_told = reason in (*COUNTED, UNKNOWN) or all_periods
    inputs = flown.inputs[row] if is_told else None
    note = "" if is_plain else _in_words(period)
    points = None if flown.points is None else flown.points.at(float(flown.time_s[row]))
    return Instant(flown.system, inputs, note, points)


def _in_words(period: Period) -> str:
    """Describe whether the force that a system commanded was fired, and when before and after."""
    flown, row = period.flown, period.row
    words = f"{flown.system.name}: at {period.time_s:g} s "
    if period.reason == UNKNOWN and row is None:
        return words + "nothing was inferred"
    reason = period.reason if row is None else str(flown.reason[row])
    if period.reason in COUNTED and reason not in COUNTED:
        words += "what was fired was not its doing; "
    if row is not None:
        force = f"{number(float(flown.output[row]))} {flown.system.outputs[0].unit}".rstrip()
        was_due = f"{force} was due, asked for at {flown.time_s[row]:g} s; "
        words += was_due if flown.delay_s else f"it asked for {force}; "
    elif period.reason in COUNTED:
        return words + "it asked for nothing"
    words += REASONS.get(reason, "nothing was fired")
    fired = flown.time_s[flown.is_counted] + flown.delay_s
    before, after = fired[fired < period.time_s], fired[fired > period.time_s]
    words += f"; it last fired at {before[-1]:g} s" if len(before) else "; it had not fired before"
    words += f" and next at {after[0]:g} s" if len(after) else " and did not fire again"
    return words


def given_to(inputs: str, whole: FuzzyTree) -> Floats:
    """Return the inputs of wired systems that are given by hand, in their order."""
    return _row(assignments(inputs), whole)


def _row(values: Mapping[str, float], whole: FuzzyTree) -> Floats:
    """Return the inputs of wired systems in their order; raise Mistake for missing ones."""
    known = [variable.name for variable in whole.inputs]
    require_known(values, known, "there is no input", Mistake)
    if missing := [name for name in known if name not in values]:
        raise Mistake(
            f"the inputs {', '.join(missing)} of {whole.name} are not given; add --inputs NAME=NUMBER,…, or "
            "name one of its systems with --system"
        )
    return np.array([values[name] for name in known])


def _given(inputs: str, controller: FuzzyController) -> Iterator[tuple[FuzzySystem, Floats]]:
    """Yield each system whose inputs are all given on the command line, or each wired one, with inputs."""
    values = assignments(inputs)
    if controller.wires:
        whole = tree(controller)
        with raised_as(Mistake, ValueError):
            inference = infer_tree(whole, _row(values, whole))
        yield from ((part.system, part.inputs) for part in inference.parts)
        return
    known = list(dict.fromkeys(v.name for system in controller.systems for v in system.inputs))
    require_known(values, known, "there is no input", Mistake)
    complete = [s for s in controller.systems if all(variable.name in values for variable in s.inputs)]
    if not complete:
        needs = "; ".join(f"{s.name} needs {', '.join(v.name for v in s.inputs)}" for s in controller.systems)
        raise Mistake(
            "the inputs of no system are all given; add --inputs NAME=NUMBER,… "
            f"(or --time for a flight): {needs}"
        )
    for system in complete:
        yield system, np.array([values[variable.name] for variable in system.inputs])
