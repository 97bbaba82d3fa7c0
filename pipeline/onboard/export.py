"""The on-board function of a controller as a folder: its source, the evidence for it, and wrappers."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from fis_tools.formats.c.text import WARNINGS, plain
from pipeline.flight.fly.fleet_logs import fly_logged_fleet
from pipeline.flight.fly.simulation import fly_logged
from pipeline.flight.state.log import FlightLog, Scenario
from pipeline.onboard.evidence import (
    line_runs,
    loop_table,
    obligation_table,
    requirement_table,
    rule_table,
    traceability,
    vector_source,
)
from pipeline.onboard.fmi import block_facts
from pipeline.onboard.parts import parts_of
from pipeline.onboard.prefix import USUAL, renamed
from pipeline.onboard.program import OnboardProgram
from pipeline.onboard.recorded import Library, Recorded, differing, recorded
from pipeline.onboard.sizes import Sizes, sizes, stack_table
from pipeline.onboard.source import Sources, rendered, sources
from pipeline.settings.fleet import Fleet
from plain_files.file_access import filling, write_text

#: functions of the source whose meaning is told to the analyser, since it does not know the library's
SPECIFIED = ("nearest_whole", "power_of_two")
#: functions that call those of a search, or draw its numbers; and in which the analyser steps through it
SEARCHING = ("main", "controller_plan", "advance_plan", "begin_plan", "draw_numbers")
#: and where plans are flown ahead
FLYING = ("advance_flight", "begin_ahead", "exchange_flights", "is_flown_on")
#: a folder's files that are filled in, beside the source: messages as octets, and the page on them
MESSAGES = ("packets.h", "packets.c", "interface.md")
EVIDENCE = (
    *("any_input.c", "main.c", "vector.h", "check.sh", "prove.sh"),
    *("emulate.sh", "cortex/board.c", "cortex/board.h", "cortex/board.ld", "cortex/sums.c"),
)
#: and where flights are flown ahead
PARTS_FILE = "parts.c"
WRAPPERS = (
    *("README.md", "fprime/Controller.fpp", "fprime/Controller.hpp", "fprime/Controller.cpp"),
    *("cfs/inspection_app.c", "cfs/inspection_msgids.h", "cfs/inspection.xml"),
    *("basilisk/inspectionController.c", "basilisk/inspectionController.h", "simulink/controller_sfun.c"),
    *("basilisk/inspectionController.i", "basilisk/CMakeLists.txt"),
    *("fmi/fmi.c", "fmi/modelDescription2.xml", "fmi/modelDescription3.xml", "fmi/build.sh"),
)
#: no fleet
ALONE = Fleet()


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
    sizes : Sizes or None
        By gcc; None without it.
    """

    source: Sources
    num_flights: int
    num_commands: int
    num_different: int | None
    sizes: Sizes | None


def export(
    program: OnboardProgram,
    scenarios: Sequence[Scenario],
    folder: Path,
    prefix: str = USUAL,
    fleet: Fleet = ALONE,
) -> Exported:
    """Write the on-board function, and compare it with flights from some starts, of each deputy.

    The folder is new or empty, and stays so if anything fails. The names that other files see begin with the
    prefix.

    Raises
    ------
    TranslationError
        If something has no translation.
    OSError
        If a file cannot be written.
    """
    with filling(folder) as unfinished:
        return _written(program, scenarios, unfinished, prefix, fleet)


def joined(program: OnboardProgram) -> str:
    """Return the analyser's option by which ways through a search are joined at once, not after ten."""
    planner = program.planner
    names = [*SEARCHING, *(FLYING if planner.again else ()), *planner.functions] if planner else []
    return f"-eva-slevel-function {','.join(f'{name}:0' for name in names)} " if names else ""


