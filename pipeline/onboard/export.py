"""The on-board function of a controller as a folder: its source, the evidence for it, and wrappers."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fis_tools.file_access import write_text
from pipeline.flight.fly.simulation import fly_logged
from pipeline.flight.state.log import REHEARSED, FlightLog, Scenario
from pipeline.onboard.program import OnboardProgram
from pipeline.onboard.recorded import Library, Recorded, differing, recorded
from pipeline.onboard.source import WARNINGS, Sources, rendered, sources

#: functions of the source whose meaning is told to the analyser, since it does not know the library's
SPECIFIED = ("nearest_whole", "power_of_two")
#: a folder's files that are filled in, beside the source
EVIDENCE = ("any_input.c", "main.c", "vector.h", "check.sh")
WRAPPERS = (
    *("README.md", "fprime/Controller.fpp", "fprime/Controller.hpp", "fprime/Controller.cpp"),
    *("cfs/inspection_app.c", "cfs/inspection_msgids.h"),
    *("basilisk/inspectionController.c", "basilisk/inspectionController.h", "simulink/controller_sfun.c"),
)


@dataclass(frozen=True)
class Exported:
    """What was written.

    Parameters
    ----------
    source : Sources
    num_flights, num_commands : int
        Recorded flights with which the C compiled here was compared, and their commands.
    num_different : int or None
        Commands that differ in any bit; None without gcc.
    """

    source: Sources
    num_flights: int
    num_commands: int
    num_different: int | None


def export(program: OnboardProgram, scenarios: Sequence[Scenario], folder: Path) -> Exported:
    """Write the on-board function, and compare it with flights from some starts.

    Raises
    ------
    TranslationError
        If something has no translation.
    OSError
        If a file cannot be written.
    """
    source = sources(program)
    _write(folder / "controller.h", source.header)
    _write(folder / "controller.c", source.code)
    logs = [
        fly_logged(program.mission, program.controller, scenario, is_one_of_many=True)
        for scenario in scenarios
    ]
    flights = [recorded(program, scenario, log) for scenario, log in zip(scenarios, logs, strict=True)]
    facts = {
        "name": program.controller.name,
        "world": program.world,
        "num_flights": len(flights),
        "warnings": WARNINGS,
        "specified": _specified(source.code),
    }
    evidence = folder / "evidence"
    for name in EVIDENCE:
        _write(evidence / name, rendered(f"evidence/{name}.jinja", **facts))
    _write(evidence / "vector.c", "\n".join(_vector(program, flights, logs)) + "\n")
    _write(evidence / "loops.csv", "\n".join(_loops(program)) + "\n")
    _write(evidence / "traceability.csv", "\n".join(_traceability(source)) + "\n")
    for name in WRAPPERS:
        _write(folder / "wrappers" / name, rendered(f"wrappers/{name}.jinja", **facts))
    num_different = _compared(folder, flights, logs)
    exported = Exported(source, len(flights), sum(len(flight.steps) for flight in flights), num_different)
    _write(folder / "README.md", rendered("README.md.jinja", program=program, exported=exported, **facts))
    return exported


def _write(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    write_text(path, text)


def _compared(folder: Path, flights: Sequence[Recorded], logs: Sequence[FlightLog]) -> int | None:
    """Return how many commands differ; None without gcc."""
    try:
        library = Library(folder)
    except FileNotFoundError:
        return None
    return sum(
        len(differing(library.answers(flight), log)) for flight, log in zip(flights, logs, strict=True)
    )


def _specified(code: str) -> str:
    names = ",".join(name for name in SPECIFIED if f" {name}(" in code)
    return f"-eva-use-spec {names} " if names else ""


def _loops(program: OnboardProgram) -> Iterator[str]:
    """Return a table of the loops, each with how often it runs at most."""
    yield "function,counter,at most,python"
    for loop in program.translator.loops:
        yield f"{loop.function},{loop.variable},{loop.most},{loop.file}:{loop.line}"


def _traceability(source: Sources) -> Iterator[str]:
    """Return which line of Python each line of C comes from."""
    yield "line of controller.c,python"
    for number, file, line in source.origins:
        yield f"{number},{file}:{line}"


def _vector(program: OnboardProgram, flights: Sequence[Recorded], logs: Sequence[FlightLog]) -> Iterator[str]:
    """Return recorded flights as C."""
    yield from ('#include "vector.h"', "")
    yield "const struct controller_start_input vector_starts[VECTOR_NUM_FLIGHTS] = {"
    for flight in flights:
        yield f"    {_fields(flight.start)},"
    yield from ("};", "")
    yield "const struct vector_step vector_steps[VECTOR_NUM_FLIGHTS][CONTROLLER_NUM_PERIODS] = {"
    for flight, log in zip(flights, logs, strict=True):
        yield "    {"
        is_given = (log.command_reason == REHEARSED).any(axis=1)
        for k, step in enumerate(flight.steps):
            force = ", ".join(float(x).hex() for x in log.force_commanded_n[k])
            choice = flight.choices.get(k, -1)
            yield f"        {{{_fields(step)}, {choice}, {int(is_given[k])}, {{{force}}}}},"
        yield "    },"
    yield "};"


def _fields(record: Any) -> str:
    """Return a record as the initial value of a structure; doubles as hexadecimal digits."""

    def text(value: Any) -> str:
        if np.ndim(value):
            return "{" + ", ".join(map(text, value)) + "}"
        return str(int(value)) if np.asarray(value).dtype.kind in "iu" else float(value).hex()

    return "{" + ", ".join(text(record[name]) for name in record.dtype.names) + "}"
