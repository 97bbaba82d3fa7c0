"""Kill the processes of one campaign, then the scheduler of another, and compare their results.

``python -m benchmarks workers --kills 50`` flies a campaign in Dask's processes and kills one of them at
random moments, also while they start; then it kills the scheduler of a second campaign, which must end
with a sentence and be resumable. Both must produce the same files, bit for bit, as a campaign without Dask.
"""

import argparse
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from pipeline.run import artifacts
from tests.hostile.kills import command, run_alone

LONGEST_S: Final = 3600.0
Quiet = subprocess.Popen[bytes]


def workers_of(pid: int) -> list[int]:
    """Return the processes that a process started through Dask."""
    found = []
    for path in Path("/proc").glob("[0-9]*"):
        try:
            parent = int((path / "stat").read_text().rpartition(")")[2].split()[1])
            is_worker = parent == pid and b"spawn_main" in (path / "cmdline").read_bytes()
        except (OSError, ValueError, IndexError):  # it has ended
            continue
        if is_worker:
            found.append(int(path.name))
    return found


def parts_of(folder: Path) -> int:
    """Return the number of parts that a campaign has kept."""
    return len(list((folder / artifacts.EPISODE_PARTS).rglob("*.parquet")))


def kill_workers(words: Sequence[str], kills: int, pause_s: float, rng: random.Random) -> tuple[int, int]:
    """Run a campaign and kill its processes; return the number killed, and the exit code."""
    campaign = quietly(*words)
    killed, until = 0, time.monotonic() + LONGEST_S
    while campaign.poll() is None and time.monotonic() < until:
        time.sleep(rng.uniform(0.0, 2.0 * pause_s))
        if killed < kills and (running := workers_of(campaign.pid)):
            os.kill(rng.choice(running), signal.SIGKILL)
            killed += 1
            print(f"  {killed} killed", file=sys.stderr, flush=True)
    campaign.kill()
    return killed, campaign.wait()


@contextmanager
def dask_at(place: Path) -> Iterator[Quiet]:
    """Run a scheduler, which is yielded, and two workers."""
    (place / "scheduler.json").unlink(missing_ok=True)
    scheduler = quietly("cluster", "scheduler", str(place), "--host", "127.0.0.1")
    while not (place / "scheduler.json").exists():
        time.sleep(0.2)
    workers = quietly("cluster", "workers", str(place), "--processes", "2")
    try:
        yield scheduler
    finally:
        for process in (scheduler, workers):
            process.terminate()
            process.wait()


def quietly(*words: str) -> Quiet:
    """Start a command of the pipeline and discard its output."""
    return subprocess.Popen(command(words), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)  # noqa: S603


def lose_scheduler(words: Sequence[str], folder: Path, place: Path) -> tuple[int, int, str]:
    """Run a campaign whose scheduler is killed, and resume it with another.

    Returns the exit code without a scheduler, the number of parts kept, and the message.
    """
    with dask_at(place) as scheduler:
        campaign = subprocess.Popen(  # noqa: S603
            command(words), stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
        )
        while campaign.poll() is None and parts_of(folder) == 0:
            time.sleep(0.05)
        scheduler.kill()
        said = campaign.communicate()[1]
    kept = parts_of(folder)
    with dask_at(place):
        subprocess.run(command([f"resume={folder}"]), check=True, capture_output=True)  # noqa: S603
    return campaign.returncode, kept, next(row for row in said.splitlines() if row.startswith("error"))


def main(arguments: Sequence[str]) -> int:
    """Kill processes, and print the results."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks workers", description=__doc__)
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument("--cases", type=int, default=200_000, help="flights of each campaign")
    parser.add_argument("--controller", default="coast")
    parser.add_argument("--pause", type=float, default=3.0, help="mean of the time between kills, s")
    parser.add_argument("--seed", type=int, default=1, help="of the moments")
    options = parser.parse_args(arguments)
    words = [
        "+experiment=evaluate", f"controller={options.controller}", "stages=[evaluate]",
        f"monte_carlo.num_cases={options.cases}", f"engine.part_cases={max(1, options.cases // 200)}",
    ]  # fmt: skip
    with tempfile.TemporaryDirectory(prefix="workers-") as name:
        root = Path(name)
        folders = {kind: root / kind for kind in ("alone", "killed", "lost")}
        run_alone([*words, f"hydra.run.dir={folders['alone']}"], os.environ)
        by_dask = [*words, "engine=dask", "engine.processes=2", f"hydra.run.dir={folders['killed']}"]
        rng = random.Random(options.seed)  # noqa: S311
        killed, code = kill_workers(by_dask, options.kills, options.pause, rng)
        print(f"{killed} processes killed in one campaign of {options.cases:,} flights, exit code {code}")
        joined = [*words, "engine=dask", f"engine.scheduler={root}/dask/scheduler.json"]
        lost, kept, said = lose_scheduler(
            [*joined, f"hydra.run.dir={folders['lost']}"], folders["lost"], root / "dask"
        )
        print(f"scheduler lost: exit code {lost}, {kept} parts kept; {said}")
        hashes = {
            kind: artifacts.file_hash(folder / artifacts.EPISODES)
            for kind, folder in folders.items()
            if (folder / artifacts.EPISODES).exists()
        }
    same = len(hashes) == len(folders) and len(set(hashes.values())) == 1
    print(f"the same table of flights, bit for bit: {'yes' if same else hashes}")
    return int(not same or killed < options.kills or code != 0 or lost != 2)
