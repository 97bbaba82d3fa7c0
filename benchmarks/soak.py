"""Train, evaluate, record and replay for any length of time, with faults at random moments.

``python -m benchmarks soak --minutes 30`` prints a table of tasks and faults: the number of each, and of
failures. A fault may stop a process if it reports it in sentences; then the task is resumed, and must
end with the same files, bit for bit, as an undisturbed one.
"""

import argparse
import os
import platform
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Final

from pipeline.run import artifacts
from pipeline.run.maker import git_revision, product_version
from tests.hostile import faults
from tests.hostile.kills import KINDS, command, differences, run_alone, words_of

REPLAY: Final = "replay"
FAULTS: Final = ("none", *faults.SIGNALS, "folder deleted", "disk full", "disk read-only")
#: exit codes: done, user error, interrupted, terminated
IN_ORDER: Final = (0, 2, 130, 143)
#: exit codes of a process terminated by a signal; exhausted memory aborts LLVM
BY_SIGNAL: Final = {
    "SIGKILL": (-signal.SIGKILL,), "SIGTERM": (-signal.SIGTERM,), "Ctrl-C": (-signal.SIGINT,),
    "no memory": (-signal.SIGABRT, -signal.SIGSEGV, -signal.SIGTRAP, 1),
}  # fmt: skip
#: size of a disk that is too small, KiB
SMALL_DISK: Final = (30, 700)
#: options that make a disk writable again
CURES: Final = {"disk full": "size=256m", "disk read-only": "rw"}
#: longest duration of a task, s
LONGEST_S: Final = 1200.0


@dataclass
class Soak:
    """The tasks done so far, and their failures."""

    rng: random.Random
    root: Path
    alone: dict[str, tuple[Path, float]] = field(default_factory=dict)
    done: Counter[tuple[str, str]] = field(default_factory=Counter)
    struck: Counter[str] = field(default_factory=Counter)
    bad: list[str] = field(default_factory=list)

    def prepare(self, kinds: Sequence[str]) -> None:
        """Run each task once to compile what it needs, and once undisturbed."""
        for kind in kinds:
            run_alone(words_of(kind, self.root / f"{kind}-first"), os.environ)
            folder = self.root / f"{kind}-alone"
            self.alone[kind] = folder, run_alone(words_of(kind, folder), os.environ)

    def flight(self) -> Path:
        """Return a recorded flight."""
        return next(path for folder, _ in self.alone.values() for path in folder.rglob("*.mcap"))

    def once(self, kind: str, fault: str) -> None:
        """Run a task under a fault, resume it, and check the result."""
        number = sum(self.done.values())
        self.done[kind, fault] += 1
        folder = self.root / f"{number}"
        is_disk = fault.startswith("disk")
        size = self.rng.randint(*SMALL_DISK) if fault == "disk full" else 262_144
        with faults.small_disk(folder, size) if is_disk else nullcontext(lambda _option: True) as change:
            problem = (self._replay if kind == REPLAY else self._run)(kind, fault, folder / "run", change)
        if problem:
            self.bad.append(f"{number}: {kind}, {fault}: {problem}")
        faults.take_folder(folder)

    def _strike(self, words: Sequence[str], fault: str, seconds: float, hit: Callable[[], object]) -> str:
        """Start a process, cause a fault at a random moment, and return what is wrong with its end."""
        process = subprocess.Popen(  # noqa: S603
            words, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, start_new_session=True
        )
        try:
            said = process.communicate(timeout=self.rng.uniform(0.0, seconds))[1]
        except subprocess.TimeoutExpired:
            if fault in faults.SIGNALS:
                faults.SIGNALS[fault](process.pid)
            else:
                hit()
            try:
                said = process.communicate(timeout=LONGEST_S)[1]
            except subprocess.TimeoutExpired:
                faults.SIGNALS["SIGKILL"](process.pid)
                return "did not end"
        self.struck[fault] += process.returncode != 0
        if process.returncode not in (*IN_ORDER, *BY_SIGNAL.get(fault, ())):
            return f"exit code {process.returncode}: {said.strip()[-300:]}"
        if "Traceback" in said and process.returncode >= 0 and fault != "no memory":
            return f"a traceback: {said.strip()[-300:]}"
        return "" if process.returncode <= 0 or said.strip() else "ended without a word"

    def _run(self, kind: str, fault: str, folder: Path, change: Callable[[str], bool]) -> str:
        reference, seconds = self.alone[kind]
        hits = {
            "folder deleted": partial(faults.take_folder, folder),
            "disk read-only": partial(change, "ro"),
        }
        problem = self._strike(command(words_of(kind, folder)), fault, seconds, hits.get(fault, int))
        if problem:
            return problem
        change(CURES.get(fault, ""))
        is_begun = folder.is_dir() and artifacts.holds_run(folder)
        words = [f"resume={folder}"] if is_begun else words_of(kind, folder)
        ended = subprocess.run(command(words), capture_output=True, text=True, check=False)  # noqa: S603
        if ended.returncode != 0:
            return f"cannot be gone on with: {ended.stderr.strip()[-300:]}"
        return ", ".join(differences(folder, reference))

    def _replay(self, _kind: str, fault: str, folder: Path, change: Callable[[str], bool]) -> str:
        folder.mkdir(parents=True)
        scene = folder / "flight.rrd"
        words = [sys.executable, "-m", "telemetry", "replay", str(self.flight()), "--save", str(scene)]
        hits = {
            "folder deleted": partial(faults.take_folder, folder),
            "disk read-only": partial(change, "ro"),
        }
        problem = self._strike(words, fault, 6.0, hits.get(fault, int))
        if problem:
            return problem
        left = [path.name for path in folder.glob("*") if path != scene]
        if left and fault not in ("SIGKILL", "no memory", "disk read-only"):
            return f"left {', '.join(left)}"
        change(CURES.get(fault, ""))
        folder.mkdir(exist_ok=True)
        ended = subprocess.run(words, capture_output=True, text=True, check=False)  # noqa: S603
        return "" if ended.returncode == 0 else f"cannot be done again: {ended.stderr.strip()[-300:]}"

    def table(self, kinds: Sequence[str], chosen: Sequence[str]) -> str:
        """Return how often each task was run under each fault, as Markdown."""
        lines = [f"| work | {' | '.join(chosen)} |", "|---" * (len(chosen) + 1) + "|"]
        lines += [
            f"| {kind} | {' | '.join(str(self.done[kind, fault]) for fault in chosen)} |" for kind in kinds
        ]
        return "\n".join(
            [*lines, f"| stopped by it | {' | '.join(str(self.struck[fault]) for fault in chosen)} |"]
        )


