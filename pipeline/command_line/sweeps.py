"""Sweeps: the runs of one command, one after the other; those that fail stop no other."""

import os
import sys
import time
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path

from pipeline.command_line import runs
from pipeline.command_line.config import Composed
from pipeline.command_line.runs import FAULT, MISTAKE, OK, sentence
from pipeline.run import artifacts, sweep
from pipeline.run.lock import held
from pipeline.run.runner import Interrupted
from pipeline.run.sweep import DONE, SweptRun, state_of


def start(jobs: Sequence[Composed], swept: Sequence[SweptRun], folder: Path) -> int:
    """Run the runs of a new sweep, or of one that is made larger; return the exit code.

    Parameters
    ----------
    jobs : sequence of Composed
    swept : sequence of SweptRun
        The same as the sweep's file tells them.
    folder : Path
        Of the sweep.

    Raises
    ------
    ValueError
        What can be told before any folder is made.
    """
    for job in jobs:
        runs.check_before(job.experiment)

    def begin(job: Composed, run: SweptRun) -> Callable[[], int]:
        return lambda: runs.start(job, run.command)

    with held(folder):
        known = sweep.read(folder) if (folder / sweep.SWEEP).exists() else []
        known = sweep.merged(known, swept)
        sweep.write(folder, known)
        for job in jobs:
            _announce(job)
        begun = [(run, begin(job, run)) for job, run in zip(jobs, swept, strict=True)]
        return _run_all(folder, known, begun)


def resume(folder: Path) -> int:
    """Go on with the runs of a sweep that are not finished; return the exit code."""
    with held(folder):
        known = sweep.read(folder)
        left = [run for run in known if state_of(folder, run) != DONE]

        def go_on(run: SweptRun) -> Callable[[], int]:
            return lambda: runs.resume(folder / run.folder, (), run.command)

        if not left:
            sys.stderr.write(f"nothing is left to do: all {len(known)} runs are finished\n")
            return OK
        return _run_all(folder, known, [(run, go_on(run)) for run in left])


def _announce(job: Composed) -> None:
    """Put a configuration where its run will be made, so that it can be gone on with; spare what is there."""
    if not (job.folder / artifacts.CONFIG).exists():
        artifacts.write_config(job.folder, job.config)


def _run_all(folder: Path, known: list[SweptRun], begun: Sequence[tuple[SweptRun, Callable[[], int]]]) -> int:
    """Run all that is begun, with a line each; at the end name those that failed."""
    started, codes = time.perf_counter(), [OK]
    for number, (run, begin) in enumerate(begun, 1):
        try:
            code, failure = _attempt(begin)
        except Interrupted as interrupt:
            left = len(begun) - number + 1
            raise Interrupted(
                f"{interrupt}\n{left} runs of the sweep are left. To go on with all: "
                f"python -m pipeline resume={folder}"
            ) from interrupt
        codes.append(code)
        known = sweep.with_failure(known, run.folder, failure)
        sweep.write(folder, known)
        per_run = (time.perf_counter() - started) / number
        word = f"FAILED: {failure}" if failure else "done"
        sys.stderr.write(
            f"[{number}/{len(begun)}] {run.folder}: {word}; {per_run * (len(begun) - number):.0f} s left\n"
        )
    _tell(folder, known)
    return max(codes)


def _attempt(begin: Callable[[], int]) -> tuple[int, str]:
    """Run one; return its exit code and why it failed, nothing where it did not."""
    if os.environ.get("HYDRA_FULL_ERROR") == "1":
        return begin(), ""
    try:
        return begin(), ""
    except (ValueError, OSError, MemoryError) as error:
        sys.stderr.write(runs.told(error))
        return MISTAKE, sentence(error)
    except Exception as error:  # noqa: BLE001 - a fault of one run is no reason to lose the others
        traceback.print_exc()
        return FAULT, f"a fault of the program: {type(error).__name__}: {error}"


def _tell(folder: Path, known: Sequence[SweptRun]) -> None:
    """Say what became of a sweep, and how to see its summary."""
    failed = [run for run in known if run.failure]
    for run in failed:
        sys.stderr.write(f"failed: {run.folder}: {run.failure}\n")
    sys.stderr.write(
        f"{len(known) - len(failed)} of {len(known)} runs are done"
        + (f"; to try the others again: python -m pipeline resume={folder}" if failed else "")
        + f"\nto see what came out: python -m pipeline summary {folder}\n"
    )
