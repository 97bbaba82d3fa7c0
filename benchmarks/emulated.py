"""Exported controllers on emulated Cortex-M7 and M4: flights compared bit by bit, instructions and memory."""

import os
import re
import subprocess
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.flight.fly.simulation import fly_logged
from pipeline.flight.state.log import Scenario
from pipeline.onboard.export import export
from pipeline.onboard.program import OnboardProgram
from pipeline.onboard.recorded import FLAGS, recorded, vector_of
from pipeline.onboard.sizes import sizes

#: what the boards have for a vector, bytes
ROOM = 3_500_000
HEADING = (
    "| controller | commands that differ | mean instructions a period | most | at the start "
    "| code, kB | stack bound, bytes | stack used |\n"
    "|---|---|---|---|---|---|---|---|\n"
)
#: what is printed below, of controllers that plan on board
PLANS = (
    "| controller | instructions to look ahead | of the first part | mean of a later one | most |\n"
    "|---|---|---|---|---|\n"
)
_PLANNED = re.compile(
    r"a plan: (\d+) instructions to look ahead, (\d+) the first part of a generation, (\d+) a later one, "
    r"(\d+) at most"
)
_PRINTED = re.compile(
    r"(Cortex-M\d): (\d+) instructions a period, (\d+) at most, (\d+) at the start; (\d+) bytes of stack, "
    r"(\d+) of state\n\d+ flights, (\d+) control periods: (\d+) commands differ"
)


@dataclass
class Cost:
    """What one processor took."""

    total: float = 0.0
    num_commands: int = 0
    num_different: int = 0
    #: instructions in a period and at the start, bytes of stack and of the state
    most: list[int] = field(default_factory=lambda: [0, 0, 0, 0])
    #: instructions of plans: to look ahead, of the first part of a generation, mean and most of later ones
    plans: list[list[int]] = field(default_factory=list)


def rows(words: Sequence[str], program: OnboardProgram, starts: Sequence[Scenario]) -> tuple[str, str]:
    """Return a champion's row of the table: numbers of the Cortex-M7, then of the M4 where they differ.

    Then its row of the table of plans; nothing if it does not plan on board.
    """
    costs: dict[str, Cost] = {}
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        export(program, starts[:1], folder)
        part: list[Any] = []
        for number, start in enumerate(starts, start=1):
            log = fly_logged(program.mission, program.controller, start)
            part.append((recorded(program, start, log), log))
            flights, logs = zip(*part, strict=True)
            starts_bytes, steps = vector_of(flights, logs)
            if number == len(starts) or (len(part) + 1) * steps[0].nbytes > ROOM:
                emulate(folder, starts_bytes, steps, costs)
                part = []
        script = (folder / "evidence" / "emulate.sh").read_text(encoding="utf-8")
        columns = [_column(folder, script, *item) for item in costs.items()]
    different, mean, most, at_start, code, bound, used = (
        " / ".join(dict.fromkeys(pair)) for pair in zip(*columns, strict=True)
    )
    num_commands = next(iter(costs.values())).num_commands
    name = f"`{words[0]}` {' '.join(f'`{word}`' for word in words[1:])}"
    planned = ""
    if program.planner is not None:
        greatest = zip(*(np.max(cost.plans, axis=0) for cost in costs.values()), strict=True)
        planned = f"| {name} | {' | '.join(' / '.join(f'{n:,}' for n in pair) for pair in greatest)} |"
    return (
        f"| {name} | {different} of {num_commands:,} "
        f"| {mean} | {most} | {at_start} | {code} | {bound} | {used} |",
        planned,
    )


def _column(folder: Path, script: str, processor: str, cost: Cost) -> tuple[str, ...]:
    """Return the numbers of one processor."""
    options = re.search(rf"emulated {processor} \S+ ((?:-m\S+ ?)+)", script)
    size = sizes(folder, "arm-none-eabi-gcc", (*FLAGS, "-mthumb", *(options[1].split() if options else ())))
    bound = max(size.stacks[name] for name in ("controller_start", "controller_step"))
    most, at_start, used, _ = cost.most
    numbers = cost.total / cost.num_commands, most, at_start
    return (
        f"{cost.num_different}",
        *(f"{number:,.0f}" for number in numbers),
        f"{size.code / 1e3:.1f}",
        f"{bound:,}",
        f"{used:,}",
    )


def emulate(folder: Path, starts: Any, steps: Any, costs: dict[str, Cost]) -> None:
    """Repeat flights on each processor, and add up what it printed."""
    vector = folder / "vector.s"
    vector.write_text(
        '.section .rodata,"a"\n'
        + "".join(
            f'.balign 8\n.global {name}\n{name}: .incbin "{folder / name}"\n'
            for name in ("vector_starts", "vector_steps")
        ),
        encoding="utf-8",
    )
    starts.tofile(folder / "vector_starts")
    steps.tofile(folder / "vector_steps")
    printed = subprocess.run(  # noqa: S603
        ["/bin/sh", folder / "evidence" / "emulate.sh"],
        env=os.environ | {"VECTOR": f"-DVECTOR_NUM_FLIGHTS={len(starts)} {vector}"},
        capture_output=True,
        text=True,
        check=False,
    )
    matches = _PRINTED.findall(printed.stdout)
    if len(matches) != 2:
        raise RuntimeError(f"the emulation ended early: {printed.stdout}{printed.stderr}")
    for (processor, *_), numbers in zip(matches, _PLANNED.findall(printed.stdout), strict=False):
        costs.setdefault(processor, Cost()).plans.append(list(map(int, numbers)))
    for processor, *numbers in matches:
        mean, *most, num_commands, num_different = map(int, numbers)
        cost = costs.setdefault(processor, Cost())
        cost.total += mean * num_commands
        cost.num_commands += num_commands
        cost.num_different += num_different
        cost.most = [max(pair) for pair in zip(cost.most, most, strict=True)]
