"""Clusters: sweeps as SLURM job arrays, and Dask's scheduler and workers on several machines.

``cluster slurm`` writes the script of an array, ``cluster run`` is one of its tasks.
A task is a run of the sweep, in the folder that the sweep gives it, and starts by resuming what is
there: one that was preempted, requeued or killed needs no attention.
"""

import argparse
import os
import re
import shlex
import socket
import sys
import tempfile
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Final, NoReturn

from pipeline.command_line import experiments, runs
from pipeline.command_line.arguments import ConfigError, read_arguments
from pipeline.command_line.config import Job, options
from pipeline.command_line.overrides import check_overrides, parse, quoted, rewrite_paths
from pipeline.run import artifacts, sweep
from pipeline.run.lock import held
from pipeline.run.sweep import DONE, state_of
from pipeline.settings.schema import reached_outside

OK: Final = 0
#: in a sweep's folder
SCRIPT: Final = "slurm.sh"
#: in a scheduler's folder: its address, and the certificate shared by it and its peers
SCHEDULER: Final = "scheduler.json"
CERTIFICATE: Final = "tls.pem"
#: keys that set the number of threads of a run
THREADS: Final = ("optimizer.workers", "monte_carlo.workers", "optimum.workers", "assurance.workers")


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        """Raise ConfigError."""
        raise ConfigError(f"{message}; see docs/how-to/run-on-a-cluster.md")


def cluster(arguments: Sequence[str]) -> int:
    """Run ``cluster slurm`` or ``cluster run``; return the exit code.

    Raises
    ------
    ValueError, OSError
        User errors.
    """
    commands = {"slurm": _slurm, "run": _run, "scheduler": _scheduler, "workers": _workers}
    if not arguments or arguments[0] not in commands:
        raise ConfigError(
            "cluster has the commands slurm, which writes a script, run, which the script calls, scheduler "
            "and workers, which start Dask's: python -m pipeline cluster slurm +experiment=train seed=1,2,3"
        )
    return commands[arguments[0]](arguments[1:])


def _slurm(arguments: Sequence[str]) -> int:
    """Write a sweep and the job script of its unfinished runs."""
    parser = _Parser(prog="python -m pipeline cluster slurm", allow_abbrev=False, add_help=False)
    parser.add_argument("--time", default="1-00:00:00", help="limit of a task, as SLURM writes it")
    parser.add_argument("--cpus", type=int, default=1, help="processors, and threads, of a task")
    parser.add_argument("--memory", default="2G", help="of a task")
    parser.add_argument("--partition")
    parser.add_argument("--at-once", type=int, help="tasks that run at the same time")
    parser.add_argument("--notice", type=int, default=120, help="s before the limit, when it is requeued")
    parser.add_argument("--setup", action="append", default=[], help="a line before each task")
    chosen, words = parser.parse_known_args(list(arguments))
    asked = read_arguments(words)
    given = parse(rewrite_paths(asked.overrides))
    keys = {override.key_or_group for override in given}
    threads = [f"{key}={chosen.cpus}" for key in THREADS if key not in keys]
    overrides = [*given, *parse(threads)]
    check_overrides(overrides, options(asked.folders))
    jobs, swept, folder = experiments.composed_sweep(asked, overrides)
    with held(folder):
        known = experiments.announce(jobs, swept, folder)
        left = [number for number, run in enumerate(known) if state_of(folder, run) != DONE]
        if not left:
            sys.stderr.write(f"nothing is left to do: all {len(known)} runs are finished\n")
            return OK
        outside = _outside(jobs)
        artifacts.write_atomically(folder / SCRIPT, script(folder.resolve(), left, chosen, outside))
    sys.stderr.write(
        f"{len(left)} of {len(known)} runs are left; to start them: sbatch {folder / SCRIPT}\n"
        f"to see what came out, at any time: python -m pipeline summary {folder}\n"
    )
    sys.stdout.write(f"{folder / SCRIPT}\n")
    return OK


def _outside(jobs: Sequence[Job]) -> list[str]:
    """Return the overrides of what the runs reach outside their folders, for the tasks to be given again."""
    reached = [reached_outside(job.config) for job in jobs]
    if any(one != reached[0] for one in reached):
        raise ConfigError(
            f"the runs differ in {', '.join(sorted({key for one in reached for key in one}))}; the tasks of "
            "an array share their command line, so give all runs the same"
        )
    return [f"{key}={quoted(str(value))}" for key, value in reached[0].items()]


