"""Deputies that aim at one another, kept apart: ``python -m benchmarks fleet_attacks``.

In fleets of two, three and five each deputy steers its next stop at the next one's, however late and with
whatever losses messages are heard. SciPy's matrix exponential moves them. The table tells how near two came
at a sample, with the safety layer and without.
"""

import argparse
from collections.abc import Sequence

import numpy as np

from tests.pipeline.flight.attacks import APART_M, LINKS, attacks


def main(given: Sequence[str]) -> int:
    """Print a table of attacks; return 1 if two came nearer than they are kept apart."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks fleet_attacks", description=__doc__)
    parser.add_argument("--flights", type=int, default=10_000, help="of all rows together")
    parser.add_argument("--deputies", type=int, nargs="+", default=[2, 3, 5])
    parser.add_argument("--seed", type=int, default=2026)
    options = parser.parse_args(given)
    number = -(-options.flights // (len(LINKS) * len(options.deputies)))
    print("messages | deputies | flights | nearest two (m) | without the layer (m)", flush=True)
    least = np.inf
    for link in LINKS:
        for deputies in options.deputies:
            pairs = [
                (fleet.least(), alone.least())
                for fleet, alone, _ in attacks(deputies, link, number, options.seed)
            ]
            nearest, unguarded = np.min(pairs, axis=0)
            least = min(least, nearest)
            cells = [str(deputies), str(number), f"{nearest:.4f}", f"{unguarded:.4f}"]
            print(link, *cells, sep=" | ", flush=True)
    return int(least < APART_M)
