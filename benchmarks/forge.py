"""Forge proofs, and count those that are accepted although their claim is false.

``python -m benchmarks forge`` prints, for each certificate, its mutants and what became of them; each that is
accepted is flown.
"""

import argparse
import tempfile
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from tests.pipeline.proof.forged import NUM_FLIGHTS, STARTS, forge


def main(arguments: Sequence[str]) -> int:
    """Forge and print."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks forge", description=__doc__)
    parser.add_argument("--mutants", type=int, default=2000, help="of all certificates together")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--certificates", nargs="*", default=list(STARTS), choices=list(STARTS))
    parser.add_argument("--all", action="store_true", help="print every mutant that is accepted")
    options = parser.parse_args(arguments)
    each = -(-options.mutants // len(options.certificates))
    reasons: Counter[str] = Counter()
    examples: dict[str, str] = {}
    total = num_false = 0
    for name in options.certificates:
        with tempfile.TemporaryDirectory(prefix="forge-") as folder:
            results = list(forge(name, each, options.seed, Path(folder)))
        accepted = [result for result in results if result is not None]
        for result in accepted:
            reasons[result.reason] += 1
            examples.setdefault(result.reason, result.change)
            if options.all or result.num_false:
                against = f"{result.num_false} of {NUM_FLIGHTS} flights are against it"
                print(f"{name}: {result.change}: {result.reason}; {against}")
        false = sum(result.num_false > 0 for result in accepted)
        print(f"{name}: {len(results)} mutants, {len(accepted)} accepted, {false} of them false", flush=True)
        total, num_false = total + len(results), num_false + false
    print("| accepted because | mutants | for example |\n|---|---|---|")
    for reason, count in reasons.most_common():
        print(f"| {reason} | {count} | {examples[reason]} |")
    print(f"{total} mutants, {num_false} false")
    return int(num_false > 0)
