"""The on-board function of each champion in C: flights compared bit by bit, and proofs by Frama-C.

``python -m benchmarks onboard --flights 300 --prove`` prints the table of docs/how-to/fly-on-board.md. With
``--faults`` faults are put into the C, and the analyser must find each.
"""

import argparse
import os
import re
import resource
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from pipeline.command_line.config import compose_experiment
from pipeline.controllers import source
from pipeline.flight.fly.simulation import fly_logged
from pipeline.onboard.export import export
from pipeline.onboard.program import translate
from pipeline.onboard.recorded import Library, differing, recorded
from pipeline.scenarios import evaluation_scenarios

#: each champion with rules, as it is flown
CHAMPIONS: tuple[tuple[str, ...], ...] = (
    ("champion_27", "sun=random"),
    ("champion_27_fixed_sun",),
    ("champion_81", "sun=random"),
    ("champion_any_sun", "sun=random"),
    ("champion_fixed_sun",),
    ("paper_champion",),
    ("champion_leo", "world=leo"),
    ("champion_afrl", "world=afrl"),
    ("champion_rso", "world=rso"),
    ("champion_docking", "problem=docking"),
)
#: faults: what is replaced by what, in the C of `champion_27`
FAULTS: tuple[tuple[str, str], ...] = (
    (r"for \(int j = 0; j < 104;", "for (int j = 0; j < 105;"),
    (r"most\(least\(state->asked|most\(least\(force_x, 1\.0\), -1\.0\)", "(2.0 * force_x)"),
    (
        r"\(output->status != 0\) \|\| \(period < 0\) \|\| \(period >= CONTROLLER_NUM_PERIODS\)",
        "output->status != 0",
    ),
    (r"finite_or_zero\(state->signals", "(state->signals"),
    (r"state->leading\[system\] >= 0", "state->leading[system] >= -1"),
)


def proved(folder: Path) -> tuple[int, str, float]:
    """Return the number of alarms, the share of statements reached, and the processor seconds of EVA."""
    script = (folder / "evidence" / "check.sh").read_text(encoding="utf-8")
    command = re.search(r"frama-c (.*) >eva.log", script)
    if command is None:
        raise RuntimeError("the script of an export has no call of Frama-C")
    started = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    done = subprocess.run(  # noqa: S603
        ["frama-c", *command[1].split()],  # noqa: S607
        cwd=folder / "evidence",
        env=os.environ | {"PWD": os.fspath(folder / "evidence")},  # by which it finds files
        capture_output=True,
        text=True,
        check=True,
    )
    seconds = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - started
    alarms = re.search(r"(\d+) alarms? generated", done.stdout)
    reached = re.search(r"statements reached \(out of \d+\): (\d+)%", done.stdout)
    unknown = len(re.findall(r"(?:got status (?:unknown|invalid))", done.stdout))
    return int(alarms[1] if alarms else -1) + unknown, f"{reached[1] if reached else '?'} %", seconds


def row(words: Sequence[str], num_flights: int, *, is_proved: bool) -> str:
    """Return a champion's row of the table."""
    job = compose_experiment(["+experiment=evaluate", f"controller={words[0]}", *words[1:]])
    mission = job.experiment.mission
    program = translate(mission, source.load(job.config["controller"], mission))
    starts = evaluation_scenarios(job.experiment)[:num_flights]
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        exported = export(program, starts[:1], folder)
        library, num_different, num_commands = Library(folder), 0, 0
        for start in starts:
            log = fly_logged(mission, program.controller, start, is_one_of_many=True)
            answers = library.answers(recorded(program, start, log))
            num_different += len(differing(answers, log))
            num_commands += len(answers)
        alarms, reached, seconds = proved(folder) if is_proved else ("", "", 0.0)
    size = exported.source
    return (
        f"| `{words[0]}` {' '.join(f'`{word}`' for word in words[1:])} | {len(starts)} | {num_different} of "
        f"{num_commands:,} | {size.code.count(chr(10)):,} | {sum(size.tables.values()) / 1e3:.1f} | "
        f"{size.state_bytes / 1e3:.1f} | {alarms} | {reached} | {seconds:.0f} |"
    )


def faults_found() -> int:
    """Return how many faults the analyser finds, of those that are put into the C of `champion_27`."""
    job = compose_experiment(["+experiment=evaluate", "controller=champion_27"])
    mission, num_found = job.experiment.mission, 0
    program = translate(mission, source.load(job.config["controller"], mission))
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        export(program, evaluation_scenarios(job.experiment)[:1], folder)
        code = (folder / "controller.c").read_text(encoding="utf-8")
        for pattern, fault in FAULTS:
            faulty, number = re.subn(pattern, fault, code, count=1)
            (folder / "controller.c").write_text(faulty, encoding="utf-8")
            alarms, _, _ = proved(folder)
            sys.stdout.write(f"{fault}: {number} place, {alarms} alarms\n")
            num_found += number > 0 and alarms > 0
    return num_found


def main(arguments: Sequence[str]) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks onboard", description=__doc__)
    parser.add_argument("--flights", type=int, default=100)
    parser.add_argument("--prove", action="store_true")
    parser.add_argument("--faults", action="store_true")
    parser.add_argument("--only", nargs="*", default=[])
    chosen = parser.parse_args(arguments)
    if (chosen.prove or chosen.faults) and shutil.which("frama-c") is None:
        parser.error("frama-c was not found: apt-get install frama-c-base")
    if chosen.faults:
        sys.stdout.write(f"{faults_found()} of {len(FAULTS)} faults are found\n")
        return
    sys.stdout.write(
        "| controller | flights | commands that differ | lines | tables, kB | state, kB | alarms | reached "
        "| s |\n"
        "|---|---|---|---|---|---|---|---|---|\n"
    )
    for words in CHAMPIONS:
        if not chosen.only or words[0] in chosen.only:
            sys.stdout.write(row(words, chosen.flights, is_proved=chosen.prove) + "\n")
            sys.stdout.flush()
