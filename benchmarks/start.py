"""Durations of starts, with all compiled and with nothing, and what each kernel costs to compile."""

import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from numba.core import event

from benchmarks.timing import line

REPEATS = 10
FLY = ("+experiment=fly", "controller=paper_champion")
#: compiles also what comes compiled
UNSHIPPED = {"FIS_TOOLS_SHIPPED": "0"}


def run() -> None:
    """Print what `+experiment=fly` takes from start to end, and what its kernels cost to compile."""
    with tempfile.TemporaryDirectory() as folder:
        cache = {"NUMBA_CACHE_DIR": f"{folder}/cache"}
        starts = {name: _fly(Path(folder), cache) for name in ("first", "second")}
        starts["one that compiles the flight"] = _fly(Path(folder), cache | UNSHIPPED)
        warm = [_fly(Path(folder), cache) for _ in range(REPEATS)]
        costs = {name: _costs(Path(folder), also) for name, also in (("first", {}), ("compiling", UNSHIPPED))}
    print(f"Start: python -m pipeline {' '.join(FLY)}, start to end")
    line("seconds, all compiled", f"{min(wall for wall, _ in warm):.2f}")
    line("seconds of processor time, all compiled", f"{min(used for _, used in warm):.2f}")
    for name, (wall, used) in starts.items():
        line(f"with nothing compiled: {name}", f"{wall:.1f} s, {used:.1f} s of processor time")
    for name, kernels in costs.items():
        print(f"Kernels that the {name} start compiles, with all that they call")
        for kernel, (seconds, functions) in sorted(kernels.items(), key=lambda cost: cost[1], reverse=True):
            line(kernel, f"{seconds:.1f} s, {functions} functions")


def _fly(folder: Path, environment: dict[str, str], *program: str) -> tuple[float, float]:
    """Return the seconds that a start takes, and those of processor time."""
    command = [
        sys.executable,
        *(program or ("-m", "pipeline")),
        *FLY,
        f"hydra.run.dir={folder}/{time.time_ns()}",
    ]
    used, began = _used(), time.perf_counter()
    subprocess.run(command, check=True, capture_output=True, env=os.environ | environment)  # noqa: S603
    return time.perf_counter() - began, _used() - used


def _used() -> float:
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def _costs(folder: Path, also: dict[str, str]) -> dict[str, tuple[float, int]]:
    """Return what each kernel that a start compiles costs, in seconds, and how many functions it takes."""
    environment = {"NUMBA_CACHE_DIR": f"{folder}/counted", "COSTS": f"{folder}/costs.json"}
    _fly(folder, environment | also, "-m", "benchmarks.start")
    costs: dict[str, tuple[float, int]] = json.loads((folder / "costs.json").read_text())
    return costs


def main() -> int:
    """Run the pipeline, and write what each kernel costs to compile into the file ``$COSTS``."""
    from pipeline.__main__ import main as run_pipeline  # noqa: PLC0415 - numba is told first who listens

    with event.install_recorder("numba:compile") as recorder:
        code = run_pipeline()
    costs: dict[str, tuple[float, int]] = {}
    depth = functions = 0
    for when, what in recorder.buffer:
        functions = functions + what.is_start if depth else 1
        depth += 1 if what.is_start else -1
        if what.is_start and depth == 1:
            began = when
        elif depth == 0:
            function = what.data["dispatcher"].py_func
            name = f"{function.__module__}.{function.__qualname__}"
            seconds, others = costs.get(name, (0.0, 0))
            costs[name] = seconds + when - began, functions + others
    Path(os.environ["COSTS"]).write_text(json.dumps(costs))
    return code


if __name__ == "__main__":
    sys.exit(main())