def main(arguments: Sequence[str]) -> int:
    """Run the soak test, and print the report."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks soak", description=__doc__)
    parser.add_argument("--minutes", type=float, default=30.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument(
        "--kinds", nargs="*", choices=sorted(KINDS), default=["genetic", "cma_es", "evaluate"]
    )
    options = parser.parse_args(arguments)
    chosen = [name for name in FAULTS if faults.may_mount() or not name.startswith("disk")]
    kinds = [*options.kinds, REPLAY]
    with tempfile.TemporaryDirectory(prefix="soak-") as root:
        soak = Soak(random.Random(options.seed), Path(root))  # noqa: S311
        soak.prepare(options.kinds)
        started = time.monotonic()
        while time.monotonic() < started + 60.0 * options.minutes:
            fewest = min(soak.done[kind, fault] for kind in kinds for fault in chosen)
            pairs = [(kind, fault) for kind in kinds for fault in chosen if soak.done[kind, fault] == fewest]
            soak.once(*soak.rng.choice(pairs))
            print(f"  {sum(soak.done.values())} works, {len(soak.bad)} bad", file=sys.stderr, flush=True)
    minutes = (time.monotonic() - started) / 60.0
    print(
        f"Version {product_version()}, sources {(git_revision() or 'unknown')[:12]}, Python "
        f"{platform.python_version()}, {platform.system()}, seed {options.seed}: {minutes:.0f} minutes, "
        f"{sum(soak.done.values())} works, {len(soak.bad)} ended badly.\n\n{soak.table(kinds, chosen)}"
    )
    print("\n".join(soak.bad))
    return 1 if soak.bad else 0
