"""A Dask scheduler with workers, as `python -m pipeline cluster` starts them, for a run to join."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Final

#: longest time in which a scheduler writes its file, s
LONGEST_S: Final = 120.0
SCHEDULER, WORKER = "scheduler", "worker"


@contextmanager
def peers_at(folder: Path, env: Mapping[str, str]) -> Iterator[tuple[list[str], dict[str, int]]]:
    """Start a scheduler and two workers; end them afterwards, with all that they have started.

    Yield the arguments by which a run joins them, and the process numbers of the scheduler and of a worker.
    """
    file = folder / "scheduler.json"
    file.unlink(missing_ok=True)
    started = [_start(["scheduler", str(folder), "--host=127.0.0.1"], env)]
    try:
        until = time.monotonic() + LONGEST_S
        while not file.exists():
            assert started[0].poll() is None, "the scheduler ended at its start"
            assert time.monotonic() < until, "the scheduler did not start"
            time.sleep(0.1)
        started += [_start(["workers", str(folder), "--processes=1"], env) for _ in range(2)]
        yield [f"engine.scheduler={file}"], {SCHEDULER: started[0].pid, WORKER: started[1].pid}
    finally:
        for one in started:
            with suppress(ProcessLookupError):
                os.killpg(one.pid, signal.SIGKILL)
            one.wait()


def _start(words: list[str], env: Mapping[str, str]) -> "subprocess.Popen[bytes]":
    command = [sys.executable, "-m", "pipeline", "cluster", *words]
    quiet = subprocess.DEVNULL
    return subprocess.Popen(command, stdout=quiet, stderr=quiet, env=dict(env), start_new_session=True)  # noqa: S603
