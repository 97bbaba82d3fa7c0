"""The memory of a campaign: ``python -m benchmarks scaling`` measures how it grows with the flights."""

import argparse
import os
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path

from benchmarks.timing import line
from tests.hostile.kills import command


def memory_of(cases: int, part_cases: int, folder: Path) -> float:
    """Fly a campaign of `cases` flights; return the peak memory of its process, MB."""
    words = [
        "+experiment=evaluate", "controller=coast", "stages=[evaluate]", "duration_s=60",
        f"monte_carlo.num_cases={cases}", f"engine.part_cases={part_cases}", "optimum.reference=null",
        f"hydra.run.dir={folder}",
    ]  # fmt: skip
    process = subprocess.Popen(command(words), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)  # noqa: S603
    _, status, used = os.wait4(process.pid, 0)
    if status:
        raise RuntimeError(f"the campaign of {cases} flights ended with {status}")
    return used.ru_maxrss / 1024.0


def main(arguments: Sequence[str]) -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks scaling", description=__doc__)
    parser.add_argument("--cases", type=int, nargs="*", default=[100_000, 200_000, 400_000])
    options = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as name:
        held = [memory_of(cases, 10_000, Path(name) / str(cases)) for cases in options.cases]
    for cases, megabytes in zip(options.cases, held, strict=True):
        line(f"{cases:,} flights, MB at most", f"{megabytes:.0f}")
    growth = (held[-1] - held[0]) / (options.cases[-1] - options.cases[0])
    line("bytes more a flight", f"{1048576 * growth:.0f}")
    line("10,000,000 flights, extrapolated, MB", f"{held[0] + growth * (1e7 - options.cases[0]):.0f}")
    return 0
