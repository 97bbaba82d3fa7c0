"""How rare it is that flights come near the chief, by splitting: ``python -m benchmarks rare``.

Rows are controllers under a random Sun, without the safety layer, and distances that about a thousandth or a
hundred thousandth of flights fall below. ``--plain 50000`` counts that many flights besides, with Clopper and
Pearson's interval. ``--closed 40`` estimates instead, by as many seeds, an event of 1e-5 with a closed form,
and counts the intervals that hold it.
"""

import argparse
from collections.abc import Sequence
from typing import Final

import numpy as np
from scipy.stats import binomtest, norm

from pipeline.array_types import Floats
from pipeline.command_line.config import compose_experiment
from pipeline.controllers.source import load
from pipeline.evaluation.assurance.case_space import case_space
from pipeline.evaluation.assurance.rare import FlightLaw
from pipeline.evaluation.population import Numbers
from pipeline.evaluation.splitting import rare_share
from pipeline.flight.goals.flights import fly_all
from pipeline.settings.experiment import Experiment

#: controllers, distances in metres, and flights of splitting
ROWS: Final = (
    ("lqr", 4.28, 20_000),
    ("champion_27", 16.01, 20_000),
    ("champion_27", 10.49, 100_000),
    ("champion_any_sun", 12.1, 100_000),
    ("paper_champion", 41.5, 100_000),
    ("champion_81", 13.5, 100_000),
    ("lqr", 0.65, 100_000),
)
#: confidence, per cent; the probability that a closed form has
CONFIDENCE, KNOWN = 95.0, 1e-5
#: plain flights side by side; the first part of their seed
PART, PLAIN = 50_000, 1 << 24


class Nearer:
    """The event that a flight comes nearer to the chief than a distance, as `CaseLaw` has it."""

    def __init__(self, experiment: Experiment, distance_m: float) -> None:
        self._mission, self._distance_m = experiment.mission, distance_m
        self._controller = load(experiment.controller, experiment.mission)
        self._law = FlightLaw(case_space(experiment, is_exact=True), experiment.seed)
        self.is_periodic = self._law.is_periodic

    def margins(self, genes: Floats, numbers: Numbers) -> Floats:
        """Return by how much flights stay farther away, (n,), m."""
        flown = fly_all(self._mission, self._controller, self._law.scenarios(genes, numbers))
        return flown.min_distance_m - self._distance_m


class Tails:
    """The event that the mean of four normal variables is in either tail, of a probability that is given."""

    is_periodic = np.zeros(4, np.bool_)

    def __init__(self, probability: float) -> None:
        self._distance = -norm.ppf(0.5 * probability)

    def margins(self, genes: Floats, numbers: Numbers) -> Floats:
        """Return how far cases are from the tails, (n,), in standard deviations of the mean."""
        return np.asarray(self._distance - np.abs(0.5 * norm.ppf(genes).sum(axis=1)))


def main(arguments: Sequence[str]) -> int:
    """Print a row for each event."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks rare", description=__doc__)
    parser.add_argument("--plain", type=int, default=0, help="flights to count besides")
    parser.add_argument("--seeds", type=int, default=1, help="estimates of each event")
    parser.add_argument("--only", action="append", help="a controller")
    parser.add_argument("--closed", type=int, default=0, help="estimates of an event with a closed form")
    options = parser.parse_args(arguments)
    if options.closed:
        return held(options.closed)
    print("| event | by splitting, 95 % | flights | plain flights, 95 % |\n|---|---|---|---|", flush=True)
    for name, distance_m, num_flights in ROWS:
        if options.only and name not in options.only:
            continue
        words = ("+experiment=evaluate", f"controller={name}", "sun=random", "safety=none")
        law = Nearer(compose_experiment(words).experiment, distance_m)
        for seed in range(1, 1 + options.seeds):
            rare = rare_share(law, num_flights, CONFIDENCE, (seed,))
            ends = f" ({rare.low:.3g} to {rare.high:.3g})" if rare.high is not None else ""
            estimate = "none" if rare.share is None else f"{rare.share:.3g}{ends}"
            plain = counted(law, options.plain) if seed == 1 else ""
            print(
                f"| `{name}` nearer than {distance_m} m | {estimate} | {rare.num_flights:,} | {plain} |",
                flush=True,
            )
    return 0


def held(num_seeds: int) -> int:
    """Print how often intervals hold a probability that is known, and how wide they are."""
    print(
        "| flights | intervals that hold it | half their width, of the estimate |\n|---|---|---|", flush=True
    )
    for num_flights in (20_000, 100_000):
        rares = [rare_share(Tails(KNOWN), num_flights, CONFIDENCE, (seed,)) for seed in range(num_seeds)]
        ends = [(rare.low, rare.high, rare.share) for rare in rares if rare.high is not None and rare.share]
        count = sum(low <= KNOWN <= high for low, high, _ in ends)
        widths = np.sort([50.0 * (high - low) / share for low, high, share in ends])
        width = f"{np.median(widths):.0f} % ({widths[0]:.0f} to {widths[-1]:.0f})"
        print(f"| {num_flights:,} | {count} of {num_seeds} | {width} |", flush=True)
    return 0


def counted(law: Nearer, num_flights: int) -> str:
    """Return the share of plain flights, with its interval."""
    if not num_flights:
        return ""
    generator, count = np.random.default_rng((1, PLAIN)), 0
    for first in range(0, num_flights, PART):
        size = min(PART, num_flights - first)
        genes = generator.random((size, len(law.is_periodic)))
        count += int((law.margins(genes, np.arange(first, first + size)) < 0.0).sum())
    low, high = binomtest(count, num_flights).proportion_ci(CONFIDENCE / 100.0, "exact")
    return f"{count / num_flights:.3g} ({low:.3g} to {high:.3g}), {count} of {num_flights:,}"
