"""What a page flies of a run: a snapshot, and what each case has of its own, such as start and errors."""

import base64
from collections.abc import Sequence
from functools import reduce
from importlib.resources import files
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipeline.array_types import Floats
from pipeline.flight.control.controller import Controller, RuleController
from pipeline.flight.control.law import rehearsed_pushes
from pipeline.flight.fly.plain import is_interpreted
from pipeline.flight.fly.replanning import foresees
from pipeline.flight.fly.simulation import looked_ahead
from pipeline.flight.fly.tours import tour_images
from pipeline.flight.state.log import Scenario
from pipeline.player.arguments import Arguments, ModuleArguments, arguments_of
from pipeline.player.memory import Memory, types_of
from pipeline.player.runs import PlayedRun
from pipeline.player.snapshot import snapshot_of
from pipeline.settings.dispersions import distributions
from pipeline.settings.experiment import Mission
from plain_files.file_access import read_shipped
from plain_files.plain_text import parse_json
from telemetry.page.panel import OF_NUMBERS, packed

PACKAGE = "pipeline.player"
HILL = "hill"
#: fields of a log that a case's panels read
LOGGED = (
    *("position_m", "velocity_m_s", "force_hill_n", "force_asked_n", "safety_force_hill_n", "fis_input"),
    *("sun_angle_rad", "sun_elevation_rad", "delta_v_m_s", "is_inspected", "is_decided"),
)
#: arguments of which a case may have rows of its own
OF_CASES = (
    *("flights.cases", "flights.counted", "flights.openings", "flights.values"),
    *("flights.law.plans.forces", "flights.law.plans.paths"),
    *("errors.fixes.errors.at_start", "errors.fixes.errors.of_fixes", "errors.fixes.errors.of_sight"),
    *("errors.fixes.errors.of_attitude", "errors.firing.errors.matrices", "errors.firing.errors.arms"),
    "errors.course.varying",
)
#: bytes of what all cases have of their own; numbers that are drawn do not shrink
MOST_BYTES = 48_000
#: cases that have little of their own: a start, and which points count
FEW_BYTES = 400
#: cases of controllers that look ahead, each of which takes long to choose
MOST_AHEAD = 8


class FlownCases(NamedTuple):
    """What a module flies: the rows of the cases, none for all, and what the page's script is given."""

    rows: list[int] | None
    content: dict[str, Any]


def _keeps(limit: float, mission: Mission) -> bool:
    """Return whether the safety layer of a mission keeps a limit, which is off where it is 0."""
    return mission.safety.kind == "filter" and limit > 0.0


def why_recorded(mission: Mission) -> str:
    """Return in words why no module flies a mission; empty if one does."""
    reasons = {
        "flights in plain Python are not flown in a page": mission.flight == "reference"
        or is_interpreted(mission),
        "each case has a mission of its own": bool(distributions(mission.dispersions)),
        "pages know no limit on the speed along each axis": _keeps(
            mission.safety.axis_speed_limit_m_s, mission
        ),
        "pages know no cone about the Sun": _keeps(mission.safety.min_sun_angle_deg, mission),
    }
    return next((words for words, applies in reasons.items() if applies), "")


def looks_ahead(controller: Controller) -> bool:
    """Return whether a controller chooses by flights ahead."""
    return isinstance(controller, RuleController) and (
        foresees(controller) or bool(tour_images(controller)) or len(rehearsed_pushes(controller)) > 0
    )


def tells_reasons(mission: Mission, controller: Controller) -> bool:
    """Return whether a page can tell why each push came from what it flies."""
    is_plain = isinstance(controller, RuleController) and controller.force_axes == HILL and controller.systems
    is_exact = mission.navigation.mode == "perfect" and mission.actuators.kind != "real"
    return bool(is_plain and is_exact and not looks_ahead(controller))


def module(name: str) -> bytes:
    """Return a compiled module."""
    return (files(PACKAGE) / "modules" / f"{name}.wasm").read_bytes()  # file: a part of the package


def _types_of_modules() -> Any:
    return parse_json(read_shipped(files(PACKAGE) / "modules" / "types.json"))


