"""The cost of distribution: parts, processes, memory of a campaign; and a simulation of many workers.

``python -m benchmarks scaling`` measures processor time, which other processes affect less than
wall time: Dask's cost per part and while idle, and the growth of a campaign's memory
with its flights. From these it computes, and labels as such, the speed-up with up to 1,000 workers.
"""

import argparse
import heapq
import os
import resource
import subprocess
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import psutil

from benchmarks.timing import line
from pipeline.run.engine import crew
from pipeline.settings.experiment import Engine
from tests.hostile.kills import command

IDLE_S: Final = 10.0
WORKERS: Final = (1, 2, 10, 30, 100, 300, 1000)


def nothing(number: int) -> int:
    """Do nothing: a part without work."""
    return number


def processor_seconds(root: psutil.Process) -> float:
    """Return the processor time of a process and all that it has started."""
    total = 0.0
    for process in (root, *root.children(recursive=True)):
        times = process.cpu_times()
        total += times.user + times.system
    return total


class Spent:
    """Processor time since its creation: of this process, and with all processes that it started."""

    def __init__(self) -> None:
        self.clock, self.here = time.perf_counter(), time.process_time()
        self.all = processor_seconds(psutil.Process())

    def seconds(self) -> tuple[float, float, float]:
        """Return the wall time, the processor time here, and the processor time everywhere, s."""
        everywhere = processor_seconds(psutil.Process()) - self.all
        return time.perf_counter() - self.clock, time.process_time() - self.here, everywhere


def overhead(num_parts: int, processes: int) -> tuple[float, float, float]:
    """Return Dask's processor time per part, here and everywhere, and per second of idling, s."""
    with crew(Engine(kind="dask", processes=processes)) as do_all:
        list(do_all(nothing, [(0,)] * 50))  # wakes all processes
        idle = Spent()
        time.sleep(IDLE_S)
        clock, _, waiting = idle.seconds()
        busy = Spent()
        list(do_all(nothing, [(number,) for number in range(num_parts)]))
        took, here, everywhere = busy.seconds()
    rest = waiting / clock
    return here / num_parts, (everywhere - rest * took) / num_parts, rest


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


def simulated(workers: int, part_s: float, scheduler_s: float, num_parts: int) -> float:
    """Return the speed-up of many workers over one, if a scheduler serves one part at a time.

    Each part takes its worker `part_s`, and before that the one scheduler `scheduler_s`.
    """
    free = [0.0] * workers
    served = 0.0
    for _ in range(num_parts):
        begun = max(heapq.heappop(free), served)
        served = begun + scheduler_s
        heapq.heappush(free, served + part_s)
    return num_parts * part_s / max(free)


def main(arguments: Sequence[str]) -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks scaling", description=__doc__)
    parser.add_argument("--parts", type=int, default=500, help="without work, that are timed")
    parser.add_argument("--cases", type=int, nargs="*", default=[100_000, 200_000, 400_000])
    options = parser.parse_args(arguments)
    for processes in (1, 2):
        here, part, rest = overhead(options.parts, processes)
        print(f"Dask with {processes} processes, {options.parts} parts without work")
        line("processor time a part: scheduler and client, ms", f"{1e3 * here:.1f}")
        line("processor time a part: all processes, ms", f"{1e3 * part:.1f}")
        line("processor time in a second of waiting: all processes, ms", f"{1e3 * rest:.1f}")
        line("so of parts of a second, %", f"{100.0 * (part + rest / processes):.2f}")
    print(f"Simulated, with {1e3 * here:.1f} ms of the scheduler a part; 20 parts a worker")
    for workers in WORKERS:
        speeds = [f"{simulated(workers, part_s, here, 20 * workers):7.1f}" for part_s in (1.0, 10.0, 60.0)]
        line(f"{workers} workers: times as fast as one, parts of 1, 10 and 60 s", " ".join(speeds))
    print("Memory of a campaign's process")
    with tempfile.TemporaryDirectory() as name:
        held = [memory_of(cases, 10_000, Path(name) / str(cases)) for cases in options.cases]
    for cases, megabytes in zip(options.cases, held, strict=True):
        line(f"{cases:,} flights, MB at most", f"{megabytes:.0f}")
    growth = (held[-1] - held[0]) / (options.cases[-1] - options.cases[0])
    line("bytes more a flight", f"{1048576 * growth:.0f}")
    line("10,000,000 flights, extrapolated, MB", f"{held[0] + growth * (1e7 - options.cases[0]):.0f}")
    line("this process, MB", f"{resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f}")
    return 0
