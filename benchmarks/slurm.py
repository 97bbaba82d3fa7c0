"""Preempt, requeue and signal the jobs of a sweep on a small local SLURM, started for this purpose.

``python -m benchmarks slurm`` needs Debian's ``slurm-wlm``, and root. The runs of the sweep must end with
the same files, bit for bit, as undisturbed runs.
"""

import argparse
import getpass
import os
import platform
import re
import shutil
import socket
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Final

from pipeline.command_line.cluster import THREADS
from pipeline.run import sweep
from tests.hostile.kills import SMALL, command, differences, run_alone

PROGRAMS: Final = ("munged", "slurmctld", "slurmd", "sbatch", "scontrol", "scancel", "squeue")
#: a node of two processors; jobs of the partition ``high`` preempt those of ``low``, which are requeued
CONFIG: Final = """\
ClusterName=small
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={control_port}
SlurmdPort={node_port}
SlurmUser={user}
SlurmdUser={user}
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket,cred_expire=5
CredType=cred/munge
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
MpiDefault=none
ReturnToService=2
SchedulerParameters=sched_interval=2,batch_sched_delay=1
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
PreemptType=preempt/partition_prio
PreemptMode=REQUEUE
KillWait=5
NodeName={host} NodeAddr=127.0.0.1 CPUs=2 State=UNKNOWN
PartitionName=low Nodes={host} Default=YES MaxTime=INFINITE State=UP PriorityTier=1 PreemptMode=REQUEUE
PartitionName=high Nodes={host} MaxTime=INFINITE State=UP PriorityTier=10 PreemptMode=OFF
"""
#: longest wait for any event, s
LONGEST_S: Final = 1800.0
WORDS: Final = ("+experiment=train", "stages=[scenario,train,evaluate]", "optimizer=islands",
                "optimizer.migrants=1", "optimizer.migrate_every=3", *SMALL)  # fmt: skip


def missing() -> str:
    """Return the name of a missing program, or nothing."""
    lacking = [name for name in PROGRAMS if shutil.which(name) is None]
    return f"{lacking[0]} is not installed; apt-get install slurm-wlm" if lacking else ""


