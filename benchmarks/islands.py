"""One population against islands, with equal numbers of flights: ``python -m benchmarks islands``.

Each variant trains on the paper's eight starts from the same seeds, with as many individuals and generations;
its result is then flown from starts not used in training. For islands, the difference from one
population is paired by seed.
"""

import argparse
import math
import sys
import time
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from scipy import stats

from pipeline.command_line.config import compose_experiment
from pipeline.controllers import source
from pipeline.flight.cases.starts import validation_scenarios
from pipeline.settings.experiment import Experiment
from pipeline.training.genome import genome_of
from pipeline.training.judging import costs_of, evolved

#: name of each variant, and its overrides
WAYS: Final[Mapping[str, Sequence[str]]] = {
    "one population of 200": (),
    "4 islands of 50": ("optimizer=islands",),
    "4 islands of 50, no migration": ("optimizer=islands", "optimizer.migrants=0"),
    "10 islands of 20": ("optimizer=islands", "optimizer.islands=10"),
}
VALIDATION_CASES: Final = 500


def trained(experiment: Experiment) -> tuple[float, float, int]:
    """Train; return the champion's fitness, its cost on other starts, and the number of flights."""
    genome = genome_of(source.load(experiment.controller, experiment.mission), experiment.optimizer.encoding)
    result = evolved(experiment, genome)
    others = validation_scenarios(experiment.starts, experiment.sun, experiment.seed, VALIDATION_CASES)
    elsewhere = costs_of(experiment, genome, result.champion, others, 0)
    return result.fitness, float(np.median(elsewhere)), result.history[-1].evaluations


def difference(values: Sequence[float], first: Sequence[float]) -> str:
    """Return the mean of paired differences with Student's 95 % interval."""
    apart = np.subtract(values, first)
    if not np.any(apart):
        return ""
    reach = stats.t.ppf(0.975, len(apart) - 1) * apart.std(ddof=1) / math.sqrt(len(apart))
    return f"{apart.mean():+.3f} ± {reach:.3f}"


def main(arguments: Sequence[str]) -> int:
    """Train every variant from every seed, and print the table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks islands", description=__doc__)
    parser.add_argument("--seeds", type=int, default=6, help="trainings of each way")
    parser.add_argument("--generations", type=int, default=60, help="of each training")
    parser.add_argument("words", nargs="*", help="of the experiment, such as starts=random")
    options = parser.parse_args(arguments)
    found: dict[str, list[tuple[float, float, int]]] = {way: [] for way in WAYS}
    started = time.process_time()
    for seed in range(1, options.seeds + 1):
        for way, chosen in WAYS.items():
            words = ["+experiment=train", *chosen, f"seed={seed}", *options.words]
            composed = compose_experiment([*words, f"optimizer.generations={options.generations}"])
            found[way].append(trained(composed.experiment))
            print(f"  seed {seed}, {way}: {found[way][-1][0]:.4f} m/s", file=sys.stderr, flush=True)
    print(
        "| way | evaluations | fitness (m/s), mean ± std | difference, 95 % | median cost elsewhere (m/s) |"
    )
    print("|---|---|---|---|---|")
    first: Any = None
    for way, rows in found.items():
        fitness, elsewhere, evaluations = (list(column) for column in zip(*rows, strict=True))
        first = first or fitness
        print(
            f"| {way} | {evaluations[0]:,} | {np.mean(fitness):.3f} ± {np.std(fitness, ddof=1):.3f} "
            f"| {difference(fitness, first)} | {np.mean(elsewhere):.3f} |"
        )
    print(f"{time.process_time() - started:.0f} s of processor time")
    return 0