def _logged(
    program: OnboardProgram, scenarios: Sequence[Scenario], fleet: Fleet
) -> tuple[list[FlightLog], list[Recorded]]:
    """Fly from some starts; return the log of each flight, of fleets those of each deputy, and as inputs."""
    mission = replace(program.mission, fleet=fleet)
    if not mission.has_fleet:
        logs = [fly_logged(mission, program.controller, scenario) for scenario in scenarios]
        return logs, [recorded(program, *pair) for pair in zip(scenarios, logs, strict=True)]
    of_fleets = [log for case in scenarios for log in fly_logged_fleet(mission, program.controller, case)]
    starts = [start for case in scenarios for start in case.fleet]
    flights = [
        recorded(program, start, log.flight, log) for start, log in zip(starts, of_fleets, strict=True)
    ]
    return [log.flight for log in of_fleets], flights


def _written(
    program: OnboardProgram, scenarios: Sequence[Scenario], folder: Path, prefix: str, fleet: Fleet
) -> Exported:
    source = sources(program, prefix)
    _write(folder / "controller.h", source.header)
    _write(folder / "controller.c", source.code)
    logs, flights = _logged(program, scenarios, fleet)
    parts = parts_of(source.code, source.members, program)
    facts = {
        "interface": source.interface,
        "parameters": source.interface.parameters,
        "identity": source.identity,
        "name": plain(program.controller.name),
        "world": program.world,
        "num_flights": len(flights),
        "planner": program.planner,
        "warnings": WARNINGS,
        "parts": parts,
        "specified": _specified(source.code) + joined(program),
        "is_shared": program.is_shared,
        "is_kept_apart": program.is_kept_apart,
        "token": source.identity["code"],
        **block_facts(source.interface),
    }
    for name in MESSAGES:
        _write(folder / name, renamed(rendered(f"{name}.jinja", **facts), prefix))
    evidence = folder / "evidence"
    for name in (*EVIDENCE, *[PARTS_FILE] * bool(parts)):
        _write(evidence / name, renamed(rendered(f"evidence/{name}.jinja", **facts), prefix))
    _write(
        evidence / "vector.c", renamed("".join(f"{line}\n" for line in vector_source(flights, logs)), prefix)
    )
    answers, measured = _answers(folder, flights, prefix), _measured(folder)
    _write_lines(evidence / "loops.csv", loop_table(program))
    _write_lines(evidence / "obligations.csv", obligation_table(program))
    _write_lines(evidence / "requirements.csv", requirement_table(folder))
    _write_lines(evidence / "rules.csv", rule_table(program, source, answers))
    _write_lines(evidence / "traceability.csv", traceability(source, line_runs(folder)))
    if measured is not None:
        _write_lines(evidence / "stack.csv", stack_table(measured))
    for name in WRAPPERS:
        text = rendered(f"wrappers/{name}.jinja", **facts)
        _write(folder / "wrappers" / renamed(name, prefix), renamed(text, prefix))
    different = [len(differing(*pair)) for pair in zip(answers, logs, strict=bool(answers))]
    num_commands = sum(len(flight.steps) for flight in flights)
    exported = Exported(source, len(flights), num_commands, sum(different) if answers else None, measured)
    is_told = fleet.sharing != "nothing" or program.is_kept_apart
    heeding = fleet if fleet.deputies > 1 and is_told else None
    facts |= {"program": program, "exported": exported, "prefix": prefix, "fleet": heeding}
    _write(folder / "README.md", renamed(rendered("README.md.jinja", **facts), prefix))
    return exported


def _write(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    write_text(path, text)


def _write_lines(path: Path, lines: Iterable[str]) -> None:
    _write(path, "".join(f"{line}\n" for line in lines))


def _answers(folder: Path, flights: Sequence[Recorded], prefix: str) -> list[Any]:
    """Return what the C answers to recorded flights; nothing without gcc."""
    try:
        library = Library(folder, prefix=prefix)
    except FileNotFoundError:
        return []
    return [library.answers(flight) for flight in flights]


def _measured(folder: Path) -> Sizes | None:
    """Return sizes by gcc; None without it."""
    try:
        return sizes(folder)
    except FileNotFoundError:
        return None


def _specified(code: str) -> str:
    names = ",".join(name for name in SPECIFIED if f" {name}(" in code)
    return f"-eva-use-spec {names} " if names else ""