def free_port() -> int:
    """Return a free port."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def until(what: str, is_so: Callable[[], bool]) -> None:
    """Wait until a condition holds."""
    end = time.monotonic() + LONGEST_S
    while not is_so():
        if time.monotonic() > end:
            raise TimeoutError(f"{what}: not within {LONGEST_S:.0f} s")
        time.sleep(0.25)


def answer(*words: str) -> str:
    """Run a command and return what it prints."""
    done = subprocess.run(words, check=True, capture_output=True, text=True)  # noqa: S603
    return done.stdout.strip()


@contextmanager
def daemon(folder: Path, *words: str) -> Iterator[None]:
    """Run a program in the background, with its output in a file, and end it."""
    with (folder / f"{words[0]}.log").open("w") as log:
        process = subprocess.Popen(words, stdout=log, stderr=log, stdin=subprocess.DEVNULL)  # noqa: S603
    try:
        yield
    finally:
        process.terminate()
        process.wait()


@contextmanager
def small_slurm(folder: Path) -> Iterator[None]:
    """Start a SLURM of one node, and end it; its commands find it through the environment."""
    host = platform.node().partition(".")[0]
    for name in ("state", "spool"):
        (folder / name).mkdir()
    config = folder / "slurm.conf"
    ports = {"control_port": free_port(), "node_port": free_port()}
    config.write_text(CONFIG.format(host=host, user=getpass.getuser(), folder=folder, **ports))
    key = folder / "munge.key"
    key.write_bytes(os.urandom(128))
    key.chmod(0o600)
    os.environ["SLURM_CONF"] = str(config)
    own = [f"--{name}={folder}/munge.{name}" for name in ("socket", "pid-file", "log-file", "seed-file")]
    with ExitStack() as stack:
        stack.enter_context(daemon(folder, "munged", "--foreground", "--force", f"--key-file={key}", *own))
        until("munge", (folder / "munge.socket").exists)
        stack.enter_context(daemon(folder, "slurmctld", "-D", "-c", "-f", str(config)))
        stack.enter_context(daemon(folder, "slurmd", "-D", "-f", str(config), "-N", host))
        until("a node that is idle", lambda: is_idle(host))
        yield


def is_idle(host: str) -> bool:
    """Return whether a node is idle."""
    command = ["sinfo", "-h", "-n", host, "-o", "%T"]
    done = subprocess.run(command, check=False, capture_output=True, text=True)  # noqa: S603
    return done.stdout.split()[:1] == ["idle"]


def states(job: str) -> dict[str, str]:
    """Return the state of each task of an array that SLURM still knows, by its number."""
    rows = answer("squeue", "-h", "-r", "-t", "all", "-j", job, "-o", "%K %T").splitlines()
    return dict(row.split() for row in rows)  # type: ignore[misc]


def restarts(job: str) -> int:
    """Return how often the tasks of an array were restarted."""
    return sum(map(int, re.findall(r"Restarts=(\d+)", answer("scontrol", "show", "job", job))))


def has_begun(folder: Path) -> bool:
    """Return whether a run has a generation to resume from."""
    return any(folder.rglob("checkpoint.npz"))


def disturb(job: str, folder: Path, runs: Sequence[str]) -> None:
    """Preempt, requeue and signal tasks of an array while they train."""
    running = lambda: [task for task, state in states(job).items() if state == "RUNNING"]  # noqa: E731
    until("a first generation", lambda: any(has_begun(folder / run) for run in runs))
    print("  preempted by a job of the partition high", flush=True)
    before = restarts(job)
    answer("sbatch", "--wait", "-p", "high", "-c", "2", "-o", "/dev/null", "--wrap", "sleep 2")
    until("tasks begun again", lambda: restarts(job) > before and bool(running()))
    for told, words in (
        ("requeued", ("scontrol", "requeue")),
        ("told that its time is nearly up", ("scancel", "--signal=USR1", "--batch")),
    ):
        until("a task that runs", lambda: bool(running()))
        task, before = running()[0], restarts(job)
        print(f"  task {task} {told}", flush=True)
        answer(*words, f"{job}_{task}")
        until("a task begun again", lambda before=before: restarts(job) > before)


def main(arguments: Sequence[str]) -> int:
    """Start SLURM, disturb a sweep, and compare it with undisturbed runs."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks slurm", description=__doc__)
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--generations", type=int, default=400, help="of each run")
    options = parser.parse_args(arguments)
    if told := missing():
        print(told)
        return 2
    print(answer("slurmctld", "-V"))
    words = [*WORDS, f"optimizer.generations={options.generations}", *(f"{key}=1" for key in THREADS)]
    seeds = [str(seed) for seed in range(1, options.runs + 1)]
    with tempfile.TemporaryDirectory(prefix="slurm-") as name:
        root = Path(name)
        for seed in seeds:
            run_alone([*words, f"seed={seed}", f"hydra.run.dir={root}/alone-{seed}"], os.environ)
        swept = root / "swept"
        slurm = ["cluster", "slurm", "--partition", "low", "--memory", "0", "--time", "01:00:00"]
        made = [*words, f"seed={','.join(seeds)}", f"hydra.sweep.dir={swept}"]
        subprocess.run(command([*slurm, *made]), check=True, capture_output=True)  # noqa: S603
        with small_slurm(root):
            job = answer("sbatch", "--parsable", str(swept / "slurm.sh"))
            disturb(job, swept, [f"seed={seed}" for seed in seeds])
            until("the end of all tasks", lambda: set(states(job).values()) <= {"COMPLETED", "FAILED"})
            ended, again = sorted(states(job).items()), restarts(job)
        print(f"tasks at their end: {', '.join(f'{task} {state}' for task, state in ended)}")
        print(f"tasks were begun again {again} times")
        unlike = [
            f"seed={seed}: {told}"
            for seed in seeds
            for told in differences(swept / f"seed={seed}", root / f"alone-{seed}")
        ]
        done = [sweep.state_of(swept, run) for run in sweep.read(swept)]
    print(f"{done.count(sweep.DONE)} of {len(done)} runs are done, in other files: {unlike or 'none'}")
    return int(bool(unlike) or done.count(sweep.DONE) < len(done) or again < 3)
