"""Damage input files, and check that readers reject them in a sentence, quickly, and in little memory.

``python -m benchmarks fuzz --minutes 10`` prints a row for each reader: inputs, and failures.
"""

import argparse
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

from tests.hostile.attack import BrokenError, assert_survives_apart, attack
from tests.hostile.giants import GIANTS
from tests.hostile.readers import Reader, all_readers


def campaign(readers: Mapping[str, Reader], minutes: float, first: int, kept: Path) -> list[str]:
    """Attack readers in turn until the time is up; return the findings, and print a table."""
    until, number = time.monotonic() + 60.0 * minutes, first
    counts, failures = dict.fromkeys(readers, 0), list[str]()
    with tempfile.TemporaryDirectory(prefix="fuzz-") as root:
        for (name, what), make in GIANTS.items():
            if name in readers:
                counts[name] += 1
                try:
                    assert_survives_apart(readers[name], make(readers[name].samples[0]), Path(root))
                except BrokenError as error:
                    failures.append(f"{name}: {what}: {error}"[:400])
        while time.monotonic() < until:
            for name, reader in readers.items():
                number += 1
                folder = Path(root)
                try:
                    counts[name] += attack(reader, 200, number, folder)
                except BrokenError as error:  # the next reader is attacked in any case
                    kept.mkdir(parents=True, exist_ok=True)
                    (kept / f"{name}-{number}").write_bytes((folder / "input").read_bytes())
                    failures.append(f"{name} {number}: {error}"[:400])
                    print(failures[-1], file=sys.stderr, flush=True)
    print("| reader | inputs | found |\n|---|---|---|")
    for name, count in counts.items():
        print(f"| {name} | {count} | {sum(line.startswith((f'{name} ', f'{name}:')) for line in failures)} |")
    return failures


def main(arguments: Sequence[str]) -> int:
    """Run the campaign."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks fuzz", description=__doc__)
    parser.add_argument("--minutes", type=float, default=1.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--readers", nargs="*", default=[], help="names; all unless given")
    parser.add_argument(
        "--keep", type=Path, default=Path("build/fuzz"), help="where inputs that broke a reader go"
    )
    options = parser.parse_args(arguments)
    failures = campaign(all_readers(options.readers), options.minutes, 1000 * options.seed, options.keep)
    print("\n".join(failures))
    return 1 if failures else 0