def script(
    folder: Path, numbers: Iterable[int], chosen: argparse.Namespace, outside: Sequence[str] = ()
) -> str:
    """Return the script of a job array, with a task for each of the numbered runs.

    What they reach outside their folders is in `outside`, as overrides.
    """
    limit = f"%{chosen.at_once}" if chosen.at_once else ""
    asked = {
        "job-name": re.sub(r"[^\w.-]+", "-", folder.name),
        "array": ranges(numbers) + limit,
        "partition": chosen.partition,
        "time": chosen.time,
        "cpus-per-task": chosen.cpus,
        "mem": chosen.memory,
        "signal": f"B:USR1@{chosen.notice}",
        "open-mode": "append",
        "output": _in_a_header(f"{folder}/slurm-%a.log"),
    }
    headers = [f"#SBATCH --{name}={value}" for name, value in asked.items() if value is not None]
    command = shlex.join([sys.executable, "-m", "pipeline", "cluster", "run", str(folder)])
    return "\n".join(
        [
            "#!/bin/bash",
            *headers,
            "#SBATCH --requeue",
            "# Each task is a run of the sweep in this folder, and goes on where it stopped.",
            f"cd {shlex.quote(str(Path.cwd()))} || exit",
            *chosen.setup,
            # a run saves its state at every generation and part, so that it may be killed at any moment
            'trap \'echo "time is nearly up: to be gone on with"; scontrol requeue "$SLURM_JOB_ID"\' USR1',
            f'{command} "$SLURM_ARRAY_TASK_ID"{"".join(f" {shlex.quote(word)}" for word in outside)} &',
            "run=$!",
            "while :; do",
            '  wait "$run"',
            "  code=$?",
            '  kill -0 "$run" 2>/dev/null || exit "$code" # else a signal ended the waiting, not the run',
            "done",
            "",
        ]
    )


def _in_a_header(path: str) -> str:
    """Quote a path for an ``#SBATCH`` line."""
    return path if re.fullmatch(r"[\w./%=+-]+", path) else '"' + path.replace('"', '\\"') + '"'


def ranges(numbers: Iterable[int]) -> str:
    """Write ascending numbers as SLURM reads them, such as ``0-3,7``."""
    spans: list[list[int]] = []
    for number in numbers:
        if spans and number == spans[-1][1] + 1:
            spans[-1][1] = number
        else:
            spans.append([number, number])
    return ",".join(str(first) if first == last else f"{first}-{last}" for first, last in spans)


def _run(arguments: Sequence[str]) -> int:
    """Resume one run of a sweep, and record in the sweep how it ended."""
    parser = _Parser(prog="python -m pipeline cluster run", add_help=False)
    parser.add_argument("folder", type=Path, help="of the sweep")
    parser.add_argument("number", type=int, help="of the run, from 0")
    parser.add_argument("overrides", nargs="*", help="as resume= takes them")
    chosen = parser.parse_args(arguments)
    overrides = parse(chosen.overrides)
    check_overrides(overrides, {})
    known = sweep.read(chosen.folder)
    if not 0 <= chosen.number < len(known):
        raise ConfigError(
            f"{chosen.folder} has no run {chosen.number}; its {len(known)} runs are counted from 0"
        )
    run = known[chosen.number]
    code, failure = experiments.attempt(
        lambda: runs.resume(chosen.folder / run.folder, overrides, run.command)
    )
    sweep.note_failure(chosen.folder, run, failure)
    return code


def _scheduler(arguments: Sequence[str]) -> NoReturn:
    """Become a Dask scheduler that speaks only to those who can read its folder."""
    from pipeline.run.processes import MOST_DEATHS, NO_DASHBOARD, write_certificate  # noqa: PLC0415 - an extra

    parser = _Parser(prog="python -m pipeline cluster scheduler", add_help=False)
    parser.add_argument("folder", type=Path, help="of its address and its certificate, for all to read")
    parser.add_argument("--host", default=socket.gethostname(), help="by which others find it")
    chosen = parser.parse_args(arguments)
    write_certificate(chosen.folder / CERTIFICATE)
    os.environ["DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES"] = str(MOST_DEATHS)
    own = ("--protocol=tls", f"--host={chosen.host}", "--port=0", f"--dashboard-address={NO_DASHBOARD}")
    _become("dask_scheduler", chosen.folder, *own)


def _workers(arguments: Sequence[str]) -> NoReturn:
    """Become workers of a scheduler, one thread each; they end with it."""
    parser = _Parser(prog="python -m pipeline cluster workers", add_help=False)
    parser.add_argument("folder", type=Path, help="of the scheduler")
    parser.add_argument("--processes", type=int, default=len(os.sched_getaffinity(0)))
    chosen = parser.parse_args(arguments)
    own = (f"--nworkers={chosen.processes}", "--nthreads=1", "--memory-limit=0", "--death-timeout=60")
    _become("dask_worker", chosen.folder, *own, f"--local-directory={tempfile.mkdtemp(prefix='dask-')}")


def _become(program: str, folder: Path, *words: str) -> NoReturn:
    certificate = str(folder / CERTIFICATE)
    tls = [f"--tls-{what}={certificate}" for what in ("ca-file", "cert", "key")]
    own = [f"--scheduler-file={folder / SCHEDULER}", "--no-dashboard", *tls, *words]
    os.execv(sys.executable, [sys.executable, "-m", f"distributed.cli.{program}", *own])  # noqa: S606
