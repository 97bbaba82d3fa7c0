"""Learned policies and other controllers, flown from the same starts: ``python -m benchmarks policies``.

``python -m benchmarks policies -c champion_27 -c lqr seed-1.onnx seed-2.onnx sun=random`` prints two tables:
the nominal world, and the dispersed one. Policies are grouped, as trainings of one method from
several seeds: their numbers are interquartile means over flights and trainings, with intervals by the
stratified bootstrap, as Agarwal et al. propose (Deep Reinforcement Learning at the Edge of the Statistical
Precipice, NeurIPS 2021), with starts as tasks.
"""

import argparse
import sys
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.stats import trim_mean

from pipeline.command_line.config import compose_experiment
from pipeline.controllers.source import named
from pipeline.evaluation.statistics import fraction
from pipeline.flight.fly.simulation import fly_all
from pipeline.flight.state.log import Outcomes
from pipeline.scenarios import evaluation_scenarios

Floats = NDArray[np.float64]

#: overrides of each world
WAYS: Final[Mapping[str, Sequence[str]]] = {
    "nominal": (),
    "dispersed": (
        "navigation=fixes",
        "actuators=real",
        "+dispersions.deputy.mass_kg={kind:normal,mean:12.0,std:0.5}",
        "+dispersions.deputy.max_torque_n_m={kind:normal,mean:0.01,std:0.002,low:0.005}",
    ),
}
NUM_RESAMPLED: Final = 2000
QUARTER: Final = 0.25


def interquartile_mean(values: Floats) -> float:
    """Return the mean of the middle half of all numbers."""
    return float(trim_mean(values, QUARTER, axis=None))


def resampled(values: Floats, seed: int = 0) -> tuple[float, float]:
    """Return the 95 % interval of the interquartile mean of trainings by starts, shape (trainings, starts).

    For each start, trainings are drawn with replacement; for a single training, the starts are drawn.
    """
    generator, (trainings, starts) = np.random.default_rng(seed), values.shape
    means = np.empty(NUM_RESAMPLED)
    for draw in range(NUM_RESAMPLED):
        if trainings == 1:
            drawn = values[0, generator.integers(starts, size=starts)]
        else:
            drawn = np.take_along_axis(values, generator.integers(trainings, size=values.shape), axis=0)
        means[draw] = interquartile_mean(drawn)
    low, high = np.percentile(means, [2.5, 97.5])
    return float(low), float(high)


def row(name: str, flown: Sequence[Outcomes], threshold: float) -> str:
    """Return a row of the table: of one controller, or of the trainings of one method."""

    def format_mean(values: list[Floats], digits: int) -> str:
        low, high = resampled(np.array(values))
        return f"{interquartile_mean(np.array(values)):.{digits}f} ({low:.{digits}f} to {high:.{digits}f})"

    spent = format_mean([flights.delta_v_m_s for flights in flown], 3)
    rate = format_mean([100.0 * flights.inspected_count / flights.inspectable_count for flights in flown], 2)
    shares = (
        np.concatenate([flights.is_success(threshold) & ~flights.is_violated for flights in flown]),
        np.concatenate([flights.is_violated for flights in flown]),
    )
    parts = [fraction(share, 95.0) for share in shares]
    words = [f"{100 * part.fraction:.1f} % ({100 * part.low:.1f} to {100 * part.high:.1f})" for part in parts]
    return f"| {name} | {spent} | {rate} | {words[0]} | {words[1]} |"


def main(arguments: Sequence[str]) -> int:
    """Fly all of them, and print the tables."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks policies", description=__doc__)
    parser.add_argument("-c", "--controller", action="append", default=[], help="to compare with")
    parser.add_argument("--cases", type=int, default=300, help="flights of each")
    parser.add_argument("--seed", type=int, default=6, help="of the starts")
    parser.add_argument("words", nargs="+", help="policies (.onnx), and words of the world")
    options = parser.parse_args(arguments)
    paths = [word for word in options.words if word.endswith(".onnx")]
    words = [word for word in options.words if word not in paths]
    cases = [f"monte_carlo.num_cases={options.cases}", f"seed={options.seed}"]
    for way, of_way in WAYS.items():
        base = ["+experiment=evaluate", "controller=coast", *words, *cases, *of_way]
        experiment: Any = compose_experiment(base).experiment
        starts = evaluation_scenarios(experiment)
        print(f"\n{way}: {options.cases} starts, {' '.join([*words, *of_way])}\n")
        print("| controller | delta-v (m/s) | inspection rate (%) | success rate | outside the limits |")
        print("|---|---|---|---|---|", flush=True)

        def fly(name: str, experiment: Any = experiment, starts: list[Any] = starts) -> Outcomes:
            return fly_all(experiment.mission, named(name, experiment.mission), starts)

        threshold = experiment.mission.inspection_threshold_percent
        if paths:
            flown = [fly(path) for path in paths]
            print(row(f"PPO, {len(paths)} trainings", flown, threshold), flush=True)
            for path, flights in zip(paths, flown, strict=True):
                print(row(path, [flights], threshold), file=sys.stderr, flush=True)
        for name in options.controller:
            print(row(f"`{name}`", [fly(name)], threshold), flush=True)
    return 0
