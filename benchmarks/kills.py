"""Kill runs at random moments, resume them, and compare their results with undisturbed runs.

``python -m benchmarks kills --number 200`` prints a row for each kind of run: number of kills, runs
lost (could not be resumed) and runs with different files in the end.
"""

import argparse
import math
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from pipeline.run import artifacts

SMALL: Final = ("duration_s=600", "optimizer.population_size=12", "optimizer.generations=12",
                "monte_carlo.num_cases=40", "telemetry.record_training=false")  # fmt: skip
#: for searches that fly many starts by default
FEW: Final = ("optimizer.rounds=1", "optimizer.validation_cases=8", "starts.num_cases=8", "starts.num_hard=0")

#: kinds of trainings and evaluations, small
KINDS: Final[Mapping[str, Sequence[str]]] = {
    "genetic": ("+experiment=train", "stages=[scenario,train,evaluate,record]"),
    "rounds": (
        "+experiment=train", "stages=[scenario,train,evaluate]", "starts=random", "optimizer.rounds=3",
        "optimizer.generations=4", "optimizer.validation_cases=8",
    ),
    "islands": (
        "+experiment=train", "optimizer=islands", "stages=[scenario,train]", "optimizer.migrants=1",
        "optimizer.migrate_every=3",
    ),
    "cma_es": ("+experiment=train_planes", "stages=[scenario,train,evaluate]", *FEW),
    "nsga2": ("+experiment=train_front", "stages=[scenario,train,evaluate]", *FEW),
    "evaluate": ("+experiment=evaluate", "controller=paper_champion", "stages=[scenario,evaluate,record]"),
    "planned": ("+experiment=evaluate", "controller=lqr", "stages=[scenario,evaluate,record]"),
    "safety": (
        "+experiment=evaluate", "controller=champion_any_sun", "safety=filter", "chief=tumbling",
        "stages=[scenario,evaluate]",
    ),
}  # fmt: skip


@dataclass
class Tally:
    """The results of the runs of a kind."""

    runs: int = 0
    kills: int = 0
    lost: list[str] = field(default_factory=list)
    different: list[str] = field(default_factory=list)


def command(words: Sequence[str]) -> list[str]:
    """Return the command line of the pipeline with some arguments."""
    return [sys.executable, "-m", "pipeline", *words]


def words_of(kind: str, folder: Path) -> list[str]:
    """Return the arguments that start a run of a kind; later ones take precedence."""
    chosen = KINDS[kind]
    given = {word.partition("=")[0] for word in chosen}
    small = [word for word in SMALL if word.partition("=")[0] not in given]
    return [*chosen[:1], *small, *chosen[1:], f"hydra.run.dir={folder}"]


def run_alone(words: Sequence[str], env: Mapping[str, str]) -> float:
    """Run to the end, and return the duration in seconds."""
    started = time.perf_counter()
    subprocess.run(command(words), check=True, capture_output=True, env=env)  # noqa: S603
    return time.perf_counter() - started


def killed_after(words: Sequence[str], seconds: float, env: Mapping[str, str]) -> tuple[bool, int, str]:
    """Run until it ends or is killed; return whether it was killed, its exit code and its last output."""
    # the whole group, so that nothing keeps running
    process = subprocess.Popen(  # noqa: S603
        command(words), stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, env=env, text=True,
        start_new_session=True,
    )  # fmt: skip
    try:
        said = process.communicate(timeout=seconds)[1]
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        said = process.communicate()[1]
        return True, process.returncode, said
    return False, process.returncode, said


def survive(kind: str, folder: Path, seconds: float, rng: random.Random, tally: Tally, cold: bool) -> None:
    """Start a run, kill it once to three times, and let it finish."""
    first = words_of(kind, folder)
    kills = rng.choice((1, 1, 2, 3))
    tally.runs += 1
    with tempfile.TemporaryDirectory(prefix="kills-cache-") as cache:
        env = {**os.environ, **({"NUMBA_CACHE_DIR": cache} if cold else {})}
        while True:
            is_begun = folder.is_dir() and artifacts.holds_run(folder)
            words = [f"resume={folder}"] if is_begun else first
            limit = rng.uniform(0.0, seconds * (3.0 if cold else 1.0)) if kills > 0 else 600.0
            was_killed, code, said = killed_after(words, limit, env)
            if not was_killed:
                break
            kills -= 1
            tally.kills += 1
            if kills < 0:
                tally.lost.append(f"{kind} {folder.name}: did not end")
                return
    if code != 0:
        tally.lost.append(f"{kind} {folder.name}: {said.strip().splitlines()[-1:]}")


def differences(folder: Path, other: Path) -> list[str]:
    """Return the files in which two finished runs differ."""
    one, two = (artifacts.read_manifest(place) for place in (folder, other))
    if one["finished_stages"] != two["finished_stages"]:
        return ["finished_stages"]
    names = sorted({*one["sha256"], *two["sha256"]})
    unlike = [name for name in names if one["sha256"].get(name) != two["sha256"].get(name)]
    left = [path.name for path in folder.rglob(".*")]
    stale = [name for name, digest in one["sha256"].items() if artifacts.file_hash(folder / name) != digest]
    return [*unlike, *left, *stale]


def campaign(options: argparse.Namespace, root: Path) -> dict[str, Tally]:
    """Kill runs of some kinds in turn until the number of kills is reached, or the time is up."""
    kinds, until = options.kinds, time.monotonic() + 60.0 * options.minutes
    rng = random.Random(options.seed)  # noqa: S311
    tallies = {kind: Tally() for kind in kinds}
    alone: dict[str, tuple[Path, float]] = {}
    for kind in kinds:
        run_alone(words_of(kind, root / f"{kind}-first"), os.environ)  # compiles
        folder = root / f"{kind}-alone"
        alone[kind] = folder, run_alone(words_of(kind, folder), os.environ)
        for name in differences(folder, root / f"{kind}-first"):
            print(f"  {kind}: two runs left alone differ in {name}", flush=True)
    while sum(tally.kills for tally in tallies.values()) < options.number and time.monotonic() < until:
        kind = min(kinds, key=lambda name: tallies[name].kills)
        tally, (reference, seconds) = tallies[kind], alone[kind]
        folder = root / f"{kind}-{tally.runs}"
        lost = len(tally.lost)
        survive(kind, folder, seconds, rng, tally, rng.random() < options.cold)
        if len(tally.lost) == lost and (unlike := differences(folder, reference)):
            tally.different.append(f"{kind} {folder.name}: {', '.join(unlike)}")
        print(f"  {kind}: {tally.kills} kills", file=sys.stderr, flush=True)
    return tallies


def main(arguments: Sequence[str]) -> int:
    """Run the campaign and print its table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks kills", description=__doc__)
    parser.add_argument("--number", type=int, default=200, help="of kills")
    parser.add_argument("--minutes", type=float, default=math.inf, help="after which no run is begun")
    parser.add_argument("--seed", type=int, default=1, help="of the moments")
    parser.add_argument("--cold", type=float, default=0.05, help="share of runs that compile everything")
    parser.add_argument("--kinds", nargs="*", choices=sorted(KINDS), default=list(KINDS))
    options = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory(prefix="kills-") as root:
        tallies = campaign(options, Path(root))
    print("| kind | runs | kills | lost | different |\n|---|---|---|---|---|")
    for kind, tally in tallies.items():
        print(f"| {kind} | {tally.runs} | {tally.kills} | {len(tally.lost)} | {len(tally.different)} |")
    problems = [told for tally in tallies.values() for told in (*tally.lost, *tally.different)]
    print("\n".join(problems))
    return 1 if problems else 0
