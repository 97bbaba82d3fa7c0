"""Deputies that aim at one another, kept apart: ``python -m benchmarks fleet_attacks``.

In fleets of two, three and five each deputy steers its next stop at the next one's, however late and with
whatever losses messages are heard. SciPy's matrix exponential moves them. The table tells how near two came
at a sample, with the safety layer and without, and between which distances from the chief all stayed. Where a
mission has errors, as with ``world=leo safety=robust``, estimates and fired forces are as far off as their
bounds allow.
"""

import argparse
from collections.abc import Sequence

import numpy as np

from tests.pipeline.flight.attacks import APART_M, LINKS, attacks, mission_of


def main(given: Sequence[str]) -> int:
    """Print a table of attacks; return 1 if two came nearer than they are kept apart."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks fleet_attacks", description=__doc__)
    parser.add_argument("--flights", type=int, default=10_000, help="of all rows together")
    parser.add_argument("--deputies", type=int, nargs="+", default=[2, 3, 5])
    parser.add_argument("--seed", type=int, default=2026)
    parser.add_argument("words", nargs="*", help="settings of the mission, such as world=leo safety=robust")
    options = parser.parse_args(given)
    number = -(-options.flights // (len(LINKS) * len(options.deputies)))
    columns = "nearest two (m)", "without the layer (m)", "from the chief (m)"
    print("messages", "deputies", "flights", *columns, sep=" | ", flush=True)
    least, limits = np.inf, mission_of(2, *options.words).deputy
    near, far = np.inf, 0.0
    for link in LINKS:
        for deputies in options.deputies:
            nearest, unguarded, spheres = np.inf, np.inf, np.array([np.inf, 0.0])
            for fleet, alone, _ in attacks(deputies, link, number, options.seed, *options.words):
                nearest, unguarded = min(nearest, fleet.least()), min(unguarded, alone.least())
                distances = np.linalg.norm(fleet.states[:, :3], axis=1)
                spheres = np.array([min(spheres[0], distances.min()), max(spheres[1], distances.max())])
            least, near, far = min(least, nearest), min(near, spheres[0]), max(far, spheres[1])
            cells = [f"{nearest:.4f}", f"{unguarded:.4f}", f"{spheres[0]:.2f} to {spheres[1]:.2f}"]
            print(link, deputies, number, *cells, sep=" | ", flush=True)
    return int(least < APART_M or near < limits.min_distance_m or far > limits.max_distance_m)
