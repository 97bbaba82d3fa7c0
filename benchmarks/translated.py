"""Whether random functions do the same as C as they do in Python, or are refused.

``python -m benchmarks translated --functions 10000 --seed 1`` prints a row for each class of construct: how
many are the same, bit for bit, how many the translator refuses, and how many differ, which are kept.
"""

import argparse
import shutil
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from tests.pipeline.onboard import drawn
from tests.pipeline.onboard.agreement import Agreement, compared

#: functions that are compiled together
BATCH = 100
HEADING = "| class | same | refused | without a result in Python | different |\n|---|---|---|---|---|"


def batch(kind: str, first: int, count: int, compiler: str) -> tuple[Agreement, str]:
    """Return what becomes of functions of a class, and their text."""
    with tempfile.TemporaryDirectory() as scratch:
        functions = drawn.functions(first, count, kind, Path(scratch))
        text = "".join(path.read_text() for path in Path(scratch).glob("drawn_*.py"))
        return compared(functions, Path(scratch), compiler), text


def main(arguments: Sequence[str]) -> int:
    """Print the table; return 1 if a function differs."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks translated", description=__doc__)
    parser.add_argument("--functions", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--classes", nargs="*", default=drawn.CLASSES, choices=drawn.CLASSES)
    parser.add_argument("--keep", type=Path, default=Path("build/translated"), help="where what differs goes")
    chosen = parser.parse_args(arguments)
    compiler = shutil.which("gcc")
    if compiler is None:
        parser.error("gcc was not found: apt-get install gcc")
    num_different, each = 0, -(-chosen.functions // len(chosen.classes))
    print(HEADING)
    for kind in chosen.classes:
        counts = [0, 0, 0, 0]
        for first in range(0, each, BATCH):
            start = 1_000_000 * chosen.seed + first
            agreement, text = batch(kind, start, min(BATCH, each - first), compiler)
            parts = (agreement.same, agreement.refused, agreement.without_result, agreement.different)
            counts = [before + len(part) for before, part in zip(counts, parts, strict=True)]
            for name, where in agreement.different.items():
                print(f"{name}: {where}", file=sys.stderr, flush=True)
            if agreement.different:
                chosen.keep.mkdir(parents=True, exist_ok=True)
                (chosen.keep / f"{kind}_{start}.py").write_text(text)
        num_different += counts[-1]
        print(f"| {kind.replace('_', ' ')} | {' | '.join(map(str, counts))} |", flush=True)
    return 1 if num_different else 0
