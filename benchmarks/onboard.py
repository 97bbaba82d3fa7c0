"""The on-board function of each champion in C: flights compared bit by bit, and proofs by Frama-C.

``python -m benchmarks onboard --flights 1000 --compilers --prove`` prints the table of
docs/how-to/fly-on-board.md; with ``--compilers`` each flight is repeated by gcc and clang, from -O0 to -O3.
With ``--emulate`` they are repeated on emulated Cortex-M7 and M4, and instructions and memory counted, alone
or after the proofs of ``--prove``. With ``--faults`` faults are put into each C, and the analyser must find
them.
"""

import argparse
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import get_args, get_type_hints

from benchmarks import emulated
from benchmarks.scaling import words_of
from pipeline.command_line.config import compose_experiment
from pipeline.controllers import source
from pipeline.flight.fly.replanning import foresees
from pipeline.flight.fly.simulation import fly_logged
from pipeline.flight.state.log import Scenario
from pipeline.onboard.allowed import NotTranslatableError
from pipeline.onboard.dispersed import of_all_flights
from pipeline.onboard.export import export
from pipeline.onboard.program import OnboardProgram, translate
from pipeline.onboard.recorded import Library, differing, recorded
from pipeline.scenarios import evaluation_scenarios
from pipeline.settings.mission import Guidance, Safety
from pipeline.settings.places import conf_folder

#: settings whose other kinds bring functions of their own on board
KINDS: Mapping[str, type[Guidance | Safety]] = {"guidance": Guidance, "safety": Safety}
#: words of an orbit that is no circle
ELLIPSE = (
    *("dynamics=two_body", "light=shadow", "orbit=elements", "orbit.semi_major_axis_m=9615714"),
    *("orbit.eccentricity=0.3", "orbit.true_anomaly_deg=290"),
)
#: and of a chief that tumbles
TUMBLING = "chief=tumbling"
#: what each flight draws of its own: fixes, and thrusters and drag that vary as time goes by
VARYING_THRUST = "+dispersions.actuators.scale_error={kind:normal,mean:0.0,std:0.05,correlation_s:600}"
VARYING_DRAG = "+dispersions.dynamics.drag_m_s2={kind:normal,mean:3e-7,std:1e-7,low:0,correlation_s:1200}"
NOISE = "+dispersions.navigation.noise_m={kind:uniform,low:0.5,high:2.0}"
#: missions that bring tables of their own: of what a chief's parts hide, and of an orbit that is no circle;
#: in which what ships for another mission plans on board; in which errors make plans anew; in which flights
#: draw settings; and in which plans take tables of a chief's orbit and of its turn
MISSIONS: tuple[tuple[str, ...], ...] = (
    ("champion_27", "sun=random", "chief=satellite"),
    ("champion_leo_rehearsed", "sun=random"),
    ("champion_leo_parked", "sun=random"),
    ("champion_27_rehearsed", "sun=random", "navigation=fixes", "actuators=real"),
    ("champion_27_parked", "sun=random", "navigation=fixes", "actuators=real"),
    ("champion_leo_rehearsed", "world=leo", "safety=robust"),
    ("champion_leo_parked", "world=leo", "safety=robust"),
    ("champion_27_rehearsed", "sun=random", "navigation=fixes", "actuators=real", NOISE, VARYING_THRUST),
    ("champion_leo_rehearsed", "world=leo", "safety=robust", VARYING_THRUST, VARYING_DRAG),
    ("champion_leo", "sun=random", *ELLIPSE),
    ("champion_leo_rehearsed", "sun=random", *ELLIPSE),
    ("champion_leo_rehearsed", "sun=random", *ELLIPSE, "navigation=fixes", "actuators=real"),
    ("champion_27_rehearsed", "sun=random", TUMBLING),
    ("champion_leo_rehearsed", "sun=random", TUMBLING),
)
#: compilers and levels of optimisation by which each flight is repeated
COMPILERS, LEVELS = ("gcc", "clang"), ("-O0", "-O1", "-O2", "-O3")
HEADING = (
    "| controller | commands that differ | lines | tables, kB | state, kB | alarms | reached |\n"
    "|---|---|---|---|---|---|---|\n"
)
#: faults: what is replaced by what in the C of any controller, where it stands first
FAULTS: Mapping[str, tuple[str, str]] = {
    "a loop that runs once too often": (r"(for \(int j = 0; j) < (\w+); ", r"\1 <= \2; "),
    "twice the force": (r"(state->commanded\[0\] = finite_number\()", r"\g<1>2.0 * "),
    "a period out of range": (
        r"if \((is_fit\(output->status, CONTROLLER_NEEDED_BY_RULES\)) && \(period >= 0\) && "
        r"\(period < CONTROLLER_NUM_PERIODS\)\)",
        r"if (\1)",
    ),
    "a signal that is not finite": (r"finite_number\(state->signals", "(state->signals"),
    "a rule before the first": (r"state->leading\[system\] >= 0", "state->leading[system] >= -1"),
    "a table read beyond its end": (r"(const int offset\w* = \d+ \+ \(int\)\()", r"\g<1>1e6 + "),
}