def flown_in_page(run: PlayedRun) -> FlownCases | str:
    """Return what a module flies of a run; in words why none does.

    Where cases have much of their own, those of `PlayedRun.rows` come first, and then others as they fit.
    """
    mission, starts = run.mission, run.starts
    if not starts:
        return "its start was not kept"
    if why := why_recorded(mission):
        return why
    order = list(dict.fromkeys([*run.rows, *range(len(starts))]))
    prepared = _Prepared(mission, run.controller)
    flown = prepared.flown([starts[order[0]]])
    if _types_of_modules()[flown.module]["fly"] != types_of(flown.arguments.leaves(Memory())):
        return "the module is of other types than this controller's flights"
    if not prepared.looks_ahead and _size(flown, prepared.flown([starts[order[-1]]])) <= FEW_BYTES:
        every = prepared.flown(list(starts))
        if every.module == flown.module:
            return _content(flown, _rows([every]), None)
    chosen, each, room = order[:1], [flown], MOST_BYTES
    for row in order[1 : MOST_AHEAD if prepared.looks_ahead else len(order)]:
        single = prepared.flown([starts[row]])
        room -= _size(flown, single)
        if room < 0:
            break
        if single.module == flown.module:
            chosen.append(row)
            each.append(single)
    return _content(flown, _rows(each), chosen)


def _size(first: ModuleArguments, other: ModuleArguments) -> int:
    """Return how many bytes a case has of its own."""
    pairs = zip(_named(first.arguments).values(), _named(other.arguments).values(), strict=False)
    return sum(there.nbytes for here, there in pairs if not np.array_equal(here, there, equal_nan=False))


class _Prepared:
    """A mission and a controller; of each case it is chosen what its flight follows."""

    def __init__(self, mission: Mission, controller: Controller) -> None:
        self._mission, self._controller = mission, controller
        self.looks_ahead = looks_ahead(controller)

    def flown(self, starts: Sequence[Scenario]) -> ModuleArguments:
        """Return what flies some starts, a single one where a controller looks ahead."""
        if not self.looks_ahead:
            return arguments_of(self._mission, self._controller, starts)
        (start,) = starts
        ahead = looked_ahead(self._mission, self._controller, start)
        openings = ahead.openings
        if openings is not None and openings.shape[1] < self._mission.num_controls:
            rest = np.zeros((1, self._mission.num_controls - openings.shape[1], 4))
            openings = np.concatenate([openings, rest], axis=1)
        if openings is None:
            openings = np.zeros((1, self._mission.num_controls, 4))
        return arguments_of(self._mission, ahead.controller, starts, openings)


def _named(arguments: Arguments) -> dict[str, Any]:
    """Return the arrays of which a case may have rows of its own, by their names as arguments."""
    by_name = dict(zip(arguments.names, arguments.values, strict=True))
    arrays = {}
    for path in OF_CASES:
        name, *fields = path.split(".")
        if by_name[name] is not None:
            arrays[path] = np.asarray(reduce(getattr, fields, by_name[name]))
    return arrays


def _rows(flown: Sequence[ModuleArguments]) -> dict[str, NDArray[np.uint8]]:
    """Return the bytes that differ from case to case, by array: of one batch, or of single cases."""
    each = [_named(single.arguments) for single in flown]
    count = len(each[0]["flights.cases"]) if len(each) == 1 else len(each)
    rows = {}
    for name in each[0]:
        arrays = [np.ascontiguousarray(arrays[name]) for arrays in each]
        if len(arrays) == 1 and len(arrays[0]) != count:
            continue  # all cases share it
        content = np.frombuffer(b"".join(array.tobytes() for array in arrays), np.uint8)
        if content.size:
            by_case = content.reshape(count, -1)
            if name == OF_CASES[0] or (by_case != by_case[0]).any():
                rows[name] = by_case
    return rows


def _content(
    flown: ModuleArguments, rows: dict[str, NDArray[np.uint8]], chosen: list[int] | None
) -> FlownCases:
    shared = (*(f"results.log.{name}" for name in LOGGED), *OF_CASES)
    of_cases = np.concatenate(list(rows.values()), axis=1)
    content = {
        "module": flown.module,
        "snapshot": snapshot_of({"fly": flown.arguments}, shared, ("first", "last")),
        "own": {
            "names": list(rows),
            "size": of_cases.shape[1],
            "rows": chosen,
            # bytes of one place beside each other, which shrink more
            "content": packed(of_cases.T.tobytes(), OF_NUMBERS),
        },
    }
    return FlownCases(chosen, content)


def as_text(values: Floats | NDArray[Any], kind: str) -> str:
    """Return an array's bytes as text, of a type such as ``<f4``."""
    return base64.b64encode(np.ascontiguousarray(values, dtype=kind).tobytes()).decode("ascii")
