"""Tables of an export's evidence: recorded flights, bounds of loops, and what each line and rule comes to."""

import re
import shutil
import subprocess
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from fis_tools.words.text import sentence
from pipeline.flight.state.log import FlightLog
from pipeline.onboard.messages import REQUIREMENTS
from pipeline.onboard.program import OnboardProgram
from pipeline.onboard.recorded import Recorded, vector_of
from pipeline.onboard.source import Sources
from plain_files.file_access import read_text


def loop_table(program: OnboardProgram) -> Iterator[str]:
    """Return a table of the loops, each with how often it runs at most."""
    yield "function,counter,at most,python"
    for loop in program.translator.loops:
        yield f"{loop.function},{loop.variable},{loop.most},{loop.file}:{loop.line}"


def obligation_table(program: OnboardProgram) -> Iterator[str]:
    """Return what ranges of whole numbers alone do not show of the C, and an analyser of any input must."""
    yield "function,what might happen,python"
    for each in program.translator.obligations:
        what = each.what.partition(";")[0]
        yield f'{each.function},"{what}",{each.file}:{each.line}'


def requirement_table(folder: Path) -> Iterator[str]:
    """Return which lines of the C name each requirement that they serve."""
    yield "requirement,file,line,text"
    for file in ("controller.c", "packets.c"):
        lines = read_text(folder / file).splitlines()  # file: written just now
        for number, line in enumerate(lines, start=1):
            for name in re.findall(
                r"\bB\d+\b", " ".join(re.findall(r"\(([^()]*)\)", line)) if "*" in line else ""
            ):
                if name in REQUIREMENTS:
                    yield f'{name},{file},{number},"{REQUIREMENTS[name]}"'


def traceability(source: Sources, runs: Mapping[int, int] | None) -> Iterator[str]:
    """Return which line of Python each line of C comes from, and how often the test vector runs it."""
    yield "line of controller.c,python,runs in main.c"
    for number, file, line in source.origins:
        yield f"{number},{file}:{line},{'' if runs is None else runs.get(number, '')}"


def rule_table(program: OnboardProgram, source: Sources, answers: Sequence[Any]) -> Iterator[str]:
    """Return where each rule stands in the C, and in how many recorded commands it led."""
    lines = source.code.splitlines()
    yield "system,rule,line of controller.c,commands it led,words"
    for system, axis in zip(program.controller.systems, program.law.axes, strict=True):
        first = lines.index(f" * {system.name}:")
        for number, rule in enumerate(system.rules, start=1):
            at = next(k for k in range(first, len(lines)) if lines[k].startswith(f" * {number:3d}. "))
            led = sum(int(np.count_nonzero(each["leading_rule"][:, axis] == number)) for each in answers)
            words = sentence(rule).replace('"', '""')
            yield f'{system.name},{number},{at + 1},{led},"{words}"'


def line_runs(folder: Path) -> dict[int, int] | None:
    """Return how often the test vector of an export runs each line of the C; None without gcc and gcov."""
    compiler, reader = shutil.which("gcc"), shutil.which("gcov")
    if compiler is None or reader is None:
        return None
    evidence = folder.resolve() / "evidence"
    files: list[str | Path] = [evidence / "main.c", evidence / "vector.c", evidence.parent / "controller.c"]
    flags = ["-std=c99", "-O0", "-ffp-contract=off", "--coverage"]
    with TemporaryDirectory() as scratch:
        program = Path(scratch) / "compared"
        subprocess.run([compiler, *flags, "-o", program, *files, "-lm"], cwd=scratch, check=True)  # noqa: S603
        subprocess.run([program], cwd=scratch, check=False, capture_output=True)  # noqa: S603
        (notes,) = Path(scratch).glob("*controller.gcda")
        read = [reader, "--stdout", str(notes)]
        text = subprocess.run(  # noqa: S603
            read, cwd=scratch, check=True, capture_output=True, text=True
        ).stdout
    counts = re.findall(r"^\s*(\d+|#####)\*?:\s*(\d+):", text, re.MULTILINE)
    return {int(line): 0 if count.startswith("#") else int(count) for count, line in counts}


def vector_source(flights: Sequence[Recorded], logs: Sequence[FlightLog]) -> Iterator[str]:
    """Return recorded flights as C."""
    starts, steps = vector_of(flights, logs)
    yield from ('#include "vector.h"', "")
    yield "const struct controller_start_input vector_starts[VECTOR_NUM_FLIGHTS] = {"
    yield from (f"    {_fields(start)}," for start in starts)
    yield from ("};", "")
    yield "const struct vector_step vector_steps[VECTOR_NUM_FLIGHTS][CONTROLLER_NUM_PERIODS] = {"
    for flight in steps:
        yield "    {"
        yield from (f"        {_fields(step)}," for step in flight)
        yield "    },"
    yield "};"


def _fields(record: Any) -> str:
    """Return a record as the initial value of a structure; doubles as hexadecimal digits."""

    def text(value: Any) -> str:
        if value.dtype.names:
            return _fields(value)
        if np.ndim(value):
            return "{" + ", ".join(map(text, value)) + "}"
        return str(int(value)) if value.dtype.kind in "iu" else float(value).hex()

    return "{" + ", ".join(text(record[name]) for name in record.dtype.names) + "}"