def champions() -> Iterator[tuple[str, ...]]:
    """Yield each champion that ships, and the words of the world that it is for; then `MISSIONS`.

    Then, for each other kind of a setting, the first champion of which it changes what is called on board.
    """
    paths = sorted((conf_folder() / "controller").glob("*champion*.yaml"))
    rows = [(path.stem, *words_of(path.stem)[1:]) for path in paths]
    yield from rows
    yield from MISSIONS
    for group, settings in KINDS.items():
        kinds = set(get_args(get_type_hints(settings)["kind"])) - {settings().kind}
        for word in sorted(f"{group}.kind={kind}" for kind in kinds):
            yield next((*words, word) for words in rows if functions((*words, word)) > functions(words))


@cache
def functions(words: Sequence[str]) -> set[str]:
    """Return the names of the functions of C that a champion is translated into."""
    return {function.name for function in program_of(words)[0].translator.functions}


def proved(folder: Path) -> tuple[int, float]:
    """Return EVA's number of alarms, and the percentage of statements reached, of all its analyses."""
    script: list[str | Path] = ["/bin/sh", folder / "evidence" / "prove.sh"]
    done = subprocess.run(script, capture_output=True, text=True, check=False)  # noqa: S603
    alarms = [int(number) for number in re.findall(r"(\d+) alarms? generated", done.stdout)]
    reached = re.findall(r"(\d+) statements? reached \(out of (\d+)\)", done.stdout)
    if not alarms or len(alarms) != len(reached):
        raise RuntimeError(f"the analysis ended early: {done.stdout[-1000:]}")
    unproved = sum(alarms) + len(re.findall(r"got status (?:unknown|invalid)", done.stdout))
    if (done.returncode == 0) != (unproved == 0):
        raise RuntimeError(f"prove.sh exits with {done.returncode} where {unproved} are left")
    statements, all_statements = (sum(map(int, numbers)) for numbers in zip(*reached, strict=True))
    return unproved, 100.0 * statements / all_statements


def program_of(words: Sequence[str]) -> tuple[OnboardProgram, list[Scenario]]:
    """Return a champion's program, and its starts."""
    job = compose_experiment(["+experiment=evaluate", f"controller={words[0]}", *words[1:]])
    mission = job.experiment.mission
    controller = source.load(job.config["controller"], mission)
    try:
        program = of_all_flights(mission, lambda flown: translate(flown, controller))
    except NotTranslatableError:  # where its planner is not exported
        program = translate(mission, controller, rules_alone=True)
    return program, list(evaluation_scenarios(job.experiment))


def named_by(words: Sequence[str], program: OnboardProgram) -> str:
    """Return what a row is of."""
    rules = ", its rules" if foresees(program.controller) and program.planner is None else ""
    return f"`{words[0]}` {' '.join(f'`{word}`' for word in words[1:])}{rules}"


