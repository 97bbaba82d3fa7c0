"""Kill runs at random moments or file operations, resume them, and compare them with undisturbed runs.

``python -m benchmarks kills --number 200`` prints a row for each kind of run: number of kills, runs
lost (could not be resumed) and runs with different files in the end. SIGKILL, SIGTERM and SIGINT go to the
process, or to its group; folders are absolute or relative. Half of the kills come just before an operation
on a file of the run: open, rename, remove, mkdir and their like.
"""

import argparse
import math
import random
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from tests.hostile.kills import (
    KINDS,
    Tally,
    differences,
    environment_of,
    hooked,
    num_operations,
    run_alone,
    survive,
    verify_survives,
    words_of,
)

VERIFY = "verify"


def campaign(options: argparse.Namespace, root: Path) -> dict[str, Tally]:
    """Kill runs of some kinds in turn until the number of kills is reached, or the time is up."""
    rng = random.Random(options.seed)  # noqa: S311
    tallies = {kind: Tally() for kind in options.kinds}
    alone: dict[str, tuple[Path, float]] = {}
    operations: dict[str, int] = {}
    for kind in (kind for kind in options.kinds if kind != VERIFY):
        folder = root / f"{kind}-alone"
        env = environment_of(kind, root)
        first, counts = root / f"{kind}-first", root / f"{kind}-operations"
        run_alone(words_of(kind, first), hooked(env, first, counts))  # compiles
        operations[kind] = num_operations(counts)
        alone[kind] = folder, run_alone(words_of(kind, folder), env)
        for name in differences(folder, first):
            print(f"  {kind}: two runs left alone differ in {name}", flush=True)
    flown, seconds = alone.get("report") or next(iter(alone.values()))
    alone[VERIFY] = flown, seconds
    until = time.monotonic() + 60.0 * options.minutes
    with suppress(KeyboardInterrupt):  # the table tells of what was done
        _kill(options, until, alone, operations, tallies, rng, root)
    return tallies


def _kill(
    options: argparse.Namespace,
    until: float,
    alone: dict[str, tuple[Path, float]],
    operations: dict[str, int],
    tallies: dict[str, Tally],
    rng: random.Random,
    root: Path,
) -> None:
    """Kill runs of the kinds in turn, compare them with those left alone, and count."""
    while (
        sum(tally.kills.total() for tally in tallies.values()) < options.number and time.monotonic() < until
    ):
        kind = min(options.kinds, key=lambda name: tallies[name].kills.total())
        tally, (reference, seconds) = tallies[kind], alone[kind]
        lost = len(tally.lost)
        if kind == VERIFY:
            verify_survives(reference, seconds, rng, tally, root)
            continue
        name = Path(f"{kind}-{tally.runs}")
        is_cold = rng.random() < options.cold
        number = operations[kind] if rng.random() < options.operations and not is_cold else 0
        chosen = rng.choice((name, root / name))
        survive(kind, chosen, seconds, rng, tally, root, is_cold=is_cold, operations=number)
        if len(tally.lost) == lost and (unlike := differences(root / name, reference)):
            tally.different.append(f"{kind} {name}: {', '.join(unlike)}")
        print(f"  {kind}: {tally.kills.total()} kills", file=sys.stderr, flush=True)


def main(arguments: Sequence[str]) -> int:
    """Run the campaign and print its table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks kills", description=__doc__)
    parser.add_argument("--number", type=int, default=200, help="of kills")
    parser.add_argument("--minutes", type=float, default=math.inf, help="after which no run is begun")
    parser.add_argument("--seed", type=int, default=1, help="of the moments")
    parser.add_argument("--cold", type=float, default=0.05, help="share of runs that compile everything")
    parser.add_argument(
        "--operations", type=float, default=0.5, help="share of runs killed at file operations"
    )
    kinds = [*KINDS, VERIFY]
    parser.add_argument("--kinds", nargs="*", choices=sorted(kinds), default=kinds)
    options = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory(prefix="kills-") as root:
        tallies = campaign(options, Path(root))
    print("| kind | runs | kills | lost | different |\n|---|---|---|---|---|")
    for kind, tally in tallies.items():
        print(
            f"| {kind} | {tally.runs} | {tally.kills.total()} | {len(tally.lost)} | {len(tally.different)} |"
        )
    how = sum((tally.kills for tally in tallies.values()), Counter[str]())
    print("\n" + ", ".join(f"{count} {what}" for what, count in sorted(how.items())))
    problems = [problem for tally in tallies.values() for problem in (*tally.lost, *tally.different)]
    print("\n".join(problems))
    return 1 if problems else 0