def libraries(folder: Path, *, is_by_all: bool) -> list[Library]:
    """Return the C of a folder by each compiler and level, or by gcc alone."""
    if not is_by_all:
        return [Library(folder)]
    return [
        Library(folder, compiler, ("-std=c99", level, "-ffp-contract=off"))
        for compiler in COMPILERS
        for level in LEVELS
    ]


def row(words: Sequence[str], num_flights: int, *, is_proved: bool, is_by_all: bool) -> str:
    """Return a champion's row of the table."""
    program, starts = program_of(words)
    starts = starts[:num_flights]
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        exported = export(program, starts[:1], folder)
        compiled, num_different, num_commands = libraries(folder, is_by_all=is_by_all), 0, 0
        for start in starts:
            log = fly_logged(program.mission, program.controller, start)
            flight = recorded(program, start, log)
            num_different += sum(len(differing(library.answers(flight), log)) for library in compiled)
            num_commands += len(flight.steps) * len(compiled)
        alarms, reached = proved(folder) if is_proved else (0, 0.0)
    proof = f"{alarms} | {reached:.1f} %" if is_proved else "|"
    size = exported.source
    return (
        f"| {named_by(words, program)} | {num_different} of {num_commands:,} "
        f"| {size.code.count(chr(10)):,} | {sum(size.tables.values()) / 1e3:.1f} | "
        f"{size.state_bytes / 1e3:.1f} | {proof} |"
    )


def missed_faults(words: Sequence[str]) -> list[str]:
    """Return which faults the analyser does not find, of those that are put into the C of a champion."""
    program, starts = program_of(words)
    missed = []
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        export(program, starts[:1], folder)
        code = (folder / "controller.c").read_text(encoding="utf-8")
        for name, (pattern, fault) in FAULTS.items():
            faulty, number = re.subn(pattern, fault, code, count=1)
            (folder / "controller.c").write_text(faulty, encoding="utf-8")
            if number == 0 or proved(folder)[0] == 0:
                missed.append(name)
    return missed


def main(arguments: Sequence[str]) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks onboard", description=__doc__)
    parser.add_argument("--flights", type=int, default=100)
    parser.add_argument("--prove", action="store_true")
    parser.add_argument("--compilers", action="store_true")
    parser.add_argument("--emulate", action="store_true")
    parser.add_argument("--faults", action="store_true")
    parser.add_argument("--only", nargs="*", default=[], help="controllers, or other words of a row")
    chosen = parser.parse_args(arguments)
    if (chosen.prove or chosen.faults) and shutil.which("frama-c") is None:
        parser.error("frama-c was not found: apt-get install frama-c-base")
    rows = [words for words in champions() if not chosen.only or set(words) & set(chosen.only)]
    if chosen.faults:
        for words in rows:
            missed = missed_faults(words)
            number = len(FAULTS) - len(missed)
            _write(", ".join([f"`{words[0]}`: {number} of {len(FAULTS)} found", *missed]) + "\n")
        return
    if chosen.prove or chosen.compilers or not chosen.emulate:
        _write(HEADING)
        for words in rows:
            line = row(words, chosen.flights, is_proved=chosen.prove, is_by_all=chosen.compilers)
            _write(line + "\n")
    if chosen.emulate:
        _emulate(rows, chosen.flights)


def _emulate(rows: Iterable[Sequence[str]], num_flights: int) -> None:
    """Print the table of what processors take, then that of plans."""
    plans: list[str] = []
    _write(emulated.HEADING)
    for words in rows:
        program, starts = program_of(words)
        line, planned = emulated.rows(words, program, starts[:num_flights])
        plans += [planned] if planned else []
        _write(line + "\n")
    if plans:
        _write("\n" + emulated.PLANS + "".join(f"{each}\n" for each in plans))


def _write(text: str) -> None:
    sys.stdout.write(text)
    sys.stdout.flush()
